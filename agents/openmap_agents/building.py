"""A recording and something that sees -> a map that can be asked. No environment, no agent that walks."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_agents.colour_votes import ColourVotes
from openmap_agents.kept_frames import KeptFrames
from openmap_agents.mapping import InstanceMap, MappingSettings, OpenMapper
from openmap_agents.naming import Naming
from openmap_agents.perception import Encoder, Masks, Segmenter
from openmap_agents.perception.stored_frames import unit_rows
from openmap_scenes import DataError, PinholeCamera
from openmap_scenes.recordings import Frame, Recording

_DEFAULT = MappingSettings()
_LOOKS = 10
"""How often the instances are counted on the way."""


@dataclass(frozen=True, eq=False)
class FrameReport:
    """What became of one frame.

    Parameters
    ----------
    done, total : int
        How many frames are behind us, this one included, and how many there are.
    index : int
        Its number in the source.
    has_depth : bool
        Whether it has a depth reading; without any it is left out.
    kept : bool
        Whether its masks and features were on disk from an earlier run.
    seconds_seeing, seconds_mapping : float
        What perception (or reading what is kept) and the mapper took.
    instances : int or None
        In the map as of the last count, some ten times on the way; None before the first.
    T_world_camera : (4, 4) float64
    """

    done: int
    total: int
    index: int
    has_depth: bool
    kept: bool
    seconds_seeing: float
    seconds_mapping: float
    instances: int | None
    T_world_camera: npt.NDArray[np.float64]


def build_map(
    recording: Recording,
    segmenter: Segmenter,
    encoder: Encoder,
    settings: MappingSettings = _DEFAULT,
    *,
    made_by: tuple[str, str] = ("", ""),
    keep: KeptFrames | str | Path | None = None,
    on_frame: Callable[[FrameReport], None] | None = None,
) -> InstanceMap:
    """The map of a recording, with elected colours and a label for every instance.

    Frames are read one at a time; only the map grows.

    Parameters
    ----------
    recording : Recording
        ``open_recording`` gives one, ``subsampled`` a part of one.
    segmenter, encoder : Segmenter, Encoder
        What they say of a frame must follow from that frame alone, if ``keep`` is given: kept frames are not shown to them again.
    settings : MappingSettings
    made_by : (str, str)
        Specs of the segmenter and of the encoder, which are kept with the map: ``openmap query`` finds its encoder by them.
    keep : KeptFrames or path, optional
        Where masks and features are kept. A call that was killed is given again and goes on from what is there, and the map is
        the same to the bit. The folder stays: ``KeptFrames.remove`` it when the map is saved.
    on_frame : function of a FrameReport, optional
        Called after every frame.

    Raises
    ------
    DataError
        The recording is broken, or no frame can be used, or ``keep`` holds what another run kept.
    """
    if not len(recording):
        lost = f", {len(recording.skipped)} without a pose" if recording.skipped else ""
        raise DataError(recording.name, f"no frame to use{lost}", "at least one")
    with ExitStack() as stack:
        if isinstance(keep, str | Path):
            keep = stack.enter_context(KeptFrames(keep))
        if keep is not None:
            keep.begin(_identity(recording, settings, made_by))
        return _build(recording, _Seeing(segmenter, encoder, recording.camera, keep), settings, made_by, on_frame)


class _Seeing:
    """Masks and unit features of frames: from disk where they are kept, else from perception, and then kept."""

    def __init__(self, segmenter: Segmenter, encoder: Encoder, camera: PinholeCamera, keep: KeptFrames | None) -> None:
        self.segmenter, self.encoder, self.camera, self.keep = segmenter, encoder, camera, keep

    def __call__(self, n: int, frame: Frame) -> tuple[Masks, npt.NDArray[np.float32], bool]:
        """Masks, features (n, D) of the n-th frame, and whether they were kept."""
        kept = None if self.keep is None else self.keep.read(n, frame)
        if kept is not None and kept.features is not None:
            return kept.masks, kept.features, True
        view = frame.T_world_camera, self.camera
        masks = self.segmenter.segment(frame.rgb, frame.depth, *view)
        features = np.asarray(self.encoder.encode_regions(frame.rgb, frame.depth, masks, *view), np.float32)
        if self.keep is not None:
            self.keep.write(n, frame, masks, features)
        # Exactly as a reader gives them, so that it is the same whether they are kept or not.
        return masks, unit_rows(f"frame {frame.index}", features), False


def _build(
    recording: Recording,
    see: _Seeing,
    settings: MappingSettings,
    made_by: tuple[str, str],
    on_frame: Callable[[FrameReport], None] | None,
) -> InstanceMap:
    mapper, colours = OpenMapper(recording.camera, settings), ColourVotes()
    # Counting gives instances their ids, so it is done at the same frames whoever watches.
    total = len(recording)
    counted_at = {total * k // _LOOKS for k in range(1, _LOOKS)}
    instances, usable, nearest = None, 0, np.inf
    for n, frame in enumerate(recording):
        has_depth, kept, times = bool((frame.depth > 0).any()), False, [time.perf_counter()] * 3
        if has_depth:
            usable += 1
            nearest = min(nearest, float(frame.depth[frame.depth > 0].min()))
            masks, features, kept = see(n, frame)
            times[1] = time.perf_counter()
            try:
                mapper.integrate(
                    frame.depth, masks.labels, features if len(masks) else None, frame.T_world_camera, frame.rgb
                )
            except ValueError as error:
                raise DataError(recording.name, f"frame {frame.index}: {error}", "frames that can be mapped") from error
            colours.add(frame.rgb, masks)
            times[2] = time.perf_counter()
        if n + 1 in counted_at:
            instances = len(mapper.instance_map)
        if on_frame is not None:
            spent = times[1] - times[0], times[2] - times[1]
            T = frame.T_world_camera
            on_frame(FrameReport(n + 1, total, frame.index, has_depth, kept, *spent, instances, T))
    if not usable:
        raise DataError(recording.name, f"{total} frames without any depth", "at least one with depth")
    if nearest > settings.max_depth:
        found, expected = f"no depth below {nearest:.6g} m", f"some within max_depth, {settings.max_depth:g} m"
        raise DataError(recording.name, found, expected, "Check the unit of depth (depth_scale) and max_depth.")
    return Naming(see.encoder, made_by).finish(mapper.finalize(), colours)


def _identity(recording: Recording, settings: MappingSettings, made_by: tuple[str, str]) -> dict[str, Any]:
    """What a run is of, for people to read where two differ. That frames are the same is seen by their digests."""
    try:
        code = version("openmap-nav")
    except PackageNotFoundError:  # run from a checkout that is not installed
        code = ""
    return {
        "code": code,
        "recording": {"name": recording.name, "frames": len(recording), "without pose": len(recording.skipped)},
        "segmenter": made_by[0],
        "encoder": made_by[1],
        "camera": asdict(recording.camera),
        "settings": asdict(settings),
    }
