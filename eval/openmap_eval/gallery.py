"""What is kept of a scene to look at: the map with names, and how well its instances fit two of the instructions."""

from __future__ import annotations

import json
import re
from pathlib import Path

from openmap_agents.agent import Agent
from openmap_agents.openmap_agent import OpenMapAgent
from openmap_env.env import OpenMapNavEnv
from openmap_env.episodes import Episode
from openmap_eval.pictures import Picture, heat_picture, map_picture, titled, write_png
from openmap_eval.records import write_json
from openmap_eval.report import ORACLE

HEATMAPS = 2


class Gallery:
    """A scene observer that writes each scene's map and its pictures into a folder; agents without a map leave none.

    Parameters
    ----------
    folder : Path
    oracle : bool
        Whether something was read from the simulator: pictures and captions then say so.

    Attributes
    ----------
    maps, heatmaps : dict
        Caption -> PNG.
    """

    def __init__(self, folder: Path, oracle: bool = False) -> None:
        self._folder, self._title = folder, ORACLE if oracle else ""
        self._index = folder / "pictures.json"
        self.maps: dict[str, Path] = {}
        self.heatmaps: dict[str, Path] = {}
        if self._index.exists():  # of scenes that an earlier run of this evaluation finished
            kept = json.loads(self._index.read_text())
            self.maps = {caption: folder / name for caption, name in kept["maps"].items()}
            self.heatmaps = {caption: folder / name for caption, name in kept["heatmaps"].items()}

    def __call__(self, env: OpenMapNavEnv, agent: Agent, scene: str) -> None:
        if not isinstance(agent, OpenMapAgent):
            return
        stem = file_name(scene)
        instance_map = agent.instance_map
        labels = {i.id: i.label for i in instance_map if i.label}
        instance_map.save(self._folder / f"{stem}.map.npz")
        picture = map_picture(instance_map, labels, agent.occupancy, agent.trajectory)
        self.maps[f"{self._title}The map of {scene}, from above"] = self._write(f"{stem}.map.png", picture)
        for number, episode in enumerate(_one_of_each_kind(env)[:HEATMAPS], start=1):
            grounding = agent.grounder.ground(episode.instruction, instance_map)
            scores = dict(zip(grounding.ranking, grounding.scores, strict=True))
            picture = heat_picture(instance_map, scores, labels, agent.occupancy)
            caption = f"{self._title}“{episode.instruction}” in {scene}: bright fits well, numbers are ranks"
            self.heatmaps[caption] = self._write(f"{stem}.heat{number}.png", picture)
        names = [{caption: path.name for caption, path in paths.items()} for paths in (self.maps, self.heatmaps)]
        write_json(self._index, {"maps": names[0], "heatmaps": names[1]})

    def _write(self, name: str, picture: Picture) -> Path:
        path = self._folder / name
        write_png(path, titled(picture, "ORACLE") if self._title else picture)
        return path


def _one_of_each_kind(env: OpenMapNavEnv) -> list[Episode]:
    first: dict[str, Episode] = {}
    for episode in env.episodes:
        first.setdefault(episode.kind, episode)
    return list(first.values())


def file_name(scene: str) -> str:
    """A scene's spec as the start of a file name."""
    return re.sub(r"[^A-Za-z0-9]+", "-", scene).strip("-")[-60:]
