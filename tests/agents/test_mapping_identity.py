"""Ids that stay, and the log of what became of each."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.mapping.identity import BACK, BORN, GONE, JOINED, SPLIT, History, Identities

Partition = list[list[int]]
SIZE = np.array([5, 3, 8, 1, 9, 2, 7, 4, 6, 10, 3, 3], np.int32)


def ask(identities: Identities, partition: Partition, moment: int, size: np.ndarray = SIZE) -> list[int]:
    return identities.assign([np.array(p, np.int32) for p in partition], size, moment)


def test_an_instance_keeps_its_id_and_what_falls_into_it_is_logged() -> None:
    who = Identities()
    assert ask(who, [[0, 1], [2], [4]], 3) == [1, 2, 3]
    # Mask 2 has 8 voxels, and so have masks 0 and 1 together: the lower id has it.
    assert ask(who, [[4, 5], [0, 1, 2, 6]], 4) == [3, 1]
    assert who.history.tolist()[3:] == [[4, 2, 1, JOINED]]


def test_the_largest_part_keeps_the_id() -> None:
    who = Identities()
    assert ask(who, [[0, 1, 2, 4]], 0) == [1]
    assert ask(who, [[0, 1], [2, 4]], 1) == [2, 1]
    assert ask(who, [[0, 1, 2, 4]], 2) == [1]
    assert who.history.tolist() == [[0, 1, 0, BORN], [1, 2, 1, SPLIT], [2, 2, 1, JOINED]]
    history = History(who.history)
    assert (history.resolve(1), history.resolve(2), history.alive) == (1, 1, [1])
    with pytest.raises(KeyError, match="never had an instance 3"):
        history.resolve(3)


def test_what_is_gone_comes_back_only_with_most_of_itself() -> None:
    who = Identities()
    assert ask(who, [[0, 1, 2], [4]], 0) == [1, 2]
    assert ask(who, [[4]], 1) == [2]
    assert History(who.history).resolve(1) is None
    assert ask(who, [[4], [3, 1]], 2) == [2, 3]  # mask 1 is the smaller part of 1
    assert ask(who, [[4], [3, 1], [0, 2, 7]], 3) == [2, 3, 1]
    assert who.history.tolist()[2:] == [[1, 1, 0, GONE], [2, 3, 1, SPLIT], [3, 1, 0, BACK]]
    assert History(who.history).holders(1) == [1, 3]


def test_what_is_gone_may_turn_up_in_another() -> None:
    who = Identities()
    ask(who, [[0], [4]], 0)
    ask(who, [[4]], 1)
    assert ask(who, [[0, 4]], 2) == [2]
    assert who.history.tolist()[-2:] == [[1, 1, 0, GONE], [2, 1, 2, JOINED]]
    # It joined for good: by itself again, the mask is a part of the other.
    assert ask(who, [[0], [4]], 3) == [3, 2]
    assert History(who.history).resolve(1) == 2
    assert History(who.history).holders(1) == [2, 3]


def test_chains_are_followed_and_what_came_out_before_is_not_a_holder() -> None:
    who = Identities()
    ask(who, [[1], [0], [4]], 0)
    ask(who, [[1, 0], [4]], 1)
    ask(who, [[1, 0, 4]], 2)
    assert who.history.tolist()[3:] == [[1, 1, 2, JOINED], [2, 2, 3, JOINED]]
    history = History(who.history)
    assert [history.resolve(i) for i in (1, 2, 3)] == [3, 3, 3]
    who = Identities()
    ask(who, [[0, 2], [4]], 0)
    ask(who, [[0], [2], [4]], 1)  # 3 comes out of 1 ...
    ask(who, [[0], [2, 4]], 2)  # ... before 1 falls into 2
    history = History(who.history)
    assert who.history.tolist()[2:] == [[1, 3, 1, SPLIT], [2, 1, 2, JOINED]]
    assert (history.holders(1), history.holders(2), history.holders(3)) == ([2, 3], [2], [3])


def test_what_cannot_be_is_refused_and_changes_nothing() -> None:
    who = Identities()
    ask(who, [[0], [1]], 5)
    for partition, moment in (([[0, 1], [1]], 6), ([[]], 6), ([[12]], 6), ([[-1]], 6), ([[0]], 4)):
        with pytest.raises(ValueError, match=r"instance|moment"):
            ask(who, partition, moment)
    assert len(who.history) == 2
    assert ask(who, [[1], [0]], 5) == [2, 1]
    with pytest.raises(ValueError, match="read-only"):
        who.history[0] = 0


@pytest.mark.parametrize(
    "rows",
    [
        [[0, 1, 1, JOINED]],
        [[0, 1, 0, BORN], [0, 1, 0, BORN]],
        [[0, 0, 0, BORN]],
        [[0, -1, 0, BORN]],
        [[0, 1, 0, BORN], [0, 1, 1, JOINED]],
        [[0, 1, 0, BORN], [0, 2, 0, BORN], [0, 1, 2, JOINED], [0, 2, 1, JOINED]],
        [[0, 1, 0, BORN], [0, 2, 0, BORN], [0, 1, 2, JOINED], [0, 1, 0, BACK]],
        [[0, 1, 0, BORN], [0, 1, 0, GONE], [0, 2, 0, BORN], [0, 2, 1, JOINED]],
        [[0, 1, 0, BORN], [0, 1, 0, BACK]],
        [[0, 1, 0, BORN], [0, 2, 3, SPLIT]],
        [[3, 1, 0, BORN], [2, 2, 0, BORN]],
        [[0, 1, 0, 6]],
    ],
)
def test_a_log_that_no_map_could_have_written_is_refused(rows: list[list[int]]) -> None:
    with pytest.raises(ValueError, match="row"):
        History(np.array(rows, np.int32)).check()


def test_a_log_of_another_shape_is_refused() -> None:
    for rows in (np.zeros((2, 3), np.int32), np.zeros(4, np.int32), np.zeros((1, 4))):
        with pytest.raises(ValueError, match="history has shape"):
            History(rows)


@st.composite
def lives(draw: st.DrawFn) -> tuple[np.ndarray, list[Partition]]:
    """Sizes of some masks, many alike, and what is made of them from moment to moment: mostly the same, sometimes not."""
    n = draw(st.integers(1, 14))
    size = np.array(draw(st.lists(st.sampled_from([0, 1, 2, 2, 3, 9]), min_size=n, max_size=n)), np.int32)
    part = draw(st.lists(st.integers(0, 4), min_size=n, max_size=n))
    partitions = []
    for _ in range(draw(st.integers(1, 8))):
        for mask, to in draw(st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, 5)), max_size=4)):
            part[mask] = to
        if draw(st.integers(0, 4)) == 0:
            a, b = draw(st.integers(0, 5)), draw(st.integers(0, 5))
            part = [b if p == a else p for p in part]
        groups = [[m for m in range(n) if part[m] == p] for p in draw(st.permutations(range(1, 6)))]
        partitions.append([g for g in groups if g])
    return size, partitions


def plainly(owner: dict[int, int], alive: set[int], partition: Partition, size: np.ndarray) -> list[int | None]:
    """The rule of who keeps what, in dictionaries; None = a new id."""
    weight = {m: max(int(size[m]), 1) for m in range(len(size))}
    claims = []
    for p, masks in enumerate(partition):
        for known in {owner[m] for m in masks if m in owner}:
            share = sum(weight[m] for m in masks if owner.get(m) == known)
            whole = sum(weight[m] for m in owner if owner[m] == known)
            if known in alive or 2 * share > whole:
                claims.append((-share, known, p))
    ids: dict[int, int] = {}
    for _, known, p in sorted(claims):
        if p not in ids and known not in ids.values():
            ids[p] = known
    return [ids.get(p) for p in range(len(partition))]


@given(lives())
@settings(max_examples=300, deadline=None)
def test_ids_are_unique_and_stay_and_the_log_says_what_became_of_each(life: tuple[np.ndarray, list[Partition]]) -> None:
    size, partitions = life
    who, twin = Identities(), Identities()
    owner: dict[int, int] = {}
    alive: set[int] = set()
    ever: set[int] = set()
    log: list[list[int]] = []
    for moment, partition in enumerate(partitions):
        expected = plainly(owner, alive, partition, size)
        ids = ask(who, partition, moment, size)
        assert ids == ask(twin, partition, moment, size)
        assert len(set(ids)) == len(ids)
        kept = [e for e in expected if e is not None]
        assert [i for i, e in zip(ids, expected, strict=True) if e is not None] == kept
        new = [i for i, e in zip(ids, expected, strict=True) if e is None]
        assert new == list(range(len(ever) + 1, len(ever) + 1 + len(new)))
        ever |= set(new)
        rows = who.history.tolist()
        assert rows[: len(log)] == log, "what was written was changed"
        log = rows
        history = History(who.history)
        history.check()
        assert history.alive == sorted(ids)
        for old in ever:
            now = history.resolve(old)
            assert now is None or now in ids
            assert set(history.holders(old)) <= set(ids)
            assert now is None or now in history.holders(old)
        # What was there and is not, has most of its masks in no instance, or is part of one that has some of them.
        for old in alive - set(ids):
            whole = [m for m in owner if owner[m] == old]
            held = {i: [m for m in masks if m in whole] for i, masks in zip(ids, partition, strict=True)}
            inside = sum(max(int(size[m]), 1) for masks in held.values() for m in masks)
            now = history.resolve(old)
            assert (now is not None) == (2 * inside > sum(max(int(size[m]), 1) for m in whole))
            assert now is None or held[now]
        for i, masks in zip(ids, partition, strict=True):
            owner.update(dict.fromkeys(masks, i))
        owner = {m: history.resolve(i) or i for m, i in owner.items()}
        alive = set(ids)
    assert [row[1] for row in log if row[3] in (BORN, SPLIT)] == sorted(ever)


def test_a_walk_of_thousands_of_masks() -> None:
    rng = np.random.default_rng(0)
    size = rng.integers(1, 500, 20_000).astype(np.int32)
    part = rng.integers(0, 300, len(size))
    who = Identities()
    for n in range(1000, len(size), 1000):
        part[rng.integers(0, n, 20)] = rng.integers(0, 300, 20)
        order = np.argsort(part[:n], kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(part[order])) + 1)
        ids = who.assign(groups, size[:n], n)
        assert History(who.history).alive == sorted(ids)
    assert len(ids) >= 300
    # Twenty masks of a thousand and more change hands a time: hardly any id changes.
    assert (who.history[:, 3] != BORN).sum() < 10
