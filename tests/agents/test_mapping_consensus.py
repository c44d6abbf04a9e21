"""The steps of the online map, one by one, on inputs that walks seldom give: they equal the reference's."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.mapping import MappingSettings, consensus, instances, reference
from openmap_agents.mapping.semantics import SemanticWeight

WEIGHTS = [SemanticWeight(0, 0.5), SemanticWeight(1, 0.5), SemanticWeight(2, 0.5, 4.0, -1.0, 0.5)]


@st.composite
def node_graphs(draw: st.DrawFn) -> tuple[reference.Recording, list[reference.Node]]:
    """Nodes as they are in mid-merge: several members, and several containers in one frame."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n_frames, n_nodes = int(rng.integers(1, 6)), draw(st.integers(1, 8))
    masks = [
        reference.Mask(f, k, set(range(int(rng.integers(1, 5)))), rng.integers(-1, 3, 2).astype(np.float32))
        for f in range(n_frames)
        for k in range(int(rng.integers(1, 4)))
    ]
    for mask in masks:
        assert mask.feature is not None
        mask.feature /= max(1.0, float(np.linalg.norm(mask.feature)))
    members: list[list[int]] = [[] for _ in range(n_nodes)]
    for k in range(len(masks)):
        members[int(rng.integers(n_nodes))].append(k)
    nodes = []
    for own in filter(None, members):
        observers = set(np.flatnonzero(rng.random(n_frames) < 0.8).tolist())
        containers = {k for k, m in enumerate(masks) if m.frame in observers and rng.random() < 0.5}
        nodes.append(reference.Node(own, observers, containers))
    return reference.Recording(masks), nodes


def rows(sets: list[set[int]]) -> consensus.Rows:
    start = np.concatenate([[0], np.cumsum([len(s) for s in sets])]).astype(np.int64)
    return consensus.Rows(start, np.array([v for s in sets for v in sorted(s)], np.int32))


def as_rows(nodes: list[reference.Node], recording: reference.Recording) -> consensus.Nodes:
    return consensus.Nodes(
        np.array([reference.representative(n, recording) for n in nodes], np.int32),
        rows([set(n.members) for n in nodes]),
        rows([n.observers for n in nodes]),
        rows([n.containers for n in nodes]),
    )


def as_sets(nodes: consensus.Nodes) -> set[tuple[tuple[int, ...], ...]]:
    columns = (nodes.members, nodes.observers, nodes.containers)
    return {tuple(tuple(c.row(i).tolist()) for c in columns) for i in range(len(nodes))}


@settings(max_examples=300, deadline=None)
@given(graph=node_graphs(), n_o=st.integers(0, 3), weight=st.sampled_from(WEIGHTS))
def test_a_merge_round_joins_what_the_plain_one_joins(
    graph: tuple[reference.Recording, list[reference.Node]], n_o: int, weight: SemanticWeight
) -> None:
    recording, nodes = graph
    frame = np.array([m.frame for m in recording.masks], np.int32)
    size = np.array([len(m.voxels) for m in recording.masks], np.int32)
    features = np.array([m.feature for m in recording.masks], np.float32)
    merged = consensus.merge_round(as_rows(nodes, recording), n_o, frame, size, int(frame.max()) + 1, features, weight)
    expected = reference.merge_round(nodes, n_o, recording, weight)
    assert as_sets(merged) == as_sets(as_rows(expected, recording))
    own = {tuple(merged.members.row(i).tolist()): int(merged.representative[i]) for i in range(len(merged))}
    assert own == {tuple(sorted(n.members)): reference.representative(n, recording) for n in expected}


@settings(max_examples=200, deadline=None)
@given(graph=node_graphs(), start=st.integers(0, 100), step=st.integers(1, 40))
def test_the_schedule_falls_as_the_plain_one_does(
    graph: tuple[reference.Recording, list[reference.Node]], start: int, step: int
) -> None:
    recording, nodes = graph
    choice = MappingSettings(observer_start=start, observer_step=step)
    found = consensus.observer_schedule(as_rows(nodes, recording), 6, choice)
    assert found == reference.observer_schedule(nodes, choice)
    assert found[-1] == 1
    assert found == sorted(found, reverse=True)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.5, 0.8, 1.0]))
def test_duplicates_are_dropped_as_the_plain_way_drops_them(seed: int, tau_overlap: float) -> None:
    rng = np.random.default_rng(seed)
    n_voxels, n = 12, int(rng.integers(0, 7))
    sets = [frozenset(rng.choice(n_voxels, int(rng.integers(1, 11)), replace=False).tolist()) for _ in range(n)]
    plain = [reference.ReferenceInstance(frozenset({(k, 1)}), s, None) for k, s in enumerate(sets)]
    pieces = [
        instances.Piece(np.array([k], np.int32), np.array(sorted(s), np.int32), np.zeros((len(s), 3), np.float32), None)
        for k, s in enumerate(sets)
    ]
    choice = MappingSettings(tau_overlap=tau_overlap)
    kept = instances.drop_overlapping(pieces, n_voxels, choice)
    assert [plain[k] for k in kept] == reference.drop_overlapping(plain, choice)
