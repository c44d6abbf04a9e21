"""The other end of ``render_child``: a contender's process, asked one thing at a time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any

from openmap_eval.bench.render_contenders import CONTENDERS


class ContenderError(RuntimeError):
    """A contender cannot be measured here; the message says why."""


def chosen_contenders(names: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Those of the names (all, if there are none) that are installed, and why the others are not: (names, {name: reason})."""
    found, missing = [], {}
    for name in names or CONTENDERS:
        module = CONTENDERS[name].module
        if module and find_spec(module) is None:
            missing[name] = f"not installed ({module})"
        else:
            found.append(name)
    return found, missing


class ContenderProcess:
    """A contender in its own process with its own cache of what follows from a scene, so that its first set-up is a first one.

    Parameters
    ----------
    name : str
        Of ``CONTENDERS``.
    homes : sequence of Path
        Where ``save_scene`` wrote them.
    scratch : Path
        For its cache and for what its libraries print.
    lp_threads : int or None
        Its LP_NUM_THREADS.
    patience_s : float
        A contender that takes longer for one answer is given up.
    """

    def __init__(
        self, name: str, homes: Sequence[Path], scratch: Path, lp_threads: int | None = None, patience_s: float = 240.0
    ) -> None:
        self.name, self._patience_s = name, patience_s
        plain = name.replace(" ", "-")
        environment = {**os.environ, "OPENMAP_CACHE": str(scratch / f"{plain}-cache")}
        environment.pop("OPENMAP_GL", None)
        environment.pop("PYOPENGL_PLATFORM", None)
        environment |= CONTENDERS[name].environment
        if lp_threads is not None:
            environment["LP_NUM_THREADS"] = str(lp_threads)
        self._log = scratch / f"{plain}.log"
        command = [sys.executable, "-m", "openmap_eval.bench.render_child", name, *map(str, homes)]
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True, env=environment
            )

    def ask(self, what: str, **details: Any) -> dict[str, Any]:
        """Its answer to ``{"do": what, ...}``; ContenderError if it has none or says that it cannot."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        asked = time.monotonic()
        patience = threading.Timer(self._patience_s, self._process.kill)
        patience.start()
        try:
            self._process.stdin.write(json.dumps({"do": what, **details}) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        finally:
            patience.cancel()
        if not line:
            if time.monotonic() - asked >= self._patience_s:
                raise ContenderError(f"it did not {what} within {self._patience_s:.0f} s")
            said = self._log.read_text(errors="replace").strip().splitlines()
            raise ContenderError(
                f"its process ended with status {self._process.wait()}: {said[-1] if said else 'silently'}"
            )
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise ContenderError(str(answer["error"]))
        return answer

    def __enter__(self) -> ContenderProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._process.kill()
        self._process.communicate()
