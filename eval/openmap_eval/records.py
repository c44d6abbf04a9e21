"""One JSON line an episode, written when the episode ends, so that a killed evaluation goes on where it was."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from openmap_scenes import DataError

STAGES = ("exploration", "segmentation", "association", "feature", "parse", "selection", "navigation")
"""Where an episode's target can be lost, in the order in which it has to pass them (``attribution.py``)."""


@dataclass(frozen=True)
class EpisodeRecord:
    """What is kept of one episode.

    Parameters
    ----------
    episode_id, scene, instruction, kind : str
    metrics : dict
        Measure -> number, as in ``info["metrics"]``; None where it is infinite (no way to the goal).
    seconds : float
        Wall time from reset to the last step.
    answer : list of dict
        The first 16 places declared: ``{"position": (3,) m in the episode frame, "label": str}``.
    targets : list of dict
        All valid targets: ``{"centre": (3,) m in the episode frame, "category": str}``.
    trace : dict
        How the agent came to its answer.
    lost_at : str or None
        Which of ``STAGES`` lost the target; None for a success, and where nobody looked.
    evidence : dict
        What shows that it was this stage.
    """

    episode_id: str
    scene: str
    instruction: str
    kind: str
    metrics: dict[str, float | None]
    seconds: float
    answer: list[dict[str, Any]] = field(default_factory=list)
    targets: list[dict[str, Any]] = field(default_factory=list)
    trace: dict[str, Any] = field(default_factory=dict)
    lost_at: str | None = None
    evidence: dict[str, Any] = field(default_factory=dict)


class RecordFile:
    """An append-only ``episodes.jsonl``.

    A line that a kill cut short is dropped when the file is opened again; what stands before it is kept.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.records: list[EpisodeRecord] = []
        if path.exists():
            self._recover()

    def _recover(self) -> None:
        data = self.path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        for number, line in enumerate(whole.splitlines(), start=1):
            try:
                self.records.append(EpisodeRecord(**json.loads(line)))
            except (ValueError, TypeError) as error:
                raise DataError(
                    f"{self.path}, line {number}",
                    f"no episode record ({error})",
                    "one JSON object an episode",
                    "Give another --out.",
                ) from error
        if len(whole) != len(data):
            write_atomically(self.path, whole)

    @property
    def done(self) -> set[tuple[str, str]]:
        """(scene, episode id) of every record."""
        return {(record.scene, record.episode_id) for record in self.records}

    def append(self, record: EpisodeRecord) -> None:
        """Add a record and wait until it is on the disk."""
        line = json.dumps(asdict(record), ensure_ascii=False, allow_nan=False) + "\n"
        with self.path.open("ab") as file:
            file.write(line.encode())
            file.flush()
            os.fsync(file.fileno())
        self.records.append(record)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file under a temporary name beside its place, then rename it."""
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_bytes(content)
    temporary.replace(path)


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a JSON document atomically."""
    write_atomically(path, (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode())
