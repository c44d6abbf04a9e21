"""The map that everybody reads: instances with points, a feature and a place, in the frame the poses were given in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_agents.mapping.identity import History


def _no_views() -> npt.NDArray[np.int32]:
    return np.empty((0, 3), np.int32)


def _no_history() -> npt.NDArray[np.int32]:
    return np.empty((0, 4), np.int32)


@dataclass(frozen=True, eq=False)
class MapInstance:
    """One instance of the map.

    Parameters
    ----------
    id : int
        > 0, stable over the life of a map.
    points : (N, 3) float32 m
        Centres of its voxels.
    feature : (D,) float32 or None
        Unit vector in the encoder's space.
    n_observations : int
        In how many frames it was seen as a mask.
    confidence : float
        0..1, the share of the frames that see it in which it was seen as a mask of its own.
    views : (K, 3) int32
        Its masks, the one of most pixels first: which call of ``integrate`` (from 0), label in that picture, pixels.
    is_structure : bool
        Floor, ceiling or wall by its shape.
    colour : (3,) uint8 or None
        Mean RGB.
    label : str
        What the agent calls it; "" = nothing yet.
    """

    id: int
    points: npt.NDArray[np.float32]
    feature: npt.NDArray[np.float32] | None
    n_observations: int = 1
    confidence: float = 1.0
    views: npt.NDArray[np.int32] = field(default_factory=_no_views)
    is_structure: bool = False
    colour: npt.NDArray[np.uint8] | None = None
    label: str = ""

    @cached_property
    def aabb_min(self) -> npt.NDArray[np.float32]:
        """Lowest corner (3,) m of the axis-aligned box of the points."""
        return np.asarray(self.points.min(0), np.float32)

    @cached_property
    def aabb_max(self) -> npt.NDArray[np.float32]:
        """Highest corner (3,) m of the axis-aligned box of the points."""
        return np.asarray(self.points.max(0), np.float32)

    @property
    def box(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Axis-aligned box (min, max), (3,) m each."""
        return self.aabb_min, self.aabb_max

    @property
    def centre(self) -> npt.NDArray[np.float32]:
        """Centre (3,) m of the axis-aligned box."""
        return (self.aabb_min + self.aabb_max) / np.float32(2)

    def best_views(self, k: int = 5) -> npt.NDArray[np.int32]:
        """The rows (up to k, 3) of ``views`` with most pixels, the best first, at most one a picture."""
        _, first = np.unique(self.views[:, 0], return_index=True)
        return self.views[np.sort(first)[:k]]


@dataclass(frozen=True)
class TopDown:
    """The map seen from above.

    Parameters
    ----------
    ids : (h, w) int32
        Instance whose point is highest in the cell, 0 = none. Rows go along +Z, columns along +X.
    origin : (2,) float64 m
        World X and Z of the outer corner of cell [0, 0].
    resolution : float
        Edge of a cell, m.
    """

    ids: npt.NDArray[np.int32]
    origin: npt.NDArray[np.float64]
    resolution: float


