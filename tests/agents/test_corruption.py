"""Masks made bad on purpose: always disjoint, never where there is no depth, and each knob does what it says and no more."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from openmap_agents.perception.corruption import TYPICAL, Corruption, corrupt

KNOBS = {"merge": 1.0, "merge_structure": 1.0, "drop": 1.0, "drop_structure": 1.0, "split": 1.0, "split_structure": 1.0,
         "spurious": 1.0, "warp": 6.0, "grow": 4.0}  # fmt: skip
ROOM = np.kron(
    np.array([[1, 1, 2, 2], [1, 3, 3, 2], [0, 3, 4, 4], [5, 5, 4, 0]], np.int32), np.ones((60, 80), np.int32)
)
FAR = np.full(ROOM.shape, 2.0, np.float32)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@st.composite
def pictures(draw) -> tuple[np.ndarray, np.ndarray]:
    """Labels of rectangles that lie over each other, with gaps in their numbers, and a depth with holes."""
    height, width = draw(st.integers(1, 50)), draw(st.integers(1, 60))
    own = rng(draw(st.integers(0, 2**32 - 1)))
    labels = np.zeros((height, width), np.int32)
    for label in own.permutation(40)[: draw(st.integers(0, 8))]:
        (top, bottom), (left, right) = (np.sort(own.integers(0, n + 1, 2)) for n in (height, width))
        labels[top:bottom, left:right] = label + 1
    depth = np.where(own.random(labels.shape) < 0.1, draw(st.sampled_from([0.0, -1.0, np.nan])), own.random() + 1.0)
    return labels, depth.astype(np.float32)


@st.composite
def corruptions(draw) -> Corruption:
    chosen = {name: draw(st.floats(0, top)) for name, top in KNOBS.items() if draw(st.booleans())}
    return Corruption(**chosen, split_area=draw(st.sampled_from([0.0, 2500.0])), split_structure_area=0.0)


def partition(labels: np.ndarray) -> set[bytes]:
    return {(labels == i).tobytes() for i in np.unique(labels[labels > 0])}


@given(pictures(), corruptions(), st.integers(0, 2**32))
@settings(max_examples=150, deadline=None)
def test_what_comes_out_is_numbered_without_gaps_lies_on_depth_and_comes_again(picture, how, seed):
    labels, depth = picture
    before = labels.copy()
    structure = np.unique(labels)[::2]
    out = corrupt(labels, depth, rng(seed), how, structure)
    assert out.dtype == np.int32
    assert out.shape == labels.shape
    assert set(np.unique(out)) - {0} == set(range(1, out.max(initial=0) + 1))
    assert not out[~(depth > 0)].any()
    np.testing.assert_array_equal(labels, before)
    assert corrupt(labels, depth, rng(seed), how, structure).tobytes() == out.tobytes()


@given(pictures(), st.integers(0, 2**32))
@settings(max_examples=60, deadline=None)
def test_settings_of_zero_change_nothing(picture, seed):
    labels, _ = picture
    out = corrupt(labels, np.ones(labels.shape), rng(seed), Corruption())
    np.testing.assert_array_equal(np.unique(labels[labels > 0])[out[out > 0] - 1], labels[labels > 0])
    np.testing.assert_array_equal(out > 0, labels > 0)


@given(pictures(), st.floats(0, 6), st.floats(0, 4), st.integers(0, 2**32))
@settings(max_examples=100, deadline=None)
def test_edges_move_no_farther_than_asked(picture, warp, grow, seed):
    """Read back by what a label was: no pixel may take a label from farther away than warp and growth (and rounding) reach."""
    labels, _ = picture
    out = corrupt(labels, np.ones(labels.shape), rng(seed), Corruption(warp=warp, grow=grow))
    reach = (warp + 0.75 if warp else 0.0) + (grow + 0.5 if grow else 0.0)
    masks = [np.equal(labels, i) for i in np.unique(labels[labels > 0])]
    near = [distance_transform_edt(~mask) <= reach for mask in masks]
    for mask in (out == i for i in range(1, out.max(initial=0) + 1)):
        assert any(not (mask & ~there).any() for there in near)


@given(pictures(), st.integers(0, 2**32), st.sampled_from(["merge", "drop", "split"]))
@settings(max_examples=100, deadline=None)
def test_merging_unites_dropping_removes_and_splitting_cuts(picture, seed, what):
    labels, _ = picture
    how = Corruption(**{what: 0.5}, split_area=0.0)
    out = corrupt(labels, np.ones(labels.shape), rng(seed), how)
    before, after = partition(labels), partition(out)
    if what == "drop":
        assert after <= before
        return
    np.testing.assert_array_equal(out > 0, labels > 0)
    coarse, fine = (out, labels) if what == "merge" else (labels, out)
    for i in range(1, fine.max(initial=0) + 1):
        assert len(np.unique(coarse[fine == i])) <= 1


@given(pictures(), st.integers(0, 2**32), st.floats(0, 1), st.floats(0, 1))
@settings(max_examples=60, deadline=None)
def test_what_was_dropped_stays_dropped_when_more_is(picture, seed, a, b):
    labels, depth = picture
    few, many = (corrupt(labels, depth, rng(seed), Corruption(drop=p)) for p in sorted((a, b)))
    assert partition(many) <= partition(few)


def test_dropping_everything_leaves_nothing_and_structure_has_chances_of_its_own():
    assert not corrupt(ROOM, FAR, rng(), Corruption(drop=1.0, drop_structure=1.0), [1, 2]).any()
    kept = corrupt(ROOM, FAR, rng(), Corruption(drop=1.0), [1, 2])
    np.testing.assert_array_equal(kept, np.where(ROOM <= 2, ROOM, 0))


def test_everything_that_touches_becomes_one_and_what_stands_alone_stays():
    joined = corrupt(ROOM, FAR, rng(), Corruption(merge=1.0))
    assert joined.max() < 5
    alone = np.zeros((40, 40), np.int32)
    alone[5:10, 5:10], alone[20:30, 20:30] = 1, 2
    np.testing.assert_array_equal(corrupt(alone, np.ones((40, 40)), rng(), Corruption(merge=1.0)), alone)


def test_only_large_masks_are_cut_and_into_as_many_pieces_as_asked():
    labels = np.ones((480, 640), np.int32)
    labels[:40, :50] = 2  # 2,000 px
    for pieces in (2, 3):
        seen = set()
        for seed in range(12):
            out = corrupt(labels, FAR_VGA, rng(seed), Corruption(split=1.0, split_pieces=(pieces, pieces)))
            assert len(np.unique(out[labels == 2])) == 1
            seen.add(len(np.unique(out[labels == 1])))
        # A cut by depth finds nothing to cut in a flat thing.
        assert seen == {1, pieces}
    counts = {int(corrupt(labels, SLOPE, rng(s), Corruption(split_structure=1.0), [1]).max()) - 1 for s in range(40)}
    assert counts == {1, 2, 3, 4}


FAR_VGA = np.full((480, 640), 3.0, np.float32)
SLOPE = np.tile(np.linspace(1.0, 5.0, 640, dtype=np.float32), (480, 1))


def test_half_of_the_cuts_go_by_depth_and_colour():
    labels = np.ones((120, 160), np.int32)
    depth = np.full(labels.shape, 1.0, np.float32)
    depth[:, 100:] = 2.0
    by_depth = sum(
        partition(corrupt(labels, depth, rng(s), Corruption(split=1.0, split_pieces=(2, 2))))
        == partition((depth > 1) + 1)
        for s in range(200)
    )
    assert 70 <= by_depth <= 130
    rgb = np.zeros((120, 160, 3), np.uint8)
    rgb[:60] = 255
    flat = np.ones(labels.shape, np.float32)
    halves = [corrupt(labels, flat, rng(s), Corruption(split=1.0, split_pieces=(2, 2)), rgb=rgb) for s in range(60)]
    by_colour = [
        h for h in halves if h.max() == 2 and (np.ptp(h, axis=1) == 0).all() and abs((h == h[0, 0]).sum(0)[0] - 60) < 6
    ]
    assert 15 <= len(by_colour) <= 45


def test_a_blob_is_one_more_mask_in_as_many_pictures_as_asked():
    more = [int(corrupt(ROOM, FAR, rng(s), Corruption(spurious=0.15)).max()) - 5 for s in range(400)]
    assert set(more) == {0, 1}
    assert 35 <= sum(more) <= 85


def test_one_knob_leaves_alone_what_the_others_do():
    for seed in range(5):
        both = corrupt(ROOM, FAR, rng(seed), Corruption(warp=3.0, drop=0.4))
        warped = corrupt(ROOM, FAR, rng(seed), Corruption(warp=3.0))
        assert partition(both) <= partition(warped)


def test_a_mask_grows_over_others_by_what_it_was_given():
    labels = np.zeros((60, 60), np.int32)
    labels[20:40, 20:40] = 1
    sizes = {int(corrupt(labels, np.ones((60, 60)), rng(s), Corruption(grow=4.0)).sum()) for s in range(40)}
    assert min(sizes) < 16 * 16
    assert max(sizes) > 24 * 24
    assert all(12 * 12 <= size <= 28 * 28 for size in sizes)


def test_the_typical_corruption_is_bad_but_not_hopeless():
    found = []
    for seed in range(30):
        out = corrupt(ROOM, FAR, rng(seed), TYPICAL, [1, 2])
        for i in range(1, 6):
            masks = [out == k for k in range(1, out.max() + 1)]
            true = np.equal(ROOM, i)
            found.append(max((m & true).sum() / (m | true).sum() for m in masks))
    assert 0.6 < np.mean(np.array(found) > 0.5) < 0.98


def test_the_same_seed_gives_the_same_bytes_in_another_process():
    code = (
        "import numpy as np, zlib\n"
        "from openmap_agents.perception.corruption import TYPICAL, corrupt\n"
        "r = np.kron(np.arange(12, dtype=np.int32).reshape(3, 4), np.ones((60, 80), np.int32))\n"
        "d = np.linspace(1, 3, r.size, dtype=np.float32).reshape(r.shape)\n"
        "print(zlib.crc32(corrupt(r, d, np.random.default_rng([7, 1]), TYPICAL, [1, 2]).tobytes()))\n"
    )
    results = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout for _ in "ab"
    }
    assert len(results) == 1
    assert results.pop().strip().isdecimal()


@pytest.mark.parametrize(
    "change",
    [
        {"merge": 1.1},
        {"drop": -0.1},
        {"warp": -1.0},
        {"grow": np.nan},
        {"split_pieces": (0, 2)},
        {"spurious_axes": (0, 1)},
    ],
)
def test_settings_out_of_range_are_named(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        replace(TYPICAL, **change)


def test_pictures_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="do not fit"):
        corrupt(ROOM, FAR[:5], rng())
    with pytest.raises(ValueError, match="do not fit"):
        corrupt(ROOM, FAR, rng(), rgb=np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(ValueError, match="expected 0 or more"):
        corrupt(ROOM - 1, FAR, rng())
