"""The scenario file as a typed model, with the defaults of what may be left out; descriptions say what is allowed."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from pushplan.mechanics.chain import Limits
from pushplan.scenario import fields as t
from pushplan.scenario.parts import DEFAULT_TOLERANCE, TOLERANCE_OF_SEVERAL
from pushplan.scenario.units import fault
from pushplan.util import names

NAME = "a name of up to 64 letters, digits, blanks, '.', '_' and '-' that begins with a letter or digit"
FRICTION = 'a friction coefficient, or a friction angle, e.g. "14 deg"'
POLYGON = f"a list of 3 to {t.MOST_CORNERS} corners [x, y]"
FACES = f"all, or a list of {', '.join(names.FACES)} and angles of outward normals in the chain frame"
SUPPORT = "uniform, unknown, {feet: [[x, y], ...]}, {feet: [[x, y, load], ...]} or {pressure_map: file.csv}"
DRIVE = "omnidirectional, {differential: {axle: [x, y, theta]}} or {car: {axle: ..., min_radius: ...}}"
GOAL = "{pose: [x, y, theta], ...}, or a list of 1 to 100 of these, any of which will do"
GOALS = "a mapping from names of objects to poses [x, y, theta], {pose: ..., symmetry: ...} or lists of these"
ROW = "{of: [name, name, ...], pose: [x, y, theta]}, or wall: ... or anywhere: true in place of the pose"
SNAP = "a length in m, e.g. 5 mm, or {position: 5 mm, angle: 2 deg}"
SHARE = "a share from 0 to 0.9, e.g. 20 %"
LENGTH = "a length in m"
HEIGHT = "a height in m, or the interval [lowest, highest] of it"
MOST_PARTS = 50
MOST_IN_ROW = 30
FOOTPRINT = (
    "{box: [length, width], pose: [x, y, theta]}, {polygon: [[x, y], ...]} or a list of 1 to "
    f"{MOST_PARTS} of these"
)
OBSTACLES = (
    "a list of at most 10000 {polygon: ...}, {box: ..., pose: ...}, {circle: ..., center: ...} and "
    "{map: file.yaml}"
)
_AXLE = (
    "[x, y, theta] of the axle's middle, in the chain frame in pusher.drive, in the plate's in robot.drive"
)
_LIMITS = Limits()


def _one_of(words: tuple[str, ...]) -> str:
    return f"one of {', '.join(words)}"


class BoxShape(t.Strict):
    """A box about its frame's origin."""

    box: t.Box = Field(description="[length along x, width along y]")


class PolygonShape(t.Strict):
    """A polygon in its frame."""

    polygon: t.Polygon = Field(description=POLYGON)


Shape = Annotated[
    Annotated[BoxShape, Tag("<box>")] | Annotated[PolygonShape, Tag("<polygon>")],
    t.by_key("box", "polygon"),
]


class Feet(t.Strict):
    """Feet in the object's frame, all of them with their part of the load, or none."""

    feet: Annotated[
        tuple[t.Foot, ...],
        t.Several(1, 1000),
        Field(
            json_schema_extra={
                "anyOf": [{"items": {"type": "array", "maxItems": n, "minItems": n}} for n in (2, 3)]
            }
        ),
    ] = Field(description="a list of 1 to 1000 feet [x, y] or [x, y, load]")

    @model_validator(mode="after")
    def _alike(self) -> Feet:
        if len({len(foot) for foot in self.feet}) > 1:
            raise fault("some feet have a load and some have none", "a load for every foot, or for none")
        return self


class PressureMap(t.Strict):
    """A measured pressure in the object's frame."""

    pressure_map: t.FileName = Field(
        description="the name of a CSV file beside the scenario, with the columns x, y, pressure"
    )


Support = Annotated[
    Annotated[Literal["uniform", "unknown"], Tag("<word>")]
    | Annotated[Feet, Tag("<feet>")]
    | Annotated[PressureMap, Tag("<pressure_map>")],
    t.by_key("feet", "pressure_map"),
]


