"""The yardstick: MaskClustering finds what it should find, and its sparse products are what its definition says."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from openmap_agents.baselines.maskclustering import (
    ClusteredInstance,
    Frame,
    MaskClusteringSettings,
    Masks,
    back_project,
    cluster,
    denoise,
    drop_overlapping,
    mask_clustering,
    observe,
    observer_schedule,
    split_node,
)
from openmap_scenes import PinholeCamera

CAMERA = PinholeCamera.from_hfov(180, 135, 75.0)
CODE = MaskClusteringSettings()
# A wall across the room and two things before it: label, min, max.
ROOM = [
    (1, (-2.0, -1.2, -3.1), (2.0, 1.2, -3.0)),
    (2, (-0.9, -0.4, -2.7), (-0.3, 0.3, -2.3)),
    (3, (0.3, -0.4, -2.7), (0.9, 0.3, -2.3)),
]


@cache
def look(x: float) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.float64]]:
    """Depth, true labels and pose, looking along -Z from (x, 0, 0) into the room."""
    rays, start = CAMERA.rays().astype(np.float64), np.array([x, 0.0, 0.0])
    depth, labels = np.full(rays.shape[:2], np.inf), np.zeros(rays.shape[:2], np.int32)
    for label, low, high in ROOM:
        with np.errstate(divide="ignore"):
            a, b = (np.array(low) - start) / rays, (np.array(high) - start) / rays
        near, far = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        hit = (near <= far) & (near > 0) & (near < depth)
        depth[hit], labels[hit] = near[hit], label
    T_world_camera = np.eye(4)
    T_world_camera[:3, 3] = start
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32), labels, T_world_camera


def walk(n: int = 6) -> list[Frame]:
    return [(depth, labels, None, T) for depth, labels, T in map(look, np.linspace(-0.5, 0.5, n).tolist())]


@cache
def scan() -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """A finished cloud of the room, one point in every 2.5 cm voxel, and its labels."""
    points, labels = [], []
    for depth, label, T in map(look, np.linspace(-0.6, 0.6, 7).tolist()):
        points.append(CAMERA.unproject(depth, T)[label > 0])
        labels.append(label[label > 0])
    cloud = np.concatenate(points)
    _, first = np.unique(np.floor(cloud / 0.025).astype(np.int64), axis=0, return_index=True)
    return cloud[first], np.concatenate(labels)[first]


def iou(found: ClusteredInstance, true: npt.NDArray[np.bool_]) -> float:
    mine = np.isin(np.arange(len(true)), found.points_index)
    return float((mine & true).sum() / (mine | true).sum())


def owners(found: list[ClusteredInstance]) -> list[set[int]]:
    return sorted((set(i.views[:, 1].tolist()) for i in found), key=min)


def test_each_thing_becomes_one_instance() -> None:
    cloud, labels = scan()
    frames = [(d, m, np.eye(4, dtype=np.float32), T) for d, m, _, T in walk()]
    found = mask_clustering(CAMERA, frames, cloud)
    large = [i for i in found if len(i.points_index) > 100]
    assert owners(large) == [{1}, {2}, {3}]
    for instance in large:
        label = int(instance.views[0, 1])
        assert iou(instance, labels == label) > 0.8
        assert instance.views[:, 0].tolist() == list(range(6))
        assert (np.diff(instance.points_index) > 0).all()
        assert instance.confidence == 1.0
        assert instance.feature is not None
        np.testing.assert_allclose(instance.feature, np.eye(4)[label - 1], atol=1e-6)


def test_a_mask_that_spans_two_things_is_dropped() -> None:
    cloud, labels = scan()
    frames = walk(8)
    depth, masks, _, T = frames[4]
    frames[4] = (depth, np.where(np.asarray(masks) == 3, 2, masks), None, T)
    found = mask_clustering(CAMERA, frames, cloud)
    for thing in (2, 3):
        best = max(found, key=lambda i: iou(i, labels == thing))
        assert iou(best, labels == thing) > 0.8
        assert best.views[:, 1].tolist() == [thing] * 7
        assert 4 not in best.views[:, 0]
    assert not any((i.views == (4, 2)).all(1).any() for i in found)


def test_same_frames_give_same_bytes() -> None:
    cloud, _ = scan()
    a, b = (mask_clustering(CAMERA, iter(walk()), cloud) for _ in range(2))
    assert [(i.points_index.tobytes(), i.views.tobytes()) for i in a] == [
        (i.points_index.tobytes(), i.views.tobytes()) for i in b
    ]


def test_a_lost_pose_is_passed_over_and_counted() -> None:
    cloud, _ = scan()
    frames = walk()
    frames[2] = (*frames[2][:3], np.full((4, 4), -np.inf))
    seen = {int(t) for i in mask_clustering(CAMERA, frames, cloud) for t in i.views[:, 0]}
    assert seen == {0, 1, 3, 4, 5}


def test_nothing_gives_nothing() -> None:
    cloud, _ = scan()
    assert mask_clustering(CAMERA, [], cloud) == []
    assert mask_clustering(CAMERA, walk(), np.zeros((0, 3), np.float32)) == []
    assert mask_clustering(CAMERA, [(d, np.zeros_like(m), f, T) for d, m, f, T in walk()], cloud) == []


def test_what_cannot_be_used_is_refused() -> None:
    with pytest.raises(ValueError, match="cloud"):
        mask_clustering(CAMERA, [], np.zeros((3, 2), np.float32))
    with pytest.raises(ValueError, match="cloud"):
        mask_clustering(CAMERA, [], np.full((3, 3), np.nan, np.float32))
    with pytest.raises(ValueError, match="semantics"):
        MaskClusteringSettings(semantics="cosine")  # type: ignore[arg-type]


def test_noise_filters_leave_the_surface() -> None:
    """A square, a small patch apart from it, a thin spur on it, a stray point; each filter takes its own."""
    plane = np.stack(np.meshgrid(np.arange(34) * 0.03, np.arange(34) * 0.03, [0.0]), -1).reshape(-1, 3)
    patch = plane[(plane[:, 0] < 0.2) & (plane[:, 1] < 0.2)] + np.array([2.0, 0, 0])
    spur = np.stack(np.meshgrid([0.48, 0.51], [0.48], np.arange(1, 11) * 0.03), -1).reshape(-1, 3)
    everything = np.concatenate([plane, patch, spur, [[0.5, 0.5, 3.0]]])

    def clean(choice: MaskClusteringSettings) -> npt.NDArray[np.float64]:
        return denoise(everything, choice)

    assert len(clean(CODE)) > 0.9 * len(plane)
    assert clean(CODE)[:, 0].max() < 1
    assert clean(CODE)[:, 2].max() < 0.15
    assert clean(replace(CODE, min_component=0.01))[:, 0].max() > 2
    assert 0.25 < clean(replace(CODE, outlier_sigma=1e9))[:, 2].max() < 1


def test_the_query_takes_the_first_points_by_index() -> None:
    """Against all distances, on a cloud so dense that the limit of neighbours binds."""
    rng = np.random.default_rng(3)
    cloud = rng.uniform((-0.6, -0.4, -2.33), (0.3, 0.3, -2.27), (40_000, 3))
    depth, labels, T = look(0.0)
    frame = (depth + rng.normal(0, 0.005, depth.shape).astype(np.float32), np.where(labels == 2, 2, 0), None, T)
    mask = denoise(CAMERA.unproject(frame[0], T)[labels == 2].astype(np.float64), CODE)
    for margin in (CODE.box_margin, 0.0):
        masks = back_project(CAMERA, [frame], cloud, replace(CODE, box_margin=margin))
        low, high = mask.min(0) - margin, mask.max(0) + margin
        cropped = np.flatnonzero(((cloud > low) & (cloud < high)).all(1))
        expected: set[int] = set()
        for point in mask:
            near = cropped[np.linalg.norm(cloud[cropped] - point, axis=1) <= CODE.radius]
            expected |= set(near[: CODE.max_neighbours].tolist())
        assert len(expected) > 500
        assert [set(p.tolist()) for p in masks.points] == [expected]
    elsewhere = cloud + np.array([0.2, 0, 0])
    assert back_project(CAMERA, [frame], elsewhere, CODE).points == [], (
        "a mask stayed of which the cloud has too little"
    )


def test_the_codes_crop_deletes_flat_masks() -> None:
    """Why it is not the default: seen from the front, the front of a box lies in no open box around itself."""
    depth, labels, T = look(0.0)
    frame, cloud = (depth, np.where(labels == 2, 2, 0), None, T), scan()[0].astype(np.float64)
    assert len(back_project(CAMERA, [frame], cloud, CODE).points) == 1
    assert back_project(CAMERA, [frame], cloud, replace(CODE, box_margin=0.0)).points == []


@st.composite
def recordings(draw: st.DrawFn) -> tuple[Masks, int]:
    """Random masks over a few points: some frames part them alike, some badly, some masks overlap."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n_points, n_frames, noise = 40, draw(st.integers(1, 7)), draw(st.sampled_from([0.0, 0.2, 0.6]))
    things = rng.integers(0, 4, n_points)
    origin, points = [], []
    for t in range(n_frames):
        label = np.where(rng.random(n_points) < noise, rng.integers(0, 5, n_points), things)
        label = np.where(rng.random(n_points) < 0.3, 0, label)
        if rng.random() < noise:
            label[label == 3] = 2
        for name in np.unique(label[label > 0]).tolist():
            extra = rng.random(n_points) < noise / 10
            origin.append((t, name))
            points.append(np.flatnonzero((label == name) | extra).astype(np.int32))
    pairs = np.array(origin, np.int32).reshape(-1, 2)
    feature = rng.integers(0, 2, (len(points), 2)).astype(np.float32)
    return Masks(pairs[:, 0], pairs[:, 1], points, feature, n_frames), n_points


