"""SAM-family models as a segmenter: a grid of points, a mask or three for each, and the good ones made disjoint.

Automatic mask generation of Segment Anything (Kirillov et al., ICCV 2023, appendix B) on one scale: masks are kept by the overlap
that the model expects of itself and by how little they change with the threshold, then suppressed by their boxes. What still
overlaps is settled by :mod:`.disjoint`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.onnx.disjoint import DisjointSettings, boxes_of, disjoint, pack, suppress, unpack
from openmap_agents.perception.onnx.pictures import check_picture, runs
from openmap_agents.perception.onnx.sam_models import DECODER, ENCODER, Embedding, SamModel, open_sam
from openmap_agents.perception.onnx.session import load
from openmap_agents.perception.protocol import Masks
from openmap_scenes import DataError, PinholeCamera

Floats = npt.NDArray[np.float32]

AT_ONCE = 32
"""Masks whose logits are held at the picture's size at a time."""


@dataclass(frozen=True)
class SamSettings:
    """How masks are asked for and chosen; thresholds as in the paper."""

    points_per_side: int = 16
    """Points of the grid along each side. The paper's 32 finds smaller things and takes four times as long."""
    points_per_batch: int = 64
    """Points a call of the decoder, where its export takes more than one."""
    min_iou: float = 0.88
    """Overlap with the thing that the model must expect of a mask."""
    min_stability: float = 0.95
    """IoU of the masks at both thresholds of ``stability_offset``."""
    stability_offset: float = 1.0
    """The mask is compared at logits of plus and minus this."""
    max_box_iou: float = 0.7
    """Of masks whose boxes overlap more, the better one stays."""
    size: int = 1024
    """Side of the encoder's input in pixels, where the file does not say."""
    pictures_per_batch: int = 4
    """Pictures a call of the encoder, where its export takes more than one."""
    threads: int = 4
    """On CPU."""
    disjoint: DisjointSettings = field(default_factory=DisjointSettings)
    """How overlaps are settled."""

    def __post_init__(self) -> None:
        for name in ("points_per_side", "points_per_batch", "size", "pictures_per_batch", "threads"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}, expected at least 1")


class SamSegmenter:
    """Masks from the encoder and the decoder of a SAM-family export; depth is not used.

    Parameters
    ----------
    path : path
        A folder that holds both files (or that has them in a folder ``onnx``), or the encoder's file with the decoder beside it.
    settings : SamSettings, optional

    Raises
    ------
    DataError
        See :func:`find_files` and :func:`.sam_models.open_sam`.
    """

    def __init__(self, path: str | Path, settings: SamSettings | None = None) -> None:
        self.settings = settings or SamSettings()
        encoder, decoder = find_files(Path(path))
        self.model: SamModel = open_sam(encoder, decoder, size=self.settings.size, threads=self.settings.threads)

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """Masks of a picture (H, W, 3) uint8."""
        return self.segment_many([rgb])[0]

    def segment_many(self, pictures: list[npt.NDArray[np.uint8]]) -> list[Masks]:
        """Masks of each of several pictures (H, W, 3) uint8, encoded together where the export and their sizes allow it."""
        for rgb in pictures:
            check_picture(rgb)
        limit = self.settings.pictures_per_batch if self.model.free_batch else 1
        found = []
        for together in runs([rgb.shape for rgb in pictures], limit):
            embeddings = self.model.encode([pictures[i] for i in together])
            for i, embedding in zip(together, embeddings, strict=True):
                height, width, _ = pictures[i].shape
                found.append(disjoint(*self.propose(embedding, (height, width)), self.settings.disjoint))
        return found

    def propose(self, embedding: Embedding, size: tuple[int, int]) -> tuple[npt.NDArray[np.bool_], Floats]:
        """Masks (n, H, W) that may overlap and the overlap that the model expects of each, (n,), by falling value."""
        points = point_grid(self.settings.points_per_side, size)
        step = self.settings.points_per_batch
        if self.model.points_per_call is not None:
            step = min(step, self.model.points_per_call)
        parts = [self._propose(embedding, points[i : i + step], size) for i in range(0, len(points), step)]
        bits, boxes, scores = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        kept = suppress(boxes, scores, self.settings.max_box_iou)
        return unpack(bits[kept], *size), scores[kept]

    def _propose(
        self, embedding: Embedding, points: Floats, size: tuple[int, int]
    ) -> tuple[npt.NDArray[np.uint64], Floats, Floats]:
        """The good masks of some points, packed, with boxes and scores."""
        fixed, n = self.model.points_per_call, len(points)
        if fixed is not None and n < fixed:  # a decoder for so many points takes no fewer
            points = np.concatenate([points, np.repeat(points[-1:], fixed - n, axis=0)])
        logits, ious = self.model.decode(embedding, points, size)
        flat, scores = logits[:n].reshape(-1, *logits.shape[2:]), ious[:n].ravel()
        good = np.flatnonzero(scores >= self.settings.min_iou)
        # Some at a time: in full, a batch of points has hundreds of MiB of logits.
        parts = [self._steady(flat, scores, good[i : i + AT_ONCE], size) for i in range(0, max(len(good), 1), AT_ONCE)]
        bits, boxes, kept = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        return bits, boxes, kept

    def _steady(
        self, logits: Floats, scores: Floats, which: npt.NDArray[np.int64], size: tuple[int, int]
    ) -> tuple[npt.NDArray[np.uint64], Floats, Floats]:
        """Those of the masks ``which`` that hardly change with the threshold."""
        full = self.model.frame(size).to_picture(logits[which])
        steady = stability(full, self.settings.stability_offset) >= self.settings.min_stability
        masks = full[steady] > 0
        return pack(masks), boxes_of(masks), scores[which][steady]


