"""A Gymnasium environment for instruction grounding in indoor meshes.

``import openmap_env`` makes ``gymnasium.make("OpenMapNav-v0")`` work, as does ``gymnasium.make("openmap_env:OpenMapNav-v0")``.
"""

import gymnasium

ENV_ID = "OpenMapNav-v0"

if ENV_ID not in gymnasium.registry:
    gymnasium.register(
        id=ENV_ID,
        entry_point="openmap_env.env:OpenMapNavEnv",
        vector_entry_point="openmap_env.vector:OpenMapNavVectorEnv",
        # The checker is for those who write an environment. Once a reset has raised it never lets an episode begin again.
        disable_env_checker=True,
    )

__all__ = ["ENV_ID"]
