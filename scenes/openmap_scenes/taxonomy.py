"""Label sets of the field and how a free name maps to them: mpcat40 (Matterport3D), ScanNet200, LVIS."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Labels:
    """What a thing is called in each label set; None where the set has no name for it."""

    mpcat40: str | None = None
    scannet200: str | None = None
    lvis: str | None = None


def labels_of(name: str) -> Labels:
    """The labels of a free name ("Office Chair", "coffee_table", "armchairs"); all None where the table does not know it."""
    return Labels()
