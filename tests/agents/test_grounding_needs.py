"""What ranks a map for a need: the cover of hypotheses, and the text vectors that outlive the process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from openmap_agents import vector_cache
from openmap_agents.grounding.lexicon import load_lexicon
from openmap_agents.grounding.needs import Needs, cover
from openmap_agents.grounding.text_space import TextSpace

CHANCE = st.floats(0, 1, width=32)
TEXTS = ["chair", "table", "window", "a red cup"]


def plain_cover(probabilities: list[float], hits: list[list[float]]) -> list[float]:
    """As ``cover`` says it: P(at least one hit) written out, each next instance by trial."""
    chosen: list[int] = []
    gains = [0.0] * len(hits)

    def at_least_one(instances: list[int]) -> float:
        total = 0.0
        for kind, probability in enumerate(probabilities):
            missed = 1.0
            for i in instances:
                missed *= 1 - hits[i][kind]
            total += probability * (1 - missed)
        return total

    while len(chosen) < len(hits):
        left = [i for i in range(len(hits)) if i not in chosen]
        added = [at_least_one([*chosen, i]) - at_least_one(chosen) for i in left]
        best = max(range(len(left)), key=lambda k: (round(added[k], 12), -left[k]))
        gains[left[best]] = added[best]
        chosen.append(left[best])
    return gains


@settings(max_examples=80, deadline=None)
@given(data=st.data(), instances=st.integers(1, 6), kinds=st.integers(1, 4))
def test_the_cover_gains_what_the_plain_one_gains(data: st.DataObject, instances: int, kinds: int) -> None:
    probabilities = data.draw(hnp.arrays(np.float64, kinds, elements=CHANCE))
    hits = data.draw(hnp.arrays(np.float64, (instances, kinds), elements=CHANCE))
    gains = cover(probabilities, hits)
    # Ties may be broken by the last bit, so compare what the k best gain together.
    expected = sorted(plain_cover(probabilities.tolist(), hits.tolist()), reverse=True)
    assert gains.max() == pytest.approx(expected[0], abs=1e-9)
    assert gains.sum() == pytest.approx(sum(expected), abs=1e-9)
    assert (gains >= -1e-12).all()


def test_one_kind_does_not_fill_the_first_places_when_features_are_sure() -> None:
    hits = np.array([[0.9, 0.0]] * 5 + [[0.0, 0.9]])
    assert np.argsort(-cover(np.array([0.7, 0.3]), hits), kind="stable")[1] == 5


def test_several_tries_of_the_best_kind_come_first_when_features_are_unsure() -> None:
    hits = np.array([[0.2, 0.0]] * 3 + [[0.0, 0.2]])
    assert np.argsort(-cover(np.array([0.7, 0.3]), hits), kind="stable").tolist() == [0, 1, 2, 3]


def test_those_past_the_greedy_ones_never_overtake_them() -> None:
    rng = np.random.default_rng(0)
    probabilities, hits = rng.dirichlet(np.ones(8)), rng.random((40, 8))
    gains = cover(probabilities, hits, greedy=10)
    whole = cover(probabilities, hits)
    assert np.array_equal(np.argsort(-gains, kind="stable")[:10], np.argsort(-whole, kind="stable")[:10])


class Counting:
    """Counts the texts that it is given."""

    def __init__(self, seed: int = 0) -> None:
        self.seed, self.count = seed, 0

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        self.count += len(texts)
        rows = [np.random.default_rng([self.seed, *text.encode()]).normal(size=32) for text in texts]
        return np.array(rows, np.float32)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return vector_cache.folder()


def listed(seed: int = 0) -> tuple[npt.NDArray[np.float32], int]:
    """The vectors of ``TEXTS`` from a new process's point of view, and how many texts were encoded for them."""
    encoder = Counting(seed)
    return TextSpace(encoder).listed(TEXTS), encoder.count


def test_listed_vectors_outlive_the_process_and_are_the_same(cache: Path) -> None:
    (first, cold), (second, warm) = listed(), listed()
    assert np.array_equal(first, second)
    assert np.array_equal(first, TextSpace(Counting()).vectors(TEXTS))
    assert (cold, warm) == (len(TEXTS) + 1, 1)


def test_vectors_of_another_encoder_are_not_taken(cache: Path) -> None:
    (first, _), (other, count) = listed(0), listed(1)
    assert count == len(TEXTS) + 1
    assert not np.allclose(first, other)
    assert len(list(cache.glob("*.npy"))) == 2


@pytest.mark.parametrize("damage", ["truncated", "garbage", "wrong shape", "not finite", "empty"])
def test_a_damaged_file_is_ignored_and_written_anew(cache: Path, damage: str) -> None:
    good, _ = listed()
    (file,) = cache.glob("*.npy")
    whole = file.read_bytes()
    if damage in ("wrong shape", "not finite"):
        np.save(file, good[:2] if damage == "wrong shape" else good * np.float32(np.nan))
    else:
        file.write_bytes({"truncated": whole[:-50], "garbage": b"\x80\x04pickle", "empty": b""}[damage])
    again, count = listed()
    assert np.array_equal(again, good)
    assert count == len(TEXTS) + 1
    assert file.read_bytes() == whole
    assert [path.name for path in cache.iterdir()] == [file.name]


def test_a_folder_that_cannot_be_made_costs_only_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    occupied = tmp_path / "file"
    occupied.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(occupied))
    assert listed()[1] == len(TEXTS) + 1


def test_beliefs_over_kinds_are_probabilities_in_falling_order(cache: Path) -> None:
    needs = Needs(load_lexicon(), TextSpace(Counting()))
    serves = needs.serving(("i want to sleep",))
    probabilities = [probability for _, probability in serves]
    assert probabilities == sorted(probabilities, reverse=True)
    assert 0 < sum(probabilities) <= 1 + 1e-9
    assert needs.serving(()) == ()
