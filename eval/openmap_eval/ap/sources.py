"""What belongs together: the scans of a command's predictions, their truth, and the points that maps need."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping import InstanceMap
from openmap_agents.perception.cloud_files import read_points, scan_name
from openmap_agents.perception.prediction_format import list_scans
from openmap_agents.perception.scannet200 import category_number
from openmap_eval.ap.format import cloud_of_scene, read_proposals, read_truth
from openmap_eval.ap.protocol import LabelledCloud, Proposal
from openmap_eval.ap.transfer import proposals_of_map
from openmap_scenes import DataError, Scene, load_scene
from openmap_scenes.formats.scannet import MESH


@dataclass(frozen=True)
class Sources:
    """What is scored.

    Parameters
    ----------
    predictions : Path
        A map, a folder in the prediction format, or a folder of maps called ``<scan>.npz`` or ``<scan>.<anything>.npz``.
    truth : str
        A file of the truth, a folder of such files, or a scene of the catalogue.
    points : str, optional
        For truth that has none: a file of points, a scene of the catalogue, or a folder that has them by the names of scans.
    class_agnostic : bool
    reach : float, optional
        From a point to its voxel, m; for maps.
    ranked : bool
        With the confidences of maps, or 1 for all.
    """

    predictions: Path
    truth: str
    points: str | None = None
    class_agnostic: bool = False
    reach: float | None = None
    ranked: bool = True

    def scans(self) -> list[str]:
        """Names of the scans, in order.

        Raises
        ------
        DataError
            There is nothing, or predictions and truth are not of the same scans.
        """
        if not self.predictions.exists():
            raise DataError(self.predictions, "nothing there", "a map, or a folder of predictions")
        if not Path(self.truth).is_dir():
            return [scan_name(self.truth) if Path(self.truth).is_file() else _scene(self.truth).name]
        known = set(_files(Path(self.truth)))
        if not known:
            raise DataError(self.truth, "neither .txt nor .npz", "the truth of each scan")
        found = set(_predicted(self.predictions)) if self.predictions.is_dir() else {scan_name(self.predictions)}
        if not found <= known:
            raise DataError(self.predictions, f"the scan {min(found - known)}", f"scans that {self.truth} knows")
        if self.predictions.is_dir() and known - found:
            remedy = (
                "A scan without any instance has an empty <scan>.txt; leave out the truth of what is not to be scored."
            )
            raise DataError(
                self.predictions, f"no predictions for {min(known - found)}", f"all of {self.truth}", remedy
            )
        return sorted(found)

    def read(self, scan: str) -> tuple[list[Proposal], LabelledCloud]:
        """The proposals and the truth of a scan.

        Raises
        ------
        DataError
            A file cannot be used, or something that maps need is missing.
        """
        truth = self._truth(scan)
        path = self.predictions
        if path.is_dir():
            names = _predicted(path)
            alone = names.get(scan) or (next(iter(names.values())) if len(names) == 1 else None)
            if alone is None:
                raise DataError(path, f"{len(names)} scans, none called {scan}", f"{scan}.txt or {scan}.npz")
            path = alone
        if path.suffix == ".txt":
            return read_proposals(path.parent, path.stem, len(truth), class_agnostic=self.class_agnostic), truth
        return self._of_map(path, truth), truth

    def _of_map(self, path: Path, truth: LabelledCloud) -> list[Proposal]:
        instance_map = InstanceMap.load(path)
        if np.isnan(truth.points).any():
            raise DataError(
                self.truth, "no points", "the place of each, to find what the map says of it", "Give --points."
            )
        if len(instance_map) and not self.class_agnostic and not any(category_number(i.label) for i in instance_map):
            remedy = "Score it with --class-agnostic, or label it first."
            raise DataError(path, "no label that ScanNet200 has", "the names of its instances", remedy)
        try:
            return proposals_of_map(instance_map, truth.points, self.reach, ranked=self.ranked)
        except ValueError as error:
            raise DataError(path, str(error), "a map with a voxel size", "Give --reach.") from None

    def _truth(self, scan: str) -> LabelledCloud:
        path = Path(self.truth)
        if path.is_dir():
            path = _files(path)[scan]
        if path.is_file():
            return read_truth(path, self._points(scan) if self.points and path.suffix != ".npz" else None)
        return cloud_of_scene(_scene(self.truth))

    def _points(self, scan: str) -> npt.NDArray[np.float32]:
        path = Path(str(self.points))
        if path.is_file():
            return read_points(path)
        if not path.is_dir():
            return _scene(str(self.points)).vertices
        names = [f"{scan}.npz", f"{scan}.ply", f"{scan}{MESH}", f"{scan}/{scan}{MESH}"]
        for name in names:
            if (path / name).is_file():
                return read_points(path / name)
        raise DataError(path, f"no points of {scan}", f"one of {', '.join(names)}")


def _files(folder: Path) -> dict[str, Path]:
    """Files of truth by scan; where there are both, .npz, which has points."""
    files = sorted(p for ending in (".txt", ".npz") for p in folder.glob(f"*{ending}") if not p.name.startswith("."))
    return {scan_name(p): p for p in sorted(files, key=lambda p: p.suffix == ".npz")}


def _predicted(folder: Path) -> dict[str, Path]:
    """Predictions by scan: maps, or ``<scan>.txt`` of the prediction format."""
    maps = {scan_name(p): p for p in sorted(folder.glob("*.npz")) if not p.name.startswith(".")}
    return maps or {scan: folder / f"{scan}.txt" for scan in list_scans(folder)}


def _scene(spec: str) -> Scene:
    """A scene of the catalogue; a name without a kind is taken for a file that is not there."""
    if ":" not in spec:
        raise DataError(spec, "no such file or folder", "one, or a scene of the catalogue such as homes:val/0")
    return load_scene(spec)
