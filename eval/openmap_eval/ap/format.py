"""Files of the truth, and proposals from and to the benchmark's prediction format (``perception.prediction_format``).

- ``<scan>.txt`` of the benchmark: one whole number a point, label number * 1000 + a number that tells instances of that label
  apart; below 1000 = nobody annotated it. It has no points, which only maps need; they come from elsewhere.
- ``<scan>.npz`` of our own: ``points`` (N, 3) m in the world frame, ``instance`` (N,), ``category`` (N,), as in ``LabelledCloud``.
- A scene whose instances are known.

In the first and the last, walls, floors and what has no class in ScanNet200 are void, as in the benchmark's instance task.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.cloud_files import as_points, read_arrays
from openmap_agents.perception.prediction_format import PredictedInstance, read_predictions, write_predictions
from openmap_agents.perception.scannet200 import INSTANCE_CLASSES, NUMBER_OF, category_number
from openmap_eval.ap.protocol import LabelledCloud, Proposal
from openmap_scenes import DataError, Scene

PER_LABEL = 1000
"""How many instances of a label the benchmark's numbers can tell apart."""
SPACING = 0.03
"""Between points that are drawn on a scene, m."""
_DENSE = 0.1  # m, longest edge of the triangles that make up at least half of a mesh whose vertices do for points
_MOST_LINES = 1 << 27


