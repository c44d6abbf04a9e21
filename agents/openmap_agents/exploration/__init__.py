"""Occupancy from depth, frontiers, a local planner."""
