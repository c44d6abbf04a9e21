"""Where the time of a frame goes: the functions of the embedded perception, timed from outside while they run."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import wraps
from typing import Any

PACKAGE = "openmap_agents.perception"
STAGES: dict[str, tuple[str, ...]] = {
    "surface": ("surface:working_picture", "maps:geometry_map"),
    "backbone": ("backbone:Backbone.dense", "maps:front_picture"),
    "neck": ("neck:Neck.__call__",),
    "patches": ("segmenter:patches_of",),
    "joining": ("segmenter:described", "joining:agglomerate"),
    "choice": ("segmenter:node_features", "joining:best_cut", "surface:to_full_size"),
    "pooling": ("maps:cover", "maps:means"),
    "shape": ("shape:shape_features",),
    "heads": ("encoder:EmbeddedEncoder.opinions",),
    "colour": ("colour:region_colour",),
}
"""Stage -> module:function or module:Class.method of the package. What one calls of another counts for the other alone."""


class StageClock:
    """Wall and CPU milliseconds of the stages, each without what it calls of the others.

    ``milliseconds`` holds {stage: (wall, CPU)} of all calls since ``start``.
    """

    def __init__(self) -> None:
        self.milliseconds: dict[str, tuple[float, float]] = {}
        self._inner: list[tuple[float, float]] = []

    def start(self) -> None:
        """Forget what was measured."""
        self.milliseconds = {}
        self._inner = []

    def timed(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, its time added to the stage's."""

        @wraps(function)
        def call(*arguments: Any, **options: Any) -> Any:
            self._inner.append((0.0, 0.0))
            wall, cpu = time.perf_counter(), time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                took = (time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3
                inner = self._inner.pop()
                own = took[0] - inner[0], took[1] - inner[1]
                self.milliseconds[stage] = _sum(self.milliseconds.get(stage, (0.0, 0.0)), own)
                if self._inner:
                    self._inner[-1] = _sum(self._inner[-1], took)

        return call


def _sum(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return a[0] + b[0], a[1] + b[1]


def install(clock: StageClock, stages: dict[str, tuple[str, ...]] = STAGES, package: str = PACKAGE) -> list[str]:
    """Put the clock around every function of the stages, wherever a loaded module of the package names it; the stages found.

    Modules that are not loaded are not in use, and passed over.

    Raises
    ------
    ValueError
        A loaded module lacks its function.
    """
    found = []
    for stage, places in stages.items():
        for place in places:
            module_name, _, path = place.partition(":")
            module = sys.modules.get(f"{package}.{module_name}")
            if module is None:
                continue
            owner_name, _, name = path.rpartition(".")
            owner = getattr(module, owner_name, None) if owner_name else module
            original = getattr(owner, name, None)
            if original is None:
                raise ValueError(f"{package}.{place} is not there; expected the functions that STAGES lists")
            _replace(owner, name, original, clock.timed(stage, original), package)
            found.append(stage)
    return list(dict.fromkeys(found))


def _replace(owner: Any, name: str, original: Any, timed: Callable[..., Any], package: str) -> None:
    """In its class or module, and in every module of the package that imported it by name."""
    setattr(owner, name, timed)
    for module_name, module in list(sys.modules.items()):
        if module_name == package or module_name.startswith(f"{package}."):
            for alias, value in list(vars(module).items()):
                if value is original:
                    setattr(module, alias, timed)
