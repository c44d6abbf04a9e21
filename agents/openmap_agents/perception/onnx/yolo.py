"""YOLOv8 / YOLO11 segmentation and FastSAM exports as a segmenter: boxes with mask coefficients over shared prototypes.

The network gives N candidates (4 + classes + K, N), each a box (centre x, centre y, width, height in pixels of its input), a
score for every class, and K coefficients, and K prototype maps; a mask is where the sum of the prototypes, weighted with the
candidate's coefficients, is positive inside its box (Bolya et al., YOLACT, ICCV 2019; FastSAM is the same with one class).
Exports that suppress by themselves give rows (N, 6 + K) instead: two corners, score, class, coefficients. Classes are not used:
masks are class-agnostic.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.onnx.disjoint import DisjointSettings, disjoint, suppress
from openmap_agents.perception.onnx.pictures import Frame, check_picture
from openmap_agents.perception.onnx.session import Port, open_model
from openmap_agents.perception.protocol import Masks
from openmap_scenes import DataError, PinholeCamera

Floats = npt.NDArray[np.float32]

EXPECTED = "a YOLO segmentation or FastSAM export"
GREY = 114
"""What the network's input is filled up with."""


@dataclass(frozen=True)
class YoloSettings:
    """How candidates are chosen."""

    min_score: float = 0.25
    """Best class score of a candidate. FastSAM's own default is 0.4."""
    max_box_iou: float = 0.7
    """Of candidates whose boxes overlap more, the better one stays, whatever their classes. FastSAM's own default is 0.9."""
    max_masks: int = 300
    """Candidates a picture after suppression, best first."""
    size: int | None = None
    """Side of the input in pixels where the export leaves it free; default the one the file names, or 640."""
    pictures_per_batch: int = 4
    """Pictures a call, where the export takes more than one."""
    threads: int = 4
    """On CPU."""
    disjoint: DisjointSettings = field(default_factory=DisjointSettings)
    """How overlaps are settled."""

    def __post_init__(self) -> None:
        for name in ("max_masks", "pictures_per_batch", "threads"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}, expected at least 1")
        if self.size is not None and (self.size < 32 or self.size % 32):
            raise ValueError(f"size is {self.size}, expected a multiple of 32, the network's coarsest stride")


