"""A scene as a folder of flat arrays that open in milliseconds and that all processes of a machine share.

``scene.json`` holds names, tables and shapes, and a digest of them. ``vertices.npy``, ``faces.npy`` ... are the arrays of
``Scene``; ``textures.npy`` holds the bytes of all textures, one after the other. Arrays are opened as read-only memory maps:
nothing is copied, pages come from the disk when they are looked at, and two processes that look at one page have it once.
"""

from __future__ import annotations

import dataclasses
import errno
import hashlib
import json
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.scene import Instance, Material, Room, Scene

INDEX, TEXTURES = "scene.json", "textures.npy"
FORMAT, VERSION = "openmap-scene", 1

_DTYPES: dict[str, np.dtype[Any]] = {
    "vertices": np.dtype(np.float32),
    "faces": np.dtype(np.int32),
    "face_material": np.dtype(np.int32),
    "face_instance": np.dtype(np.int32),
    "uv": np.dtype(np.float32),
    "vertex_colour": np.dtype(np.uint8),
}
_POINTS = ("centre", "aabb_min", "aabb_max")
_HEAD = re.compile(rb'\{"format": "([\w-]+)", "version": (\d+), "blake2b": "([0-9a-f]{64})", "scene": ')
_REMEDY = "Delete the folder; the scene is then read from its source again."


def save_scene(scene: Scene, folder: str | Path) -> None:
    """Write a scene to a folder, whole or not at all; a scene that was saved there before is replaced.

    Raises
    ------
    DataError
        The folder holds something else, or an array of the scene is not of the type that ``Scene`` documents.
    OSError
        The folder cannot be written.
    """
    folder = Path(folder)
    _check_replaceable(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    unfinished = _beside(folder)
    unfinished.mkdir()
    try:
        _write(scene, unfinished)
        _move(unfinished, folder)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def open_scene(folder: str | Path, source: str | None = None) -> Scene:
    """The scene that was saved in a folder, its arrays read-only memory maps.

    What is seen of damage: files that are missing, cut or of another type or shape, any change of ``scene.json``, and everything
    that ``Scene`` refuses. A pixel or coordinate that has changed is not seen, since that would mean to read all of it.

    Parameters
    ----------
    folder : str or Path
    source : str or None
        ``Scene.source``; None = what it was when the scene was saved.

    Raises
    ------
    DataError
        The folder does not hold a whole scene of this version.
    """
    folder = Path(folder)
    index = _read_index(folder / INDEX)
    try:
        shapes = {name: tuple(shape) for name, shape in index["arrays"].items()}
        arrays = {name: _map(folder / f"{name}.npy", _DTYPES[name], shape) for name, shape in shapes.items()}
        return Scene(
            name=index["name"],
            materials=_materials(folder / TEXTURES, index),
            instances=[Instance(**_with_points(row)) for row in index["instances"]],
            rooms=[Room(**_with_points(row)) for row in index["rooms"]],
            source=index["source"] if source is None else source,
            credits=tuple(index["credits"]),
            **arrays,
        )
    except DataError:
        raise
    except (LookupError, TypeError, AttributeError, ValueError, ArithmeticError) as error:
        found = f"tables that do not fit together ({type(error).__name__}: {error})"
        raise DataError(folder, found, f"a scene of version {VERSION}", _REMEDY) from error


def stored_bytes(scene: Scene) -> int:
    """About how much room a scene takes on disk, bytes."""
    arrays = [getattr(scene, name) for name in _DTYPES] + [texture for texture, _ in _textures(scene)]
    return sum(int(array.nbytes) for array in arrays if array is not None) + 500 * len(scene.instances) + 8192


def remove_scene(folder: Path) -> None:
    """Take a saved scene away at once, for whoever opens it next; whoever has it open keeps what was mapped."""
    old = _beside(folder)
    try:
        os.rename(folder, old)
    except FileNotFoundError:
        return
    shutil.rmtree(old, ignore_errors=True)


def _beside(folder: Path) -> Path:
    """A new hidden name in the same place, so that a rename stays on one file system."""
    return folder.with_name(f".{folder.name}.{os.getpid()}-{secrets.token_hex(4)}.tmp")


def _check_replaceable(folder: Path) -> None:
    """DataError where a folder holds something that is no saved scene, and must not be replaced by one."""
    for _ in range(5):
        try:
            names = os.listdir(folder)
        except FileNotFoundError:
            return
        except NotADirectoryError:
            break
        if not names or INDEX in names:
            return
        time.sleep(0.02)  # it may be one that another process is just taking away
    raise DataError(folder, f"something that has no {INDEX}", "a saved scene, an empty folder or nothing")


def _move(unfinished: Path, folder: Path) -> None:
    """Rename to a name that another process may take, or leave, at the same time."""
    for _ in range(100):
        try:
            os.rename(unfinished, folder)
            return
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) and not folder.exists():
                raise
        remove_scene(folder)
    raise OSError(f"{folder} is written by too many processes at once")


