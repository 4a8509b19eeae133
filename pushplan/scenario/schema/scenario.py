"""The scenario file as a typed model, and the defaults of everything that may be left out."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from pushplan.scenario.parts import DEFAULT_TOLERANCE
from pushplan.scenario.schema import types as t
from pushplan.scenario.schema.objects import FRICTION, NAME, POLYGON, Contacts, Object, Plate
from pushplan.scenario.schema.robot import Robot
from pushplan.scenario.values.quantity import fault
from pushplan.util import names


def _one_of(words: tuple[str, ...]) -> str:
    return f"one of {', '.join(words)}"


_SHARE = "a share from 0 to 0.9, e.g. 20 %"
_SNAP = "a length in m, e.g. 5 mm, or {position: 5 mm, angle: 2 deg}"


class Uncertainty(t.Strict):
    """By what share of the stated value coefficients and loads may be off; explicit intervals come before it."""

    contact_friction: t.Share = Field(default=0.0, description=_SHARE)
    floor_friction: t.Share = Field(default=0.0, description=_SHARE)
    load: t.Share = Field(default=0.0, description=_SHARE)


class Snap(t.Strict):
    """How far objects with a stated pose may be from the contact that they are moved onto."""

    position: t.SnapDistance = Field(description="a length in m")
    angle: t.SnapAngle = Field(default=math.radians(2.0), description="an angle in rad")


class Floor(t.Strict):
    """The floor under every object that does not state its own friction."""

    friction: t.FloorFriction = Field(description=FRICTION)


class Tolerance(t.Strict):
    """How far from the goal is still at the goal."""

    position: t.PositionTolerance = Field(default=DEFAULT_TOLERANCE[0], description="a length in m")
    angle: t.AngleTolerance = Field(default=DEFAULT_TOLERANCE[1], description="an angle in rad")


class ObjectGoal(t.Strict):
    """Where to bring an object."""

    pose: t.Pose = Field(description="[x, y, theta] in the world")
    tolerance: Tolerance = Field(default_factory=Tolerance, description="{position: ..., angle: ...}")
    symmetry: t.Symmetry = Field(
        default=1, description="a whole number: after so many equal turns the frame meant is as it was"
    )


class GoalPose(ObjectGoal):
    """Where to bring the chain."""

    of: str | None = Field(
        default=None, description="the name of the object meant; left out, the chain frame is meant"
    )


GOAL = "{pose: [x, y, theta], ...}, or a list of 1 to 100 of these, any of which will do"
Goals = Annotated[
    Annotated[GoalPose, Tag("<mapping>")]
    | Annotated[Annotated[tuple[GoalPose, ...], t.Several(1, 100)], Tag("<list>")],
    Discriminator(lambda value: "<list>" if isinstance(value, list | tuple) else "<mapping>"),
]


class PushChoice(t.Strict):
    """What several pushes may come to, and what counts when they are ranked."""

    most: t.Most = Field(default=6, description="a whole number")
    switch_cost: t.ArcPrice = Field(default=0.1, description="a length in m")
    transit_weight: t.Weight = Field(default=0.1, description="a weight from 0 to 1000")
    approach: t.Travel = Field(default=0.05, description="a length in m")
    retreat: t.Travel = Field(default=0.05, description="a length in m")
    settle: t.Travel = Field(default=0.02, description="a length in m")


class Area(t.Strict):
    """The rectangle in which robot, pusher and objects stay."""

    x: t.Interval = Field(description="[min, max] in m")
    y: t.Interval = Field(description="[min, max] in m")


class Obstacle(t.Strict):
    """A polygon or box, both at an optional pose in the world, a circle, or all that a map has."""

    model_config = t.exactly_one(
        "polygon",
        "box",
        "circle",
        "map",
        needs={"box": "pose", "circle": "center"},
        only={"center": "circle", "pose": "polygon box", "unknown": "polygon map"},
    )

    polygon: t.Polygon | None = Field(default=None, description=POLYGON)
    box: t.Box | None = Field(default=None, description="[length along x, width along y]")
    circle: t.Size | None = Field(default=None, description="a radius in m")
    pose: t.Pose | None = Field(default=None, description="[x, y, theta] in the world, of a box or polygon")
    center: t.Point | None = Field(default=None, description="[x, y] in the world, of a circle")
    map: Annotated[str, Field(strict=True, min_length=1)] | None = Field(
        default=None, description="a ROS map (YAML) in the scenario's folder"
    )
    unknown: Literal["obstacle", "free"] | None = Field(
        default=None,
        description="obstacle, the default, or free: what a map does not know",
    )

    @model_validator(mode="after")
    def _complete(self) -> Obstacle:
        t.require_one(self, "polygon", "box", "circle", "map")
        if self.circle is not None and self.center is None:
            raise fault("is a circle without center", "{circle: radius, center: [x, y]}")
        if self.circle is not None and self.pose is not None:
            raise fault("is a circle with a pose", "{circle: radius, center: [x, y]}")
        if self.map is not None and self.pose is not None:
            raise fault("is a map with a pose", "{map: file.yaml}, whose origin says where it is")
        if self.unknown is not None and self.map is None and (self.polygon is None or self.unknown == "free"):
            raise fault("has unknown but is no map", "{map: file.yaml, unknown: obstacle | free}")
        if self.circle is None and self.center is not None:
            raise fault("has a center but is no circle", "{polygon: ...}, or {box: ..., pose: ...}")
        if self.box is not None and self.pose is None:
            raise fault("is a box without pose", "{box: [length, width], pose: [x, y, theta]}")
        return self


class StabilityChoice(t.Strict):
    """Which stable set limits the pusher's twists, and how far inside it they stay."""

    set: Literal[names.STABLE_SETS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_STABLE_SET, description=_one_of(names.STABLE_SETS)
    )
    margin: t.Margin = Field(default=names.AUTO, description="auto, or a margin from 0 to 0.99")


