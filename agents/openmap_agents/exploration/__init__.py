"""Occupancy, next best views, and the way there."""

from openmap_agents.exploration.explorer import Explorer, ExplorerSettings
from openmap_agents.exploration.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap, OccupancySettings
from openmap_agents.exploration.planner import PlannerSettings
from openmap_agents.exploration.standing import standing_place
from openmap_agents.exploration.walker import Walker, WalkerSettings

__all__ = [
    "FREE",
    "OCCUPIED",
    "UNKNOWN",
    "Explorer",
    "ExplorerSettings",
    "OccupancyMap",
    "OccupancySettings",
    "PlannerSettings",
    "Walker",
    "WalkerSettings",
    "standing_place",
]
