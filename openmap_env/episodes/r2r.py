"""Episodes of R2R-CE (VLN-CE): ``{"episodes": [...]}``, gzipped, with a way in words and the place where it ends.

Fields that are read: ``episode_id``, ``trajectory_id``, ``scene_id``, ``start_position``, ``start_rotation`` [x, y, z, w],
``instruction.instruction_text``, ``goals[].position`` and ``radius``, ``reference_path``, ``info``.
"""

from __future__ import annotations

from openmap_env.episodes.episode import Episode, place
from openmap_env.episodes.fields import heading_of, name, number, point, remarks, text
from openmap_scenes.formats.checked_json import Value


def r2r_episode(entry: Value, scene: str) -> Episode:
    """One entry of ``episodes``; its goals are places, not instances."""
    goals = entry["goals"]
    if not goals.raw:
        goals.fail("a list of at least one {position, radius}")
    radius = goals.items()[0]["radius"]
    return Episode(
        episode_id=name(entry["episode_id"]),
        scene=scene,
        instruction=" ".join(text(entry["instruction"]["instruction_text"]).split()),
        kind="language_guided",
        start_position=point(entry["start_position"]),
        start_heading=heading_of(entry["start_rotation"]),
        targets=tuple(place(point(goal["position"])) for goal in goals.items()),
        info={
            **remarks(entry["info"]),
            "scene_id": text(entry["scene_id"]),
            "radius": number(radius) if radius.exists else None,
            "trajectory_id": name(entry["trajectory_id"]) if entry["trajectory_id"].exists else None,
            "reference_path": [list(point(p)) for p in entry["reference_path"].items()],
        },
    )
