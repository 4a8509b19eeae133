"""A scenario file in which several objects have goals of their own, as a typed model."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Tag

from pushplan.scenario.schema import types as t
from pushplan.scenario.schema.objects import Object
from pushplan.scenario.schema.robot import Robot
from pushplan.scenario.schema.scenario import ObjectGoal, StatedRoom

GOALS = "a mapping from names of objects to poses [x, y, theta], {pose: ..., symmetry: ...} or lists of these"


class PlacedObject(Object):
    """One object, apart from the others."""

    pose: t.Pose = Field(description="[x, y, theta] in the world, where there are goals")


class PlacedRobot(Robot):
    """The robot, which stands somewhere in the room."""

    start: t.Pose = Field(description="[x, y, theta] of the plate's frame in the world")


def _form(value: object) -> str:
    """Tell a goal from a list of goals: a pose is a list of numbers."""
    if not isinstance(value, list | tuple):
        return "<mapping>"
    several = any(isinstance(one, dict | list | tuple | t.Strict) for one in value)
    return "<list>" if several else "<bare>"


_One = Annotated[
    Annotated[t.Pose, Tag("<bare>")] | Annotated[ObjectGoal, Tag("<mapping>")],
    Discriminator(lambda value: "<bare>" if isinstance(value, list | tuple) else "<mapping>"),
]
_Goals = Annotated[
    Annotated[t.Pose, Tag("<bare>")]
    | Annotated[ObjectGoal, Tag("<mapping>")]
    | Annotated[Annotated[tuple[_One, ...], t.Several(1, 100)], Tag("<list>")],
    Discriminator(_form),
]


class SeveralObjectsFile(StatedRoom):
    """Several objects that stand apart, each with goals of its own or without any."""

    objects: Annotated[tuple[PlacedObject, ...], t.Several(1, 200)] = Field(
        description="a list of 1 to 200 objects, each with its pose in the world"
    )
    robot: PlacedRobot = Field(description="{footprint: ..., drive: ..., start: ...}")
    goals: Annotated[dict[str, _Goals], Field(min_length=1)] = Field(description=GOALS)
