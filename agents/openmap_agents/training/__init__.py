"""Policies learned by trial on the environment: ``python -m openmap_agents.training.ppo``, and ``load`` for what came out of it.

Needs the extra ``train`` (stable-baselines3); ``stable_baselines`` says so where it is missing.
"""

from __future__ import annotations

from openmap_agents.training.policy import load

__all__ = ["load"]
