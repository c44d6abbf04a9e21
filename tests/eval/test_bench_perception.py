"""The benchmark of perception: whose time a stage's is, what it asks, and that it measures every stage that it names."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from types import ModuleType

import pytest

from openmap_eval.bench import Perception
from openmap_eval.bench.perception import measure, words
from openmap_eval.bench.perception_stages import STAGES, StageClock, install


@pytest.fixture
def package() -> Iterator[str]:
    """A package of two modules, the second of which imported the first's function by name."""
    name = "staged_for_a_test"
    parts = {part: ModuleType(f"{name}.{part}") for part in ("inner", "outer")}
    exec("import time\ndef work(n):\n    time.sleep(n)\n    return n\n", parts["inner"].__dict__)
    parts["outer"].__dict__["renamed"] = parts["inner"].__dict__["work"]
    exec("class Both:\n    def __call__(self, n):\n        return renamed(n) + renamed(n)\n", parts["outer"].__dict__)
    sys.modules.update({f"{name}.{part}": module for part, module in parts.items()})
    yield name
    for part in parts:
        del sys.modules[f"{name}.{part}"]


def test_a_stages_time_is_its_own_without_that_of_others_that_it_calls(package: str) -> None:
    clock = StageClock()
    stages = {"inner": ("inner:work",), "outer": ("outer:Both.__call__",), "none": ("nowhere:at_all",)}
    assert install(clock, stages, package) == ["inner", "outer"]
    clock.start()
    before = time.perf_counter()
    assert sys.modules[f"{package}.outer"].Both()(0.02) == 0.04
    whole = (time.perf_counter() - before) * 1e3
    assert set(clock.milliseconds) == {"inner", "outer"}
    inner, outer = (clock.milliseconds[stage][0] for stage in ("inner", "outer"))
    assert inner >= 40.0
    # All there is is counted once: sleeping is the inner's, and the two together are no more than the whole.
    assert inner + outer <= whole
    clock.start()
    assert clock.milliseconds == {}


def test_a_function_that_is_not_there_is_named(package: str) -> None:
    with pytest.raises(ValueError, match=r"inner:rest is not there"):
        install(StageClock(), {"inner": ("inner:rest",)}, package)
    with pytest.raises(ValueError, match=r"outer:Neither\.call is not there"):
        install(StageClock(), {"outer": ("outer:Neither.call",)}, package)


@pytest.mark.parametrize("n", [1, 1000, 6000])
def test_all_labels_differ(n: int) -> None:
    assert len(set(words(n))) == n


def test_settings_that_cannot_be_measured_with_are_named(toy_specs: list[str]) -> None:
    with pytest.raises(ValueError, match="0 frames; expected 1 or more"):
        measure(Perception(toy_specs[0], frames=0))
    with pytest.raises(ValueError, match="an oracle does not see"):
        measure(Perception(toy_specs[0], perception="oracle"))


def test_every_stage_of_the_embedded_perception_is_measured(toy_specs: list[str]) -> None:
    result = measure(Perception(toy_specs[0], 160, 120, frames=2, labels=70))
    assert set(result["stages"]) == {*STAGES, "rest"}
    for values in (*result["stages"].values(), *result["whole"].values()):
        assert values["wall"]["median"] <= values["wall"]["p90"]
    named = [values for stage, values in result["stages"].items() if stage != "rest"]
    assert all(values["wall"]["median"] > 0 for values in named)
    assert list(result["text"]) == [
        "70 labels, first",
        "70 labels, again",
        "as a bank, first",
        "as a bank, by another process",
    ]
    memory = result["memory_mib"]
    assert memory["python"] < memory["loaded"] <= memory["at most"]
    assert result["settings"]["threads"] == 1
