"""What ``openmap bench homes`` holds all homes to, on one home of each split."""

from __future__ import annotations

from typing import Any

import pytest

from openmap_eval.bench.homes import audit_home, summarise
from openmap_scenes.homes.library import FOLDER_VARIABLE, furniture_folder

SPECS = ("homes:train/3", "homes:val/1", "homes:test/1")

pytestmark = pytest.mark.skipif(
    not list(furniture_folder().glob("*.sh3f")),
    reason=f"no furniture at {furniture_folder()}; install sweethome3d-furniture or set {FOLDER_VARIABLE}",
)


@pytest.fixture(scope="module")
def audits() -> list[dict[str, Any]]:
    return [audit_home(spec) for spec in SPECS]


@pytest.fixture(params=range(len(SPECS)), ids=SPECS)
def audit(request: pytest.FixtureRequest, audits: list[dict[str, Any]]) -> dict[str, Any]:
    return audits[request.param]


def test_every_room_can_be_reached(audit: dict[str, Any]) -> None:
    assert audit["unreachable"] == []


def test_no_solid_reaches_into_another(audit: dict[str, Any]) -> None:
    assert audit["clashes"] == []


def test_nearly_everything_can_be_seen_from_somewhere(audit: dict[str, Any]) -> None:
    assert audit["objects"] >= 40
    assert audit["visible"] >= 0.95, audit["hidden"]


def test_the_summary_tells_the_worst(audits: list[dict[str, Any]]) -> None:
    clean = sum(len(a["clashes"]) for a in audits)
    spoilt = [
        audits[0]
        | {"clashes": [*audits[0]["clashes"], "a / b"], "visible": 0.5, "hidden": ["pea (3 px)"], "same_bytes": False},
        *audits[1:],
    ]
    summary = summarise(spoilt)
    assert summary["clashes"] == clean + 1
    assert summary["share visible (worst)"] == 0.5
    assert summary["hidden most often"]["pea"] == 1
    assert summary["homes that differ in another process"] == [SPECS[0]]
