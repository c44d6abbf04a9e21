"""Overlapping proposals become disjoint masks: held to a plain twin, and to what people would want of a cushion on a sofa."""

from __future__ import annotations

import numpy as np
import tiny_segmenters as tiny
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.perception.onnx.disjoint import DisjointSettings, boxes_of, disjoint, pack, suppress, unpack

ANY_AREA = DisjointSettings(min_area=0)


def plain_suppress(boxes: np.ndarray, scores: np.ndarray, max_iou: float) -> list[int]:
    """Pair by pair."""

    def iou(a: np.ndarray, b: np.ndarray) -> float:
        w, h = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
        both = max(w, 0) * max(h, 0)
        union = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both
        return both / union if union else 0.0

    kept: list[int] = []
    for i in sorted(range(len(scores)), key=lambda i: (-scores[i], i)):
        if all(iou(boxes[i], boxes[j]) <= max_iou for j in kept):
            kept.append(i)
    return kept


@given(st.integers(0, 2**32 - 1), st.integers(0, 30), st.sampled_from([0.0, 0.3, 0.7, 1.0]))
@settings(max_examples=60, deadline=None)
def test_suppression_is_the_plain_one(seed: int, n: int, max_iou: float) -> None:
    rng = np.random.default_rng(seed)
    corner = rng.integers(0, 20, (n, 2))
    boxes = np.hstack([corner, corner + rng.integers(0, 20, (n, 2))]).astype(float)
    scores = rng.integers(0, 5, n) / 4
    assert list(suppress(boxes, scores, max_iou)) == plain_suppress(boxes, scores, max_iou)


@given(
    st.integers(0, 2**32 - 1), st.integers(0, 12), st.sampled_from([0.0, 0.01, 0.1]), st.sampled_from([0.0, 0.2, 1.0])
)
@settings(max_examples=80, deadline=None)
def test_every_pixel_has_one_label_of_a_proposal_that_has_it(
    seed: int, n: int, min_area: float, min_left: float
) -> None:
    rng = np.random.default_rng(seed)
    proposals = rectangles(rng, n, (23, 31))
    scores = rng.permutation(np.linspace(-0.1, 1.1, n)) if n else np.zeros(0)
    chosen = DisjointSettings(min_area=min_area, min_left=min_left)
    masks = disjoint(proposals, scores, chosen)
    tiny.check_masks(masks, (23, 31))
    assert list(masks.scores) == sorted(masks.scores, reverse=True)
    used = set()
    for i, score in enumerate(masks.scores):
        mine = masks.labels == i + 1
        sources = [
            k
            for k in range(n)
            if np.isclose(np.clip(scores[k], 0, 1), score) and not (mine & ~proposals[k]).any() and k not in used
        ]
        assert sources
        used.add(sources[0])
        assert mine.sum() >= min_area * mine.size
    again = disjoint(proposals, scores, chosen)
    np.testing.assert_array_equal(masks.labels, again.labels)


@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
@settings(max_examples=60, deadline=None)
def test_a_pixel_goes_to_the_inner_and_then_to_the_better_proposal(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    proposals, scores = rectangles(rng, n, (23, 31)), rng.permutation(np.linspace(0.1, 0.9, n))
    chosen = DisjointSettings(min_area=0, min_left=0)
    masks = disjoint(proposals, scores, chosen)
    np.testing.assert_array_equal(masks.labels > 0, proposals.any(0))
    area = proposals.sum((1, 2))

    def inside(i: int, j: int) -> bool:
        both = (proposals[i] & proposals[j]).sum()
        return 0 < both >= chosen.nested * area[i] and area[i] <= chosen.smaller * area[j]

    for y, x in rng.integers(0, (23, 31), (20, 2)):
        there = [i for i in range(n) if proposals[i, y, x]]
        if not there:
            continue
        owner = int(np.flatnonzero(np.isclose(scores, masks.scores[masks.labels[y, x] - 1]))[0])
        # Nobody who has the pixel is inside the owner, and where insideness says nothing at all the score decides.
        assert not any(inside(i, owner) for i in there)
        if not any(inside(i, j) for i in range(n) for j in range(n)):
            assert owner == max(there, key=lambda i: scores[i])


def test_a_cushion_stays_in_the_sofa_and_a_second_try_goes() -> None:
    sofa, cushion, again = np.zeros((3, 20, 30), bool)
    sofa[2:18, 2:28] = True
    cushion[4:10, 4:12] = True
    again[2:18, 3:28] = True
    masks = disjoint(np.stack([sofa, cushion, again]), np.array([0.9, 0.5, 0.8]), ANY_AREA)
    np.testing.assert_allclose(masks.scores, [0.9, 0.5])
    np.testing.assert_array_equal(masks.labels, np.where(cushion, 2, sofa))


def test_the_pixels_of_a_proposal_given_up_go_to_the_next_in_line() -> None:
    best, middle, worst = np.zeros((3, 10, 40), bool)
    best[:, 0:19] = True
    middle[:, 0:20] = True
    worst[:, 8:24] = True
    masks = disjoint(np.stack([best, middle, worst]), np.array([0.9, 0.8, 0.7]), ANY_AREA)
    np.testing.assert_allclose(masks.scores, [0.9, 0.7])
    np.testing.assert_array_equal(masks.labels[0], [1] * 19 + [2] * 5 + [0] * 16)
    larger = DisjointSettings(min_area=51 / 400)
    np.testing.assert_allclose(disjoint(np.stack([best, worst]), np.array([0.9, 0.7]), larger).scores, [0.9])


def rectangles(rng: np.random.Generator, n: int, size: tuple[int, int]) -> np.ndarray:
    masks = np.zeros((n, *size), bool)
    for mask in masks:
        y, x = rng.integers(0, size)
        mask[y : y + rng.integers(0, size[0]), x : x + rng.integers(0, size[1])] = True
    return masks


def test_packing_keeps_masks_and_boxes_hold_them() -> None:
    masks = rectangles(np.random.default_rng(0), 9, (13, 17))
    np.testing.assert_array_equal(unpack(pack(masks), 13, 17), masks)
    for mask, (x0, y0, x1, y1) in zip(masks, boxes_of(masks).astype(int), strict=True):
        assert mask[y0 : y1 + 1, x0 : x1 + 1].sum() == mask.sum()