class Object(t.Strict):
    """One object; without `pose` it is stacked flush on the one before, or on the plate."""

    name: t.Name = Field(description=NAME)
    shape: Shape = Field(description="{box: [length, width]} or {polygon: [[x, y], ...]}")
    mass: t.Mass = Field(description="a mass in kg")
    support: Support = Field(default="uniform", description=SUPPORT)
    height: t.Size | None = Field(default=None, description="a height in m")
    center_of_mass: t.MassCenter | None = Field(
        default=None, description="[x, y] in the object's frame, or [x, y, z] with z above the floor"
    )
    floor_friction: t.Friction | None = Field(default=None, description=FRICTION)
    offset: t.Coordinate | None = Field(default=None, description=LENGTH)
    pose: t.Pose | None = Field(default=None, description="[x, y, theta] in the chain frame")


class ContactPair(t.Strict):
    """The friction between two objects, or between the pusher and an object, and the height of their contact."""

    objects: Annotated[tuple[str, ...], t.Several(2, 2)] = Field(
        description="two names of objects that touch, e.g. [near, far], or pusher and an object"
    )
    friction: t.Friction | None = Field(default=None, description=FRICTION)
    height: t.Height | None = Field(default=None, description=HEIGHT)

    @model_validator(mode="after")
    def _says_something(self) -> ContactPair:
        if self.friction is None and self.height is None:
            raise fault("neither friction nor height of a contact", "one of them, or both")
        return self


class Contacts(t.Strict):
    """Friction where objects touch each other."""

    friction: t.Friction | None = Field(default=None, description=FRICTION)
    between: Annotated[tuple[ContactPair, ...], t.Several(0, 400)] = Field(
        default=(), description="a list of {objects: [a, b], friction: ..., height: ...}"
    )


class Wheels(t.Strict):
    """Two driven wheels on one axle."""

    axle: t.Pose = Field(description=_AXLE)


class CarWheels(Wheels):
    """A rear axle that follows and front wheels that steer."""

    min_radius: t.Size = Field(description="the smallest turning radius of the axle's middle, a length in m")


class Differential(t.Strict):
    """A drive with two wheels that do not slip sideways."""

    differential: Wheels = Field(description="{axle: [x, y, theta]}")


class Car(t.Strict):
    """A drive that steers like a car."""

    car: CarWheels = Field(description="{axle: [x, y, theta], min_radius: ...}")


Drive = Annotated[
    Annotated[Literal["omnidirectional"], Tag("<word>")]
    | Annotated[Differential, Tag("<differential>")]
    | Annotated[Car, Tag("<car>")],
    t.by_key("differential", "car"),
]


class MotionLimits(t.Strict):
    """What the pusher's motion may not exceed."""

    speed: t.Speed = Field(default=_LIMITS.speed, description="a speed in m/s, or [least, most]")
    acceleration: t.Acceleration = Field(
        default=_LIMITS.acceleration, description="an acceleration in m/s^2, or [least, most]"
    )
    jerk: t.Jerk = Field(default=_LIMITS.jerk, description="a jerk in m/s^3")
    angular_speed: t.AngularSpeed = Field(
        default=_LIMITS.angular_speed, description="an angular speed in rad/s, or [least, most]"
    )
    angular_acceleration: t.AngularAcceleration = Field(
        default=_LIMITS.angular_acceleration,
        description="an angular acceleration in rad/s^2, or [least, most]",
    )
    angular_jerk: t.AngularJerk = Field(
        default=_LIMITS.angular_jerk, description="an angular jerk in rad/s^3"
    )
    contact: Literal[names.CONTACT_LIMITS] = Field(  # type: ignore[valid-type]
        default=_LIMITS.contact, description=_one_of(names.CONTACT_LIMITS)
    )


Faces = Annotated[
    Annotated[Literal["all"], Tag("<one>")]
    | Annotated[Annotated[tuple[t.Face, ...], t.Several(1, 100)], Tag("<list>")],
    Discriminator(t.one_or_list),
]


class Plate(t.Strict):
    """The plate and how it may move."""

    width: t.Size = Field(description=LENGTH)
    thickness: t.Size = Field(default=0.03, description=LENGTH)
    friction: t.Friction = Field(description=FRICTION)
    contact_height: t.Height = Field(default=0.0, description=HEIGHT)
    drive: Drive = Field(default="omnidirectional", description=DRIVE)
    faces: Faces | None = Field(default=None, description=FACES)
    offsets: Annotated[tuple[t.Coordinate, ...], t.Several(1, 20)] | None = Field(
        default=None, description="a list of 1 to 20 lengths in m, e.g. [0, 15 mm]"
    )
    limits: MotionLimits = Field(
        default_factory=MotionLimits, description="{speed: ..., acceleration: ..., jerk: ..., ...}"
    )