def read_truth(path: str | Path, points: npt.NDArray[np.float32] | None = None) -> LabelledCloud:
    """The truth from a file of the benchmark, or of our own (.npz).

    Parameters
    ----------
    points : (N, 3) float32 m, optional
        For a file that has none; not-a-numbers stand in for them.

    Raises
    ------
    DataError
        The file cannot be read, or is not of these points.
    """
    path = Path(path)
    if path.suffix == ".npz":
        return read_cloud(path)
    values = _read_numbers(path)
    if points is None:
        points = np.full((len(values), 3), np.nan, np.float32)
    if len(points) != len(values):
        raise DataError(path, f"{len(values)} lines", f"{len(points)}, one for each point of the scan")
    # The whole number is the instance, so that two labels may use the same number for theirs.
    category = np.where(np.isin(values // PER_LABEL, INSTANCE_CLASSES), values // PER_LABEL, 0)
    return LabelledCloud(points, values.astype(np.int32), category.astype(np.int32))


def write_truth(path: str | Path, truth: LabelledCloud) -> None:
    """Write a cloud as a file of the benchmark; instances of a category are numbered anew from 1, by ascending id.

    Raises
    ------
    ValueError
        A category has more instances than the format can tell apart.
    """
    values = np.zeros(len(truth), np.int64)
    for category in np.unique(truth.category[truth.category > 0]):
        mine = (truth.category == category) & (truth.instance > 0)
        ids, number = np.unique(truth.instance[mine], return_inverse=True)
        if len(ids) >= PER_LABEL:
            raise ValueError(f"category {category} has {len(ids)} instances, expected fewer than {PER_LABEL}")
        values[mine] = int(category) * PER_LABEL + 1 + number
    _write(Path(path), "".join(f"{v}\n" for v in values.tolist()).encode())


def read_cloud(path: str | Path) -> LabelledCloud:
    """A labelled cloud from an .npz; DataError if it cannot be one."""
    path = Path(path)
    arrays = read_arrays(path, ("points", "instance", "category"))
    points = as_points(arrays["points"], path)
    for name in ("instance", "category"):
        values = arrays[name]
        if values.shape != (len(points),) or values.dtype.kind not in "iu":
            raise DataError(path, f"{name} {values.dtype} {values.shape}", f"whole numbers ({len(points)},), as points")
        if values.min() < 0 or values.max() >= 2**31:
            raise DataError(path, f"{name} of {values.min()} to {values.max()}", "numbers from 0 to 2147483647")
    return LabelledCloud(points, arrays["instance"].astype(np.int32), arrays["category"].astype(np.int32))


def write_cloud(path: str | Path, truth: LabelledCloud) -> None:
    """Write a labelled cloud as an .npz, under a temporary name first."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.tmp")
    with unfinished.open("wb") as file:
        np.savez_compressed(
            file,
            allow_pickle=False,
            points=truth.points.astype(np.float32),
            instance=truth.instance,
            category=truth.category,
        )
    os.replace(unfinished, path)


def cloud_of_scene(scene: Scene, seed: int = 0) -> LabelledCloud:
    """The truth of a scene: its vertices where they lie densely, as in scans, else points drawn on its faces.

    A vertex is of the instance that most of its faces are of. Drawn points lie on all faces, seen or not, one for each square of
    ``SPACING`` on average.
    """
    if _is_dense(scene):
        points, instance = scene.vertices, _vertex_instance(scene)
    else:
        points, instance = _drawn(scene, np.random.default_rng(seed))
    number = np.zeros(1 + max((i.id for i in scene.instances), default=0), np.int32)
    for item in scene.instances:
        number[item.id] = NUMBER_OF[item.scannet200] if item.scannet200 else category_number(item.category)
    category = number[instance]
    return LabelledCloud(points, instance, np.where(np.isin(category, INSTANCE_CLASSES), category, 0).astype(np.int32))


def read_proposals(folder: str | Path, scan: str, n_points: int, *, class_agnostic: bool) -> list[Proposal]:
    """A scan's proposals in the prediction format; DataError as ``read_predictions``, labels too unless class-agnostic."""
    found = read_predictions(folder, scan, n_points, any_label=class_agnostic)
    return [Proposal(p.indices, p.confidence, p.category) for p in found]


def write_proposals(folder: str | Path, scan: str, proposals: Sequence[Proposal], n_points: int) -> Path:
    """Write a scan's proposals in the prediction format; returns the path of ``<scan>.txt``."""
    found = [PredictedInstance(p.indices, p.confidence, p.category) for p in proposals]
    return write_predictions(folder, scan, found, n_points)


def _is_dense(scene: Scene) -> bool:
    corners = scene.vertices[scene.faces].astype(np.float64)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
    area = _areas(corners)
    return bool(area[longest <= _DENSE].sum() * 2 >= area.sum())


def _areas(corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Areas (F,) m2 of triangles (F, 3, 3)."""
    sides = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2)


def _vertex_instance(scene: Scene) -> npt.NDArray[np.int32]:
    """Instance (V,) that most faces of a vertex have; of equally many the lowest, but any rather than none."""
    ids, rank = np.unique(np.append(scene.face_instance, 0), return_inverse=True)
    pairs = scene.faces.astype(np.int64) * len(ids) + rank[:-1, None]
    keys, count = np.unique(pairs, return_counts=True)
    vertex, number = np.divmod(keys, len(ids))
    order = np.lexsort((number, number == 0, -count, vertex))
    first = order[np.append(True, np.diff(vertex[order]) != 0)]
    instance = np.zeros(len(scene.vertices), np.int32)
    instance[vertex[first]] = ids[number[first]]
    return instance


def _drawn(scene: Scene, rng: np.random.Generator) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    corners = scene.vertices[scene.faces].astype(np.float64)
    wanted = _areas(corners) / SPACING**2
    n = np.floor(wanted + rng.random(len(wanted))).astype(np.int64)
    face = np.repeat(np.arange(len(n)), n)
    a, b = rng.random((2, len(face), 1))
    # Beyond the diagonal of the parallelogram is the other triangle.
    over = a + b > 1
    a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)
    origin = corners[face, 0]
    points = origin + a * (corners[face, 1] - origin) + b * (corners[face, 2] - origin)
    return points.astype(np.float32), scene.face_instance[face].astype(np.int32)


def _read_numbers(path: Path) -> npt.NDArray[np.int64]:
    expected = "one whole number a line, label * 1000 + instance"
    try:
        data = path.read_bytes()
    except OSError as error:
        found = "no such file" if isinstance(error, FileNotFoundError) else f"an unreadable file ({error.strerror})"
        raise DataError(path, found, expected) from None
    lines = data.split()
    if not lines or len(lines) > _MOST_LINES:
        raise DataError(path, f"{len(lines)} numbers", expected)
    if any(not line.isdigit() or len(line) > 10 for line in lines):
        bad = next(n for n, line in enumerate(lines) if not line.isdigit() or len(line) > 10)
        raise DataError(path, f"{lines[bad][:40].decode('ascii', 'replace')!r} as number {bad + 1}", expected)
    values = np.array(lines, "S10").astype(np.int64)
    if values.max() >= 2**31:
        raise DataError(path, f"the number {values.max()}", "numbers below 2147483648")
    return values


def _write(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.tmp")
    unfinished.write_bytes(data)
    os.replace(unfinished, path)
