"""The faces of a scene in the order and layout in which OpenGL draws them: compact batches of vertices that need no look-up."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_env.kept import kept
from openmap_env.rendering import geometry
from openmap_env.rendering.geometry import Batches, split_into_batches
from openmap_env.rendering.textures import TexturePlan, plan_textures
from openmap_scenes import Scene

VERTEX_TYPE = np.dtype(
    [("position", "3f4"), ("uv", "2f4"), ("colour", "3f4"), ("layer", "i4"), ("instance", "i4")], align=False
)
VERTEX_FORMAT = "3f4 2f4 3f4 1i4 1i4"


@dataclass(frozen=True)
class DrawMesh:
    """What a scene's triangles look like to OpenGL.

    Parameters
    ----------
    vertices : (n,) of ``VERTEX_TYPE``
    indices : (3F,) uint32
        Corners of the faces, batch after batch.
    batches : Batches
        Of faces; ``group`` is the texture array.
    textures : TexturePlan
    """

    vertices: npt.NDArray[np.void]
    indices: npt.NDArray[np.uint32]
    batches: Batches
    textures: TexturePlan


def draw_mesh(scene: Scene, faces_per_batch: int) -> DrawMesh:
    """Lay a scene out for drawing; the arrays are kept on disk for the next time."""
    plan = plan_textures(scene)
    looks = np.stack([m.colour for m in scene.materials]).astype(np.float32)
    parts = (
        *(scene.vertices, scene.faces, scene.face_material, scene.face_instance, scene.uv, scene.vertex_colour),
        *(looks, plan.group, plan.layer, plan.scale, str(faces_per_batch)),
    )

    def make() -> dict[str, npt.NDArray[np.generic]]:
        group = plan.group[scene.face_material]
        batches = split_into_batches(scene.vertices, scene.faces, group, faces_per_batch)
        vertices, indices = _vertex_buffer(scene, batches.order, plan, looks)
        named = {"starts": batches.starts, "group": batches.group, "low": batches.low, "high": batches.high}
        return {"vertices": vertices, "indices": indices, "order": batches.order, **named}

    a = kept("drawing", parts, [sys.modules[__name__], geometry], make)
    batches = Batches(*(np.array(a[name]) for name in ("order", "starts", "group", "low", "high")))
    return DrawMesh(a["vertices"], a["indices"], batches, plan)


def _vertex_buffer(
    scene: Scene, order: npt.NDArray[np.int64], plan: TexturePlan, looks: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.uint32]]:
    """Vertices (n,) of ``VERTEX_TYPE`` and indices (3F,), in the order of the faces given.

    A vertex is repeated for every instance and material that uses it, so that the three corners of a face agree on both and
    "flat" needs no convention about which corner provokes.
    """
    faces = scene.faces[order].astype(np.int64)
    face_looks = np.stack([scene.face_instance[order], scene.face_material[order]], 1)
    kinds, kind = np.unique(face_looks, axis=0, return_inverse=True)
    keys = (faces * len(kinds) + kind.reshape(-1, 1)).reshape(-1)
    unique, firsts, indices = np.unique(keys, return_index=True, return_inverse=True)
    # Numbered in order of first use, so that a batch's vertices lie together.
    rank = np.empty(len(unique), np.int64)
    first_used = np.argsort(firsts, kind="stable")
    rank[first_used] = np.arange(len(unique))
    vertex, (instance, material) = unique[first_used] // len(kinds), kinds[unique[first_used] % len(kinds)].T
    buffer = np.zeros(len(unique), VERTEX_TYPE)
    buffer["position"] = scene.vertices[vertex]
    if scene.uv is not None:
        buffer["uv"] = scene.uv[vertex] * plan.scale[material]
    buffer["colour"] = looks[material]
    if scene.vertex_colour is not None:
        buffer["colour"] *= scene.vertex_colour[vertex] / np.float32(255.0)
    buffer["layer"], buffer["instance"] = plan.layer[material], instance
    return buffer, rank[indices.reshape(-1)].astype(np.uint32)
