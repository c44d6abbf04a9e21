"""The online map: frames go in one by one, the map can be asked at any time, and at the end it is what ``reference.py`` gives.

A frame visits the voxels that it sees. Each of them lists its earlier sightings, so one pass gives, for every mask met there,
how much of it the frame sees and under which of the frame's masks, and the same for the frame's own masks and earlier frames. Those
counts are final: neither masks nor frames change later. What is kept of them is sparse (observer, container). Merging then works on
these rows; pieces of instances are kept for as long as the members of a node stay the same.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.consensus import Nodes, initial_nodes
from openmap_agents.mapping.consensus import cluster as cluster_by_rounds
from openmap_agents.mapping.frame import FrameVoxels, check_frame, frame_voxels
from openmap_agents.mapping.geometry import mark_structure
from openmap_agents.mapping.identity import Identities
from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_agents.mapping.instances import Piece, drop_overlapping, elected_pieces, pieces_of
from openmap_agents.mapping.segments import Columns, Segments
from openmap_agents.mapping.semantics import COSINE_STEPS, CosineStatistics, semantic_weight, soft_weight
from openmap_agents.mapping.settings import MappingSettings
from openmap_agents.mapping.soft_clusters import SoftClusters
from openmap_agents.mapping.voxel_store import VoxelStore
from openmap_scenes import PinholeCamera

IntArray = npt.NDArray[np.int32]
_DEFAULT = MappingSettings()


class OpenMapper:
    """Builds the instance map of a posed RGB-D stream with masks.

    Parameters
    ----------
    camera : PinholeCamera
        Of all frames.
    settings : MappingSettings
    """

    def __init__(self, camera: PinholeCamera, settings: MappingSettings = _DEFAULT) -> None:
        self.camera, self.settings = camera, settings
        self._store, self._segments = VoxelStore(), Segments()
        # Who observes a mask: (mask, frame, container or -1), by frame. Who holds how much of it: (mask, segment, voxels).
        self._observations, self._overlaps = Columns(), Columns()
        self._same, self._different = CosineStatistics(), CosineStatistics()
        self._calls = 0
        self._map: InstanceMap | None = None
        self._pieces: dict[bytes, list[Piece]] = {}
        self._identities, self._clusters = Identities(), SoftClusters()
        self._is_final = False

    @property
    def n_frames(self) -> int:
        """Frames that were used."""
        return self._segments.n_frames

    @property
    def n_voxels(self) -> int:
        """Voxels met so far."""
        return self._store.n_voxels

    def integrate(
        self,
        depth: npt.ArrayLike,
        masks: npt.ArrayLike,
        features: npt.ArrayLike | None,
        T_world_camera: npt.ArrayLike,
        rgb: npt.ArrayLike | None = None,
    ) -> bool:
        """Take in a frame.

        Parameters
        ----------
        depth : (H, W) float32 m, planar, 0 = nothing seen
        masks : (H, W) int32, 0 = no mask, 1..n
        features : (n, D) float32 or None
            Of masks 1..n, any length; None = no features in this frame.
        T_world_camera : (4, 4)
            In any frame with Y up that stays the same for all frames.
        rgb : (H, W, 3) uint8, optional
            Gives instances a mean colour.

        Returns
        -------
        bool
            Whether it was used; False if it brought nothing new (``min_novelty``) or saw nothing.

        Raises
        ------
        ValueError
            An argument cannot be used. The map is as it was.
        """
        depth_, masks_, features_, T = check_frame(self.camera, depth, masks, features, T_world_camera, rgb)
        dim = self._segments.dim
        if features_ is not None and dim is not None and features_.shape[1] != dim:
            raise ValueError(f"features have {features_.shape[1]} dimensions, expected {dim} as in earlier frames")
        call, self._calls = self._calls, self._calls + 1
        voxels = frame_voxels(depth_, masks_, self.camera, T, self.settings)
        numbers = self._store.find(voxels.keys)
        novel = int((self._store.views(numbers) < self.settings.max_views).sum())
        if len(numbers) == 0 or novel < self.settings.min_novelty * len(numbers):
            return False
        met = self._store.overlaps(numbers, voxels.mask, len(voxels.labels))
        base, frame = self._segments.n, self._segments.n_frames
        numbers = self._store.add(voxels.keys, numbers, voxels.mask, base, base + 1 + len(voxels.labels))
        colour = None if rgb is None else _mean_colours(np.asarray(rgb), masks_)
        self._segments.add_frame(voxels, numbers, features_, colour, call)
        self._observe(voxels, *met, base, frame)
        self._map = None
        return True

    def _observe(self, voxels: FrameVoxels, met: IntArray, common: IntArray, base: int, frame: int) -> None:
        """Note who observes and contains whom, from the voxels (R, n + 1) that old segments share with the frame's masks."""
        n, tau_obs, tau_sub = len(voxels.labels), self.settings.tau_obs, self.settings.tau_sub
        own = base + 1 + np.arange(n, dtype=np.int32)

        # The new frame as an observer of old masks.
        sizes = self._segments.size[met]
        visible = common.sum(axis=1)
        seen = (sizes > 0) & (visible > tau_obs * sizes)
        old, visible, of_old = met[seen], visible[seen], common[seen, 1:]
        best = of_old.argmax(axis=1) if n else np.zeros(len(old), np.int64)
        held = of_old.max(axis=1, initial=0) >= tau_sub * visible
        holder = np.where(held, base + 1 + best, -1).astype(np.int32)
        self._note(old, np.full(len(old), frame, np.int32), holder)
        rows, columns = np.nonzero(of_old)
        self._note_overlaps(old[rows], (base + 1 + columns).astype(np.int32), of_old[rows, columns])

        # Old frames as observers of the new masks: rows of one frame lie together.
        frames, first = np.unique(self._segments.frame[met], return_index=True)
        counts = common[:, 1:].astype(np.int64)
        total = np.add.reduceat(counts, first, axis=0) if len(first) else np.zeros((0, n), np.int64)
        counts[sizes == 0] = -1  # what lies under no mask is visible, but held by none
        row_frame = np.repeat(np.arange(len(frames)), np.diff(np.append(first, len(met))))
        most = np.maximum.reduceat(counts, first, axis=0) if len(first) else total
        holder_of = np.full((len(frames), n), -1, np.int32)
        rows, columns = np.nonzero((counts == most[row_frame]) & (counts >= tau_sub * total[row_frame]) & (counts > 0))
        holder_of[row_frame[rows], columns] = met[rows]
        k, t = np.nonzero((total > tau_obs * voxels.sizes).T)
        self._note(own[k], frames[t].astype(np.int32), holder_of[t, k])
        self._note(own, np.full(n, frame, np.int32), own)
        observing = (total > tau_obs * voxels.sizes)[row_frame] & (counts > 0)
        columns, rows = np.nonzero(observing.T)
        self._note_overlaps(own[columns], met[rows], counts[rows, columns])
        self._note_overlaps(own, own, voxels.sizes)

        self._learn(own, old[held], holder[held], own[k], holder_of[t, k])

    def _note(self, mask: IntArray, frame: IntArray, container: IntArray) -> None:
        if self.settings.consensus == "paper":
            self._observations.add(mask, frame, container)

    def _note_overlaps(self, mask: IntArray, segment: IntArray, voxels: npt.NDArray[np.integer]) -> None:
        if self.settings.consensus == "soft":
            self._overlaps.add(mask, segment, voxels.astype(np.int32))

    def _learn(self, own: IntArray, old: IntArray, holder: IntArray, new: IntArray, new_holder: IntArray) -> None:
        """Cosines of the frame's masks among each other (different) and with masks that hold them and that they hold (same)."""
        if self._segments.dim is None or self.settings.semantics != "calibrated":
            return
        features = self._segments.features
        known = np.asarray(features.any(axis=1))
        fresh = own[known[own]]
        cosines = features[fresh].astype(np.float64) @ features[fresh].T.astype(np.float64)
        self._different.add(_rounded(cosines[np.triu_indices(len(fresh), 1)]))
        span = np.int64(self._segments.n)
        pairs = np.intersect1d(holder * span + old, new * span + new_holder)
        a, b = pairs // span, pairs % span
        use = known[a] & known[b]
        same = np.einsum("nd,nd->n", features[a[use]].astype(np.float64), features[b[use]].astype(np.float64))
        self._same.add(_rounded(same))

    @property
    def instance_map(self) -> InstanceMap:
        """The map of all frames so far; computed when asked for, and kept until the next frame that is used.

        With the soft consensus, what no frame has touched since the map was last asked for stays as it was (``soft_clusters.py``).
        """
        if self._map is None:
            self._map, self._is_final = self._build(afresh=False), self.settings.consensus == "paper"
        return self._map

    def finalize(self) -> InstanceMap:
        """The map of all frames, exactly what the reference gives, asked on the way or not. More frames may follow."""
        if self._map is None or not self._is_final:
            self._map, self._is_final = self._build(afresh=True), True
        return self._map

    def _build(self, afresh: bool) -> InstanceMap:
        segments, settings = self._segments, self.settings
        if segments.n == 0:
            return InstanceMap(voxel_size=settings.voxel_size)
        pieces, observers = self._soft_pieces(afresh) if settings.consensus == "soft" else self._paper_pieces()
        kept = drop_overlapping(pieces, self._store.n_voxels, settings)
        ids = self._identities.assign([pieces[i].members for i in kept], segments.size, self._calls)
        instances = [self._instance(pieces[i], observers[i], new_id) for i, new_id in zip(kept, ids, strict=True)]
        return InstanceMap(
            mark_structure(sorted(instances, key=lambda i: i.id)),
            voxel_size=settings.voxel_size,
            history=self._identities.history,
        )

    def _soft_pieces(self, afresh: bool) -> tuple[list[Piece], list[int]]:
        """Pieces of all clusters, and how many frames observe the cluster of each."""
        weight = soft_weight(self.settings, self._same, self._different)
        clusters, observing = self._clusters.update(self._segments, self._overlaps, weight, self.settings, afresh)
        pieces, origin = elected_pieces(clusters, self._segments, self._store, self.settings)
        return pieces, [int(observing[c]) for c in origin]

    def _paper_pieces(self) -> tuple[list[Piece], list[int]]:
        segments, settings = self._segments, self.settings
        weight = semantic_weight(settings, self._same, self._different)
        nodes = initial_nodes(*self._observations.columns, segments.size, segments.n_frames, settings)
        nodes = cluster_by_rounds(
            nodes, segments.frame, segments.size, segments.n_frames, segments.features, weight, settings
        )
        return self._split(nodes)

    def _split(self, nodes: Nodes) -> tuple[list[Piece], list[int]]:
        """Pieces of all nodes, and how many frames observe the node of each."""
        pieces: list[Piece] = []
        observers: list[int] = []
        cache: dict[bytes, list[Piece]] = {}
        for i in range(len(nodes)):
            members = nodes.members.row(i)
            key = members.tobytes()
            found = self._pieces.get(key)
            cache[key] = pieces_of(members, self._segments, self._store, self.settings) if found is None else found
            pieces += cache[key]
            observers += [len(nodes.observers.row(i))] * len(cache[key])
        self._pieces = cache
        return pieces, observers

    def _instance(self, piece: Piece, n_observers: int, instance_id: int) -> MapInstance:
        segments, members = self._segments, piece.members
        frames = np.unique(segments.frame[members])
        order = members[np.lexsort((members, -segments.pixels[members].astype(np.int64)))]
        views = np.array(
            [(segments.call(int(segments.frame[m])), segments.label[m], segments.pixels[m]) for m in order]
        )
        colours = segments.colour[members]
        weights = np.where(np.isnan(colours[:, 0]), 0, segments.pixels[members])
        colour = None
        if weights.any():
            colour = np.rint(np.average(np.nan_to_num(colours), axis=0, weights=weights)).astype(np.uint8)
        return MapInstance(
            id=instance_id,
            points=piece.points,
            feature=piece.feature,
            n_observations=len(frames),
            confidence=min(1.0, len(frames) / max(n_observers, 1)),
            views=views.astype(np.int32),
            colour=colour,
        )


def _rounded(cosines: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    return np.asarray(np.rint(cosines * COSINE_STEPS) / COSINE_STEPS)


def _mean_colours(rgb: npt.NDArray[np.generic], masks: npt.NDArray[np.int32]) -> npt.NDArray[np.float32]:
    """Mean RGB (n + 1, 3) of every label 0..n; NaN for labels without a pixel."""
    flat = masks.ravel()
    count = np.bincount(flat)
    sums = [np.bincount(flat, weights=rgb[..., c].ravel(), minlength=len(count)) for c in range(3)]
    with np.errstate(invalid="ignore"):
        return np.asarray(np.stack(sums, axis=1) / count[:, None], np.float32)
