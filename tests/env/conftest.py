"""What the tests of the environment share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from rendering_cases import Make, open_backend

from openmap_env.rendering import Renderer


@pytest.fixture
def make() -> Iterator[Make]:
    """open_backend, with everything closed at the end."""
    opened: list[Renderer] = []

    def open_one(*args: object, **kwargs: object) -> Renderer:
        opened.append(open_backend(*args, **kwargs))  # type: ignore[arg-type]
        return opened[-1]

    yield open_one
    for renderer in opened:
        renderer.close()
