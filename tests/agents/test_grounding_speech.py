"""What people say around the thing that they mean does not change which thing that is."""

import pytest

from openmap_agents.grounding.description import Thing
from openmap_agents.grounding.interpreter import Interpreter


@pytest.fixture(scope="module")
def interpreter() -> Interpreter:
    return Interpreter()


def told(thing: Thing | None) -> tuple[str, str | None, list[tuple[str, str, bool]]]:
    """Name, room and relations."""
    assert thing is not None
    return thing.phrase, thing.room, [(r.name, r.landmarks[0].phrase, r.negated) for r in thing.relations]


@pytest.mark.parametrize(
    ("instruction", "expected"),
    [
        ("Do you know where the window above the toilet is?", ("window", None, [("above", "toilet", False)])),
        ("Go to the chair, I mean the stool by the window.", ("stool", None, [("near", "window", False)])),
        ("the chair, sorry, the stool", ("stool", None, [])),
        ("There's a lamp in the bedroom, turn it on", ("lamp", "bedroom", [])),
        ("Throw this in the trash can in the living room, please.", ("trash can", "living room", [])),
        ("Plump up the cushions on the sofa.", ("cushions", None, [("on", "sofa", False)])),
        ("Find the chest of drawers by the window", ("chest of drawers", None, [("near", "window", False)])),
        ("the chair, but not the one by the door", ("chair", None, [("near", "door", True)])),
        (
            "Walk by the armchair on your right, then carry on to the magazine on the coffee table.",
            ("magazine", None, [("on", "coffee table", False)]),
        ),
        (
            "Leave the bedroom through the door and keep going through the hall. Walk on to the telly on the TV stand.",
            ("telly", "hallway", [("on", "tv stand", False)]),
        ),
    ],
)
def test_the_thing_meant(
    interpreter: Interpreter, instruction: str, expected: tuple[str, str | None, list[tuple[str, str, bool]]]
) -> None:
    assert told(interpreter.parse(instruction).target) == expected


@pytest.mark.parametrize(
    ("instruction", "needs", "room"),
    [
        ("Listen, I feel like reading. Can you lead the way?", ("i feel like reading",), None),
        ("Sorry to bother you, but I have to fill a jug.", ("i have to fill a jug",), None),
        ("I want to look outside from the kitchen. Where should I look?", ("i want to look outside",), "kitchen"),
        ("I'd like to air the bathroom.", ("i'd like to air the room",), "bathroom"),
        ("There are crumbs all over the floor.", ("there are crumbs all over the floor",), None),
    ],
)
def test_the_need_stated(interpreter: Interpreter, instruction: str, needs: tuple[str, ...], room: str | None) -> None:
    description = interpreter.parse(instruction)
    assert (description.needs, description.needs_room, description.target) == (needs, room, None)


def test_what_is_ruled_out(interpreter: Interpreter) -> None:
    description = interpreter.parse("Anything but the sofa, I need to sit down.")
    assert [thing.phrase for thing in description.avoid] == ["sofa"]
    assert description.needs == ("i need to sit down",)