class PlannerChoice(t.Strict):
    """Which planner runs, for how long, with which random numbers."""

    name: Literal[names.PLANNERS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_PLANNER, description=_one_of(names.PLANNERS)
    )
    time_limit: t.Duration = Field(default=2.0, description="a time in s")
    seed: t.Seed = Field(default=1, description="a whole number")
    cost: Literal[names.COSTS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_COST, description=_one_of(names.COSTS)
    )
    weight: t.Weight = Field(default=1.0, description="a weight from 0 to 1000")
    gap: t.Gap = Field(default=0.0, description="a share from 0 to 100")
    arc_price: t.ArcPrice = Field(default=0.03, description="a length in m")


SnapChoice = Annotated[
    Annotated[t.SnapDistance, Tag("<length>")] | Annotated[Snap, Tag("<mapping>")],
    Discriminator(lambda value: "<mapping>" if isinstance(value, dict | t.Strict) else "<length>"),
]


class StatedRoom(t.Strict):
    """What every scenario file states: objects, robot, room and settings, but for where objects are and shall go."""

    format: Literal["pushplan/1"] = Field(description=names.SCENARIO_FORMAT)
    name: t.Name | None = Field(default=None, description=NAME)
    floor: Floor = Field(description="{friction: ...}")
    uncertainty: Uncertainty = Field(
        default_factory=Uncertainty, description="{contact_friction: ..., floor_friction: ..., load: ...}"
    )
    snap: SnapChoice | None = Field(default=None, description=_SNAP)
    objects: Annotated[tuple[Object, ...], t.Several(1, 200)] = Field(
        description="a list of 1 to 200 objects, from the pusher outward"
    )
    contacts: Contacts = Field(default_factory=Contacts, description="{friction: ..., between: [...]}")
    pusher: Plate = Field(description="{width: ..., friction: ..., ...}")
    robot: Robot = Field(default_factory=Robot, description="{footprint: ..., drive: ..., start: ...}")
    pushes: PushChoice | None = Field(
        default=None, description="{most: ..., switch_cost: ..., transit_weight: ..., approach: ..., ...}"
    )
    workspace: Area | None = Field(default=None, description="{x: [min, max], y: [min, max]}")
    obstacles: Annotated[tuple[Obstacle, ...], t.Several(0, 10_000)] = Field(
        default=(),
        description="a list of at most 10000 {polygon: ...}, {box: ..., pose: ...}, {circle: ..., center: ...} and "
        "{map: file.yaml}",
    )
    clearance: t.Clearance = Field(default=names.COLLISION_CLEARANCE, description="a length in m")
    stability: StabilityChoice = Field(default_factory=StabilityChoice, description="{set: ..., margin: ...}")
    trajectory: Literal[names.TRAJECTORIES] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_TRAJECTORY, description=_one_of(names.TRAJECTORIES)
    )
    planner: PlannerChoice = Field(
        default_factory=PlannerChoice, description="{name: ..., time_limit: ..., seed: ...}"
    )


class ScenarioFile(StatedRoom):
    """One push problem."""

    start: t.Pose = Field(
        default=(0.0, 0.0, 0.0), description="[x, y, theta] of the chain frame in the world"
    )
    goal: Goals = Field(description=GOAL)
