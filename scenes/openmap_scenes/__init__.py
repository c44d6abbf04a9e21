"""What a home is: geometry, textures, instances, rooms; readers for the formats that homes come in; homes of our own."""

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.catalog import load_scene
from openmap_scenes.errors import DataError
from openmap_scenes.scene import Instance, Material, Room, Scene

__all__ = ["DataError", "Instance", "Material", "PinholeCamera", "Room", "Scene", "load_scene"]
