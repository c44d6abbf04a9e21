"""Plain meshes: colours, texture coordinates and transforms survive a round trip through a file."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image

from openmap_scenes import DataError, load_scene


def textured_quad() -> trimesh.Trimesh:
    texture = np.zeros((4, 4, 3), np.uint8)
    texture[:2] = (255, 0, 0)
    texture[2:] = (0, 0, 255)
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    material = trimesh.visual.material.PBRMaterial(name="paint", baseColorTexture=Image.fromarray(texture))
    # trimesh counts v from the bottom: the upper edge (y = 1) shows the texture's first row.
    mesh.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]], material=material)
    return mesh


def test_textures_stand_the_right_way_up(tmp_path):
    path = tmp_path / "quad.glb"
    textured_quad().export(path)
    scene = load_scene(f"file:{path}")
    top = scene.vertices[:, 1] > 0.5
    assert np.allclose(scene.uv[top, 1], 0.0)
    assert scene.materials[0].texture[0, 0].tolist() == [255, 0, 0]


def test_node_transforms_are_applied(tmp_path):
    path = tmp_path / "moved.glb"
    graph = trimesh.Scene()
    T_file_node = trimesh.transformations.translation_matrix([3, 4, 5])
    graph.add_geometry(textured_quad(), transform=T_file_node)
    graph.export(path)
    low, high = load_scene(f"file:{path}").aabb
    np.testing.assert_allclose(low, [3, 4, 5], atol=1e-6)
    np.testing.assert_allclose(high, [4, 5, 5], atol=1e-6)


@pytest.mark.parametrize("content", [b"", b"glTF", b"not a mesh at all, but long enough", b"glTF" + bytes(40)])
def test_garbage_is_named(tmp_path, content):
    path = tmp_path / "garbage.glb"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"garbage\.glb"):
        load_scene(f"file:{path}")


def test_every_truncation_ends_in_the_same_error_type(tmp_path):
    whole = tmp_path / "quad.glb"
    textured_quad().export(whole)
    data = whole.read_bytes()
    path = tmp_path / "cut.glb"
    for length in range(0, len(data), 97):
        path.write_bytes(data[:length])
        with pytest.raises(DataError, match=r"cut\.glb"):
            load_scene(f"file:{path}")