def matrix(masks: Masks, n_points: int) -> sparse.csr_matrix:
    dense = np.zeros((len(masks.points), n_points), np.int32)
    for k, points in enumerate(masks.points):
        dense[k, points] = 1
    return sparse.csr_matrix(dense)


def plain_observe(masks: Masks, choice: MaskClusteringSettings) -> list[tuple[set[int], set[int], bool]]:
    """Frames and masks that contain each mask, and whether it is sound, in sets and loops."""
    sets, of_frame = [set(p.tolist()) for p in masks.points], masks.frame.tolist()
    boundary = {
        p for i, a in enumerate(sets) for j, b in enumerate(sets[:i]) if of_frame[i] == of_frame[j] for p in a & b
    }
    result = []
    for own in sets:
        inner, frames, containers, n_seen, n_split = own - boundary, set(), set(), 0, 0
        for t in range(masks.n_frames):
            held = {j: len(inner & sets[j]) for j in range(len(sets)) if of_frame[j] == t}
            total = sum(held.values())
            if total == 0 or (total / len(inner) < choice.tau_visible and total < choice.min_visible):
                continue
            n_seen += 1
            best = max(held, key=lambda j: held[j])
            if held[best] / total > choice.tau_contained:
                frames.add(t)
                containers.add(best)
            else:
                n_split += 1
        result.append((frames, containers, n_seen > 0 and n_split / n_seen <= choice.tau_undersegmented))
    for bad in [k for k, (_, _, sound) in enumerate(result) if not sound]:
        for frames, containers, _ in result:
            if bad in containers:
                containers.remove(bad)
                frames.remove(of_frame[bad])
    return result


