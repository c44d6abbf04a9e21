"""Everything that perceives, remembers, understands and acts."""

from openmap_agents.factory import make_agent

__all__ = ["make_agent"]
