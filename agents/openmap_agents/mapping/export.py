"""A map as files for other programs: a coloured point cloud (PLY) and a scene of named things (GLB).

Both are in the map's own frame: metres, Y up, right-handed, which is glTF's frame too. The same map gives the same bytes.
"""

from __future__ import annotations

import colorsys
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt
import trimesh
from plyfile import PlyData, PlyElement

from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_agents.mapping.whole_file import write_whole_file

Colours = Literal["instance", "rgb"] | Mapping[int, float]
"""A colour for each instance, its own mean colour, or heat: values 0..1 by id, those without one grey."""
Rgb = tuple[int, int, int]

DIMMED: Rgb = (205, 205, 200)
"""Of structure, and of what has no value or no colour."""
_EDGE = 0.04
"""Of the cubes of a map that does not say how large its voxels are, m."""
_NEAR = 0.5
"""Boxes up to this far apart should be told apart at a glance, m."""
_FAR_ENOUGH = 60.0
"""Distance in CIE Lab beyond which two colours are as different as anybody needs."""
_GOLDEN = 0.61803398875


def _palette() -> npt.NDArray[np.uint8]:
    """Colours (36, 3): hues by the golden ratio, so that any few in a row lie far apart, in three lightnesses."""
    hls = [((k * _GOLDEN) % 1.0, (0.42, 0.58, 0.74)[k % 3], 0.68) for k in range(36)]
    rgb = np.array([colorsys.hls_to_rgb(*colour) for colour in hls])
    return np.asarray(np.rint(rgb * 255), np.uint8)


def instance_colours(instance_map: InstanceMap) -> dict[int, Rgb]:
    """A colour for each thing that is easily told from those of things beside it; structure is dimmed.

    In the order of ids each takes the first colour of the palette, from a place of its own on, that is far from the colours of all
    earlier things within ``_NEAR`` m, or the farthest there is.
    """
    palette = _palette()
    lab = cv2.cvtColor((palette[None] / np.float32(255)).astype(np.float32), cv2.COLOR_RGB2LAB)[0]
    apart = np.minimum(np.linalg.norm(lab[:, None] - lab[None], axis=2), _FAR_ENOUGH)
    things = [i for i in instance_map if not i.is_structure]
    low = np.array([i.aabb_min for i in things]).reshape(-1, 3)
    high = np.array([i.aabb_max for i in things]).reshape(-1, 3)
    chosen = np.zeros(len(things), np.int64)
    for n, thing in enumerate(things):
        gap = np.maximum(np.maximum(low[:n] - high[n], low[n] - high[:n]), 0)
        beside = chosen[:n][np.linalg.norm(gap, axis=1) <= _NEAR]
        order = (np.arange(len(palette)) + thing.id) % len(palette)
        chosen[n] = order[np.argmax(apart[np.ix_(order, beside)].min(axis=1, initial=_FAR_ENOUGH))]
    colours = {i.id: DIMMED for i in instance_map}
    return colours | {thing.id: _rgb(palette[k]) for thing, k in zip(things, chosen, strict=True)}


