"""One way to open a recording of any kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from openmap_scenes.errors import DataError
from openmap_scenes.recordings import own, record3d, replica_style, tum
from openmap_scenes.recordings.exported import PARTS, ExportedRecording
from openmap_scenes.recordings.files import numbered
from openmap_scenes.recordings.recording import Recording
from openmap_scenes.recordings.sens import SensRecording


@dataclass(frozen=True)
class Kind:
    """A kind of recording.

    Parameters
    ----------
    what : str
        What lies in its folder.
    fits : callable
        Whether a folder looks like one.
    read : callable
        Opens a path, leniently or not.
    """

    what: str
    fits: Callable[[Path], bool]
    read: Callable[[Path, bool], Recording]


def _is_tum(folder: Path) -> bool:
    return sum((folder / name).is_file() for name in tum.LISTS) >= 2


def _is_replica_style(folder: Path) -> bool:
    return (folder / replica_style.TRAJECTORY).is_file() or bool(
        numbered(folder / replica_style.PICTURES, (".jpg", ".jpeg", ".png"), "frame")
    )


def _is_record3d(folder: Path) -> bool:
    pictures = (folder / "rgbd").is_dir() or (folder / "rgb").is_dir()
    return pictures and any((folder / name).is_file() for name in record3d.METADATA)


def _is_exported(folder: Path) -> bool:
    # Others, too, have folders named color and depth.
    return any((folder / part).is_dir() for part in ("pose", "intrinsic"))


def _sens_files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.sens"))


def _read_sens(path: Path, lenient: bool) -> Recording:
    files = [path] if path.is_file() else _sens_files(path)
    if len(files) != 1:
        raise DataError(path, f"{len(files)} .sens files", "one of them, or its path")
    return SensRecording(files[0], lenient=lenient)


KINDS: dict[str, Kind] = {
    "openmap": Kind(own.INDEX, lambda f: (f / own.INDEX).is_file(), lambda path, _: own.OwnRecording(path)),
    "tum": Kind("rgb.txt, depth.txt, groundtruth.txt", _is_tum, lambda path, _: tum.TumRecording(path)),
    "replica": Kind(
        "results/frame*.jpg, results/depth*.png, traj.txt",
        _is_replica_style,
        lambda path, lenient: replica_style.ReplicaStyleRecording(path, lenient=lenient),
    ),
    "record3d": Kind(
        "metadata and rgbd or rgb, depth",
        _is_record3d,
        lambda path, lenient: record3d.Record3DRecording(path, lenient=lenient),
    ),
    "scannet": Kind("color, depth, pose, intrinsic", _is_exported, lambda path, _: ExportedRecording(path)),
    "sens": Kind("a .sens file", lambda folder: bool(_sens_files(folder)), _read_sens),
}


def kinds_at(path: str | Path) -> list[str]:
    """The kinds of recording that a path looks like; a ``.sens`` file beside its own export does not count."""
    path = Path(path)
    if path.is_file():
        return ["sens"] if path.suffix == ".sens" else ["openmap"] if path.name == own.INDEX else []
    if not path.is_dir():
        return []
    kinds = [name for name, kind in KINDS.items() if kind.fits(path)]
    if not kinds or kinds == ["sens"]:
        # What is left of an export that lost some of its folders is still worth an error that says which.
        kinds = ["scannet"] if any((path / part).is_dir() for part in PARTS) else kinds
    return [name for name in kinds if name != "sens" or "scannet" not in kinds]


def open_recording(path: str | Path, kind: str | None = None, lenient: bool = False) -> Recording:
    """Open a posed RGB-D recording.

    Parameters
    ----------
    path : str or Path
        A folder, a ``.sens`` file or a ``recording.json``. A folder with a ``.sens`` file and ScanNet's exported folders is read as
        exported, which holds all that the ``.sens`` file does.
    kind : str or None
        One of ``KINDS``; None = told by what lies there.
    lenient : bool
        Of a recording that was cut short (``.sens``, Replica-style, Record3D) give the frames that are whole.

    Raises
    ------
    DataError
        Nothing of a known kind is there, several kinds are, or it is broken.
    """
    path = Path(path)
    every = "; ".join(f"{name} ({known.what})" for name, known in KINDS.items())
    if kind is not None and kind not in KINDS:
        raise DataError("kind of recording", repr(kind), f"one of {every}")
    if not path.exists():
        raise DataError(path, "no such file or folder", f"a recording: {every}")
    try:
        if kind is None:
            kind = _only(path, kinds_at(path), every)
        return KINDS[kind].read(path, lenient)
    except OSError as error:  # a folder that may not be listed, a name that is too long
        raise DataError(path, f"a place that cannot be read ({error.strerror})", "a recording") from error


def _only(path: Path, kinds: list[str], every: str) -> str:
    if len(kinds) > 1:
        remedy = f"Name one of them as the kind ({', '.join(kinds)}), or part the files."
        raise DataError(path, f"a folder that looks like {' and '.join(kinds)}", "one recording", remedy)
    if kinds:
        return kinds[0]
    if path.suffix.lower() == ".r3d":
        remedy = "It is a ZIP archive: unpack it and open the folder."
        raise DataError(path, "a packed Record3D recording", "its unpacked folder", remedy)
    found = "nothing of a recording" if path.is_dir() else "a file of another kind"
    raise DataError(path, found, f"one of {every}")
