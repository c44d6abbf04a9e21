"""What other people render indoor meshes with, used as its documentation shows, on the same home and from the same poses.

Each shows what it can: some have no ids, and one no colours. None culls anything that its library does not cull by itself.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes import PinholeCamera, Scene

Shown = tuple[npt.NDArray[Any] | None, ...]
_NEAR, _FAR = 0.05, 100.0


def _parts(scene: Scene) -> Iterator[tuple[int, int, npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]]:
    """(instance, material, vertices, uv, faces) of each object by itself; uv with v down."""
    assert scene.uv is not None
    looks = np.stack([scene.face_instance, scene.face_material], 1)
    kinds, kind = np.unique(looks, axis=0, return_inverse=True)
    order = np.argsort(kind.reshape(-1), kind="stable")
    firsts = np.searchsorted(kind.reshape(-1)[order], np.arange(len(kinds) + 1))
    for (instance, material), first, last in zip(kinds.tolist(), firsts[:-1], firsts[1:], strict=True):
        vertices, faces = np.unique(scene.faces[order[first:last]], return_inverse=True)
        yield instance, material, scene.vertices[vertices], scene.uv[vertices], faces.reshape(-1, 3)


class StockPyrender:
    """pyrender as its users have it: a mesh for each object, an ``OffscreenRenderer``, colours and ids in two calls."""

    def __init__(self, scene: Scene, camera: PinholeCamera) -> None:
        pyrender: Any = import_module("pyrender")
        trimesh: Any = import_module("trimesh")

        self._world = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 0.0), ambient_light=(1.0, 1.0, 1.0))
        self._shades: dict[Any, tuple[int, int, int]] = {}
        looks = [
            pyrender.MetallicRoughnessMaterial(
                baseColorTexture=pyrender.Texture(source=np.asarray(m.texture), source_channels="RGB"), doubleSided=True
            )
            for m in scene.materials
        ]
        for instance, material, vertices, uv, faces in _parts(scene):
            visual = trimesh.visual.TextureVisuals(uv=uv * (1, -1) + (0, 1))
            mesh = trimesh.Trimesh(vertices, faces, visual=visual, process=False)
            node = self._world.add(pyrender.Mesh.from_trimesh(mesh, material=looks[material]))
            self._shades[node] = (instance >> 16 & 255, instance >> 8 & 255, instance & 255)
        lens = pyrender.IntrinsicsCamera(camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5, _NEAR, _FAR)
        self._eye = self._world.add(lens)
        self._renderer = pyrender.OffscreenRenderer(camera.width, camera.height)
        self._flags = pyrender.RenderFlags

    def show(self, T_world_camera: npt.NDArray[np.float64]) -> Shown:
        self._world.set_pose(self._eye, T_world_camera)
        flat = self._flags.FLAT | self._flags.SKIP_CULL_FACES
        rgb, depth = self._renderer.render(self._world, flat)
        shade, _ = self._renderer.render(self._world, self._flags.SEG, self._shades)
        code = shade.astype(np.int32)
        return rgb, depth, (code[..., 0] << 16) + (code[..., 1] << 8) + code[..., 2]

    def close(self) -> None:
        self._renderer.delete()


class HabitatSim:
    """habitat-sim with the home as its stage: a colour and a depth sensor. Ids would need its own annotation format."""

    def __init__(self, scene: Scene, camera: PinholeCamera) -> None:
        habitat_sim: Any = import_module("habitat_sim")
        trimesh: Any = import_module("trimesh")

        self._folder = tempfile.TemporaryDirectory(prefix="openmap-bench-")
        world = trimesh.Scene()
        pictures = [Image.fromarray(np.asarray(m.texture)) for m in scene.materials]
        for _, material, vertices, uv, faces in _parts(scene):
            surface = trimesh.visual.material.PBRMaterial(baseColorTexture=pictures[material], doubleSided=True)
            look = trimesh.visual.TextureVisuals(uv=uv * (1, -1) + (0, 1), material=surface)
            world.add_geometry(trimesh.Trimesh(vertices, faces, visual=look, process=False))
        path = Path(self._folder.name) / "home.glb"
        path.write_bytes(world.export(file_type="glb"))
        settings = habitat_sim.SimulatorConfiguration()
        settings.scene_id, settings.enable_physics = str(path), False
        settings.gpu_device_id = int(os.environ.get("HABITAT_SIM_GPU", "0"))
        sensors = []
        for name, kind in (("rgb", habitat_sim.SensorType.COLOR), ("depth", habitat_sim.SensorType.DEPTH)):
            sensor = habitat_sim.CameraSensorSpec()
            sensor.uuid, sensor.sensor_type = name, kind
            sensor.resolution, sensor.position = [camera.height, camera.width], [0.0, 0.0, 0.0]
            sensor.hfov = float(np.degrees(2 * np.arctan(camera.width / (2 * camera.fx))))
            sensors.append(sensor)
        body = habitat_sim.agent.AgentConfiguration(sensor_specifications=sensors)
        self._sim = habitat_sim.Simulator(habitat_sim.Configuration(settings, [body]))
        self._habitat = habitat_sim

    def show(self, T_world_camera: npt.NDArray[np.float64]) -> Shown:
        from scipy.spatial.transform import Rotation

        x, y, z, w = Rotation.from_matrix(T_world_camera[:3, :3]).as_quat().tolist()
        state = self._habitat.AgentState(T_world_camera[:3, 3].astype(np.float32))
        state.rotation = self._habitat.utils.common.quat_from_coeffs([x, y, z, w])
        self._sim.get_agent(0).set_state(state)
        seen = self._sim.get_sensor_observations()
        return np.asarray(seen["rgb"])[..., :3], np.asarray(seen["depth"]), None

    def close(self) -> None:
        self._sim.close()
        self._folder.cleanup()


class Mujoco:
    """MuJoCo's own renderer on the home as static meshes: colours, depth and ids in three calls."""

    def __init__(self, scene: Scene, camera: PinholeCamera) -> None:
        mujoco: Any = import_module("mujoco")

        spec = mujoco.MjSpec()
        spec.visual.global_.offwidth, spec.visual.global_.offheight = camera.width, camera.height
        spec.visual.global_.fovy = float(np.degrees(2 * np.arctan(camera.height / (2 * camera.fy))))
        spec.visual.headlight.ambient = [1.0, 1.0, 1.0]
        spec.visual.headlight.diffuse = spec.visual.headlight.specular = [0.0, 0.0, 0.0]
        # Near and far are given in units of the extent.
        spec.stat.extent, spec.visual.map.znear, spec.visual.map.zfar = 1.0, _NEAR, _FAR
        for number, surface in enumerate(scene.materials):
            picture = np.ascontiguousarray(surface.texture)
            texture = spec.add_texture(name=f"t{number}", type=mujoco.mjtTexture.mjTEXTURE_2D)
            texture.height, texture.width, texture.nchannel = *picture.shape[:2], 3
            texture.data = picture.tobytes()
            roles = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
            roles[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = f"t{number}"
            spec.add_material(name=f"m{number}", textures=roles)
        instances = []
        for number, (instance, material, vertices, uv, faces) in enumerate(_parts(scene)):
            # As a shell, since open surfaces have no volume.
            spec.add_mesh(
                name=f"g{number}", uservert=vertices.reshape(-1), userface=faces.reshape(-1).astype(np.int32),
                usertexcoord=uv.reshape(-1), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )  # fmt: skip
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"g{number}", material=f"m{material}",
                contype=0, conaffinity=0,
            )  # fmt: skip
            instances.append(instance)
        self._instances = np.array([0, *instances], np.int32)
        spec.worldbody.add_camera(name="eye")
        model = spec.compile()
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._renderer = mujoco.Renderer(model, camera.height, camera.width, max_geom=2 * len(instances) + 100)
        self._camera_id = model.camera("eye").id

    def show(self, T_world_camera: npt.NDArray[np.float64]) -> Shown:
        self._data.cam_xpos[self._camera_id] = T_world_camera[:3, 3]
        self._data.cam_xmat[self._camera_id] = T_world_camera[:3, :3].reshape(-1)
        self._renderer.update_scene(self._data, "eye")
        rgb = self._renderer.render()
        self._renderer.enable_depth_rendering()
        depth = self._renderer.render()
        self._renderer.disable_depth_rendering()
        self._renderer.enable_segmentation_rendering()
        ids = self._renderer.render()[..., 0]
        self._renderer.disable_segmentation_rendering()
        return rgb, np.where(depth < 0.99 * _FAR, depth, 0.0).astype(np.float32), self._instances[ids + 1]

    def close(self) -> None:
        self._renderer.close()


