"""HM3D scenes: ``<hash>.glb`` (look), ``<hash>.semantic.glb`` (ids as colours), ``<hash>.semantic.txt`` (names), v0.1 and v0.2.

Both meshes are Z up after the transforms of their nodes (in spite of glTF's rule): world = (x, z, -y). The look and the semantics
come in separate archives, so the semantic files are looked for in the trees beside the scene's as well. The format names no
rooms: it gives each object the number of its region.
"""

from __future__ import annotations

from dataclasses import dataclass
from glob import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.glb import files_textured_mesh, read_textured_mesh
from openmap_scenes.formats.hm3d_paint import face_ids
from openmap_scenes.formats.hm3d_rooms import make_rooms
from openmap_scenes.formats.hm3d_table import Row, read_table
from openmap_scenes.formats.images import basis_error
from openmap_scenes.formats.instances import make_instance
from openmap_scenes.formats.mesh import T_WORLD_ZUP, TexturedMesh
from openmap_scenes.formats.transfer import SAME_FACE, transfer_face_ids
from openmap_scenes.scene import Instance, Scene, instance_boxes

# What follows the scene's hash in the names of its files; the longer ones first.
LOOK, BASIS, SEMANTIC, TABLE = ".glb", ".basis.glb", ".semantic.glb", ".semantic.txt"
SUFFIXES = (BASIS, SEMANTIC, TABLE, LOOK)
EXPECTED = "an HM3D scene: <hash>.glb and, for its instances, <hash>.semantic.glb and <hash>.semantic.txt"


@dataclass(frozen=True)
class _Files:
    """A scene's files; ``semantic`` and ``table`` are both None where the scene is not annotated."""

    look: Path
    semantic: Path | None
    table: Path | None


def read_hm3d(path: str | Path) -> Scene:
    """The scene of a folder (``00001-<hash>``) or of one of its files.

    ``Instance.id`` is the table's id. Without semantic files the scene has neither instances nor rooms.

    Raises
    ------
    DataError
        A file is missing or broken, the textures are Basis compressed, or the files do not belong together.
    """
    files = _locate(path)
    rows = read_table(files.table) if files.table else {}
    mesh = read_textured_mesh(files.look, T_WORLD_ZUP)
    face_instance = np.zeros(len(mesh.faces), np.int32)
    instances: list[Instance] = []
    if files.semantic and files.table:
        labelled = read_textured_mesh(files.semantic, T_WORLD_ZUP)
        ids = face_ids(labelled, {object_id: row.colour for object_id, row in rows.items()})
        _check_painted(files.semantic, files.table, ids, rows)
        instances = _instances(rows, instance_boxes(labelled.vertices, labelled.faces, ids))
        if _same_triangles(labelled, mesh):
            face_instance = ids
        else:
            face_instance = transfer_face_ids(
                labelled.vertices, labelled.faces, ids, mesh.vertices, mesh.faces, files.semantic, files.look
            )
    return Scene(
        name=_hash(files.look),
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_material=mesh.face_material,
        face_instance=face_instance,
        materials=mesh.materials,
        instances=instances,
        rooms=make_rooms(instances),
        uv=mesh.uv,
        vertex_colour=mesh.vertex_colour,
        source=f"hm3d:{path}",
    )


def files_hm3d(path: str | Path) -> list[Path]:
    """Every file that decides what ``read_hm3d`` gives; DataError where one is missing."""
    files = _locate(path)
    found = files_textured_mesh(files.look)
    if files.semantic and files.table:
        found += [*files_textured_mesh(files.semantic), files.table]
    return found


def _locate(path: str | Path) -> _Files:
    path = Path(path)
    if not path.exists():
        raise DataError(path, "no such file or folder", EXPECTED)
    folder, scene = (path, _scene_of_folder(path)) if path.is_dir() else (path.parent, _hash(path))
    look, semantic, table = (_find(folder, scene + suffix) for suffix in (LOOK, SEMANTIC, TABLE))
    if look is None and table is not None:
        read_table(table)  # what is wrong with the files that are there comes first
    if look is None:
        basis = _find(folder, scene + BASIS)
        raise basis_error(basis) if basis else DataError(folder / (scene + LOOK), "no such file", EXPECTED)
    for there, other, suffix in ((semantic, table, TABLE), (table, semantic, SEMANTIC)):
        if there is not None and other is None:
            raise DataError(
                there,
                f"no {scene + suffix} with it",
                "both, or neither of them",
                "Fetch the semantic annotations again.",
            )
    return _Files(look, semantic, table)


def _hash(file: Path) -> str:
    """The scene's name within that of one of its files."""
    suffix = next((suffix for suffix in SUFFIXES if file.name.endswith(suffix)), "")
    if not suffix or file.name == suffix:
        raise DataError(file, f"a file named {file.name!r}", f"one of {', '.join(f'<hash>{s}' for s in SUFFIXES)}")
    return file.name.removesuffix(suffix)


def _scene_of_folder(folder: Path) -> str:
    """The scene whose files a folder holds: the one that it is named after, or the only one."""
    names = sorted(
        {_hash(file) for file in folder.iterdir() if file.name.endswith(SUFFIXES) and file.name not in SUFFIXES}
    )
    for name in (folder.name.partition("-")[2], folder.name):
        if name in names:
            return name
    if len(names) == 1:
        return names[0]
    found = f"files of {len(names)} scenes ({', '.join(names[:5])})" if names else "none of its files"
    raise DataError(folder, found, EXPECTED, "Name one of the .glb files itself." if names else "")


def _find(folder: Path, name: str) -> Path | None:
    """A file of the scene in its folder, or in the folder of the same name in a tree of another archive, which is named hm3d.

    The archives unpack to ``hm3d/val/<scene>/``, ``hm3d-val-glb-v0.2/<scene>/`` and ``hm3d-val-semantic-annots-v0.2/<scene>/``.
    Of several versions the latest one counts.
    """
    if (folder / name).is_file():
        return folder / name
    absolute = folder.resolve()
    inner = f"{escape(absolute.name)}/{escape(name)}"
    found: list[Path] = []
    for tree in list(absolute.parents)[1:3]:
        for archive in ("*[hH][mM]3[dD]*", "*[hH][mM]3[dD]*/*"):
            try:
                found += [file for file in tree.glob(f"{archive}/{inner}") if file.is_file()]
            except OSError:  # a folder above the scene that may not be listed holds nothing of it
                continue
    return max(found, default=None)


def _check_painted(semantic: Path, table: Path, ids: npt.NDArray[np.int32], rows: dict[int, Row]) -> None:
    if rows and not ids.any():
        raise DataError(
            semantic,
            f"no face in one of the {len(rows)} colours that {table.name} lists",
            "the colours of the table",
            "The two files are not of one scene, or the textures were compressed or filtered.",
        )


def _same_triangles(labelled: TexturedMesh, shown: TexturedMesh) -> bool:
    """Whether two meshes list the same triangles in the same order, so that ids need no searching."""
    if labelled.faces.shape != shown.faces.shape:
        return False
    difference = np.abs(labelled.vertices[labelled.faces] - shown.vertices[shown.faces])
    return bool(difference.max() <= SAME_FACE)


def _instances(
    rows: dict[int, Row], boxes: dict[int, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]
) -> list[Instance]:
    """Instances of the table's objects that have faces."""
    return [
        make_instance(object_id, row.category, *boxes[object_id], room=row.region, source_id=object_id)
        for object_id, row in rows.items()
        if object_id in boxes
    ]
