"""Which things are most often taken for which others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from openmap_eval.perception.labels import NameList
from openmap_eval.perception.observe import Observed, Regions

_MARGIN = 0.25


@dataclass(frozen=True)
class Confusion:
    """Regions of ``kind`` whose first label was of the kind ``taken_for``.

    Parameters
    ----------
    kind, taken_for : str
    instances, views : int
        How many things, and views of them.
    kind_views : int
        Views of the kind in all.
    examples : list of (H, W, 3) uint8
        Pictures of them, of different instances first.
    """

    kind: str
    taken_for: str
    instances: int
    views: int
    kind_views: int
    examples: list[npt.NDArray[np.uint8]]


def confusions(
    scenes: Sequence[Observed],
    trained: Sequence[str],
    encode: Callable[[list[str]], npt.NDArray[np.float32]],
    most: int = 5,
    examples: int = 6,
) -> list[Confusion]:
    """The ``most`` frequent, by instances and then by views, among all names and, where there are any, with true masks."""
    found: dict[tuple[str, str], list[tuple[int, int]]] = defaultdict(list)
    of_kind: dict[str, int] = defaultdict(int)
    for s, observed in enumerate(scenes):
        regions = _regions(observed)
        categories = [i.category for i in observed.things]
        names = NameList.every(trained, categories)
        first = names.by_kind(regions.features @ encode(list(names.words)).T).argmax(1)
        for row, (thing, kind) in enumerate(zip(regions.things.tolist(), first.tolist(), strict=True)):
            if not regions.there[row]:
                continue
            own = names.kind_of(categories[thing])
            of_kind[own] += 1
            if names.kinds[kind] != own:
                found[own, names.kinds[kind]].append((s, row))
    ranked = sorted(found.items(), key=lambda item: (-len(_instances(scenes, item[1])), -len(item[1]), item[0]))
    return [
        Confusion(own, other, len(_instances(scenes, rows)), len(rows), of_kind[own], _examples(scenes, rows, examples))
        for (own, other), rows in ranked[:most]
    ]


def _regions(observed: Observed) -> Regions:
    """Those of true masks where the encoder reads them."""
    return observed.predicted if observed.true is None else observed.true


def _instances(scenes: Sequence[Observed], rows: Sequence[tuple[int, int]]) -> set[tuple[int, int]]:
    return {(s, int(scenes[s].predicted.things[row])) for s, row in rows}


def _examples(scenes: Sequence[Observed], rows: Sequence[tuple[int, int]], most: int) -> list[npt.NDArray[np.uint8]]:
    """Crops, the largest of every instance before the second of any."""
    by_instance: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for s, row in rows:
        by_instance[s, int(scenes[s].predicted.things[row])].append((s, row))
    ranked = [sorted(views, key=lambda r: -_area(scenes[r[0]].boxes[r[1]])) for _, views in sorted(by_instance.items())]
    turns = [views[k] for k in range(max(map(len, ranked))) for views in ranked if k < len(views)]
    return [crop(scenes[s], row) for s, row in turns[:most]]


def _area(box: npt.NDArray[np.int64]) -> int:
    return int((box[2] - box[0]) * (box[3] - box[1]))


def crop(observed: Observed, row: int, side: int = 128) -> npt.NDArray[np.uint8]:
    """A region and a quarter around it, outlined, as a picture of at most ``side`` pixels."""
    data = np.frombuffer(observed.pictures[int(observed.predicted.views[row])], np.uint8)
    picture = cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    left, top, right, bottom = observed.boxes[row].tolist()
    cv2.rectangle(picture, (left, top), (right - 1, bottom - 1), (255, 220, 0), 1)
    pad = round(_MARGIN * max(right - left, bottom - top)) + 4
    part = picture[max(0, top - pad) : bottom + pad, max(0, left - pad) : right + pad]
    scale = side / max(part.shape[:2])
    size = (max(1, round(part.shape[1] * scale)), max(1, round(part.shape[0] * scale)))
    return np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC), np.uint8)
