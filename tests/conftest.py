"""Fixtures that all tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_scenes() -> Path:
    """The folder of scene fixtures that lies beside a checkout; skips where there is none, as on a user's machine."""
    default = Path(__file__).resolve().parents[2] / "shared" / "scenes"
    folder = Path(os.environ.get("OPENMAP_SHARED_SCENES", default))
    if not folder.is_dir():
        pytest.skip(f"scene fixtures are not at {folder}; set OPENMAP_SHARED_SCENES to their folder")
    return folder
