"""What lies in a folder, told from names alone: which dataset a scan is of, and all scenes below a folder of datasets."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from openmap_scenes.errors import DataError

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
# Parts of a dataset's scan that are no scene by themselves.
_PART = re.compile(r".*(\.semantic\.glb|\.basis\.glb|_semantic\.(ply|glb)|_vh_clean.*\.ply|\.labels\.ply)$")
_HM3D_FOLDER = re.compile(r"\d{5}-.+")


@dataclass(frozen=True)
class _Listing:
    """The names in a folder."""

    path: Path
    files: frozenset[str]
    folders: frozenset[str]

    @classmethod
    def of(cls, path: Path) -> _Listing:
        with os.scandir(path) as entries:
            found = [(entry.name, entry.is_dir()) for entry in entries if not entry.name.startswith(".")]
        return cls(path, frozenset(n for n, d in found if not d), frozenset(n for n, d in found if d))

    def stems(self, *endings: str) -> set[str]:
        """What stands before any of the endings in the names of files."""
        return {n[: -len(e)] for e in endings for n in self.files if n.endswith(e) and len(n) > len(e)}


def list_scenes(root: str | Path) -> list[str]:
    """The specs of everything that can be loaded below a folder, sorted; only names are looked at, no content.

    Found are scans of Matterport3D (Habitat's layout or the raw one), HM3D, Gibson, Replica and ScanNet, wherever they lie (such as
    in Habitat's ``scene_datasets`` tree), and plain meshes everywhere else. Links are followed.

    Raises
    ------
    DataError
        No such folder.
    """
    root = Path(root)
    check_exists(root, "a folder of scenes")
    if root.is_file():
        return [guess_spec(root)]
    return sorted(_walk(root, root, set()))


def guess_spec(path: str | Path) -> str:
    """The spec of the scene that lies at a path, by the files there: a scan's folder, one of its files, or a mesh.

    A folder is told by what only one dataset has, so that one with missing files is named too, and its reader says what is missing.

    Raises
    ------
    DataError
        Nothing there, no scene, or several.
    """
    path = Path(path)
    check_exists(path, "a scan's folder or a mesh")
    if path.is_file():
        kind, _ = _kind(_Listing.of(path.parent))
        if kind is not None:
            return f"{kind}:{path.parent}"
        if path.suffix.lower() not in MESH_SUFFIXES:
            raise DataError(path, f"suffix {path.suffix!r}", f"a mesh ({', '.join(MESH_SUFFIXES)}) or a scan's folder")
        return _mesh_spec(path, _Listing.of(path.parent))
    listing = _Listing.of(path)
    kind, _ = _kind(listing)
    if kind is not None:
        return f"{kind}:{path}"
    meshes = _meshes(listing)
    if len(meshes) == 1:
        return _mesh_spec(path / meshes[0], listing)
    below = list_scenes(path)
    if len(below) == 1:
        return below[0]
    found = f"{len(below)} scenes ({', '.join(below[:3])}{', ...' if len(below) > 3 else ''})" if below else "no scene"
    expected = "one scan of Matterport3D, HM3D, Gibson, Replica or ScanNet, or one mesh"
    raise DataError(path, found, expected, "Name one of them." if below else "")


def check_exists(path: Path, expected: str) -> None:
    """DataError where a path does not exist, with the name that comes nearest and what lies there instead."""
    from difflib import get_close_matches

    if path.exists():
        return
    # The name at fault is the first one that is missing.
    missing = path
    while not missing.parent.exists() and missing.parent != missing:
        missing = missing.parent
    try:
        beside = sorted(item.name for item in missing.parent.iterdir() if not item.name.startswith("."))
    except OSError:
        beside = []
    near = get_close_matches(missing.name, beside, 1, 0.6)
    remedy = f"Did you mean {missing.with_name(near[0]) / path.relative_to(missing)}? " if near else ""
    shown = ", ".join(beside[:8]) + (f", ... ({len(beside)} in all)" if len(beside) > 8 else "")
    remedy += f"In {missing.parent} lie: {shown}." if beside else f"{missing.parent} holds nothing."
    found = "no such file" if path.suffix.lower() in MESH_SUFFIXES else "no such folder"
    raise DataError(path, found, expected, remedy)


def _walk(folder: Path, root: Path, seen: set[str]) -> Iterator[str]:
    """Specs below a folder; ``seen`` are the real paths of folders that were walked, for links that go in circles."""
    real = os.path.realpath(folder)
    if real in seen:
        return
    seen.add(real)
    try:
        listing = _Listing.of(folder)
    except OSError:
        return  # may not be read
    kind, complete = _kind(listing)
    if kind is not None and complete:
        yield f"{kind}:{folder}"
        return
    for name in _meshes(listing):
        yield _mesh_spec(folder / name, listing, root)
    for name in sorted(listing.folders):
        yield from _walk(folder / name, root, seen)


def _kind(listing: _Listing) -> tuple[str | None, bool]:
    """Which dataset's scan a folder is, None for none, and whether all that its reader needs is there."""
    files, folders = listing.files, listing.folders
    if houses := listing.stems(".house"):
        whole = any({f"{h}.glb", f"{h}_semantic.ply"} <= files for h in houses)
        if whole or "matterport_mesh" not in {listing.path.name, *folders}:
            in_raw_scan = listing.path.name == "house_segmentations"
            return (None, False) if in_raw_scan else ("mp3d", whole)
    if "house_segmentations" in folders:
        return "mp3d", "matterport_mesh" in folders
    if scans := listing.stems("_vh_clean_2.ply"):
        return "scannet", bool(scans)
    if listing.stems(".aggregation.json", ".segs.json"):
        return "scannet", False
    if "info_semantic.json" in files or "mesh_semantic.ply" in files:
        return ("replica", "mesh.ply" in files) if listing.path.name != "habitat" else (None, False)
    if "mesh.ply" in files and folders & {"habitat", "textures"}:
        return "replica", True
    if scans := listing.stems(".semantic.glb", ".semantic.txt"):
        return "hm3d", any(f"{scan}.glb" in files for scan in scans)
    if _HM3D_FOLDER.fullmatch(listing.path.name) and listing.stems(".glb"):
        scan = listing.path.name.partition("-")[2]
        if f"{scan}.glb" in files or f"{scan}.basis.glb" in files:
            return "hm3d", f"{scan}.glb" in files
    return None, False


def _meshes(listing: _Listing) -> list[str]:
    """Names of the meshes in a folder that are scenes by themselves."""
    return sorted(n for n in listing.files if Path(n).suffix.lower() in MESH_SUFFIXES and not _PART.match(n))


def _mesh_spec(path: Path, listing: _Listing, root: Path | None = None) -> str:
    """``gibson:`` for a GLB in a folder of that name or beside Gibson's tables, ``file:`` for every other mesh."""
    above = (
        path.parent.absolute().parts if root is None else (root.absolute().name, *path.parent.relative_to(root).parts)
    )
    in_gibson = any(part.lower().startswith("gibson") for part in above)
    tables = {f"{path.stem}.scn", f"{path.stem}.ids"}
    return f"{'gibson' if path.suffix.lower() == '.glb' and (in_gibson or tables & listing.files) else 'file'}:{path}"
