"""What a benchmark ran on: enough to compare two results, nothing that names a person or a computer."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rich.console import Console

PACKAGES = ("openmap-nav", "numpy", "scipy", "numba", "trimesh", "pillow", "plyfile", "open3d", "moderngl", "torch")


@dataclass(frozen=True)
class Machine:
    """Print what every benchmark writes beside its figures: processor, cores, memory, versions."""

    out: Path | None = None
    """Write it to this JSON file too."""

    def run(self, console: Console) -> None:
        description = describe_machine()
        console.print_json(json.dumps(description))
        if self.out is not None:
            write_json(self.out, description)


def describe_machine() -> dict[str, Any]:
    """Processor, usable cores, memory in GiB, operating system, Python and package versions; no host, user or path."""
    import psutil

    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": _cpu_name(),
        "cores": usable,
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {name: found for name in PACKAGES if (found := _version(name))},
    }


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write a result, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        unfinished.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def _cpu_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass  # not Linux
    return platform.processor() or platform.machine()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