def heat_colour(values: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Colours (n, 3) of values (n,) 0..1 in viridis, whose steps look equal: 0 dark violet, 1 yellow."""
    scaled = np.rint(np.asarray(values, np.float64) * 255).astype(np.uint8).reshape(-1, 1)
    bgr = cv2.applyColorMap(scaled, cv2.COLORMAP_VIRIDIS)
    return np.asarray(bgr.reshape(-1, 3)[:, ::-1], np.uint8)


def colours_of(instance_map: InstanceMap, colours: Colours = "instance") -> dict[int, Rgb]:
    """The colour of every instance by its id.

    Raises
    ------
    ValueError
        Heat that is not within 0..1.
    """
    if isinstance(colours, str):
        if colours == "instance":
            return instance_colours(instance_map)
        if colours == "rgb":
            return {i.id: DIMMED if i.colour is None else _rgb(i.colour) for i in instance_map}
        raise ValueError(f"colours {colours!r}, expected 'instance', 'rgb' or values by id")
    ids = [i.id for i in instance_map if i.id in colours]
    values = np.array([colours[i] for i in ids], np.float64)
    if not ((values >= 0) & (values <= 1)).all():
        raise ValueError(f"heat from {values.min()} to {values.max()}, expected values within 0..1")
    heat = heat_colour(values) if ids else np.empty((0, 3), np.uint8)
    return {i.id: DIMMED for i in instance_map} | {i: _rgb(colour) for i, colour in zip(ids, heat, strict=True)}


def _rgb(colour: npt.NDArray[np.uint8]) -> Rgb:
    red, green, blue = (int(c) for c in colour)
    return red, green, blue


def save_ply(
    instance_map: InstanceMap, path: str | Path, colours: Colours = "instance", *, structure: bool = True
) -> None:
    """Write the voxel centres as a point cloud: binary little-endian PLY.

    Its vertices have ``x y z red green blue instance label``, and ``heat`` (NaN = none) where colours are values. ``label`` is the
    place of a label among those in the comments of the header, from 0 on, in the order of the alphabet and written as JSON.

    Parameters
    ----------
    instance_map : InstanceMap
    path : str or Path
    colours : "instance", "rgb" or mapping of id to 0..1
    structure : bool
        Whether to write floors, ceilings and walls.

    Raises
    ------
    ValueError
        There is nothing to write, or the colours cannot be used.
    DataError
        The path cannot be written to.
    """
    chosen, shown = _chosen(instance_map, structure), colours_of(instance_map, colours)
    heat = None if isinstance(colours, str) else np.array([colours.get(i.id, np.nan) for i in chosen], np.float32)
    labels = sorted({i.label for i in chosen})
    number = {label: n for n, label in enumerate(labels)}
    counts = [len(i.points) for i in chosen]
    columns: list[tuple[str, str, npt.NDArray[Any]]] = [
        *zip("xyz", ["<f4"] * 3, np.concatenate([i.points for i in chosen]).T, strict=True),
        *(
            (name, "u1", np.repeat([shown[i.id][channel] for i in chosen], counts))
            for channel, name in enumerate(("red", "green", "blue"))
        ),
        ("instance", "<i4", np.repeat([i.id for i in chosen], counts)),
        ("label", "<i4", np.repeat([number[i.label] for i in chosen], counts)),
        *([] if heat is None else [("heat", "<f4", np.repeat(heat, counts))]),
    ]
    vertices = np.empty(sum(counts), [(name, kind) for name, kind, _ in columns])
    for name, _, values in columns:
        vertices[name] = values
    comments = [f"label {n} {json.dumps(label)}" for n, label in enumerate(labels)]
    file = io.BytesIO()
    PlyData([PlyElement.describe(vertices, "vertex")], byte_order="<", comments=comments).write(file)
    write_whole_file(path, file.getvalue())


def save_glb(
    instance_map: InstanceMap, path: str | Path, colours: Colours = "instance", *, structure: bool = True
) -> None:
    """Write a scene with a node for each instance, called "<id> <label>": its voxels as cubes, without the faces between them.

    Nodes and meshes carry ``extras``: id, label, centre (m), confidence, n_observations, is_structure, and heat where colours are
    values. Parameters and errors as for ``save_ply``.
    """
    chosen, shown = _chosen(instance_map, structure), colours_of(instance_map, colours)
    scene = trimesh.Scene()
    factors: dict[str, list[float]] = {}
    for instance in chosen:
        name = f"{instance.id} {instance.label}".rstrip()
        # glTF's factors are linear; see ``exact`` for why they are not given here.
        factors[name] = [*_linear(shown[instance.id]), 1.0]
        vertices, faces = cubes(instance.points, instance_map.voxel_size or _EDGE)
        material = trimesh.visual.material.PBRMaterial(name=name, metallicFactor=0.0, roughnessFactor=1.0)
        mesh = trimesh.Trimesh(vertices, faces, process=False, visual=trimesh.visual.TextureVisuals(material=material))
        mesh.metadata = _about(instance, colours)
        scene.add_geometry(mesh, node_name=name, geom_name=name)

    def exact(tree: dict[str, Any]) -> None:
        # trimesh would round the factors to bytes, and put the extras on the meshes alone.
        for entry in tree["materials"]:
            entry["pbrMetallicRoughness"]["baseColorFactor"] = factors[entry["name"]]
        for node in tree["nodes"]:
            if "mesh" in node:
                node["extras"] = tree["meshes"][node["mesh"]]["extras"]

    write_whole_file(path, trimesh.exchange.gltf.export_glb(scene, include_normals=False, tree_postprocessor=exact))


def _chosen(instance_map: InstanceMap, structure: bool) -> list[MapInstance]:
    chosen = [i for i in instance_map if structure or not i.is_structure]
    if not chosen:
        raise ValueError(f"the map has no instances to write{'' if structure else ' that are not structure'}")
    return chosen


def _about(instance: MapInstance, colours: Colours) -> dict[str, Any]:
    about = {
        "id": instance.id,
        "label": instance.label,
        "centre": [round(float(x), 4) for x in instance.centre],
        "confidence": round(instance.confidence, 4),
        "n_observations": instance.n_observations,
        "is_structure": instance.is_structure,
    }
    if not isinstance(colours, str) and instance.id in colours:
        about["heat"] = float(colours[instance.id])
    return about


def _linear(colour: Rgb) -> list[float]:
    """Linear values of an sRGB colour (IEC 61966-2-1)."""
    srgb = np.array(colour) / 255
    return [float(x) for x in np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)]


def cubes(points: npt.NDArray[np.floating], edge: float) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Cubes of a grid around points, as one surface: only faces with no cube behind them, corners shared.

    Parameters
    ----------
    points : (N, 3) m
        At least one; on a grid of that edge, or they are moved to the nearest place of the grid through the first of them.
    edge : float
        m.

    Returns
    -------
    vertices : (V, 3) float64 m
    faces : (F, 3) int64
        Counter-clockwise seen from outside.
    """
    origin = np.asarray(points[0], np.float64)
    cells = np.unique(np.rint((np.asarray(points, np.float64) - origin) / edge).astype(np.int64), axis=0)
    low = cells.min(0) - 1
    shape = cells.max(0) + 3 - low
    # Cells and corners as numbers in one box with a margin, so that a neighbour is a number further on.
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    key = (cells - low) @ stride
    quads = []
    for axis in range(3):
        one, other = stride[(axis + 1) % 3], stride[(axis + 2) % 3]
        for side in (0, 1):
            step = stride[axis] if side else -stride[axis]
            bare = key[~np.isin(key + step, key, assume_unique=True)] + side * stride[axis]
            around = [0, one, one + other, other] if side else [0, other, one + other, one]
            quads.append(bare[:, None] + np.array(around))
    corners, index = np.unique(np.concatenate(quads), return_inverse=True)
    index = index.reshape(-1, 4)
    place = np.stack([corners // stride[0], corners // stride[1] % shape[1], corners % shape[2]], axis=1) + low
    faces = np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]])
    return origin + (place - 0.5) * edge, faces.astype(np.int64)
