"""The PLY reader on every way to write the same mesh, and on damaged files."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from fuzzing import hold_to_data_error
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_scenes import DataError
from openmap_scenes.formats.ply import read_ply

FORMATS = ["ascii", "<", ">"]


def write_polygons(path: Path, polygons: list[list[int]], n: int, order: str) -> npt.NDArray[np.float64]:
    """Write n random vertices, an element nobody asks for, and the polygons, each with its row - 1 as object_id.

    Returns the vertices (n, 7): coordinates, colours, alpha. plyfile is not used, since it writes big-endian rows with lists
    in the machine's order.
    """
    rng = np.random.default_rng(n)
    vertices = np.concatenate([rng.integers(-99, 99, (n, 3)) / 8, rng.integers(0, 256, (n, 4))], axis=1)
    rows: list[tuple[str, list[float]]] = [("3f4B", [*v[:3].tolist(), *map(int, v[3:])]) for v in vertices]
    rows.append(("dBHHH", [0.5, 3, 7, 8, 9]))
    rows += [(f"B{len(p)}ii", [len(p), *p, row - 1]) for row, p in enumerate(polygons)]
    names = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}
    head = f"ply\nformat {names[order]} 1.0\ncomment ours\nelement vertex {n}\n"
    head += "".join(f"property float {c}\n" for c in "xyz")
    head += "".join(f"property uchar {c}\n" for c in ("red", "green", "blue", "alpha"))
    head += "element camera 1\nproperty double lens\nproperty list uchar ushort views\n"
    head += (
        f"element face {len(polygons)}\nproperty list uchar int vertex_indices\nproperty int object_id\nend_header\n"
    )
    if order == "ascii":
        body = "".join(" ".join(f"{value:g}" for value in values) + "\n" for _, values in rows).encode()
    else:
        body = b"".join(struct.pack(order + layout, *values) for layout, values in rows)
    path.write_bytes(head.encode() + body)
    return vertices


@pytest.mark.parametrize("order", FORMATS)
@settings(max_examples=40, deadline=None)
@given(st.data())
def test_every_format_gives_what_the_polygons_say(
    order: str, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
):
    sizes = data.draw(st.one_of(st.lists(st.integers(3, 6), max_size=12), st.lists(st.just(4), max_size=5)))
    polygons = [data.draw(st.lists(st.integers(0, 8), min_size=s, max_size=s)) for s in sizes]
    path = tmp_path_factory.mktemp("ply") / "mesh.ply"
    vertices = write_polygons(path, polygons, 9, order)
    mesh = read_ply(path, vertex_properties=["alpha"], face_properties=["object_id"])
    fans = [(row, [p[0], p[k], p[k + 1]]) for row, p in enumerate(polygons) for k in range(1, len(p) - 1)]
    assert mesh.faces.tolist() == [corners for _, corners in fans]
    assert mesh.polygon.tolist() == [row for row, _ in fans]
    assert mesh.face_properties["object_id"].tolist() == [row - 1 for row, _ in fans]
    np.testing.assert_array_equal(mesh.vertices, vertices[:, :3])
    np.testing.assert_array_equal(mesh.vertex_colour, vertices[:, 3:6])
    np.testing.assert_array_equal(mesh.vertex_properties["alpha"], vertices[:, 6])


def test_a_split_quad_keeps_its_orientation(tmp_path: Path):
    path = tmp_path / "quad.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    )
    mesh = read_ply(path)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    np.testing.assert_array_equal(np.cross(b - a, c - a), [[0, 0, 1], [0, 0, 1]])
    assert mesh.vertex_colour is None


HEADER = (
    "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {faces}\nproperty list {count} int vertex_indices\nend_header\n"
)


@pytest.mark.parametrize(
    ("vertices", "faces", "count", "body", "says"),
    [
        (10**12, 1, "uchar", "0 0 0\n", "rows of vertex"),
        (2 * 10**9, 1, "uchar", "0 0 0\n", "bytes after the header"),
        (1, 2 * 10**9, "uchar", "0 0 0\n", "bytes after the header"),
        (1, 1, "uchar", "0 0 0\n3 0 0 1\n", "vertex_indices out of range"),
        (1, 1, "uchar", "0 0 0\n3 0 0 0.5\n", "vertex_indices out of range"),
        (1, 1, "uchar", "0 0 0\n3 0 0 -1\n", "vertex_indices out of range"),
        (1, 1, "uchar", "0 0 0\n2 0 0\n", "face 0 with 2 corners"),
        (1, 1, "uchar", "0 0 0\n200 0 0\n", "row 0 of 1 of element face"),
        (1, 1, "uchar", "0 0 0\nnan 0 0\n", "row 0 of 1 of element face"),
        (1, 1, "uchar", "0 0 0\n-3 0 0\n", "row 0 of 1 of element face"),
        (1, 1, "uchar", "0 nan 0\n3 0 0 0\n", "out of all bounds"),
        (1, 1, "uchar", "0 1e300 0\n3 0 0 0\n", "out of all bounds"),
        (1, 1, "uchar", "0 zero 0\n3 0 0 0\n", "not all numbers"),
        (1, 1, "uchar", "0 0 0\n3 0 0 0\n3 0 0 0\n", "4 numbers after the last row"),
        (1, 1, "float", "0 0 0\n3 0 0 0\n", "line 8"),
    ],
)
def test_a_text_file_that_lies_is_refused(tmp_path: Path, vertices: int, faces: int, count: str, body: str, says: str):
    path = tmp_path / "mesh.ply"
    path.write_text(HEADER.format(format="ascii", vertices=vertices, faces=faces, count=count) + body)
    with pytest.raises(DataError, match=says) as caught:
        read_ply(path)
    assert str(path) in str(caught.value)


def test_a_binary_list_of_absurd_length_is_refused(tmp_path: Path):
    path = tmp_path / "mesh.ply"
    head = HEADER.format(format="binary_big_endian", vertices=1, faces=1, count="uint").encode()
    path.write_bytes(head + bytes(12) + b"\xff\xff\xff\xfe" + bytes(12))
    with pytest.raises(DataError, match="row 0 of 1 of element face"):
        read_ply(path)
    path.write_bytes(head + bytes(12) + b"\0\0\0\3" + bytes(12) + b"more")
    with pytest.raises(DataError, match="4 bytes after the last row"):
        read_ply(path)


def test_missing_files_and_properties_are_named(tmp_path: Path):
    with pytest.raises(DataError, match="no such file"):
        read_ply(tmp_path / "none.ply")
    path = tmp_path / "mesh.ply"
    write_polygons(path, [[0, 1, 2]], 3, "<")
    with pytest.raises(DataError, match="no face property label"):
        read_ply(path, face_properties=["label"])


@pytest.mark.parametrize("order", FORMATS)
def test_fuzz_only_data_errors(tmp_path: Path, order: str):
    healthy = tmp_path / "healthy"
    healthy.mkdir()
    for name, sizes in (("even.ply", [4] * 12), ("mixed.ply", [3, 4, 4, 3, 5] * 3)):
        rng = np.random.default_rng(1)
        write_polygons(healthy / name, [rng.integers(0, 20, s).tolist() for s in sizes], 20, order)

    def read(folder: Path) -> None:
        for name in ("even.ply", "mixed.ply"):
            read_ply(folder / name, face_properties=["object_id"])

    scratch = tmp_path / "scratch"
    scratch.mkdir()
    assert hold_to_data_error(read, healthy, ["even.ply", "mixed.ply"], scratch, cases=700) > 200
