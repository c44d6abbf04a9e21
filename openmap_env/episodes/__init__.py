"""Episodes: reading them, writing them, and making them for any home with semantics."""

from openmap_env.episodes.episode import KINDS, Episode, Kind, Target
from openmap_env.episodes.generator import generate_episodes
from openmap_env.episodes.jsonl import read_episodes, write_episodes
from openmap_env.episodes.readers import load_episodes

__all__ = [
    "KINDS",
    "Episode",
    "Kind",
    "Target",
    "generate_episodes",
    "load_episodes",
    "read_episodes",
    "write_episodes",
]