_PART = Field(default=(0.0, 0.0, 0.0), description="[x, y, theta] in the frame of the plate's front edge")


class BoxPart(BoxShape):
    """A rectangular part of the robot."""

    pose: t.Pose = _PART


class PolygonPart(PolygonShape):
    """A polygonal part of the robot."""

    pose: t.Pose = _PART


Part = Annotated[
    Annotated[BoxPart, Tag("<box>")] | Annotated[PolygonPart, Tag("<polygon>")],
    t.by_key("box", "polygon"),
]
Footprint = Annotated[
    Annotated[Part, Tag("<one>")]
    | Annotated[Annotated[tuple[Part, ...], t.Several(1, MOST_PARTS)], Tag("<list>")],
    Discriminator(t.one_or_list),
]


class RobotLimits(t.Strict):
    """What the robot cannot exceed, beside the plate's motion."""

    force: t.Force = Field(description="a force in N, the largest with which the plate pushes, e.g. 40 N")
    breakaway: t.Breakaway = Field(
        default=_LIMITS.breakaway,
        description="a factor from 1, by which the force that sets a load in motion exceeds that of sliding",
    )


class Robot(t.Strict):
    """What carries the plate, its shape and its drive."""

    footprint: Footprint | None = Field(default=None, description=FOOTPRINT)
    drive: Drive | None = Field(default=None, description=DRIVE)
    start: t.Pose | None = Field(
        default=None,
        description="[x, y, theta] of the plate's frame in the world; asks for a multi-push plan",
    )
    base: t.Pose | None = Field(
        default=None,
        description="[x, y, theta] in the plate's frame of the frame that path followers steer; default: the axle",
    )
    limits: RobotLimits | None = Field(default=None, description="{force: ..., breakaway: ...}")


class UncertaintyShares(t.Strict):
    """By what share of the stated value coefficients and loads may be off; explicit intervals come before it."""

    contact_friction: t.Share = Field(default=0.0, description=SHARE)
    floor_friction: t.Share = Field(default=0.0, description=SHARE)
    load: t.Share = Field(default=0.0, description=SHARE)


class Snap(t.Strict):
    """How far objects with a stated pose may be from the contact that they are moved onto."""

    position: t.SnapDistance = Field(description=LENGTH)
    angle: t.SnapAngle = Field(default=math.radians(2.0), description="an angle in rad")


SnapChoice = Annotated[
    Annotated[t.SnapDistance, Tag("<word>")] | Annotated[Snap, Tag("<mapping>")],
    Discriminator(lambda value: "<mapping>" if isinstance(value, dict | t.Strict) else "<word>"),
]


class Floor(t.Strict):
    """The floor under every object that does not state its own friction."""

    friction: t.FloorFriction = Field(description=FRICTION)


class Tolerance(t.Strict):
    """How far from the goal is still at the goal."""

    position: t.PositionTolerance = Field(default=DEFAULT_TOLERANCE[0], description=LENGTH)
    angle: t.AngleTolerance = Field(default=DEFAULT_TOLERANCE[1], description="an angle in rad")


class ToleranceOfSeveral(Tolerance):
    """How far from its goal one of several objects is still there."""

    position: t.PositionTolerance = Field(default=TOLERANCE_OF_SEVERAL[0], description=LENGTH)
    angle: t.AngleTolerance = Field(default=TOLERANCE_OF_SEVERAL[1], description="an angle in rad")


class _Aim(t.Strict):
    """A pose, and after how many equal turns it is the same."""

    pose: t.Pose = Field(description="[x, y, theta] in the world")
    symmetry: t.Symmetry = Field(
        default=1, description="a whole number: after so many equal turns the frame meant is as it was"
    )


class ObjectGoal(_Aim):
    """Where to bring one of several objects."""

    tolerance: ToleranceOfSeveral = Field(
        default_factory=ToleranceOfSeveral, description="{position: ..., angle: ...}"
    )


