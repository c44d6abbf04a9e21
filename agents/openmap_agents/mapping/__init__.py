"""The instance map: frames -> masks -> consensus -> instances."""

from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_scenes import PinholeCamera

__all__ = ["InstanceMap", "MapInstance", "PinholeCamera"]