def _write(scene: Scene, folder: Path) -> None:
    arrays: dict[str, npt.NDArray[Any]] = {n: a for n in _DTYPES if (a := getattr(scene, n)) is not None}
    for name, array in arrays.items():
        if array.dtype != _DTYPES[name]:
            raise DataError(scene.source or scene.name, f"{name} of type {array.dtype}", f"{_DTYPES[name]}")
        _write_array(folder / f"{name}.npy", array.dtype, array.shape, [array])
    textures = [texture for texture, _ in _textures(scene)]
    for texture in textures:
        if texture.dtype != np.uint8 or texture.ndim != 3 or texture.shape[2] != 3:
            found = f"a texture {texture.shape} of {texture.dtype}"
            raise DataError(scene.source or scene.name, found, "(h, w, 3) uint8")
    size = sum(texture.nbytes for texture in textures)
    if size:
        _write_array(folder / TEXTURES, np.dtype(np.uint8), (size,), textures)
    number = {m: i for i, (_, members) in enumerate(_textures(scene)) for m in members}
    index = {
        "name": scene.name,
        "source": scene.source,
        "credits": scene.credits,
        "arrays": {name: array.shape for name, array in arrays.items()},
        "textures": [texture.shape[:2] for texture in textures],
        "materials": [
            _row(dataclasses.replace(m, texture=None)) | {"texture": number.get(i)}
            for i, m in enumerate(scene.materials)
        ],
        "instances": [_row(instance) for instance in scene.instances],
        "rooms": [_row(room) for room in scene.rooms],
    }
    payload = json.dumps(index, default=_plain).encode()
    check = hashlib.blake2b(payload, digest_size=32).hexdigest()
    head = f'{{"format": "{FORMAT}", "version": {VERSION}, "blake2b": "{check}", "scene": '
    with _durable(folder / INDEX) as file:
        file.write(head.encode() + payload + b"}")


def _textures(scene: Scene) -> list[tuple[npt.NDArray[np.uint8], list[int]]]:
    """Every different texture array of a scene with the numbers of the materials that have it."""
    found: dict[int, tuple[npt.NDArray[np.uint8], list[int]]] = {}
    for number, material in enumerate(scene.materials):
        if material.texture is not None:
            found.setdefault(id(material.texture), (material.texture, []))[1].append(number)
    return list(found.values())


def _row(thing: Instance | Room | Material) -> dict[str, Any]:
    return {field.name: _plain(getattr(thing, field.name)) for field in dataclasses.fields(thing)}


def _plain(value: Any) -> Any:
    """What JSON can hold of a value; float64 goes through JSON without loss."""
    if isinstance(value, np.ndarray):
        return value.astype(np.float64).tolist()
    return value.item() if isinstance(value, np.generic) else value


def _write_array(path: Path, dtype: np.dtype[Any], shape: tuple[int, ...], parts: Iterable[npt.NDArray[Any]]) -> None:
    """One .npy file of the parts, one after the other, without putting them together in memory."""
    header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    with _durable(path) as file:
        np.lib.format.write_array_header_1_0(file, header)
        for part in parts:
            file.write(np.ascontiguousarray(part).reshape(-1).data)


@contextmanager
def _durable(path: Path) -> Iterator[BinaryIO]:
    """A new file that is on the disk when it closes: after a power cut a folder with its final name must not hold zeros."""
    with path.open("xb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def _read_index(path: Path) -> dict[str, Any]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(path, f"no readable file ({error.strerror})", "the tables of a saved scene") from error
    head = _HEAD.match(data)
    if head is None or head[1].decode() != FORMAT or not data.endswith(b"}"):
        raise DataError(path, f"{len(data)} bytes of something else", "the tables of a saved scene", _REMEDY)
    if int(head[2]) != VERSION:
        raise DataError(path, f"version {int(head[2])}", f"version {VERSION}", _REMEDY)
    payload = data[head.end() : -1]
    if hashlib.blake2b(payload, digest_size=32).hexdigest() != head[3].decode():
        raise DataError(path, "a content that its digest does not fit", "an intact file", _REMEDY)
    index: dict[str, Any] = json.loads(payload)
    return index


def _map(path: Path, dtype: np.dtype[Any], shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """An array file as a read-only memory map, if it is what the index says."""
    try:
        array = np.lib.format.open_memmap(path, mode="r")
        size = path.stat().st_size
    except Exception as error:  # a broken header may fail anywhere inside numpy
        found = f"no readable array ({type(error).__name__}: {error})"
        raise DataError(path, found, f"{shape} of {dtype}", _REMEDY) from error
    if array.dtype != dtype or array.shape != shape or not array.flags.c_contiguous:
        raise DataError(path, f"{array.shape} of {array.dtype}", f"{shape} of {dtype}", _REMEDY)
    if size != array.offset + array.nbytes:
        raise DataError(path, f"{size} bytes", f"{array.offset + array.nbytes}", _REMEDY)
    # The plain view costs less at every slice than numpy's memmap class, and keeps the map alive.
    return array.view(np.ndarray)


def _materials(path: Path, index: dict[str, Any]) -> list[Material]:
    shapes = [(int(h), int(w), 3) for h, w in index["textures"]]
    sizes = [h * w * 3 for h, w, _ in shapes]
    whole = _map(path, np.dtype(np.uint8), (sum(sizes),)) if sum(sizes) else np.zeros(0, np.uint8)
    ends = np.cumsum([0, *sizes]).tolist()
    textures = [whole[ends[i] : ends[i + 1]].reshape(shape) for i, shape in enumerate(shapes)]
    return [
        Material(
            **row
            | {
                "colour": np.array(row["colour"], np.float32),
                "texture": None if row["texture"] is None else textures[row["texture"]],
            }
        )
        for row in index["materials"]
    ]


def _with_points(row: dict[str, Any]) -> dict[str, Any]:
    return {name: np.array(value, np.float64) if name in _POINTS else value for name, value in row.items()}
