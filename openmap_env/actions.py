"""What an agent can do in one step."""

from __future__ import annotations

from enum import IntEnum


class Action(IntEnum):
    """The discrete actions; how far and how much is a setting of the simulator."""

    STOP = 0
    MOVE_FORWARD = 1
    TURN_LEFT = 2
    TURN_RIGHT = 3
    LOOK_UP = 4
    LOOK_DOWN = 5
