"""One way to open a recording of any kind."""

from __future__ import annotations

from pathlib import Path

from openmap_scenes.errors import DataError
from openmap_scenes.recordings.exported import PARTS, ExportedRecording
from openmap_scenes.recordings.recording import Recording
from openmap_scenes.recordings.sens import SensRecording


def open_recording(path: str | Path, *, lenient: bool = False) -> Recording:
    """Open a posed RGB-D recording.

    Parameters
    ----------
    path : str or Path
        A ``.sens`` file, or a folder with ScanNet's exported ``color``, ``depth``, ``pose`` and ``intrinsic``, or a folder with one
        ``.sens`` file. A folder that has both is read as exported, which holds all that the ``.sens`` file does.
    lenient : bool
        Of a ``.sens`` file that was cut short give the frames before the cut.

    Raises
    ------
    DataError
        Nothing of this kind is there, or it is broken.
    """
    path = Path(path)
    if path.is_file():
        return SensRecording(path, lenient=lenient)
    if any((path / part).is_dir() for part in PARTS):
        return ExportedRecording(path)
    files = sorted(path.glob("*.sens")) if path.is_dir() else []
    if len(files) != 1:
        found = (
            f"{len(files)} .sens files and no folders {', '.join(PARTS)}" if path.is_dir() else "no such file or folder"
        )
        raise DataError(path, found, "a .sens file, or ScanNet's exported folders color, depth, pose and intrinsic")
    return SensRecording(files[0], lenient=lenient)