class PyVista:
    """VTK through pyvista: an actor for each object, colours and depth. Ids would need a second scene."""

    def __init__(self, scene: Scene, camera: PinholeCamera) -> None:
        pyvista: Any = import_module("pyvista")

        self._plotter = pyvista.Plotter(off_screen=True, window_size=[camera.width, camera.height], lighting="none")
        pictures = [pyvista.Texture(np.ascontiguousarray(m.texture)) for m in scene.materials]
        for _, material, vertices, uv, faces in _parts(scene):
            mesh = pyvista.PolyData.from_regular_faces(vertices, faces)
            mesh.active_texture_coordinates = (uv * (1, -1) + (0, 1)).astype(np.float32)
            self._plotter.add_mesh(mesh, texture=pictures[material], lighting=False)
        eye = self._plotter.camera
        eye.view_angle = float(np.degrees(2 * np.arctan(camera.height / (2 * camera.fy))))
        eye.clipping_range = (_NEAR, _FAR)
        self._plotter.show(auto_close=False)

    def show(self, T_world_camera: npt.NDArray[np.float64]) -> Shown:
        eye, R = self._plotter.camera, T_world_camera[:3, :3]
        eye.position, eye.focal_point = T_world_camera[:3, 3], T_world_camera[:3, 3] - R[:, 2]
        eye.up, eye.clipping_range = R[:, 1], (_NEAR, _FAR)
        self._plotter.render()
        rgb = self._plotter.screenshot(return_img=True)
        depth = -np.nan_to_num(self._plotter.get_image_depth(fill_value=0.0))
        return rgb, depth.astype(np.float32), None

    def close(self) -> None:
        self._plotter.close()


