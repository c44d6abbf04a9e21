"""The furniture library on disk: which catalogues there are and what they hold.

Sweet Home 3D catalogues (``.sh3f``) are zip archives: ``PluginFurnitureCatalog.properties`` numbers the pieces and gives
each a name, its size in centimetres, the path of an OBJ model and who made it. Everything is read straight from them.
"""

from __future__ import annotations

import hashlib
import os
import re
import zipfile
from bisect import bisect_left
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError

DEFAULT_FOLDER = Path("/usr/share/sweethome3d/furniture")
FOLDER_VARIABLE = "OPENMAP_FURNITURE"
_PROPERTIES = "PluginFurnitureCatalog.properties"


@dataclass(frozen=True)
class Piece:
    """One entry of a furniture catalogue.

    Parameters
    ----------
    id : str
        Unique in the library ("scopia/bed1"): the folder of the model.
    name : str
        The catalogue's English name.
    size : (3,) float64 m
        Width (x), height (y), depth (z) that the catalogue declares.
    elevation : float
        Height above the floor, m, at which the catalogue places it.
    surface : float or None
        Height, m above its base, of the surface on which things may be dropped; None where the catalogue forbids it.
    rotation : (3, 3) float64
        Applied to the model before it is scaled to ``size``; afterwards x is right, y up, and the front looks along +z.
    archive : Path
    model : str
        Path of the OBJ file inside the archive.
    creator, licence : str
    """

    id: str
    name: str
    size: npt.NDArray[np.float64]
    elevation: float
    surface: float | None
    rotation: npt.NDArray[np.float64]
    archive: Path
    model: str
    creator: str
    licence: str

    @property
    def credit(self) -> str:
        """Who made it and under which licence, on one line."""
        return f"{self.name} ({self.id}) by {self.creator}, {self.licence}"

    def content_key(self) -> str:
        """A digest of the model's folder in the archive and of the size: changes when the piece does."""
        digest = hashlib.sha256(repr((self.model, self.size.tolist(), self.rotation.tolist())).encode())
        folder = self.model.rsplit("/", 1)[0] + "/"
        entries = _directory(self.archive, self.archive.stat().st_mtime_ns)
        for name, crc, size in entries[bisect_left(entries, (folder,)) :]:
            if not name.startswith(folder):
                break
            digest.update(f"{name}:{crc}:{size};".encode())
        return digest.hexdigest()[:32]


@cache
def _directory(archive: Path, modified: int) -> list[tuple[str, int, int]]:
    """Name, checksum and size of every file in an archive, sorted; ``modified`` is its time stamp, so that a change is seen."""
    with zipfile.ZipFile(archive) as file:
        return sorted((entry.filename, entry.CRC, entry.file_size) for entry in file.infolist())


def furniture_folder() -> Path:
    """The folder of the catalogues: ``OPENMAP_FURNITURE``, or where the Debian package puts them."""
    return Path(os.environ.get(FOLDER_VARIABLE, DEFAULT_FOLDER))


def read_library(folder: Path | None = None) -> dict[str, Piece]:
    """Every piece of every catalogue in a folder, by id, in the order of the ids.

    Raises
    ------
    DataError
        The folder holds no catalogue, or one cannot be read.
    """
    folder = furniture_folder() if folder is None else folder
    archives = sorted(folder.glob("*.sh3f")) if folder.is_dir() else []
    if not archives:
        raise DataError(
            folder,
            "no furniture catalogue" if folder.is_dir() else "no such folder",
            "Sweet Home 3D catalogues (*.sh3f)",
            "Install the Debian package sweethome3d-furniture (apt install sweethome3d-furniture), "
            f"set {FOLDER_VARIABLE} to a folder that holds its catalogues, or to 'none' for homes of pieces made by rule alone.",
        )
    pieces = [piece for archive in archives for piece in _read_catalogue(archive, archive.stat().st_mtime_ns)]
    return {piece.id: piece for piece in sorted(pieces, key=lambda p: p.id)}


@cache
def _read_catalogue(path: Path, modified: int) -> list[Piece]:
    """The pieces of a catalogue; ``modified`` is its time stamp, so that a change is seen."""
    try:
        with zipfile.ZipFile(path) as archive:
            properties = parse_properties(archive.read(_PROPERTIES).decode("latin-1"))
    except (zipfile.BadZipFile, KeyError, OSError) as error:
        raise DataError(path, f"{error}", f"a zip archive with {_PROPERTIES}", "Reinstall the catalogue.") from error
    numbers = sorted(int(key[3:]) for key in properties if re.fullmatch(r"id#\d+", key))
    return [_piece(path, properties, n) for n in numbers]


def _piece(path: Path, properties: dict[str, str], n: int) -> Piece:
    def value(key: str, default: str = "") -> str:
        return properties.get(f"{key}#{n}", default)

    try:
        model = value("model").lstrip("/")
        width, depth, height = (float(value(k)) / 100.0 for k in ("width", "depth", "height"))
        drop = float(value("dropOnTopElevation", str(height * 100.0)))
        rotation = np.array([float(v) for v in value("modelRotation", "1 0 0 0 1 0 0 0 1").split()]).reshape(3, 3)
        return Piece(
            id=model.rsplit("/", 1)[0],
            name=value("name"),
            size=np.array([width, height, depth]),
            elevation=float(value("elevation", "0")) / 100.0,
            surface=drop / 100.0 if drop > 0 else None,
            rotation=rotation,
            archive=path,
            model=model,
            creator=value("creator", "unknown"),
            licence=" ".join(properties.get("license", "licence unknown").split()),
        )
    except ValueError as error:
        raise DataError(f"{path}, entry {n}", f"{error}", "numbers for width, depth, height and rotation") from error


def parse_properties(text: str) -> dict[str, str]:
    """A Java ``.properties`` text as a dict: continued lines joined, unicode escapes resolved, comments left out."""
    text = re.sub(r"\\\r?\n\s*", "", text)
    text = re.sub(r"\\u([0-9a-fA-F]{4})", lambda m: chr(int(m[1], 16)), text)
    pairs = (line.split("=", 1) for line in text.splitlines() if "=" in line and line.lstrip()[:1] not in "#!")
    return {key.strip(): value.strip() for key, value in pairs}