CHOICES = [
    CODE,
    replace(CODE, min_visible=6, tau_contained=0.6),
    replace(CODE, tau_undersegmented=0.6, semantics="product"),
]


@settings(max_examples=100, deadline=None)
@given(recording=recordings(), choice=st.sampled_from(CHOICES))
def test_products_are_the_plain_sets(recording: tuple[Masks, int], choice: MaskClusteringSettings) -> None:
    masks, n_points = recording
    if not masks.points:
        return
    visible, containers, sound = observe(masks, matrix(masks, n_points), choice)
    plain = plain_observe(masks, choice)
    assert [set(np.flatnonzero(row).tolist()) for row in visible] == [frames for frames, _, _ in plain]
    assert [set(np.flatnonzero(row).tolist()) for row in containers.toarray()] == [held for _, held, _ in plain]
    assert sound.tolist() == [s for _, _, s in plain]

    common = visible @ visible.T
    schedule: list[float] = []
    for percent in range(95, -5, -5):
        value = float(np.percentile(common[common > 0], percent)) if (common > 0).any() else 0.0
        if value <= 1 and percent < 50:
            break
        schedule.append(max(value, 1.0))
    assert observer_schedule(visible) == pytest.approx(schedule, abs=1e-6)
    assert np.ceil(observer_schedule(visible)).tolist() == np.ceil(schedule).tolist()

    nodes = [({k}, set(f), set(c)) for k, (f, c, good) in enumerate(plain) if good]
    for n_o in observer_schedule(visible):
        nodes = plain_round(nodes, n_o, masks, choice)
    rows, owner = cluster(masks, visible, containers, sound, choice)
    assert [set(np.flatnonzero(owner == n).tolist()) for n in range(len(rows))] == [members for members, _, _ in nodes]
    assert [set(np.flatnonzero(row).tolist()) for row in rows] == [frames for _, frames, _ in nodes]
    assert (owner[~sound] == -1).all()


PlainNode = tuple[set[int], set[int], set[int]]


