"""``openmap export``: saved maps for other programs and as pictures."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from plyfile import PlyData

from openmap_agents.grounding import Grounding
from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.mapping.export import heat_colour, instance_colours
from openmap_agents.perception import make_text_tower
from openmap_eval.cli import main
from openmap_eval.export_command import from_above, heat_of

EDGE = 0.05


def block(instance_id: int, corner: tuple[float, float, float], size: tuple[int, int, int], **rest) -> MapInstance:
    cells = np.array(list(itertools.product(*(range(n) for n in size)))) + 0.5
    return MapInstance(instance_id, (cells * EDGE + corner).astype(np.float32), **{"feature": None, **rest})


@pytest.fixture(scope="module")
def room() -> InstanceMap:
    """A chair, a lamp over it and a sink, on a floor by a wall; features are those of their names."""
    names = ["chair", "pendant lamp", "sink", "floor", "wall"]
    features = iter(np.asarray(make_text_tower("embedded").encode_text(names), np.float32))
    return InstanceMap(
        [
            block(1, (0, 0, 0), (10, 18, 10), label="chair", feature=next(features)),
            block(2, (0, 2, 0), (10, 4, 10), label="pendant lamp", feature=next(features)),
            block(3, (2, 0, 2), (12, 18, 10), label="sink", feature=next(features)),
            block(4, (-1, -0.1, -1), (80, 1, 80), label="floor", feature=next(features), is_structure=True),
            block(5, (-1, 0, -1.1), (80, 50, 1), label="wall", feature=next(features), is_structure=True),
        ],
        EDGE,
        encoder="embedded",
    )


@pytest.fixture
def saved(room: InstanceMap, tmp_path: Path) -> Path:
    room.save(tmp_path / "room.map.npz")
    return tmp_path / "room.map.npz"


def test_a_map_becomes_points_a_scene_and_a_picture(saved: Path, tmp_path: Path, capsys) -> None:
    for name in ("room.ply", "room.glb", "deep/room.png"):
        main(["export", str(saved), "--out", str(tmp_path / name)])
        assert "written: " in capsys.readouterr().out
    assert np.unique(PlyData.read(tmp_path / "room.ply")["vertex"]["instance"]).tolist() == [1, 2, 3, 4, 5]
    names = ["1 chair", "2 pendant lamp", "3 sink", "4 floor", "5 wall"]
    assert sorted(trimesh.load(tmp_path / "room.glb").geometry) == names
    assert Image.open(tmp_path / "deep" / "room.png").size > (500, 500)
    main(["export", str(saved), "--out", str(tmp_path / "room.glb"), "--no-structure"])
    assert sorted(trimesh.load(tmp_path / "room.glb").geometry) == names[:3]


def test_heat_is_how_well_things_fit_the_words(saved: Path, tmp_path: Path) -> None:
    main(["export", str(saved), "--out", str(tmp_path / "a.ply"), "--heat", "something to sit on", "--no-structure"])
    vertices = PlyData.read(tmp_path / "a.ply")["vertex"]
    heat = {i: vertices["heat"][vertices["instance"] == i][0] for i in (1, 2, 3)}
    assert heat[1] == 1
    assert max(heat[2], heat[3]) < 0.7
    main(["export", str(saved), "--out", str(tmp_path / "a.png"), "--heat", "something to sit on"])
    picture = np.asarray(Image.open(tmp_path / "a.png"))
    seen = (picture == heat_colour([1.0])[0]).all(axis=2).sum()
    # It covers a hundredth of the picture, and its name covers some of it.
    assert seen > 0.007 * picture.shape[0] * picture.shape[1], "the chair is hidden under the lamp"


def test_structure_has_heat_only_among_the_best(room: InstanceMap) -> None:
    grounding = Grounding([1, 2, 3, 4, 5], 1, 1.0, {}, [0.0] * 5, [0.9, 0.1, 0.2, 0.3, 0.4])
    assert set(heat_of(room, grounding)) == {1, 2, 3, 4, 5}
    many = [replace(room.get(1), id=i) for i in range(10, 16)]
    crowd = replace(room, instances=[*room.instances, *many])
    ids = [i.id for i in many] + [1, 2, 3, 4, 5]
    fits = [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0, 0.95]
    heat = heat_of(crowd, Grounding(ids, 10, 1.0, {}, fits, fits))
    assert {4, 5}.isdisjoint(heat)
    assert heat[10] == 1
    assert heat[14] == 0, "the middle one"
    assert heat[13] == pytest.approx(0.25)
    assert heat_of(InstanceMap(), Grounding([], None, 0.0, {})) == {}


def test_a_picture_shows_things_on_the_floor(room: InstanceMap) -> None:
    picture = from_above(room, "instance", size=(400, 400))
    colours = instance_colours(room)
    shares = [(picture == np.array(colours[i])).all(axis=2).mean() for i in (1, 2, 3)]
    assert shares[0] == 0, "the chair is under the lamp"
    assert min(shares[1:]) > 0.005
    bare = from_above(room, "instance", structure=False, size=(400, 400))
    assert bare.shape != picture.shape
    assert ((bare == 250) | (bare == 247)).all(axis=2).mean() > 0.3


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--out", "map.obj"], "ends in .ply"), (["--out", "a.png", "--heat", " "], "words"),
     (["--out", "a.ply", "--heat", "chair", "--encoder", "nonsense"], "nonsense")],
)  # fmt: skip
def test_what_cannot_be_is_said_in_one_line(arguments: list[str], said: str, saved: Path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(saved.parent)
    with pytest.raises(SystemExit) as stopped:
        main(["export", str(saved), *arguments])
    assert stopped.value.code == 2
    assert said in capsys.readouterr().out
    assert [p.name for p in saved.parent.iterdir()] == [saved.name]


def test_a_map_without_things_is_refused(room: InstanceMap, tmp_path: Path, capsys) -> None:
    replace(room, instances=room.instances[3:]).save(tmp_path / "bare.npz")
    with pytest.raises(SystemExit):
        main(["export", str(tmp_path / "bare.npz"), "--out", str(tmp_path / "a.glb"), "--no-structure"])
    assert "without instances but structure" in capsys.readouterr().out
