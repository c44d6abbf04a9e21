"""Which object each face of HM3D's semantic mesh belongs to: the colour that it is painted in.

The colour is in the base colour texture (sRGB bytes, nearest texel), in COLOR_0 or in the material's colour. Genuine textures are
painted across faces, so a face goes to whom most of its area belongs.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np
import numpy.typing as npt

from openmap_scenes.formats.mesh import TexturedMesh

# A triangle is cut into SIDE * SIDE equal ones; the colour is read at their centroids.
SIDE = 4
_CHUNK = 1 << 16

Ids = npt.NDArray[np.int32]


def face_ids(mesh: TexturedMesh, colours: Mapping[int, tuple[int, int, int]]) -> Ids:
    """Id (F,) int32 of each face, 0 = painted black or in a colour that is not listed.

    Parameters
    ----------
    mesh : TexturedMesh
        F triangles; the texture says the colour, where it says none the vertices do, and without both the material.
    colours : mapping
        (r, g, b) 0..255 by id.
    """
    id_of_code = _id_of_code(colours)
    ids = np.zeros(len(mesh.faces), np.int32)
    for number, material in enumerate(mesh.materials):
        if material.texture is not None and mesh.uv is not None:
            chosen = np.flatnonzero(mesh.face_material == number)
            codes = _codes(material.texture)
            for chunk in np.split(chosen, range(_CHUNK, len(chosen), _CHUNK)):
                ids[chunk] = majority(id_of_code[_sampled(codes, mesh.uv[mesh.faces[chunk]])])
    if mesh.vertex_colour is not None:
        unknown = ids == 0
        ids[unknown] = majority(id_of_code[_codes(mesh.vertex_colour)][mesh.faces[unknown]])
    for number, material in enumerate(mesh.materials):
        if material.texture is None:
            flat = np.rint(np.clip(material.colour, 0, 1) * 255).astype(np.uint8)
            ids[(mesh.face_material == number) & (ids == 0)] = id_of_code[_codes(flat)]
    return ids


def majority(samples: Ids) -> Ids:
    """The commonest id of each row of samples (N, S); 0 only where more than half say so; of equally common ones the lowest."""
    winner: Ids = samples[:, 0].copy()
    mixed = np.flatnonzero((samples != samples[:, :1]).any(1))
    for chunk in np.split(mixed, range(_CHUNK, len(mixed), _CHUNK)):
        rows = np.sort(samples[chunk], axis=1)
        votes = (rows[:, :, None] == rows[:, None, :]).sum(2)
        votes[(rows == 0) & (2 * votes <= rows.shape[1])] = 0
        winner[chunk] = rows[np.arange(len(rows)), votes.argmax(1)]
    return winner


def _codes(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.int32]:
    """Colours (..., 3) as one number each."""
    wide = rgb.astype(np.int32)
    return np.asarray((wide[..., 0] << 16) | (wide[..., 1] << 8) | wide[..., 2], np.int32)


def _id_of_code(colours: Mapping[int, tuple[int, int, int]]) -> Ids:
    """Id by colour code (2^24,); a listed colour lends its id to those that differ from it by 1 in any channel.

    COLOR_0 is linear, and writers round it. Where that makes two listed colours meet, the nearer one has it, then the lower id.
    """
    table = np.zeros(1 << 24, np.int32)
    offsets = sorted(product((-1, 0, 1), repeat=3), key=lambda offset: -sum(map(abs, offset)))
    ids = np.array(sorted(colours, reverse=True), np.int32)
    listed = np.array([colours[i] for i in ids.tolist()], np.int32).reshape(-1, 3)
    for offset in offsets:
        near = listed + np.array(offset, np.int32)
        valid = ((near >= 0) & (near <= 255)).all(1)
        table[_codes(near[valid].astype(np.uint8))] = ids[valid]
    table[0] = 0
    return table


def _barycentric() -> npt.NDArray[np.float32]:
    """Weights (SIDE * SIDE, 3) of the centroids of a triangle's equal parts."""
    points = [(i + 1 / 3, j + 1 / 3) for i in range(SIDE) for j in range(SIDE - i)]
    points += [(i + 2 / 3, j + 2 / 3) for i in range(SIDE - 1) for j in range(SIDE - 1 - i)]
    first = np.array(points) / SIDE
    return np.column_stack([first, 1 - first.sum(1)]).astype(np.float32)


_WEIGHTS = _barycentric()


def _sampled(codes: npt.NDArray[np.int32], uv: npt.NDArray[np.float32]) -> npt.NDArray[np.int32]:
    """Colour codes (N, S) that a texture (h, w) of codes shows inside triangles of texture coordinates (N, 3, 2)."""
    height, width = codes.shape
    at = np.einsum("sk,nkc->nsc", _WEIGHTS, uv.astype(np.float64))
    column = np.floor(at[..., 0] * width).astype(np.int64) % width
    row = np.floor(at[..., 1] * height).astype(np.int64) % height
    return np.asarray(codes[row, column], np.int32)
