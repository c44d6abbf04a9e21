"""``openmap export``: a saved map as a point cloud, a scene of named things, or a picture from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import tyro
from rich.console import Console

from openmap_scenes import DataError

if TYPE_CHECKING:
    from openmap_agents.grounding import Grounding
    from openmap_agents.mapping import InstanceMap, MapInstance
    from openmap_eval.pictures import Picture

SUFFIXES = (".ply", ".glb", ".png")
TALL = 0.5
"""Structure higher than this is drawn as a wall, else as floor, m."""
BEST = 5
"""How many answers are named in a heatmap; structure is coloured only if it is one of them."""


@dataclass(frozen=True)
class Export:
    """Write a saved map for other programs: .ply (points), .glb (a scene of named things) or .png (from above)."""

    map: tyro.conf.Positional[Path]
    """A map that an evaluation, the demo or openmap map wrote."""
    out: Path
    """X.ply, X.glb or X.png."""
    heat: str | None = None
    """Words to colour the map by, "something to sit on": bright fits well."""
    colours: Literal["instance", "rgb"] = "instance"
    """Without --heat: colours that tell things apart, or the colour that each thing has."""
    structure: bool = True
    """Whether floors, walls and ceilings are in it; a picture shows no ceiling."""
    encoder: str | None = None
    """What reads the words, as for openmap query."""
    llm: str = "builtin"

    def run(self, console: Console) -> None:
        from openmap_agents.mapping import InstanceMap
        from openmap_agents.mapping.export import save_glb, save_ply
        from openmap_eval.pictures import titled, write_png

        suffix = self.out.suffix.lower()
        if suffix not in SUFFIXES:
            raise DataError("--out", str(self.out), "a name that ends in .ply, .glb or .png")
        instance_map = InstanceMap.load(self.map)
        if not any(self.structure or not i.is_structure for i in instance_map):
            raise DataError(self.map, "a map without instances" + ("" if self.structure else " but structure"), "some")
        grounding = self._grounding(instance_map)
        colours = self.colours if grounding is None else heat_of(instance_map, grounding)
        if suffix == ".png":
            best = [] if grounding is None else grounding.ranking[:BEST]
            picture = from_above(instance_map, colours, self.structure, best)
            title = ": ".join(filter(None, ["ORACLE" if _told(instance_map) else "", self.heat]))
            self.out.parent.mkdir(parents=True, exist_ok=True)
            # The font has no other letters.
            write_png(self.out, titled(picture, title.encode("ascii", "replace").decode()) if title else picture)
        else:
            (save_ply if suffix == ".ply" else save_glb)(instance_map, self.out, colours, structure=self.structure)
        size = self.out.stat().st_size / 1e6
        console.print(f"written: {self.out}, {size:.1f} MB", soft_wrap=True, highlight=False)

    def _grounding(self, instance_map: InstanceMap) -> Grounding | None:
        from openmap_eval.commands import ask

        if self.heat is None:
            return None
        if not self.heat.strip():
            raise DataError("--heat", repr(self.heat), "words")
        return ask(self.map, instance_map, self.heat, self.encoder, self.llm)


def _told(instance_map: InstanceMap) -> bool:
    from openmap_agents.perception import is_oracle

    return is_oracle(instance_map.segmenter) or is_oracle(instance_map.encoder)


def heat_of(instance_map: InstanceMap, grounding: Grounding) -> dict[int, float]:
    """How well each instance fits by itself, by id: 1 the best, 0 the middle one and what fits less.

    Structure has heat only if it is among the ``BEST`` answers.
    """
    named = set(grounding.ranking[:BEST])
    fits = {
        i: fit
        for i, fit in zip(grounding.ranking, grounding.fits, strict=True)
        if i in named or not instance_map.get(i).is_structure
    }
    if not fits:
        return {}
    low, high = float(np.median(list(fits.values()))), max(fits.values())
    return {i: max(0.0, (fit - low) / (high - low)) if high > low else 1.0 for i, fit in fits.items()}


def from_above(
    instance_map: InstanceMap,
    colours: Literal["instance", "rgb"] | Mapping[int, float],
    structure: bool = True,
    best: Sequence[int] = (),
    size: tuple[int, int] = (1400, 1000),
) -> Picture:
    """The map from above: floors and walls in grey, things in their colours with their names.

    Where ``best`` has ids, these lie on top, the first uppermost, and only they are named, with their ranks.
    """
    from openmap_agents.mapping.export import colours_of
    from openmap_eval.pictures import FLOOR, WALL, Plan, draw_labels, draw_points

    shown = colours_of(instance_map, colours)
    heat: Mapping[int, float] = {} if isinstance(colours, str) else colours
    drawn = [i for i in instance_map if not i.is_structure or i.id in heat]
    ground = [i for i in instance_map if structure and i.is_structure and i.id not in heat]
    plan = Plan.around(np.concatenate([i.points for i in [*drawn, *ground]]), size, tight=True)
    picture = plan.blank()

    def draw(instances: list[MapInstance], colour_of: Mapping[int, tuple[int, int, int]]) -> None:
        if instances:
            colour = np.array([colour_of[i.id] for i in instances], np.uint8)
            points = np.concatenate([i.points for i in instances])
            draw_points(picture, plan, points, np.repeat(colour, [len(i.points) for i in instances], axis=0))

    walls = [i for i in ground if i.aabb_max[1] - i.aabb_min[1] > TALL]
    draw([i for i in ground if i not in walls], {i.id: FLOOR for i in ground})
    draw(walls, {i.id: WALL for i in ground})
    answers = [instance_map.get(i) for i in best]
    draw([i for i in drawn if i.id not in best], shown)
    # An answer must not lie hidden under a lamp.
    for instance in reversed(answers):
        draw([instance], shown)
    named = [(i.centre, f"{rank}. {i.label or '?'}") for rank, i in enumerate(answers, start=1)]
    by_size = sorted((i for i in drawn if i.label), key=lambda i: -len(i.points))
    draw_labels(picture, plan, named or [(i.centre, i.label) for i in by_size])
    return picture
