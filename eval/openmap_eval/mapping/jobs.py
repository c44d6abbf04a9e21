"""One map, made and scored: what it is made of, how, and what became of it. Results are kept, so that a run can be stopped."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

import openmap_agents
import openmap_eval
from openmap_agents.mapping import InstanceMap, MapInstance, MappingSettings, OpenMapper
from openmap_agents.mapping.frame import voxel_centres
from openmap_agents.mapping.settings import Consensus, Semantics
from openmap_eval.ap.protocol import LabelledCloud, Proposal, average_precision
from openmap_eval.ap.transfer import proposals_of_map
from openmap_eval.mapping.inputs import Features, Inputs, MapperFrame, MaskSpec, masks_of, source_digest
from openmap_eval.mapping.noise import Trouble, troubled
from openmap_eval.mapping.walks import Walk, WalkSpec, open_walk
from openmap_scenes import DataError

Method = Literal["fast", "reference", "peer"]
Result = dict[str, Any]
_PIECE = 8  # jobs that a worker takes together
COARSE = MappingSettings(voxel_size=0.1, min_mask_pixels=4, min_mask_voxels=3, min_voxels=3, split_distance=0.2)
"""For pictures of every eighth pixel, which the reference can take."""


@dataclass(frozen=True)
class Job:
    """A map to make.

    Parameters
    ----------
    walk : WalkSpec
    masks : MaskSpec
    features : {"none", "good", "poor", "own"}
    method : {"fast", "reference", "peer"}
        The online mapper; the plain reference and the online mapper on the same input; MaskClustering.
    consensus, semantics
        Of the mapper; the peer knows "structural" and "product".
    box_margin : float
        Of the peer.
    trouble : Trouble
    seed : int
        Of features and trouble.
    """

    walk: WalkSpec
    masks: MaskSpec
    features: Features = "none"
    method: Method = "fast"
    consensus: Consensus = "soft"
    semantics: Semantics = "structural"
    box_margin: float = 0.0
    trouble: Trouble = field(default_factory=Trouble)
    seed: int = 0

    @property
    def settings(self) -> MappingSettings:
        """Of the mapper."""
        base = COARSE if self.walk.step > 1 else MappingSettings()
        return replace(base, consensus=self.consensus, semantics=self.semantics)


def run_job(job: Job) -> Result:
    """Make the map and score it: AP with confidence 1 (``ap``, ``ap50``, ``ap25``) and with the map's own (``ranked``), in 0..1.

    ``seconds`` are of the CPU, for making the map. The reference adds ``same``, whether the online mapper makes the same
    instances of the same voxels, and ``fast_ap``.
    """
    inputs = load_inputs(job.walk, job.masks)
    frames = troubled(inputs.frames(job.features, job.seed), len(inputs), job.trouble, job.seed)
    truth = truth_of(inputs.walk, job.walk)
    if job.method == "peer":
        return _peer(job, inputs.walk, frames, truth)
    if job.method == "reference":
        return _reference(job, inputs.walk, frames, truth)
    found, seconds = fast_map(job, inputs.walk, frames)
    return {**scored(found, truth), "instances": len(found), "seconds": seconds}


@lru_cache(maxsize=1)
def load_inputs(walk: WalkSpec, masks: MaskSpec) -> Inputs:
    """A walk with its masks; the last one is kept in memory."""
    opened = open_walk(walk)
    return Inputs(opened, masks_of(opened, masks))


def truth_of(walk: Walk, spec: WalkSpec) -> LabelledCloud:
    """The truth of the whole walk; of a short piece of it (``first``) that part which its frames show."""
    cloud = walk.make_cloud()
    if not spec.first:
        return cloud
    points, reach = [], 1.5 * COARSE.voxel_size
    for n in range(len(walk)):
        frame = walk.read(n)
        points.append(walk.camera.unproject(frame.depth, frame.T_world_camera)[frame.depth > 0])
    gap, _ = cKDTree(np.concatenate(points)).query(cloud.points, distance_upper_bound=reach)
    near = gap <= reach
    return LabelledCloud(cloud.points[near], cloud.instance[near], cloud.category[near])


def fast_map(job: Job, walk: Walk, frames: Iterable[MapperFrame]) -> tuple[InstanceMap, float]:
    """What the online mapper makes of the frames, and in how many seconds of the CPU."""
    mapper, seconds = OpenMapper(walk.camera, job.settings), 0.0
    for frame in frames:
        start = time.process_time()
        mapper.integrate(*frame)
        seconds += time.process_time() - start
    start = time.process_time()
    found = mapper.finalize()
    return found, seconds + time.process_time() - start


def scored(found: InstanceMap, truth: LabelledCloud) -> Result:
    """AP on things, class-agnostic."""
    plain, ranked = (proposals_of_map(found, truth.points, ranked=r) if len(found) else [] for r in (False, True))
    return {**_ap(plain, truth), "ranked": _ap(ranked, truth)}


def _ap(proposals: list[Proposal], truth: LabelledCloud) -> Result:
    scores = average_precision([(proposals, truth)], class_agnostic=True)
    return {"ap": scores.ap, "ap50": scores.ap50, "ap25": scores.ap25}


def _reference(job: Job, walk: Walk, frames: Iterable[MapperFrame], truth: LabelledCloud) -> Result:
    from openmap_agents.mapping.reference import reference_map
    from openmap_agents.mapping.reference_soft import reference_soft_map

    plain = reference_soft_map if job.consensus == "soft" else reference_map
    frames = list(frames)
    start = time.process_time()
    instances = plain(walk.camera, frames, job.settings)
    seconds = time.process_time() - start
    voxel = job.settings.voxel_size
    built = InstanceMap(
        [
            MapInstance(number, voxel_centres(np.array(sorted(i.voxels), np.int64), voxel), i.feature)
            for number, i in enumerate(sorted(instances, key=lambda i: sorted(i.voxels)), 1)
        ],
        voxel,
    )
    fast, _ = fast_map(job, walk, frames)
    same = _parts(built) == _parts(fast)
    ap = _ap(proposals_of_map(built, truth.points, ranked=False) if len(built) else [], truth)
    return {**ap, "instances": len(built), "seconds": seconds, "same": same, "fast_ap": scored(fast, truth)["ap"]}


def _parts(found: InstanceMap) -> list[bytes]:
    """The instances as sets of voxels, in an order of their own."""
    return sorted(np.ascontiguousarray(i.points[np.lexsort(i.points.T)]).tobytes() for i in found)


def _peer(job: Job, walk: Walk, frames: Iterable[MapperFrame], truth: LabelledCloud) -> Result:
    from openmap_agents.baselines.maskclustering import MaskClusteringSettings, mask_clustering

    semantics: Literal["structural", "product"] = "product" if job.semantics == "product" else "structural"
    settings = MaskClusteringSettings(box_margin=job.box_margin, semantics=semantics)
    start = time.process_time()
    found = mask_clustering(walk.camera, frames, truth.points, settings)
    seconds = time.process_time() - start
    plain = [Proposal(i.points_index, 1.0, 0) for i in found]
    return {**_ap(plain, truth), "instances": len(found), "seconds": seconds}


def code_digest() -> str:
    """Of all that figures depend on: figures of other code are not these."""
    agents, own = Path(openmap_agents.__file__).parent, Path(openmap_eval.__file__).parent
    names = ("walks", "inputs", "noise", "jobs", "sequence")
    files = [own / "mapping" / f"{name}.py" for name in names]
    return source_digest(agents / "mapping", agents / "baselines" / "maskclustering.py", own / "ap", *files)


class Store:
    """Results by job, a line of JSON each; lines of other code, and one that a kill cut short, are passed over.

    Parameters
    ----------
    path : Path or None
        None keeps them in memory alone.
    """

    def __init__(self, path: Path | None) -> None:
        self._path, self._code = path, code_digest()
        self._known: dict[str, Result] = {}
        if path is None or not path.is_file():
            return
        data = path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        for number, line in enumerate(whole.splitlines(), 1):
            try:
                row = json.loads(line)
                if row["code"] == self._code:
                    self._known[row["key"]] = row["result"]
            except (ValueError, KeyError, TypeError):
                raise DataError(path, f"line {number}, no result", "results of this command", "Delete it.") from None
        if len(whole) < len(data):
            path.write_bytes(whole)

    def __contains__(self, job: Job) -> bool:
        return self._key(job) in self._known

    def __getitem__(self, job: Job) -> Result:
        return self._known[self._key(job)]

    def add(self, job: Job, result: Result) -> None:
        """Keep a result, on disk at once."""
        key = self._key(job)
        self._known[key] = result
        if self._path is not None:
            row = {"key": key, "code": self._code, "job": asdict(job), "result": result}
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
                file.flush()
                os.fsync(file.fileno())

    @staticmethod
    def _key(job: Job) -> str:
        return hashlib.sha256(json.dumps(asdict(job), sort_keys=True).encode()).hexdigest()[:16]


def run_jobs(jobs: Iterable[Job], store: Store, workers: int, on_done: Callable[[Job], None]) -> None:
    """Run what the store lacks; jobs with the same walk and masks should follow one another, since they share what is loaded.

    With more than one worker, each takes several such jobs at a time.
    """
    groups: dict[tuple[WalkSpec, MaskSpec], list[Job]] = {}
    for job in dict.fromkeys(jobs):
        if job not in store:
            groups.setdefault((job.walk, job.masks), []).append(job)
    if workers == 1:
        for group in groups.values():
            for job in group:
                store.add(job, run_job(job))
                on_done(job)
        return
    pieces = [group[k : k + _PIECE] for group in groups.values() for k in range(0, len(group), _PIECE)]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_run_group, piece) for piece in pieces]):
            for job, result in future.result():
                store.add(job, result)
                on_done(job)


def _run_group(jobs: list[Job]) -> list[tuple[Job, Result]]:
    return [(job, run_job(job)) for job in jobs]


def mean_of(results: Iterable[Result], *names: str) -> npt.NDArray[np.float64]:
    """Means over scenes of some figures, nan where no scene had anything to find."""
    values = np.array([[r[name] for name in names] for r in results], np.float64).reshape(-1, len(names))
    known = ~np.isnan(values)
    return np.asarray(np.where(known, values, 0).sum(0) / np.where(known.any(0), np.maximum(known.sum(0), 1), np.nan))
