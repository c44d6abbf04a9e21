"""Agents to compare with: from those that know nothing to the one that knows everything."""

from openmap_agents.baselines.oracle import OracleAgent
from openmap_agents.baselines.simple import RandomAgent, StandStillAgent

__all__ = ["OracleAgent", "RandomAgent", "StandStillAgent"]