@dataclass(frozen=True)
class Candidates:
    """What the network says of one picture.

    Parameters
    ----------
    boxes : (n, 4) float32
        x0, y0, x1, y1 in pixels of the network's input.
    scores : (n,) float32
    coefficients : (n, K) float32
    """

    boxes: Floats
    scores: Floats
    coefficients: Floats

    def __getitem__(self, which: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> Candidates:
        return Candidates(self.boxes[which], self.scores[which], self.coefficients[which])


class YoloSegmenter:
    """Masks from a YOLO segmentation or FastSAM export; depth is not used.

    Parameters
    ----------
    path : path
        The ``.onnx`` file.
    settings : YoloSettings, optional

    Raises
    ------
    DataError
        No such file, not an ONNX model, or not one with these outputs (a detector has no prototypes).
    """

    def __init__(self, path: str | Path, settings: YoloSettings | None = None) -> None:
        self.settings = settings or YoloSettings()
        self.model = open_model(
            path,
            {"images": Port(4, unnamed=True)},
            {"output0": Port(3, unnamed=True), "output1": Port(4, unnamed=True)},
            EXPECTED,
            threads=self.settings.threads,
        )
        self.network = self._network()
        batch = self.model.axis("images", 0)
        self.batch = self.settings.pictures_per_batch if batch is None else batch
        self.free_batch = batch is None
        self.coefficients = self._coefficients()

    def _network(self) -> tuple[int, int]:
        """Height and width of the input: the export's, where they are fixed."""
        named = _literal(self.model.metadata.get("imgsz"))
        pair = (named, named) if isinstance(named, int) else named
        if not (isinstance(pair, list | tuple) and len(pair) == 2 and all(isinstance(n, int) and n > 0 for n in pair)):
            pair = (640, 640)
        if self.settings.size is not None:
            pair = (self.settings.size, self.settings.size)
        return self.model.axis("images", 2) or pair[0], self.model.axis("images", 3) or pair[1]

    def _coefficients(self) -> int:
        """How many prototypes there are, after a look at whether the outputs fit each other."""
        k = self.model.axis("output1", 1) or 32
        channels, last = self.model.axis("output0", 1), self.model.axis("output0", 2)
        self.finished = last == 6 + k
        names = _literal(self.model.metadata.get("names"))
        wanted = 4 + len(names) + k if isinstance(names, list | tuple | dict) else None
        wrong = channels is not None and (channels < 5 + k or channels != (wanted or channels))
        if wrong and not self.finished:
            raise DataError(
                self.model.path,
                str(self.model.file),
                f"{EXPECTED} whose output0 has 4 + classes + {k} channels" + (f" = {wanted}" if wanted else ""),
                "Export it for the task 'segment'.",
            )
        return k

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
        """Masks of each of several pictures (H, W, 3) uint8 of any sizes."""
        for rgb in pictures:
            check_picture(rgb)
        found = []
        for i in range(0, len(pictures), self.batch):
            part = pictures[i : i + self.batch]
            inputs, frames = zip(*(letterbox(rgb, self.network) for rgb in part), strict=True)
            stack = np.stack(inputs)
            if not self.free_batch:  # a network for so many pictures takes no fewer
                stack = np.concatenate([stack, np.repeat(stack[-1:], self.batch - len(part), axis=0)])
            outputs = self.model.run(images=stack)
            for raw, prototypes, frame in zip(outputs["output0"], outputs["output1"], frames, strict=False):
                found.append(disjoint(*self.propose(raw, prototypes, frame), self.settings.disjoint))
        return found

    def propose(self, raw: Floats, prototypes: Floats, frame: Frame) -> tuple[npt.NDArray[np.bool_], Floats]:
        """Masks (n, H, W) that may overlap, and their scores (n,), by falling score."""
        candidates = self._read(raw)
        candidates = candidates[candidates.scores >= self.settings.min_score]
        kept = suppress(candidates.boxes, candidates.scores, self.settings.max_box_iou)
        candidates = candidates[kept[: self.settings.max_masks]]
        return assemble(candidates, prototypes, frame), candidates.scores

    def _read(self, raw: Floats) -> Candidates:
        k = self.coefficients
        if self.finished:
            return Candidates(raw[:, :4], raw[:, 4], raw[:, 6:])
        rows = raw.T
        centre, half = rows[:, :2], rows[:, 2:4] / 2
        return Candidates(np.hstack([centre - half, centre + half]), rows[:, 4:-k].max(1), rows[:, -k:])


def assemble(candidates: Candidates, prototypes: Floats, frame: Frame) -> npt.NDArray[np.bool_]:
    """Masks (n, H, W) of the picture: positive sums of prototypes (K, h, w), inside the candidate's box."""
    k, height, width = prototypes.shape
    logits = (candidates.coefficients @ prototypes.reshape(k, -1)).reshape(-1, height, width)
    masks = np.zeros((len(logits), *frame.size), bool)
    for mask, low, box in zip(masks, logits, to_picture(candidates.boxes, frame), strict=True):
        x0, y0, x1, y1 = np.ceil(box - 0.5).astype(int)  # pixels whose centres, at halves here, lie in the box
        inside = (slice(max(y0, 0), max(y1, 0)), slice(max(x0, 0), max(x1, 0)))
        mask[inside] = frame.to_picture(low[None])[0][inside] > 0
    return masks


def to_picture(boxes: Floats, frame: Frame) -> Floats:
    """Boxes (n, 4) of the network's input -> of the picture, in pixels counted from its corner."""
    scale = np.tile(np.array(frame.size[::-1]) / np.array(frame.inner[::-1]), 2)
    return np.asarray((boxes - np.tile(frame.corner[::-1], 2)) * scale, np.float32)


def letterbox(rgb: npt.NDArray[np.uint8], network: tuple[int, int]) -> tuple[Floats, Frame]:
    """The picture in the middle of the network's input, grey around it: (3, *network) float32 0..1, and where it lies."""
    height, width = rgb.shape[:2]
    ratio = min(network[0] / height, network[1] / width)
    inner = (max(1, round(height * ratio)), max(1, round(width * ratio)))
    # Half a pixel too much goes to the right and the bottom, as in the original.
    top, left = ((network[i] - inner[i]) // 2 for i in range(2))
    out = np.full((*network, 3), GREY, np.uint8)
    small = cv2.resize(rgb, inner[::-1], interpolation=cv2.INTER_LINEAR) if inner != (height, width) else rgb
    out[top : top + inner[0], left : left + inner[1]] = small
    return out.transpose(2, 0, 1).astype(np.float32) / np.float32(255), Frame(
        (height, width), network, inner, (top, left)
    )


def _literal(text: str | None) -> object:
    """A list, number or dict that the exporter wrote as Python text; None for anything else."""
    try:
        return ast.literal_eval(text) if text else None
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):  # all that literal_eval is said to raise
        return None