class Open3DRays:
    """Open3D's ray casting alone: depth and ids, no colours."""

    def __init__(self, scene: Scene, camera: PinholeCamera) -> None:
        open3d: Any = import_module("open3d")

        self._tensor, self._camera = open3d.core.Tensor, camera
        self._world = open3d.t.geometry.RaycastingScene()
        vertices, faces = np.ascontiguousarray(scene.vertices), np.ascontiguousarray(scene.faces, np.uint32)
        self._world.add_triangles(self._tensor(vertices), self._tensor(faces))
        self._instance = np.append(scene.face_instance, np.int32(0))
        self._nothing = len(scene.face_instance)

    def show(self, T_world_camera: npt.NDArray[np.float64]) -> Shown:
        rays = np.empty((self._camera.height, self._camera.width, 6), np.float32)
        rays[..., :3] = T_world_camera[:3, 3]
        rays[..., 3:] = self._camera.rays() @ T_world_camera[:3, :3].T
        hits = self._world.cast_rays(self._tensor(rays))
        depth, face = hits["t_hit"].numpy(), hits["primitive_ids"].numpy()
        return None, np.where(np.isfinite(depth), depth, 0.0), self._instance[np.minimum(face, self._nothing)]

    def close(self) -> None:
        """It has no context."""


PEERS: dict[str, Callable[[Scene, PinholeCamera], Any]] = {
    "pyrender": StockPyrender,
    "habitat-sim": HabitatSim,
    "mujoco": Mujoco,
    "pyvista": PyVista,
    "open3d rays": Open3DRays,
}
