"""Masks -> square pictures of one thing each, for image towers that take whole pictures.

A tight box shows what the thing is made of, a wide one what stands around it; the mean of the features of both says more than
either. So each of the k best views of an instance gives L crops whose box grows by a part of its own size each level (OpenMask3D,
NeurIPS 2023, section 3.3; OpenMap, MM 2025). The k views are the map's matter, the L crops this module's. A tower squashes or cuts
what is not square, so the crops are padded to squares with white first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import find_objects

WHITE = 255


@dataclass(frozen=True)
class Crops:
    """How a mask is cut out.

    Parameters
    ----------
    levels : int
        Crops of a mask, L.
    ratio : float
        What each level adds on every side, as a part of the mask's own box.
    whiten : bool
        Whether pixels outside the mask become white, instead of staying as background.
    """

    levels: int = 3
    ratio: float = 0.1
    whiten: bool = False

    def __post_init__(self) -> None:
        if self.levels < 1:
            raise ValueError(f"levels is {self.levels}, expected at least 1")
        if not 0.0 <= self.ratio < np.inf:
            raise ValueError(f"ratio is {self.ratio}, expected a finite number of at least 0")

    def boxes(self, box: tuple[slice, slice], height: int, width: int) -> list[tuple[slice, slice]]:
        """The box of a mask (rows, columns) and its wider levels, inside a picture of that size."""
        rows, columns = box
        # Rounded up: a level is wider than the last one however small the mask is. Less a little, for 70 * 0.1 is not 7.
        steps = (np.ceil((span.stop - span.start) * self.ratio - 1e-9) for span in box)
        step_v, step_u = (max(int(step), 0) for step in steps)
        grown = []
        for level in range(self.levels):
            dv, du = level * step_v, level * step_u
            grown.append(
                (
                    slice(max(rows.start - dv, 0), min(rows.stop + dv, height)),
                    slice(max(columns.start - du, 0), min(columns.stop + du, width)),
                )
            )
        return grown

    def of_masks(
        self, rgb: npt.NDArray[np.uint8], labels: npt.NDArray[np.int32], n: int
    ) -> list[list[npt.NDArray[np.uint8]]]:
        """Crops of the masks 1..n.

        Parameters
        ----------
        rgb : (H, W, 3) uint8
        labels : (H, W) int32
            0 = no mask.
        n : int

        Returns
        -------
        list of n lists
            Of L square pictures (s, s, 3) uint8, the tight one first; of none where the mask has no pixel.

        Raises
        ------
        ValueError
            Picture and labels are not of one size.
        """
        if rgb.shape != (*labels.shape, 3) or rgb.dtype != np.uint8:
            raise ValueError(f"rgb is {rgb.shape} {rgb.dtype}, expected {(*labels.shape, 3)} uint8 as the labels are")
        crops: list[list[npt.NDArray[np.uint8]]] = []
        for i, box in enumerate(find_objects(labels, max_label=n) if n else []):
            boxes = self.boxes(box, *labels.shape) if box is not None else []
            crops.append([self._cut(rgb, labels == i + 1 if self.whiten else None, b) for b in boxes])
        return crops

    def _cut(
        self, rgb: npt.NDArray[np.uint8], mask: npt.NDArray[np.bool_] | None, box: tuple[slice, slice]
    ) -> npt.NDArray[np.uint8]:
        part = rgb[box]
        return white_square(part if mask is None else np.where(mask[box][..., None], part, np.uint8(WHITE)))


def white_square(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """A picture (h, w, 3) uint8 in the middle of the smallest white square that holds it; an odd row is left below or right."""
    h, w = picture.shape[:2]
    side = max(h, w)
    square = np.full((side, side, 3), WHITE, np.uint8)
    top, left = (side - h) // 2, (side - w) // 2
    square[top : top + h, left : left + w] = picture
    return square
