"""Maps as point clouds and scenes that other programs read."""

from __future__ import annotations

import itertools
import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from plyfile import PlyData

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.mapping.export import DIMMED, colours_of, cubes, heat_colour, instance_colours, save_glb, save_ply
from openmap_scenes import DataError, load_scene

EDGE = 0.05


def block(instance_id: int, cell: tuple[int, int, int], size: tuple[int, int, int], **rest: Any) -> MapInstance:
    cells = np.array(list(itertools.product(*(range(n) for n in size)))) + cell
    return MapInstance(instance_id, ((cells + 0.5) * EDGE).astype(np.float32), **{"feature": None, **rest})


@pytest.fixture
def room() -> InstanceMap:
    return InstanceMap(
        [
            block(2, (0, 0, 0), (2, 3, 1), label="chair", colour=np.array([200, 90, 10], np.uint8), confidence=0.5),
            block(4, (3, 0, 0), (1, 1, 1), label="größer\n"),
            block(7, (-9, -1, -9), (20, 1, 20), label="floor", is_structure=True, n_observations=3),
            block(9, (5, 0, 0), (2, 2, 2), label="chair"),
        ],
        voxel_size=EDGE,
    )


def test_a_ply_has_every_voxel_with_its_instance_label_and_colour(room: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "deep" / "room.ply"
    save_ply(room, path)
    file = PlyData.read(path)
    assert (file.text, file.byte_order) == (False, "<")
    vertices = file["vertex"]
    points = np.stack([vertices[axis] for axis in "xyz"], axis=1)
    np.testing.assert_array_equal(points, np.concatenate([i.points for i in room]))
    np.testing.assert_array_equal(vertices["instance"], np.repeat([2, 4, 7, 9], [6, 1, 400, 8]))
    labels = [json.loads(comment.split(" ", 2)[2]) for comment in file.comments]
    assert [labels[n] for n in vertices["label"][[0, 6, 7, 407]]] == ["chair", "größer\n", "floor", "chair"]
    shown = instance_colours(room)
    colours = np.stack([vertices[c] for c in ("red", "green", "blue")], axis=1)
    assert [tuple(map(int, c)) for c in colours[[0, 6, 7, 407]]] == [shown[i] for i in (2, 4, 7, 9)]
    cloud = trimesh.load(path)
    np.testing.assert_allclose(cloud.vertices, points)
    np.testing.assert_array_equal(cloud.colors[:, :3], colours)
    save_ply(room, tmp_path / "again.ply")
    assert (tmp_path / "again.ply").read_bytes() == path.read_bytes()
    assert sorted(p.name for p in path.parent.iterdir()) == ["room.ply"]


def test_open3d_reads_the_ply(room: InstanceMap, tmp_path: Path) -> None:
    open3d = pytest.importorskip("open3d")
    save_ply(room, tmp_path / "room.ply", "rgb", structure=False)
    cloud = open3d.io.read_point_cloud(str(tmp_path / "room.ply"))
    assert len(cloud.points) == 15
    np.testing.assert_allclose(np.asarray(cloud.colors)[0] * 255, [200, 90, 10], atol=0.5)
    np.testing.assert_allclose(np.asarray(cloud.colors)[6] * 255, DIMMED, atol=0.5)


def test_heat_is_a_property_and_a_colour(room: InstanceMap, tmp_path: Path) -> None:
    save_ply(room, tmp_path / "room.ply", {2: 1.0, 9: 0.25, 1000: 0.5})
    vertices = PlyData.read(tmp_path / "room.ply")["vertex"]
    np.testing.assert_array_equal(vertices["heat"][[0, 6, 7, 407]], np.array([1, np.nan, np.nan, 0.25], np.float32))
    shown = colours_of(room, {2: 1.0, 9: 0.25})
    assert shown[4] == shown[7] == DIMMED
    assert [shown[2], shown[9]] == [tuple(map(int, c)) for c in heat_colour([1.0, 0.25])]
    # Brighter is more, in equal steps.
    lab = cv2.cvtColor((heat_colour(np.linspace(0, 1, 33))[None] / np.float32(255)), cv2.COLOR_RGB2LAB)[0]
    assert (np.diff(lab[:, 0]) > 0.5).all()
    for wrong in ({2: 1.1}, {2: -0.1}, {2: float("nan")}):
        with pytest.raises(ValueError, match=r"within 0\.\.1"):
            save_ply(room, tmp_path / "wrong.ply", wrong)
    with pytest.raises(ValueError, match="'blue'"):
        colours_of(room, "blue")  # type: ignore[arg-type]


def test_a_glb_names_the_things(room: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "room.glb"
    save_glb(room, path, {2: 0.5})
    scene = trimesh.load(path)
    assert sorted(scene.geometry) == ["2 chair", "4 größer", "7 floor", "9 chair"]
    for instance in room:
        name = f"{instance.id} {instance.label}".rstrip()
        mesh = scene.geometry[name]
        np.testing.assert_allclose(mesh.bounds[0], instance.aabb_min - EDGE / 2, atol=1e-6)
        np.testing.assert_allclose(mesh.bounds[1], instance.aabb_max + EDGE / 2, atol=1e-6)
        assert mesh.metadata["id"] == instance.id
        assert mesh.metadata["label"] == instance.label
    raw = path.read_bytes()
    document = json.loads(raw[20 : 20 + struct.unpack("<I", raw[12:16])[0]])
    nodes = {node["name"]: node for node in document["nodes"] if "mesh" in node}
    about = nodes["2 chair"]["extras"]
    assert about["heat"] == 0.5
    assert about["confidence"] == 0.5
    np.testing.assert_allclose(about["centre"], room.get(2).centre, atol=1e-4)
    assert nodes["7 floor"]["extras"]["is_structure"] is True
    save_glb(room, tmp_path / "again.glb", {2: 0.5})
    assert (tmp_path / "again.glb").read_bytes() == raw


def test_a_viewer_shows_the_colours_of_the_glb_as_they_were_meant(room: InstanceMap, tmp_path: Path) -> None:
    save_glb(room, tmp_path / "room.glb", structure=False)
    scene = load_scene(f"file:{tmp_path / 'room.glb'}")
    x = scene.vertices[scene.faces].mean(1)[:, 0]
    shown = instance_colours(room)
    for instance in (i for i in room if not i.is_structure):
        own = (x > instance.aabb_min[0] - EDGE) & (x < instance.aabb_max[0] + EDGE)
        (material,) = np.unique(scene.face_material[own])
        np.testing.assert_allclose(scene.materials[material].colour * 255, shown[instance.id], atol=0.5)


def test_what_cannot_be_written_is_said(room: InstanceMap, tmp_path: Path) -> None:
    only = InstanceMap([room.get(7)], EDGE)
    for save in (save_ply, save_glb):
        with pytest.raises(ValueError, match="no instances to write that are not structure"):
            save(only, tmp_path / "x", structure=False)
        with pytest.raises(ValueError, match="no instances to write"):
            save(InstanceMap(), tmp_path / "x")
        (tmp_path / "file").write_text("")
        with pytest.raises(DataError, match="folder that can be written to"):
            save(room, tmp_path / "file" / "x")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_things_beside_each_other_have_colours_far_apart() -> None:
    rng = np.random.default_rng(0)
    crowd = [block(int(n) + 1, tuple(rng.integers(0, 60, 3)), (2, 2, 2)) for n in np.sort(rng.permutation(900)[:150])]
    a_map = InstanceMap([*crowd, block(1000, (0, -1, 0), (60, 1, 60), is_structure=True)], EDGE)
    shown = instance_colours(a_map)
    assert shown[1000] == DIMMED
    assert shown == instance_colours(a_map)
    rgb = np.array([shown[i.id] for i in crowd], np.float32) / 255
    lab = cv2.cvtColor(rgb[None], cv2.COLOR_RGB2LAB)[0]
    distance = [
        np.linalg.norm(lab[a] - lab[b])
        for a, b in itertools.combinations(range(len(crowd)), 2)
        if np.linalg.norm(crowd[a].centre - crowd[b].centre) < 0.5
    ]
    assert len(distance) > 100
    assert min(distance) > 15, "two neighbours look alike"
    assert np.percentile(distance, 5) > 40


@given(st.sets(st.tuples(*[st.integers(0, 3)] * 3), min_size=1), st.tuples(*[st.floats(-5, 5)] * 3))
@settings(max_examples=60, deadline=None)
def test_cubes_are_the_union_of_the_voxels(cells: set[tuple[int, int, int]], origin: tuple[float, ...]) -> None:
    points = np.array(sorted(cells)) * EDGE + np.array(origin)
    vertices, faces = cubes(points.astype(np.float32), EDGE)
    # Divergence theorem: the volume within the surface is that of the voxels, which holds only if all faces look outwards.
    a, b, c = (vertices[faces[:, k]] - points[0] for k in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(len(cells) * EDGE**3, rel=1e-4)
    steps = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    inner = sum(tuple(np.add(cell, step).tolist()) in cells for cell in cells for step in steps)
    assert len(faces) == 2 * (6 * len(cells) - 2 * inner)
    assert len(np.unique(np.rint((vertices - vertices[0]) / EDGE), axis=0)) == len(vertices)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    np.testing.assert_allclose(area, EDGE**2 / 2, rtol=1e-3)
