"""The instance map: frames -> masks -> consensus -> instances.

``OpenMapper`` takes posed RGB-D frames with masks one by one; ``InstanceMap`` is what it builds. It needs no environment.
"""

from openmap_agents.mapping.instance_map import InstanceMap, MapInstance, TopDown
from openmap_agents.mapping.online import OpenMapper
from openmap_agents.mapping.settings import MappingSettings
from openmap_scenes import PinholeCamera

__all__ = ["InstanceMap", "MapInstance", "MappingSettings", "OpenMapper", "PinholeCamera", "TopDown"]
