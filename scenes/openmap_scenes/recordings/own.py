"""Recordings of anyone's own: ``recording.json`` says where the pictures of each frame lie and where the camera stood.

    {"format": "openmap-recording", "version": 1,
     "camera": {"width": 640, "height": 480, "fx": 525.0, "fy": 525.0, "cx": 319.5, "cy": 239.5},
     "depth_scale": 1000, "axes": "opengl", "up": "y",
     "frames": [{"color": "color/0.jpg", "depth": "depth/0.png", "T_world_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}

``color`` is a JPEG or PNG, ``depth`` a 16-bit PNG of ``depth_scale`` units a metre (1000 where it is not given) or an ``.npy`` of
float32 m, 0 = nothing; both may have another size than the camera with the same view. ``axes`` are the camera's: "opengl" (the
default: x right, y up, looking along -z) or "opencv" (x right, y down, z forward). ``up`` is the world's, "y" (the default) or
"z". A frame whose ``T_world_camera`` is null has lost its tracking.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import Value, read_json
from openmap_scenes.formats.mesh import T_WORLD_YUP, T_WORLD_ZUP
from openmap_scenes.formats.rigid import check_rigid
from openmap_scenes.recordings.files import inside
from openmap_scenes.recordings.folder import FolderRecording, FrameFiles
from openmap_scenes.recordings.images import check_size
from openmap_scenes.recordings.poses import T_world_camera, camera_from

INDEX, FORMAT, VERSION = "recording.json", "openmap-recording", 1
WORLDS = {"y": T_WORLD_YUP, "z": T_WORLD_ZUP}
AXES = ("opengl", "opencv")
DEPTH_SCALE = 1000.0
# The writer's index is brought up to date after so many frames, so that a program that dies loses few.
INDEX_EVERY = 32
JPEG_QUALITY = 95
# The usual level, 6, takes three times as long for a few per cent of the size.
PNG_LEVEL = 1


class OwnRecording(FolderRecording):
    """The recording in a folder with a ``recording.json``, or of such a file.

    Raises
    ------
    DataError
        The index or a picture is missing or broken, or a name leads out of the folder.
    """

    def __init__(self, path: str | Path) -> None:
        path = Path(path)
        path = path if path.is_file() else path / INDEX
        index = read_json(path, f"the index of a recording of your own ({INDEX})")
        if index["format"].raw != FORMAT:
            index["format"].fail(repr(FORMAT))
        if index["version"].integer() != VERSION:
            index["version"].fail(f"version {VERSION}", "A newer version of OpenMapNav may read it.")
        opengl = _choice(index["axes"], AXES) == "opengl"
        T_world_file = WORLDS[_choice(index["up"], tuple(WORLDS))]
        scale = index["depth_scale"].number(DEPTH_SCALE)
        if not 1e-3 <= scale <= 1e6:
            index["depth_scale"].fail("depth units a metre, usually 1000")
        frames, skipped = [], []
        for number, value in enumerate(index["frames"].items()):
            names = {part: value[part].text() for part in ("color", "depth")}
            if isinstance(value.raw, dict) and "T_world_camera" in value.raw and value.raw["T_world_camera"] is None:
                skipped.append(number)
                continue
            source = f"{path} {value.place}"
            T = T_world_camera(source, number, _matrix(value["T_world_camera"]), T_world_file, opengl=opengl)
            colour, depth = (inside(path.parent, names[part], f"{source}.{part}") for part in ("color", "depth"))
            frames.append(FrameFiles(number, colour, depth, T))
        super().__init__(path.parent, _camera(index["camera"]), frames, skipped, 1 / scale)


def _choice(value: Value, known: tuple[str, ...]) -> str:
    text = value.text(known[0])
    if text not in known:
        value.fail(" or ".join(map(repr, known)))
    return text


def _matrix(value: Value) -> npt.NDArray[np.float64]:
    rows = value.items()
    if len(rows) != 4:
        value.fail("four rows of four numbers, or null where tracking was lost")
    return np.array([row.numbers(4) for row in rows], np.float64)


def _camera(value: Value) -> PinholeCamera:
    size = value["width"].integer(), value["height"].integer()
    check_size(f"{value.source} camera", *size)
    fx, fy, cx, cy = (value[key].number() for key in ("fx", "fy", "cx", "cy"))
    return camera_from(f"{value.source} camera", (fx, fy, cx, cy), size)


class RecordingWriter:
    """Writes a recording of one's own, frame by frame; a context manager.

    Pictures and the index are each written under another name first, and the index names only pictures that are whole, so what
    lies in the folder when a program dies can be read. The index is written at every 32nd frame and when the writer is closed, by
    an exception too.

    Parameters
    ----------
    folder : str or Path
        Made if need be; must hold no recording.
    camera : PinholeCamera
        Of all pictures, colour and depth.
    exact : bool
        Keep depth as float32 (``.npy``) and colour without loss (PNG), in place of millimetres and JPEG.

    Raises
    ------
    DataError
        There is a recording in the folder already, or it cannot be written to.

    Examples
    --------
    >>> with RecordingWriter("walk", camera) as writer:
    ...     writer.append(rgb, depth, T_world_camera)
    """

    def __init__(self, folder: str | Path, camera: PinholeCamera, *, exact: bool = False) -> None:
        self._folder, self._camera, self._exact = Path(folder), camera, exact
        self._frames: list[dict[str, Any]] = []
        if (self._folder / INDEX).exists():
            raise DataError(self._folder / INDEX, "a recording", "a folder without one", "Name another folder.")
        try:
            for part in ("color", "depth"):
                (self._folder / part).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            found = f"a place where no folder can be made ({error.strerror})"
            raise DataError(folder, found, "a folder to write to") from error

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._frames)

    def append(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.floating],
        T_world_camera: npt.NDArray[np.floating] | None,
    ) -> None:
        """Add a frame; where an argument is refused, or a file cannot be written, the recording stays as it was.

        Parameters
        ----------
        rgb : (H, W, 3) uint8
        depth : (H, W) float m
            Planar, 0 = no reading. Not above 65.535 m unless the writer is ``exact``.
        T_world_camera : (4, 4) float or None
            World (Y up) from OpenGL camera axes; None = tracking was lost.

        Raises
        ------
        ValueError
            Wrong shapes or types, depth that is negative or not finite, or a matrix that is no pose.
        """
        depth = _checked(rgb, depth, self._camera, self._exact)
        rows = None
        if T_world_camera is not None:
            pose = np.asarray(T_world_camera, np.float64)
            if pose.shape != (4, 4):
                raise ValueError(f"T_world_camera has shape {pose.shape}, expected (4, 4)")
            check_rigid("T_world_camera", "a pose", pose)
            rows = pose.tolist()
        number = len(self._frames)
        colour_name = f"color/{number}.{'png' if self._exact else 'jpg'}"
        depth_name = f"depth/{number}.{'npy' if self._exact else 'png'}"
        options: dict[str, Any] = (
            {"format": "PNG", "compress_level": PNG_LEVEL}
            if self._exact
            else {"format": "JPEG", "quality": JPEG_QUALITY, "subsampling": 0}
        )
        _write(self._folder / colour_name, lambda file: Image.fromarray(rgb).save(file, **options))
        if self._exact:
            _write(self._folder / depth_name, lambda file: np.save(file, depth, allow_pickle=False))
        else:
            units = np.rint(depth * DEPTH_SCALE).astype(np.uint16)
            _write(
                self._folder / depth_name,
                lambda file: Image.fromarray(units).save(file, format="PNG", compress_level=PNG_LEVEL),
            )
        self._frames.append({"color": colour_name, "depth": depth_name, "T_world_camera": rows})
        if len(self._frames) % INDEX_EVERY == 0:
            self._write_index()

    def close(self) -> None:
        """Write the index; more frames may follow."""
        self._write_index()

    def _write_index(self) -> None:
        c = self._camera
        head = {
            "format": FORMAT,
            "version": VERSION,
            "camera": {"width": c.width, "height": c.height, "fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy},
            "depth_scale": DEPTH_SCALE,
            "axes": "opengl",
            "up": "y",
        }
        frames = ",\n".join(json.dumps(frame, allow_nan=False) for frame in self._frames)
        text = json.dumps(head)[:-1] + ', "frames": [\n' + frames + "\n]}\n"
        _write(self._folder / INDEX, lambda file: file.write(text.encode()))


def _checked(
    rgb: npt.NDArray[np.uint8], depth: npt.NDArray[np.floating], camera: PinholeCamera, exact: bool
) -> npt.NDArray[np.float32]:
    """Depth (H, W) float32 m of a frame that may be written, else ValueError."""
    size = camera.height, camera.width
    if rgb.shape != (*size, 3) or rgb.dtype != np.uint8:
        raise ValueError(f"rgb is {rgb.dtype} of shape {rgb.shape}, expected uint8 of shape {(*size, 3)}")
    if depth.shape != size or depth.dtype.kind != "f":
        raise ValueError(f"depth is {depth.dtype} of shape {depth.shape}, expected floats of shape {size}")
    largest = 1000.0 if exact else np.iinfo(np.uint16).max / DEPTH_SCALE
    if not (np.isfinite(depth).all() and depth.min() >= 0 and depth.max() <= largest):
        raise ValueError(f"depth has {depth.min()} to {depth.max()} m, expected finite numbers in 0..{largest}")
    return np.asarray(depth, np.float32)


def _write(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file under another name, and rename it when it is whole."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        with unfinished.open("wb") as file:
            write(file)
        os.replace(unfinished, path)
    except OSError as error:
        raise DataError(path, f"a file that cannot be written ({error.strerror})", "room and leave to write") from error
    finally:
        unfinished.unlink(missing_ok=True)
