"""Average precision against cases worked out by hand, a plain twin, and the orders in which things may come."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from openmap_agents.perception.scannet200 import INSTANCE_CLASSES, NAME_OF, NUMBER_OF, category_number
from openmap_eval.ap.protocol import AP_THRESHOLDS, THRESHOLDS, APScores, LabelledCloud, Proposal, average_precision

CHAIR, TABLE, PLATE = NUMBER_OF["chair"], NUMBER_OF["dining table"], NUMBER_OF["plate"]


def cloud(*runs: tuple[int, int, int]) -> LabelledCloud:
    """Points in runs of (how many, instance, category)."""
    counts, instance, category = np.array(runs).T
    n = int(counts.sum())
    return LabelledCloud(
        np.zeros((n, 3), np.float32),
        np.repeat(instance, counts).astype(np.int32),
        np.repeat(category, counts).astype(np.int32),
    )


def proposal(start: int, stop: int, confidence: float = 1.0, category: int = CHAIR) -> Proposal:
    return Proposal(np.arange(start, stop), confidence, category)


def agnostic(proposals: list[Proposal], truth: LabelledCloud) -> APScores:
    return average_precision([(proposals, truth)], class_agnostic=True)


def test_thresholds_are_nine_and_a_quarter() -> None:
    assert len(AP_THRESHOLDS) == 9
    np.testing.assert_allclose(THRESHOLDS, [0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.25])


def test_perfect_proposals_score_one() -> None:
    truth = cloud((200, 1, CHAIR), (300, 2, CHAIR))
    scores = agnostic([proposal(0, 200), proposal(200, 500)], truth)
    assert (scores.ap, scores.ap50, scores.ap25) == (1.0, 1.0, 1.0)
    assert (scores.by_class[0].n_truth, scores.by_class[0].n_proposals) == (2, 2)


def test_one_of_two_found_at_some_thresholds() -> None:
    # Instance 1 has points 0-199, the proposal 0-149 of them: IoU 150/200 = .75, found at .25 and .50 .. .70 (five of nine; .75 is
    # not above .75). Instance 2 is missed. Recall 1/2, precision 1: area (0.5 - 0) * (1 + 1) / 2 = .5 where found, else the
    # proposal is wrong: recall 0, area 0. AP = 5 * .5 / 9.
    truth = cloud((200, 1, CHAIR), (200, 2, CHAIR))
    scores = agnostic([proposal(0, 150)], truth)
    assert scores.ap50 == scores.ap25 == 0.5
    assert scores.ap == pytest.approx(2.5 / 9)


def test_precision_recall_with_a_wrong_proposal_in_between() -> None:
    # Two instances of 200; confidences .9 right, .8 wrong (IoU 100/300 with instance 1, so right nowhere from .5), .7 right.
    # Points of the curve, from the lowest confidence: (recall 1, precision 2/3), (1/2, 1/2), (1/2, 1), (0, 1).
    # Trapezia: 1/2 * (2/3 + 1/2) / 2 = 7/24; 0; 1/2 * 1 = 1/2. Area 19/24.
    truth = cloud((200, 1, CHAIR), (200, 2, CHAIR), (100, 3, CHAIR))
    wrong = Proposal(np.concatenate([np.arange(0, 100), np.arange(400, 500)]), 0.8, CHAIR)
    only_two = cloud((200, 1, CHAIR), (200, 2, CHAIR), (100, 0, 0))
    # On this cloud half of the wrong one is void, and at .5 half is not more than half: it counts.
    scores = agnostic([proposal(0, 200, 0.9), wrong, proposal(200, 400, 0.7)], only_two)
    assert scores.ap50 == pytest.approx(19 / 24)
    # At .25: the wrong one has IoU 100 / 300 = 1/3 with instance 1, which .9 has found: a duplicate, still wrong.
    assert scores.ap25 == pytest.approx(19 / 24)
    assert scores.ap == pytest.approx(19 / 24)
    # With a third instance there it overlaps that by 100 / 200 = .5, not above .5; at .25 it finds it: 3 right of 3, area 1.
    scores = agnostic([proposal(0, 200, 0.9), wrong, proposal(200, 400, 0.7)], truth)
    # At .25, instance 1 takes .9 and counts .8 as a duplicate; then instance 3 finds .8, which no instance has taken.
    # Right .9 .8 .7, wrong .8: (1, 3/4), (2/3, 2/3), (1/3, 1), (0, 1):
    # 1/3 * (3/4 + 2/3) / 2 + 1/3 * (2/3 + 1) / 2 + 1/3 = (17/24 + 5/6 + 1) / 3 = 61/72.
    assert scores.ap25 == pytest.approx(61 / 72)
    # At .50: (2/3, 2/3), (1/3, 1/2), (1/3, 1), (0, 1): 1/3 * (2/3 + 1/2) / 2 + 1/3 = 7/36 + 12/36.
    assert scores.ap50 == pytest.approx(19 / 36)


def test_duplicates_are_wrong() -> None:
    # The same instance twice: right .9, wrong .4. (1, 1/2), (1, 1), (0, 1): area 1; a duplicate below costs nothing at full recall.
    truth = cloud((200, 1, CHAIR))
    assert agnostic([proposal(0, 200, 0.9), proposal(0, 190, 0.4)], truth).ap50 == 1.0
    # With equal confidences they share one point: (1, 1/2), (0, 1): area (1/2 + 1) / 2 = 3/4.
    assert agnostic([proposal(0, 200), proposal(0, 190)], truth).ap50 == pytest.approx(0.75)
    # The better overlap does not help the lower confidence: .9 has it, at .85 (170/200 = .85, not above) it is wrong and the
    # other right: (1, 1/2), (0, 0), (0, 1): area 1/4. At .50 .. .80 (seven) 1, at .85 and .90 1/4.
    scores = agnostic([proposal(0, 170, 0.9), proposal(0, 200, 0.4)], truth)
    assert scores.ap == pytest.approx((7 * 1 + 2 * 0.25) / 9)


def test_ties_are_one_point_of_the_curve() -> None:
    # Three proposals at .5, two right and one wrong, three instances: (2/3, 2/3), (0, 1): 2/3 * (2/3 + 1) / 2 = 5/9.
    truth = cloud((200, 1, CHAIR), (200, 2, CHAIR), (200, 3, CHAIR))
    wrong = Proposal(np.concatenate([np.arange(0, 60), np.arange(200, 260), np.arange(400, 460)]), 0.5, CHAIR)
    assert agnostic([proposal(0, 200, 0.5), wrong, proposal(200, 400, 0.5)], truth).ap50 == pytest.approx(5 / 9)


def test_void_and_small_instances_are_ignored() -> None:
    # 200 points of a chair, 300 unannotated, 60 of an instance that is too small, 300 of a category that is not scored.
    truth = cloud((200, 1, CHAIR), (300, 0, 0), (60, 2, CHAIR), (300, 3, 0))
    assert agnostic([proposal(0, 200)], truth).by_class[0].n_truth == 1
    right = proposal(0, 200, 0.5)
    # All void, 240 void + 60 small, all of the unscored category: none of them counts, though they are surer than the right one.
    for start, stop in ((200, 500), (260, 560), (560, 860)):
        assert agnostic([right, proposal(start, stop, 0.9)], truth).ap == 1.0
    # Points 100-299: half void, half on the chair (IoU 100 / 300 = 1/3). At .25 it is the chair's duplicate, surer than the right
    # one, so the one that finds it: (1, 1/2), (1, 1), (0, 1) = 1. At .50 it is void by 1/2, not more: wrong. (1, 1/2), (0, 0),
    # (0, 1): 1/4. Higher thresholds alike.
    scores = agnostic([right, proposal(100, 300, 0.9)], truth)
    assert (scores.ap25, scores.ap50) == (1.0, 0.25)
    assert scores.ap == pytest.approx(0.25)
    # Points 80-379: 180 of 300 = .6 void, 120 on the chair (IoU 120/380 = .32). Ignored at .50 and .55; wrong from .60 on
    # (the threshold's float is a hair above .6, as the benchmark's is). AP = (2 * 1 + 7 * 1/4) / 9.
    assert agnostic([right, proposal(80, 380, 0.9)], truth).ap == pytest.approx((2 + 7 / 4) / 9)


def test_small_proposals_are_not_looked_at() -> None:
    truth = cloud((200, 1, CHAIR), (200, 2, CHAIR))
    scores = agnostic([proposal(0, 200, 0.5), proposal(200, 299, 0.9)], truth)
    assert scores.by_class[0].n_proposals == 1
    assert scores.ap50 == 0.5
    lower = average_precision(
        [([proposal(0, 200, 0.5), proposal(200, 299, 0.9)], truth)], class_agnostic=True, min_points=99
    )
    # Now 99 / 200 is found at .25 (area 1) and wrong at .5: (1/2, 1/2), (0, 0), (0, 1): 1/8.
    assert (lower.ap25, lower.ap50) == (1.0, 0.125)


def test_a_proposal_that_fits_a_small_instance_is_not_wrong() -> None:
    # 90 of its 160 points are a small instance (IoU 90/160 = .5625), the rest are the chair's: fits at .25 .. .55.
    truth = cloud((90, 2, CHAIR), (200, 1, CHAIR))
    scores = agnostic([proposal(90, 290, 0.5), proposal(0, 160, 0.9)], truth)
    assert scores.ap50 == 1.0
    # From .60 on it fits nothing, and .5625 of it is ignored, which is not more than t: (1, 1/2), (0, 0), (0, 1) = 1/4.
    assert scores.ap == pytest.approx((2 + 7 / 4) / 9)


def test_scans_share_one_curve() -> None:
    # Scan A: right .6. Scan B: wrong .8, nothing right. Two instances: (1/2, 1/2), (0, 0), (0, 1): 1/8.
    a = ([proposal(0, 200, 0.6)], cloud((200, 1, CHAIR)))
    b = ([proposal(200, 400, 0.8)], cloud((200, 1, CHAIR), (200, 2, TABLE)))
    scores = average_precision([a, b], class_agnostic=False)
    # B's proposal is a chair on a table: no overlap with a chair, not void: wrong.
    assert scores.by_class[CHAIR].ap == pytest.approx(1 / 8)
    # The table has no proposal: 0. The mean is over both classes.
    assert scores.by_class[TABLE].ap == 0.0
    assert scores.ap == pytest.approx(1 / 16)


def test_groups_are_means_of_their_classes() -> None:
    truth = cloud((200, 1, CHAIR), (200, 2, TABLE), (200, 3, PLATE), (200, 4, NUMBER_OF["bed"]))
    lamp = NUMBER_OF["lamp"]
    found = [proposal(0, 200), proposal(200, 400, category=TABLE), proposal(200, 400, 0.5, lamp)]
    scores = average_precision([(found, truth)], class_agnostic=False)
    # Head: chair 1, bed 0. Common: dining table 1. Tail: plate 0. A lamp that is nowhere has no score and costs nothing.
    assert (scores.groups["head"].ap, scores.groups["common"].ap, scores.groups["tail"].ap) == (0.5, 1.0, 0.0)
    assert scores.ap == 0.5
    assert math.isnan(scores.by_class[lamp].ap)
    assert average_precision([(found, truth)], class_agnostic=True).groups == {}


def test_classes_that_are_not_scored_are_void() -> None:
    wall = NUMBER_OF["wall"]
    assert wall not in INSTANCE_CLASSES
    truth = cloud((200, 1, CHAIR), (400, 2, wall))
    found = [proposal(0, 200, 0.5), proposal(200, 600, 0.9, wall), proposal(250, 550, 0.9)]
    scores = average_precision([(found, truth)], class_agnostic=False, classes=INSTANCE_CLASSES)
    assert set(scores.by_class) == {CHAIR}
    assert scores.ap == 1.0
    assert average_precision([(found, truth)], class_agnostic=True, classes=INSTANCE_CLASSES).ap == 1.0


def test_nothing_to_find_is_not_a_number() -> None:
    nothing = agnostic([proposal(0, 100)], cloud((300, 0, 0)))
    assert all(math.isnan(value) for value in (nothing.ap, nothing.ap50, nothing.ap25))
    assert math.isnan(average_precision([], class_agnostic=False).ap)
    assert agnostic([], cloud((300, 1, CHAIR))).ap == 0.0


def test_bad_input_is_refused() -> None:
    truth = cloud((200, 1, CHAIR))
    with pytest.raises(ValueError, match="point 200, expected < 200"):
        agnostic([proposal(100, 201)], truth)
    for indices in ([3, 2], [2, 2], [-1, 2]):
        with pytest.raises(ValueError, match="ascending"):
            Proposal(np.array(indices), 1.0, CHAIR)
    with pytest.raises(ValueError, match="confidence"):
        proposal(0, 5, math.nan)
    with pytest.raises(ValueError, match=r"\(N, 3\)"):
        LabelledCloud(truth.points[1:], truth.instance, truth.category)
    with pytest.raises(ValueError, match="whole numbers"):
        LabelledCloud(truth.points, -truth.instance, truth.category)


def test_class_numbers_are_the_benchmarks() -> None:
    # Both ends and the gaps, as the benchmark publishes them.
    known = {
        1: "wall",
        2: "chair",
        3: "floor",
        13: "pillow",
        29: "kitchen cabinet",
        261: "sign",
        1163: "object",
        1191: "mattress",
    }
    assert {n: NAME_OF[n] for n in known} == known
    assert (len(NAME_OF), len(INSTANCE_CLASSES)) == (200, 198)
    assert category_number("corner sofa") == NUMBER_OF["couch"]
    assert category_number("no such thing") == 0


SIZES = st.lists(st.integers(1, 8), min_size=1, max_size=5)


@st.composite
def scan(draw: st.DrawFn) -> tuple[list[Proposal], LabelledCloud]:
    """A small scan in which sizes, overlaps and confidences tie often."""
    runs = [(n, i + 1 if draw(st.integers(0, 4)) else 0, draw(st.integers(0, 2))) for i, n in enumerate(draw(SIZES))]
    truth = cloud(*runs)
    n = len(truth)
    found = []
    for _ in range(draw(st.integers(0, 6))):
        chosen = draw(st.sets(st.integers(0, n - 1), max_size=n))
        confidence = draw(st.sampled_from([0.1, 0.5, 0.9]))
        found.append(Proposal(np.array(sorted(chosen), np.int64), confidence, draw(st.integers(0, 2))))
    return found, truth


def same(a: APScores, b: APScores) -> bool:
    return repr(a) == repr(b)


@given(st.lists(scan(), max_size=3), st.booleans(), st.randoms(use_true_random=False))
def test_the_order_of_proposals_and_scans_does_not_matter(
    scans: list[tuple[list[Proposal], LabelledCloud]], class_agnostic: bool, random: object
) -> None:
    def score(given: list[tuple[list[Proposal], LabelledCloud]]) -> APScores:
        return average_precision(given, class_agnostic=class_agnostic, min_points=3)

    shuffled = [(random.sample(found, len(found)), truth) for found, truth in scans]  # type: ignore[attr-defined]
    shuffled = random.sample(shuffled, len(shuffled))  # type: ignore[attr-defined]
    assert same(score(scans), score(shuffled))


def plain_ap(
    scans: list[tuple[list[Proposal], LabelledCloud]], threshold: float, category: int, smallest: int
) -> float:
    """The module's description, sentence by sentence, for one class (0 = all) and threshold."""
    judged: list[tuple[float, bool]] = []
    wanted = 0
    for found, truth in scans:
        void, things = set[int](), dict[tuple[int, int], set[int]]()
        for point, (i, c) in enumerate(zip(truth.instance.tolist(), truth.category.tolist(), strict=True)):
            if i == 0 or c == 0:
                void.add(point)
            else:
                things.setdefault((0 if category == 0 else c, i), set()).add(point)
        own = [points for (c, _), points in sorted(things.items()) if c == category]
        large = [points for points in own if len(points) >= smallest]
        small = [points for points in own if len(points) < smallest]
        wanted += len(large)
        looked = [
            (p.confidence, set(p.indices.tolist()))
            for p in found
            if len(p.indices) >= smallest and category in (0, p.category)
        ]
        looked.sort(key=lambda p: (-p[0], -len(p[1]), sorted(p[1])))
        taken = set[int]()
        for points in large:
            fitting = [
                k
                for k, (_, mine) in enumerate(looked)
                if k not in taken and len(mine & points) / len(mine | points) > threshold
            ]
            judged += [(looked[k][0], n == 0) for n, k in enumerate(fitting)]
            taken.update(fitting[:1])
        for confidence, mine in looked:
            if any(len(mine & points) / len(mine | points) > threshold for points in own):
                continue
            ignored = len(mine & void) + sum(len(mine & points) for points in small)
            if ignored / len(mine) <= threshold:
                judged.append((confidence, False))
    if wanted == 0:
        return math.nan
    # The benchmark's sum: precision times half the recall between the neighbours; the first point doubled, (0, 1) last.
    curve = []
    for level in sorted({confidence for confidence, _ in judged}):
        above = [right for confidence, right in judged if confidence >= level]
        curve.append((sum(above) / wanted, sum(above) / len(above)))
    if not curve:
        return 0.0
    recall = [curve[0][0], *(r for r, _ in curve), 0.0, 0.0]
    precision = [*(p for _, p in curve), 1.0]
    return sum(p * (recall[k] - recall[k + 2]) / 2 for k, p in enumerate(precision))


@given(st.lists(scan(), max_size=3), st.sampled_from([1, 3]))
def test_scores_are_those_of_the_plain_twin(scans: list[tuple[list[Proposal], LabelledCloud]], smallest: int) -> None:
    for class_agnostic, categories in ((True, (0,)), (False, (1, 2))):
        scores = average_precision(scans, class_agnostic=class_agnostic, min_points=smallest)
        for category in categories:
            for n, threshold in enumerate(THRESHOLDS):
                expected = plain_ap(scans, threshold, category, smallest)
                value = scores.by_class[category].by_threshold[n] if category in scores.by_class else math.nan
                assert value == pytest.approx(expected, nan_ok=True)
