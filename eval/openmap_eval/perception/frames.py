"""A view for people: masks in colours, numbers and first labels in the picture, the first three labels in a list beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Calibration
from openmap_eval.perception.labels import NameList
from openmap_eval.perception.observe import MIN_IOU, Observed, Shown
from openmap_eval.pictures import Picture, draw_names, instance_colour, mask_picture

_WIDTH = 1120
_TOP = 3


@dataclass(frozen=True)
class Row:
    """A line of the list beside a picture.

    Parameters
    ----------
    number : int
        As in the picture.
    colour : str
        CSS, of the mask.
    labels : list of (str, str)
        The first three, with how sure each is.
    score : str
    truth : str
        What it shows, if it shows anything well enough; else "–".
    iou : str
    right : bool or None
        Whether the first label is the thing's kind; None where it shows nothing.
    """

    number: int
    colour: str
    labels: list[tuple[str, str]]
    score: str
    truth: str
    iou: str
    right: bool | None


@dataclass(frozen=True)
class DrawnFrame:
    """A picture and its list."""

    title: str
    picture: Picture
    rows: list[Row]


def drawn_frames(
    observed: Observed,
    trained: Sequence[str],
    encode: Callable[[list[str]], npt.NDArray[np.float32]],
    calibration: Calibration | None,
) -> list[DrawnFrame]:
    """The shown views of a scene, labelled among all names."""
    categories = {i.id: i.category for i in observed.things}
    names = NameList.every(trained, sorted(set(categories.values())))
    text = encode(list(names.words)).T
    frames = []
    for k, shown in enumerate(observed.shown, start=1):
        similarity = names.by_kind(shown.features @ text) if len(shown.masks) else np.zeros((0, len(names.kinds)))
        rows = _rows(shown, similarity, names, categories, calibration)
        frames.append(DrawnFrame(f"{observed.scene}, view {k}", draw(shown, rows), rows))
    return frames


def _rows(
    shown: Shown,
    similarity: npt.NDArray[np.floating],
    names: NameList,
    categories: dict[int, str],
    calibration: Calibration | None,
) -> list[Row]:
    """A row for each mask, in the order of their numbers."""
    rows = []
    for k in range(len(shown.masks)):
        first = np.argsort(-similarity[k], kind="stable")[:_TOP].tolist()
        iou = shown.overlap.iou[:, k]
        best = int(iou.argmax()) if len(iou) and iou.max() >= MIN_IOU else None
        truth = names.kind_of(categories[int(shown.overlap.things[best])]) if best is not None else None
        red, green, blue = instance_colour(k + 1)
        rows.append(
            Row(
                k + 1,
                f"rgb({red} {green} {blue})",
                [(names.kinds[c], _sure(float(similarity[k, c]), calibration)) for c in first],
                f"{float(shown.masks.scores[k]):.2f}",
                truth or "–",
                "" if best is None else f"{iou[best]:.2f}",
                None if truth is None else names.kinds[first[0]] == truth,
            )
        )
    return rows


def _sure(cosine: float, calibration: Calibration | None) -> str:
    return f"{cosine:.2f}" if calibration is None else f"{100 * float(calibration(cosine)):.0f} %"


def draw(shown: Shown, rows: Sequence[Row]) -> Picture:
    """The picture enlarged, with masks, and "number label" where there is room beside each; large masks are served first."""
    height, width = shown.rgb.shape[:2]
    scale = max(1, round(_WIDTH / width))
    labels = np.repeat(np.repeat(shown.masks.labels, scale, 0), scale, 1)
    rgb = cv2.resize(shown.rgb, (width * scale, height * scale), interpolation=cv2.INTER_LINEAR)
    picture = mask_picture(np.asarray(rgb, np.uint8), labels)
    sizes = np.bincount(shown.masks.labels.ravel(), minlength=len(rows) + 1)[1:]
    places = []
    for k in np.argsort(-sizes, kind="stable").tolist():
        if sizes[k]:
            column, row = _middle(shown.masks.labels == k + 1)
            places.append((column * scale, row * scale, f"{rows[k].number} {rows[k].labels[0][0]}"))
    draw_names(picture, places, 0.55)
    return picture


def _middle(mask: npt.NDArray[np.bool_]) -> tuple[int, int]:
    """The pixel of a mask that is farthest from its edge: column, row."""
    padded = np.pad(mask.astype(np.uint8), 1)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, 3)[1:-1, 1:-1]
    row, column = divmod(int(distance.argmax()), mask.shape[1])
    return column, row
