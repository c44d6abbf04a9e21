"""What segmenter and encoder both need of a picture, worked out once: the surface, the backbone's maps, what the neck says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.backbone import Backbone
from openmap_agents.perception.maps import front_picture, geometry_map
from openmap_agents.perception.neck import Features, Neck
from openmap_agents.perception.surface import Surface, working_picture
from openmap_agents.perception.weights import FOLDER
from openmap_scenes import PinholeCamera


@dataclass(frozen=True)
class View:
    """A picture as the embedded perception sees it.

    Parameters
    ----------
    camera : PinholeCamera
    surface : Surface
        The working picture.
    maps : [(C, h, w) float32]
        The backbone's, at strides 4, 8, 16, 32.
    features : Features
        The neck's.
    """

    camera: PinholeCamera
    surface: Surface
    maps: list[npt.NDArray[np.float32]]
    features: Features


class FrontEnd:
    """Pictures -> views; the last picture is remembered, since segmenter and encoder are given the same one after the other.

    Parameters
    ----------
    weights : Path, optional
        The folder of the neck's weights; the installed one by default.
    threads : int
        Of onnxruntime.

    Raises
    ------
    DataError
        Weights cannot be used.
    """

    def __init__(self, weights: str | Path = FOLDER, threads: int = 1) -> None:
        self.backbone, self.neck = Backbone(threads), Neck(Path(weights) / "neck.onnx", threads)
        self._last: tuple[tuple[object, ...], View] | None = None

    def look(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> View:
        """The view of rgb (H, W, 3) uint8 and planar depth (H, W) m; of ``T_world_camera`` only the rotation is used.

        Raises
        ------
        ValueError
            The picture does not fit the camera.
        """
        # By content: an environment may hand out the same buffer with another picture in it.
        key = (camera, rgb.tobytes(), depth.tobytes(), np.asarray(T_world_camera, np.float64)[:3, :3].tobytes())
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        surface = working_picture(rgb, depth, T_world_camera, camera)
        maps = self.backbone.dense(front_picture(rgb))
        geometry = geometry_map(surface, T_world_camera, camera.height, camera.width)
        view = View(camera, surface, maps, self.neck(maps, geometry))
        self._last = (key, view)
        return view
