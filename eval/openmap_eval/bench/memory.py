"""How much memory a process holds."""

from __future__ import annotations

import sys
from pathlib import Path


def peak_mib() -> float:
    """The most that was resident at once in this process, MiB."""
    try:
        # Not ru_maxrss, which counts what the parent had when it started this process.
        for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM"):
                return int(line.split()[1]) / 2**10
    except OSError:
        pass  # not Linux
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
