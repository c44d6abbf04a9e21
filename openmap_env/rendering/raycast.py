"""The plain reference: one ray a pixel with Open3D's RaycastingScene, and textures looked up by hand. Needs no OpenGL.

Textures are sampled bilinearly at full resolution, without mipmaps, so distant textures look noisier than OpenGL's.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from openmap_env.rendering.geometry import check_pose, check_range
from openmap_env.rendering.protocol import Frame, RendererUnavailableError
from openmap_scenes import PinholeCamera, Scene


class RaycastRenderer:
    """Renders a scene by ray casting on the CPU.

    Parameters
    ----------
    scene : Scene
    camera : PinholeCamera
    near, far : float
        Planar depths, m; nothing nearer or farther is seen.
    threads : int
        Threads that cast rays; 0 = all cores.

    Raises
    ------
    RendererUnavailableError
        Open3D does not load on this machine.
    """

    def __init__(
        self, scene: Scene, camera: PinholeCamera, *, near: float = 0.05, far: float = 100.0, threads: int = 0
    ) -> None:
        check_range(near, far)
        o3d = _import_open3d()
        self.scene, self.camera = scene, camera
        self._near, self._far, self._threads = near, far, threads
        self._rays = camera.rays()
        self._tensor: Any = o3d.core.Tensor
        self._geometry: Any = o3d.t.geometry.RaycastingScene()
        self._geometry.add_triangles(
            self._tensor(np.ascontiguousarray(scene.vertices, np.float32)),
            self._tensor(np.ascontiguousarray(scene.faces, np.uint32)),
        )
        self._nothing = int(o3d.t.geometry.RaycastingScene.INVALID_ID)
        self._texels, self._texture_table = _pack_textures(scene)
        self._corner_uv = np.zeros((len(scene.faces), 3, 2), np.float32) if scene.uv is None else scene.uv[scene.faces]
        self._corner_colour = np.ones((len(scene.faces), 3, 3), np.float32)
        if scene.vertex_colour is not None:
            self._corner_colour = scene.vertex_colour[scene.faces].astype(np.float32) / np.float32(255.0)
        self._corner_colour *= np.stack([m.colour for m in scene.materials])[scene.face_material][:, None]

    def render(self, T_world_camera: npt.NDArray[np.floating]) -> Frame:
        """The frame from a camera-to-world pose (4, 4); ValueError if it is not rigid, RuntimeError after ``close``."""
        pose = check_pose(T_world_camera)
        if self._geometry is None:
            raise RuntimeError("the renderer is closed; make a new one")
        # Directions have z = -1 in the camera frame, so distances along them are planar depths, and starting
        # at ``near`` of them leaves out what the near plane cuts away.
        rays = np.empty((*self._rays.shape[:2], 6), np.float32)
        rays[..., 3:] = self._rays @ pose[:3, :3].T.astype(np.float32)
        rays[..., :3] = pose[:3, 3] + self._near * rays[..., 3:]
        hits = self._geometry.cast_rays(self._tensor(rays), nthreads=self._threads)
        depth = hits["t_hit"].numpy() + np.float32(self._near)
        face = hits["primitive_ids"].numpy()
        seen = (face != self._nothing) & (depth <= self._far)
        rgb = np.zeros((*seen.shape, 3), np.uint8)
        hit_faces = face[seen].astype(np.int64)
        rgb[seen] = _shade(
            hit_faces,
            hits["primitive_uvs"].numpy()[seen],
            self._corner_uv,
            self._corner_colour,
            self.scene.face_material,
            self._texels,
            self._texture_table,
        )
        instance = np.zeros(seen.shape, np.int32)
        instance[seen] = self.scene.face_instance[hit_faces]
        return Frame(rgb, np.where(seen, depth, np.float32(0.0)), instance)

    def close(self) -> None:
        """Give back the ray casting structure; closing twice is harmless."""
        self._geometry = None


def _import_open3d() -> Any:
    try:
        import open3d
    except (ImportError, OSError) as error:
        raise RendererUnavailableError(
            f"raycast: found no usable open3d ({error}), expected it to import. "
            "Install its libraries (Debian: apt install libusb-1.0-0 libgl1 libx11-6 libgomp1)."
        ) from error
    return open3d


def _pack_textures(scene: Scene) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """All texels, flat (n,) uint8, and for each material (first texel, height, width); height 0 = no texture."""
    table = np.zeros((len(scene.materials), 3), np.int64)
    parts, first = [np.zeros(0, np.uint8)], 0
    for row, material in zip(table, scene.materials, strict=True):
        if material.texture is not None and scene.uv is not None:
            row[:] = first, *material.texture.shape[:2]
            parts.append(np.ascontiguousarray(material.texture).reshape(-1))
            first += parts[-1].size
    return np.concatenate(parts), table


@numba.njit(cache=True)
def _shade(
    face: npt.NDArray[np.int64],
    barycentric: npt.NDArray[np.float32],
    corner_uv: npt.NDArray[np.float32],
    corner_colour: npt.NDArray[np.float32],
    face_material: npt.NDArray[np.int32],
    texels: npt.NDArray[np.uint8],
    texture_table: npt.NDArray[np.int64],
) -> npt.NDArray[np.uint8]:
    """Colours (n, 3) uint8 of n hits: bilinear texture times interpolated corner colour, as sRGB display values.

    A texel's centre lies at half-integers: sample (u, v) falls at ``(u w - 0.5, v h - 0.5)``, row 0 on top.
    """
    out = np.empty((len(face), 3), np.uint8)
    for n in range(len(face)):
        f = face[n]
        b, c = barycentric[n, 0], barycentric[n, 1]
        a = 1.0 - b - c
        first, h, w = texture_table[face_material[f]]
        if h > 0:
            u = a * corner_uv[f, 0, 0] + b * corner_uv[f, 1, 0] + c * corner_uv[f, 2, 0]
            v = a * corner_uv[f, 0, 1] + b * corner_uv[f, 1, 1] + c * corner_uv[f, 2, 1]
            x, y = (u - np.floor(u)) * w - 0.5, (v - np.floor(v)) * h - 0.5
            x0, y0 = int(np.floor(x)), int(np.floor(y))
            s, t = x - x0, y - y0
            left, right, top, bottom = x0 % w, (x0 + 1) % w, y0 % h, (y0 + 1) % h
        for k in range(3):
            value = a * corner_colour[f, 0, k] + b * corner_colour[f, 1, k] + c * corner_colour[f, 2, k]
            if h > 0:
                upper = (1.0 - s) * texels[first + (top * w + left) * 3 + k] + s * texels[
                    first + (top * w + right) * 3 + k
                ]
                lower = (1.0 - s) * texels[first + (bottom * w + left) * 3 + k] + s * texels[
                    first + (bottom * w + right) * 3 + k
                ]
                value *= ((1.0 - t) * upper + t * lower) / 255.0
            out[n, k] = int(min(max(value, 0.0), 1.0) * 255.0 + 0.5)
    return out