def point_grid(n: int, size: tuple[int, int]) -> Floats:
    """The middles (n * n, 2) of n x n equal cells of a picture of size (H, W): x and y in pixels, row by row."""
    middle = (np.arange(n) + 0.5) / n
    x, y = np.meshgrid(middle * size[1], middle * size[0])
    return np.stack([x, y], axis=-1).reshape(-1, 2).astype(np.float32)


def stability(logits: Floats, offset: float) -> Floats:
    """IoU (n,) of the masks of logits (n, H, W) at plus and minus the offset; 0 for a mask that is empty at both."""
    inner = (logits > offset).sum((1, 2))
    outer = (logits > -offset).sum((1, 2))
    return np.asarray(inner / np.maximum(outer, 1), np.float32)


def find_files(path: Path) -> tuple[Path, Path]:
    """The encoder and the decoder that a path means.

    Of a folder's files the encoder is one that has "encoder" in its name and the decoder one that has "decoder"; with several
    (a float16 or int8 version beside the plain one) the shortest name. Of two files without such names the one that takes points
    is the decoder. For an encoder's file, the decoder is the one of the same version where there is one.

    Raises
    ------
    DataError
        Nothing there, or no pair.
    """
    if not path.exists():
        raise DataError(
            path, "no such file or folder", "the files of a SAM-family export", "Check the path of the spec."
        )
    folder = path if path.is_dir() else path.parent
    files = _models(folder) or (_models(folder / "onnx") if path.is_dir() else [])
    decoders = [f for f in files if "decoder" in f.stem.lower() and f != path]
    if path.is_dir():
        encoders = [f for f in files if "encoder" in f.stem.lower() and f not in decoders]
        if not (encoders and decoders) and len(files) == 2:
            return _by_inputs(files[0], files[1])
        if not encoders or not decoders:
            raise _no_pair(path, files)
        path = encoders[0]
    elif not decoders:
        decoders = [f for f in files if f != path] if len(files) == 2 else []
    if not decoders:
        raise _no_pair(path, files)
    name = path.name.lower()
    same = (name.replace("vision_encoder", "prompt_encoder_mask_decoder"), name.replace("encoder", "decoder"))
    return path, next((f for f in decoders if f.name.lower() in same), decoders[0])


def _models(folder: Path) -> list[Path]:
    """A folder's ONNX files, shortest name first."""
    return sorted(folder.glob("*.onnx"), key=lambda f: (len(f.name), f.name))


def _by_inputs(a: Path, b: Path) -> tuple[Path, Path]:
    takes_points = [any("point" in t.name for t in load(f, f"{ENCODER} or decoder").inputs) for f in (a, b)]
    if takes_points[0] == takes_points[1]:
        raise _no_pair(a.parent, [a, b])
    return (b, a) if takes_points[0] else (a, b)


def _no_pair(path: Path, files: list[Path]) -> DataError:
    found = ", ".join(f.name for f in files) or "no .onnx file"
    return DataError(
        path,
        f"{found} there" if files else found,
        f"{ENCODER} and {DECODER}, with 'encoder' and 'decoder' in the files' names",
        "Put both files of the export into one folder.",
    )