def plain_round(nodes: list[PlainNode], n_o: float, masks: Masks, choice: MaskClusteringSettings) -> list[PlainNode]:
    name = list(range(len(nodes)))
    features = [masks.feature[max(sorted(m), key=lambda k: len(masks.points[k]))] for m, _, _ in nodes]
    for j, (_, frames_j, held_j) in enumerate(nodes):
        for i, (_, frames_i, held_i) in enumerate(nodes[:j]):
            observers, supporters = len(frames_i & frames_j), len(held_i & held_j)
            if observers < n_o or observers == 0:
                continue
            joined = 10 * supporters >= 9 * observers
            if choice.semantics == "product" and features[i].any() and features[j].any():
                joined = supporters / observers * float(features[i] @ features[j]) > choice.tau_product
            if joined:
                low, high = sorted((name[i], name[j]))
                name = [low if n == high else n for n in name]
    merged: dict[int, PlainNode] = {}
    for n, (members, frames, held) in zip(name, nodes, strict=True):
        into = merged.setdefault(n, (set(), set(), set()))
        for own, more in zip(into, (members, frames, held), strict=True):
            own |= more
    return list(merged.values())


def test_supporters_are_masks_and_may_outnumber_observers() -> None:
    """Two masks of one frame contain both nodes, which only that frame sees: rate 2, so that a cosine of 0.4 is enough."""
    product = replace(CODE, semantics="product")
    feature = np.array([[1, 0], [0.4, np.sqrt(1 - 0.16)], [0, 0], [0, 0]], np.float32)
    points = [np.arange(5, dtype=np.int32)] * 4
    masks = Masks(np.array([0, 1, 2, 2], np.int32), np.array([1, 1, 1, 2], np.int32), points, feature, 3)
    visible = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 0]], np.float32)
    sound = np.array([True, True, False, False])

    def nodes(containers: list[list[int]]) -> int:
        return len(cluster(masks, visible, sparse.csr_matrix(np.array(containers, np.float32)), sound, product)[0])

    nothing = [[0, 0, 0, 0], [0, 0, 0, 0]]
    assert nodes([[0, 0, 1, 1], [0, 0, 1, 1], *nothing]) == 1
    assert nodes([[0, 0, 1, 0], [0, 0, 1, 0], *nothing]) == 2


def test_a_node_is_split_and_its_noise_kept() -> None:
    """Two blobs 1 m apart in the same masks, and stray points; one blob has points that only one frame of three shows as its."""
    blob = np.stack(np.meshgrid(*[np.arange(4) * 0.05] * 3), -1).reshape(-1, 3)
    stray = np.array([[3.0, 0, 0], [4.0, 0, 0]])
    cloud = np.concatenate([blob, blob + np.array([1.0, 0, 0]), stray])
    everything = np.arange(len(cloud), dtype=np.int32)
    fewer = everything[5:]
    frame, label = np.arange(6, dtype=np.int32), np.full(6, 4, np.int32)
    first, second, dust = everything[:64], everything[64:128], everything[128:]
    sets = [first, fewer[:59], fewer[:59], second, np.concatenate([second[:9], dust]), dust]
    masks = Masks(frame, label, sets, np.zeros((6, 0), np.float32), 6)
    seen = sparse.csr_matrix(np.ones((len(cloud), 6), np.int32))
    node = np.array([1, 1, 1, 0, 0, 0], np.float32)
    pieces = split_node(np.arange(3), node, masks, seen, cloud, CODE)
    assert [p.points_index.tolist() for p in pieces] == [list(range(5, 64))]
    assert pieces[0].views.tolist() == [[0, 4], [1, 4], [2, 4]]
    assert pieces[0].feature is None
    alone = sparse.csr_matrix(np.eye(6, dtype=np.int32)[[0] * 64 + [3] * 64 + [5] * 2])
    pieces = split_node(np.arange(6), np.ones(6, np.float32), masks, alone, cloud, replace(CODE, min_masks=1))
    assert [p.points_index.tolist() for p in pieces] == [dust.tolist(), first.tolist(), second.tolist()]
    pieces = split_node(np.arange(6), np.ones(6, np.float32), masks, alone, cloud, CODE)
    assert [p.views[:, 0].tolist() for p in pieces] == [[0, 1, 2], [3, 4]]


def test_overlapping_objects() -> None:
    def thing(first: int, last: int) -> ClusteredInstance:
        return ClusteredInstance(np.arange(first, last), np.zeros((2, 2), np.int32), None)

    def left(*things: ClusteredInstance) -> list[tuple[int, int]]:
        return [(int(o.points_index[0]), int(o.points_index[-1]) + 1) for o in drop_overlapping(list(things), 100, 0.8)]

    assert left(thing(0, 10), thing(0, 8)) == [(0, 10)]
    assert left(thing(0, 8), thing(0, 10)) == [(0, 10)]
    assert left(thing(0, 10), thing(2, 12)) == [(0, 10), (2, 12)]
    assert left(thing(0, 10), thing(0, 10)) == [(0, 10)]
    # The first lies in the second, yet takes the third with it.
    assert left(thing(10, 20), thing(0, 19), thing(16, 20)) == [(0, 19)]
    assert left(thing(0, 19), thing(16, 20)) == [(0, 19), (16, 20)]
    assert left() == []
