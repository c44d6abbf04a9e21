"""Where a body can stand and walk: the navigable surface, geodesic distance, shortest paths."""

from openmap_env.navigation.cells import Body
from openmap_env.navigation.follower import ShortestPathFollower
from openmap_env.navigation.surface import DistanceField, NavigableSurface, TopDownMap

__all__ = ["Body", "DistanceField", "NavigableSurface", "ShortestPathFollower", "TopDownMap"]