class GoalPose(_Aim):
    """Where to bring the chain."""

    tolerance: Tolerance = Field(default_factory=Tolerance, description="{position: ..., angle: ...}")
    of: str | None = Field(
        default=None, description="the name of the object meant; left out, the chain frame is meant"
    )


class PushChoice(t.Strict):
    """What several pushes may come to, and what counts when they are ranked."""

    most: t.Most = Field(default=6, description="a whole number")
    switch_cost: t.ArcPrice = Field(default=0.1, description=LENGTH)
    transit_weight: t.Weight = Field(default=0.1, description="a weight from 0 to 1000")
    approach: t.Travel = Field(default=0.05, description=LENGTH)
    retreat: t.Travel = Field(default=0.05, description=LENGTH)
    settle: t.Travel = Field(default=0.02, description=LENGTH)


class Area(t.Strict):
    """The rectangle in which robot, pusher and objects stay."""

    x: t.Interval = Field(description="[min, max] in m")
    y: t.Interval = Field(description="[min, max] in m")


_WORLD = "[x, y, theta] in the world"
_UNKNOWN = "obstacle, the default, or free: what a map does not know"


class BoxInRoom(BoxShape):
    """A rectangular obstacle."""

    pose: t.Pose = Field(description=_WORLD)


class PolygonInRoom(PolygonShape):
    """A polygonal obstacle; it may stand for a part of a map of which nothing is known."""

    pose: t.Pose | None = Field(default=None, description=_WORLD)
    unknown: Literal["obstacle"] | None = Field(default=None, description="obstacle")


class CircleInRoom(t.Strict):
    """A round obstacle."""

    circle: t.Size = Field(description="a radius in m")
    center: t.Point = Field(description="[x, y] in the world")


class MapInRoom(t.Strict):
    """All that a map has."""

    map: t.FileName = Field(description="a ROS map (YAML) in the scenario's folder")
    unknown: Literal["obstacle", "free"] | None = Field(default=None, description=_UNKNOWN)


Obstacle = Annotated[
    Annotated[PolygonInRoom, Tag("<polygon>")]
    | Annotated[BoxInRoom, Tag("<box>")]
    | Annotated[CircleInRoom, Tag("<circle>")]
    | Annotated[MapInRoom, Tag("<map>")],
    t.by_key("polygon", "box", "circle", "map"),
]


class StabilityChoice(t.Strict):
    """Which stable set limits the pusher's twists, and how far inside it they stay."""

    set: Literal[names.STABLE_SETS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_STABLE_SET, description=_one_of(names.STABLE_SETS)
    )
    margin: t.Margin = Field(default=names.AUTO, description="auto, or a margin from 0 to 0.99")


class PlannerChoice(t.Strict):
    """Which planner runs, for how long, with which random numbers."""

    name: Annotated[Literal[names.PLANNERS], BeforeValidator(t.still_here)] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_PLANNER, description=_one_of(names.PLANNERS)
    )
    time_limit: t.Duration = Field(default=2.0, description="a time in s")
    seed: t.Seed = Field(default=1, description="a whole number")
    cost: Literal[names.COSTS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_COST, description=_one_of(names.COSTS)
    )
    weight: t.Weight = Field(default=1.0, description="a weight from 0 to 1000")
    gap: t.Gap = Field(default=0.0, description="a share from 0 to 100")
    arc_price: t.ArcPrice = Field(default=0.03, description=LENGTH)


class RoomFile(t.Strict):
    """What every scenario file states: objects, robot, room and settings, but for where objects are and shall go."""

    format: Literal["pushplan/1"] = Field(description=names.SCENARIO_FORMAT)
    name: t.Name | None = Field(default=None, description=NAME)
    floor: Floor = Field(description="{friction: ...}")
    uncertainty: UncertaintyShares = Field(
        default_factory=UncertaintyShares,
        description="{contact_friction: ..., floor_friction: ..., load: ...}",
    )
    snap: SnapChoice | None = Field(default=None, description=SNAP)
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
        default=(), description=OBSTACLES
    )
    clearance: t.Clearance = Field(default=names.COLLISION_CLEARANCE, description=LENGTH)
    stability: StabilityChoice = Field(default_factory=StabilityChoice, description="{set: ..., margin: ...}")
    trajectory: Literal[names.TRAJECTORIES] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_TRAJECTORY, description=_one_of(names.TRAJECTORIES)
    )
    planner: PlannerChoice = Field(
        default_factory=PlannerChoice, description="{name: ..., time_limit: ..., seed: ...}"
    )


