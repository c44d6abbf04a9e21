"""Agents to compare with: they bound the OpenMap agent from below and above."""
