"""What follows from a scene is kept between processes, and never given back stale, damaged or half written."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from openmap_env import kept as kept_module
from openmap_env.kept import Arrays, derived_folder, kept


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENMAP_CACHE", str(tmp_path / "cache"))


class Maker:
    def __init__(self) -> None:
        self.made = 0

    def __call__(self) -> Arrays:
        self.made += 1
        return {"squares": np.arange(5000) ** 2, "small": np.array([self.made])}


def get(maker: Maker, *parts: np.ndarray | str | None) -> Arrays:
    return kept("test", parts, [kept_module], maker)


def test_what_was_made_once_is_not_made_again_and_is_the_same() -> None:
    maker = Maker()
    first, second = get(maker, np.arange(3)), get(maker, np.arange(3))
    assert maker.made == 1
    for arrays in (first, second):
        np.testing.assert_array_equal(arrays["squares"], np.arange(5000) ** 2)
        assert not arrays["squares"].flags.writeable


@pytest.mark.parametrize(
    "other", [np.arange(3, dtype=np.int32), np.arange(4), np.arange(3)[None], "0 1 2", None, np.array([0, 1, 3])]
)
def test_anything_else_it_is_made_from_makes_it_anew(other: np.ndarray | str | None) -> None:
    maker = Maker()
    get(maker, np.arange(3))
    get(maker, other)
    assert maker.made == 2


def test_a_damaged_entry_is_said_and_made_again(caplog: pytest.LogCaptureFixture) -> None:
    maker = Maker()
    get(maker, "a")
    (file,) = derived_folder().glob("test-*/squares.npy")
    file.write_bytes(file.read_bytes()[:200])
    with caplog.at_level(logging.WARNING):
        np.testing.assert_array_equal(get(maker, "a")["squares"], np.arange(5000) ** 2)
    assert maker.made == 2
    assert "damaged" in caplog.text


def test_an_entry_that_uses_the_room_of_others_takes_that_of_the_oldest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENMAP_CACHE_GB", str(4 * 110e3 / 1e9))  # a quarter of it holds two entries of 40 kB
    maker = Maker()
    for name in ("a", "b", "c"):
        get(maker, name)
    assert len(list(derived_folder().iterdir())) == 2
    get(maker, "c")
    assert maker.made == 3
    get(maker, "a")
    assert maker.made == 4


def test_nothing_is_kept_where_the_user_wants_nothing_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENMAP_CACHE_GB", "0")
    maker = Maker()
    get(maker, "a")
    get(maker, "a")
    assert maker.made == 2
    assert not derived_folder().exists()


def test_a_folder_that_cannot_be_written_costs_a_line_in_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("OPENMAP_CACHE", str(tmp_path / "file"))
    maker = Maker()
    assert get(maker, "a")["small"][0] == 1
    assert "not kept" in caplog.text


def test_an_error_of_the_maker_passes_and_leaves_nothing() -> None:
    def fail() -> Arrays:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        kept("test", ["a"], [kept_module], fail)
    assert not derived_folder().exists() or not list(derived_folder().iterdir())