class ScenarioFile(RoomFile):
    """One load, in contact with the plate or anywhere."""

    start: t.Pose = Field(
        default=(0.0, 0.0, 0.0), description="[x, y, theta] of the chain frame in the world"
    )
    goal: Annotated[
        Annotated[GoalPose, Tag("<one>")]
        | Annotated[Annotated[tuple[GoalPose, ...], t.Several(1, 100)], Tag("<list>")],
        Discriminator(t.one_or_list),
    ] = Field(description=GOAL)


class PlacedObject(Object):
    """One object, apart from the others."""

    pose: t.Pose = Field(description="[x, y, theta] in the world, where there are goals")


class PlacedRobot(Robot):
    """The robot, which stands somewhere in the room."""

    start: t.Pose = Field(description="[x, y, theta] of the plate's frame in the world")


def _goal_form(value: object) -> str:
    """Tell a goal from a list of goals: a pose is a list of numbers."""
    if not isinstance(value, list | tuple):
        return "<one>"
    several = any(isinstance(one, dict | list | tuple | t.Strict) for one in value)
    return "<list>" if several else "<bare>"


_Goal = Annotated[
    Annotated[t.Pose, Tag("<bare>")] | Annotated[ObjectGoal, Tag("<one>")],
    Discriminator(lambda value: "<bare>" if isinstance(value, list | tuple) else "<one>"),
]
_Goals = Annotated[
    Annotated[t.Pose, Tag("<bare>")]
    | Annotated[ObjectGoal, Tag("<one>")]
    | Annotated[Annotated[tuple[_Goal, ...], t.Several(1, 100)], Tag("<list>")],
    Discriminator(_goal_form),
]


class RearrangementFile(RoomFile):
    """Several objects that stand apart, each with goals of its own or without any."""

    objects: Annotated[tuple[PlacedObject, ...], t.Several(1, 200)] = Field(
        description="a list of 1 to 200 objects, each with its pose in the world"
    )
    robot: PlacedRobot = Field(description="{footprint: ..., drive: ..., start: ...}")
    goals: Annotated[dict[str, _Goals], Field(min_length=1)] = Field(description=GOALS)


class RowGoal(t.Strict):
    """Several objects that shall stand flush in a row, one in front of another as they are pushed."""

    of: Annotated[tuple[t.Name, ...], t.Several(1, MOST_IN_ROW)] = Field(
        description=f"a list of 1 to {MOST_IN_ROW} names of objects, from the pusher outward"
    )
    pose: t.Pose | None = Field(
        default=None,
        description="[x, y, theta] in the world of the middle of the row's rear face, +x along the push",
    )
    wall: Literal[names.WALLS] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"the wall that the row's front shall be at: {_one_of(names.WALLS)}"
    )
    anywhere: bool | None = Field(default=None, description="true: wherever the row comes about")
    order: Literal["any", "given"] = Field(default="any", description="any, or given: that of the list")
    tolerance: Tolerance = Field(default_factory=Tolerance, description="{position: ..., angle: ...}")
    placed: Annotated[tuple[t.Name, ...], t.Several(0, MOST_IN_ROW)] = Field(
        default=(), description="a list of those that stand in it already, at its front"
    )

    @model_validator(mode="after")
    def _one_place(self) -> RowGoal:
        """Refuse a row without a place, or with more than one."""
        given = [self.pose is not None, self.wall is not None, bool(self.anywhere)]
        if sum(given) != 1:
            raise fault("a row with " + ("no place" if not any(given) else "several places"), ROW)
        return self


class RowGoals(t.Strict):
    """The goals of a file whose objects shall stand in a row."""

    row: RowGoal = Field(description=ROW)


class GatheringFile(RearrangementFile):
    """Several objects that stand apart and shall stand in a row; others stay where they are."""

    goals: RowGoals = Field(description=f"{{row: {ROW}}}")  # type: ignore[assignment]
    gather: Literal[names.GATHER] = Field(  # type: ignore[valid-type]
        default="auto", description=f"whether objects are pushed together: {_one_of(names.GATHER)}"
    )