@dataclass(frozen=True, eq=False)
class InstanceMap:
    """All instances of a place.

    Parameters
    ----------
    instances : list of MapInstance
        M of them, ascending by id.
    voxel_size : float
        Edge of the voxels that their points are the centres of, m; 0 = not known.
    segmenter, encoder : str
        Specs of what made the masks and the features; "" = not known.
    history : (L, 4) int32
        What became of every id that was ever given (``identity.py``); empty = nothing was noted.
    """

    instances: list[MapInstance] = field(default_factory=list)
    voxel_size: float = 0.0
    segmenter: str = ""
    encoder: str = ""
    history: npt.NDArray[np.int32] = field(default_factory=_no_history)

    def __len__(self) -> int:
        return len(self.instances)

    def __iter__(self) -> Iterator[MapInstance]:
        return iter(self.instances)

    @cached_property
    def _index(self) -> dict[int, int]:
        return {instance.id: n for n, instance in enumerate(self.instances)}

    @cached_property
    def centres(self) -> npt.NDArray[np.float32]:
        """Centres (M, 3) m, in the order of ``instances``."""
        return np.array([i.centre for i in self.instances], np.float32).reshape(-1, 3)

    @cached_property
    def _history(self) -> History:
        return History(self.history)

    @property
    def feature_lengths(self) -> set[int]:
        """Lengths of the features that there are."""
        return {len(i.feature) for i in self.instances if i.feature is not None}

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.centres)

    def get(self, instance_id: int) -> MapInstance:
        """The instance of that id; KeyError where there is none."""
        if instance_id not in self._index:
            raise KeyError(f"the map has no instance {instance_id}")
        return self.instances[self._index[instance_id]]

    def resolve(self, instance_id: int) -> int | None:
        """The id that an instance of this or an earlier state of the map goes by in this one; None if it is in it no more.

        Raises
        ------
        KeyError
            As far as the history says, the id was never given.
        """
        if len(self.history) == 0:
            return self.get(instance_id).id
        now = self._history.resolve(instance_id)
        return now if now in self._index else None

    def holders(self, instance_id: int) -> list[int]:
        """Ids, ascending, of all instances that hold something of what once had this id: ``resolve``, and parts of it that have
        become instances of their own; KeyError as there."""
        if len(self.history) == 0:
            return [self.get(instance_id).id]
        return [own for own in self._history.holders(instance_id) if own in self._index]

    def neighbours(self, instance_id: int, radius: float = 2.0, k: int = 5) -> list[MapInstance]:
        """The k nearest other instances whose centres lie within ``radius`` m of this one's, nearest first."""
        own = self._index[self.get(instance_id).id]
        near = np.array(sorted(self._tree.query_ball_point(self.centres[own], radius)), np.int64)
        near = near[near != own]
        distance = np.linalg.norm(self.centres[near] - self.centres[own], axis=1)
        return [self.instances[n] for n in near[np.argsort(distance, kind="stable")][:k]]

    @cached_property
    def _points_tree(self) -> cKDTree:
        return cKDTree(np.concatenate([np.empty((0, 3), np.float32), *(i.points for i in self.instances)]))

    @cached_property
    def _owner(self) -> npt.NDArray[np.int64]:
        """Which instance each point is of, by its place in the list."""
        return np.repeat(np.arange(len(self.instances)), [len(i.points) for i in self.instances])

    def ids_at(self, places: npt.ArrayLike, within: float = np.inf) -> npt.NDArray[np.int32]:
        """Ids (n,) of the instances that the points nearest to the places (n, 3) m are of; 0 where none is within ``within`` m."""
        places = np.asarray(places, np.float64).reshape(-1, 3)
        if not self.instances or len(places) == 0:
            return np.zeros(len(places), np.int32)
        distance, point = self._points_tree.query(places)
        ids = np.array([i.id for i in self.instances], np.int32)[self._owner[point]]
        return np.where(distance <= within, ids, 0).astype(np.int32)

    def nearest(self, place: npt.ArrayLike, within: float = np.inf) -> MapInstance | None:
        """The instance of the point nearest to a place (3,) m; None if there is none within ``within`` m."""
        instance_id = int(self.ids_at(place, within)[0])
        return self.get(instance_id) if instance_id else None

    def similarities(self, feature: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Cosines (M,) of the instances' features with another (D,) of any length above 0; NaN for those that have none.

        Raises
        ------
        ValueError
            The feature is zero or has another number of dimensions.
        """
        asked = np.asarray(feature, np.float32).ravel()
        norm = float(np.linalg.norm(asked))
        if not np.isfinite(norm) or norm == 0 or self.feature_lengths - {len(asked)}:
            found = f"{len(asked)} dimensions and length {norm:g}"
            expected = " or ".join(map(str, sorted(self.feature_lengths))) or "any number of"
            raise ValueError(f"a feature of {found}, expected {expected} dimensions and a length above 0")
        cosines = np.full(len(self.instances), np.nan, np.float32)
        for n, instance in enumerate(self.instances):
            if instance.feature is not None:
                cosines[n] = instance.feature @ asked / norm
        return cosines

    def with_labels(self, labels: Mapping[int, str]) -> InstanceMap:
        """A copy in which instances are called as ``labels`` says, by id; others keep their label."""
        return replace(self, instances=[replace(i, label=labels.get(i.id, i.label)) for i in self.instances])

    def top_down(self, resolution: float = 0.05, below: float | None = None, structure: bool = True) -> TopDown:
        """Rasterise from above.

        Parameters
        ----------
        resolution : float
            Edge of a cell, m.
        below : float, optional
            Only points under this height, m, so that a ceiling hides nothing.
        structure : bool
            Whether to draw instances that ``is_structure``.
        """
        chosen = [i for i in self.instances if structure or not i.is_structure]
        points = np.concatenate([i.points for i in chosen]) if chosen else np.empty((0, 3), np.float32)
        ids = np.repeat(np.array([i.id for i in chosen], np.int32), [len(i.points) for i in chosen])
        if below is not None:
            points, ids = points[points[:, 1] < below], ids[points[:, 1] < below]
        if len(points) == 0:
            return TopDown(np.zeros((0, 0), np.int32), np.zeros(2), resolution)
        origin = points[:, [0, 2]].min(0).astype(np.float64) - resolution / 2
        column, row = ((points[:, [0, 2]] - origin) // resolution).astype(np.int64).T
        raster = np.zeros((row.max() + 1, column.max() + 1), np.int32)
        order = np.argsort(points[:, 1], kind="stable")
        raster[row[order], column[order]] = ids[order]
        return TopDown(raster, origin, resolution)

    def save(self, path: str | Path) -> None:
        """Write the map to one file (``map_file.py``)."""
        from openmap_agents.mapping.map_file import save_map

        save_map(self, path)

    @staticmethod
    def load(path: str | Path) -> InstanceMap:
        """Read a file that ``save`` wrote; DataError if it cannot be used."""
        from openmap_agents.mapping.map_file import load_map

        return load_map(path)
