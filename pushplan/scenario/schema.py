"""The scenario file as a typed model, with the defaults of what may be left out; descriptions say what is allowed."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pushplan.mechanics.chain import Limits
from pushplan.scenario import fields as t
from pushplan.scenario.parts import DEFAULT_TOLERANCE, TOLERANCE_OF_SEVERAL
from pushplan.scenario.records import ONE_OR_LIST, Before, Chosen, Record, Several, by_key, key
from pushplan.scenario.units import NotAllowedError
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


class BoxShape(Record):
    """A box about its frame's origin."""

    box: t.Box = key(description="[length along x, width along y]")


class PolygonShape(Record):
    """A polygon in its frame."""

    polygon: t.Polygon = key(description=POLYGON)


Shape = Annotated[
    BoxShape | PolygonShape,
    by_key("box", "polygon"),
]


class Feet(Record):
    """Feet in the object's frame, all of them with their part of the load, or none."""

    feet: Annotated[tuple[t.Foot, ...], Several(1, 1000)] = key(
        description="a list of 1 to 1000 feet [x, y] or [x, y, load]",
        extra={"anyOf": [{"items": {"type": "array", "maxItems": n, "minItems": n}} for n in (2, 3)]},
    )

    def checked(self) -> Feet:
        """Refuse values that do not go together."""
        if len({len(foot) for foot in self.feet}) > 1:
            raise NotAllowedError(
                "some feet have a load and some have none", "a load for every foot, or for none"
            )
        return self


class PressureMap(Record):
    """A measured pressure in the object's frame."""

    pressure_map: t.FileName = key(
        description="the name of a CSV file beside the scenario, with the columns x, y, pressure"
    )


Support = Annotated[
    Literal["uniform", "unknown"] | Feet | PressureMap,
    by_key("feet", "pressure_map", word=True),
]


class Object(Record):
    """One object; without `pose` it is stacked flush on the one before, or on the plate."""

    name: t.Name = key(description=NAME)
    shape: Shape = key(description="{box: [length, width]} or {polygon: [[x, y], ...]}")
    mass: t.Mass = key(description="a mass in kg")
    support: Support = key(default="uniform", description=SUPPORT)
    height: t.Size | None = key(default=None, description="a height in m")
    center_of_mass: t.MassCenter | None = key(
        default=None, description="[x, y] in the object's frame, or [x, y, z] with z above the floor"
    )
    floor_friction: t.Friction | None = key(default=None, description=FRICTION)
    offset: t.Coordinate | None = key(default=None, description=LENGTH)
    pose: t.Pose | None = key(default=None, description="[x, y, theta] in the chain frame")


class ContactPair(Record):
    """The friction between two objects, or between the pusher and an object, and the height of their contact."""

    objects: Annotated[tuple[str, ...], Several(2, 2)] = key(
        description="two names of objects that touch, e.g. [near, far], or pusher and an object"
    )
    friction: t.Friction | None = key(default=None, description=FRICTION)
    height: t.Height | None = key(default=None, description=HEIGHT)

    def checked(self) -> ContactPair:
        """Refuse values that do not go together."""
        if self.friction is None and self.height is None:
            raise NotAllowedError("neither friction nor height of a contact", "one of them, or both")
        return self


class Contacts(Record):
    """Friction where objects touch each other."""

    friction: t.Friction | None = key(default=None, description=FRICTION)
    between: Annotated[tuple[ContactPair, ...], Several(0, 400)] = key(
        default=(), description="a list of {objects: [a, b], friction: ..., height: ...}"
    )


class Wheels(Record):
    """Two driven wheels on one axle."""

    axle: t.Pose = key(description=_AXLE)


class CarWheels(Wheels):
    """A rear axle that follows and front wheels that steer."""

    min_radius: t.Size = key(description="the smallest turning radius of the axle's middle, a length in m")


class Differential(Record):
    """A drive with two wheels that do not slip sideways."""

    differential: Wheels = key(description="{axle: [x, y, theta]}")


class Car(Record):
    """A drive that steers like a car."""

    car: CarWheels = key(description="{axle: [x, y, theta], min_radius: ...}")


Drive = Annotated[
    Literal["omnidirectional"] | Differential | Car,
    by_key("differential", "car", word=True),
]


class MotionLimits(Record):
    """What the pusher's motion may not exceed."""

    speed: t.Speed = key(default=_LIMITS.speed, description="a speed in m/s, or [least, most]")
    acceleration: t.Acceleration = key(
        default=_LIMITS.acceleration, description="an acceleration in m/s^2, or [least, most]"
    )
    jerk: t.Jerk = key(default=_LIMITS.jerk, description="a jerk in m/s^3")
    angular_speed: t.AngularSpeed = key(
        default=_LIMITS.angular_speed, description="an angular speed in rad/s, or [least, most]"
    )
    angular_acceleration: t.AngularAcceleration = key(
        default=_LIMITS.angular_acceleration,
        description="an angular acceleration in rad/s^2, or [least, most]",
    )
    angular_jerk: t.AngularJerk = key(default=_LIMITS.angular_jerk, description="an angular jerk in rad/s^3")
    contact: Literal[names.CONTACT_LIMITS] = key(  # type: ignore[valid-type]
        default=_LIMITS.contact, description=_one_of(names.CONTACT_LIMITS)
    )


Faces = Annotated[
    Literal["all"] | Annotated[tuple[t.Face, ...], Several(1, 100)],
    ONE_OR_LIST,
]


class Plate(Record):
    """The plate and how it may move."""

    width: t.Size = key(description=LENGTH)
    thickness: t.Size = key(default=0.03, description=LENGTH)
    friction: t.Friction = key(description=FRICTION)
    contact_height: t.Height = key(default=0.0, description=HEIGHT)
    drive: Drive = key(default="omnidirectional", description=DRIVE)
    faces: Faces | None = key(default=None, description=FACES)
    offsets: Annotated[tuple[t.Coordinate, ...], Several(1, 20)] | None = key(
        default=None, description="a list of 1 to 20 lengths in m, e.g. [0, 15 mm]"
    )
    limits: MotionLimits = key(
        default_factory=MotionLimits, description="{speed: ..., acceleration: ..., jerk: ..., ...}"
    )


_PART = key(default=(0.0, 0.0, 0.0), description="[x, y, theta] in the frame of the plate's front edge")


class BoxPart(BoxShape):
    """A rectangular part of the robot."""

    pose: t.Pose = _PART


class PolygonPart(PolygonShape):
    """A polygonal part of the robot."""

    pose: t.Pose = _PART


Part = Annotated[
    BoxPart | PolygonPart,
    by_key("box", "polygon"),
]
Footprint = Annotated[
    Part | Annotated[tuple[Part, ...], Several(1, MOST_PARTS)],
    ONE_OR_LIST,
]


class RobotLimits(Record):
    """What the robot cannot exceed, beside the plate's motion."""

    force: t.Force = key(description="a force in N, the largest with which the plate pushes, e.g. 40 N")
    breakaway: t.Breakaway = key(
        default=_LIMITS.breakaway,
        description="a factor from 1, by which the force that sets a load in motion exceeds that of sliding",
    )


class Robot(Record):
    """What carries the plate, its shape and its drive."""

    footprint: Footprint | None = key(default=None, description=FOOTPRINT)
    drive: Drive | None = key(default=None, description=DRIVE)
    start: t.Pose | None = key(
        default=None,
        description="[x, y, theta] of the plate's frame in the world; asks for a multi-push plan",
    )
    base: t.Pose | None = key(
        default=None,
        description="[x, y, theta] in the plate's frame of the frame that path followers steer; default: the axle",
    )
    limits: RobotLimits | None = key(default=None, description="{force: ..., breakaway: ...}")


class UncertaintyShares(Record):
    """By what share of the stated value coefficients and loads may be off; explicit intervals come before it."""

    contact_friction: t.Share = key(default=0.0, description=SHARE)
    floor_friction: t.Share = key(default=0.0, description=SHARE)
    load: t.Share = key(default=0.0, description=SHARE)


class Snap(Record):
    """How far objects with a stated pose may be from the contact that they are moved onto."""

    position: t.SnapDistance = key(description=LENGTH)
    angle: t.SnapAngle = key(default=math.radians(2.0), description="an angle in rad")


SnapChoice = Annotated[
    t.SnapDistance | Snap,
    Chosen(lambda value: int(isinstance(value, dict))),
]


class Floor(Record):
    """The floor under every object that does not state its own friction."""

    friction: t.FloorFriction = key(description=FRICTION)


class Tolerance(Record):
    """How far from the goal is still at the goal."""

    position: t.PositionTolerance = key(default=DEFAULT_TOLERANCE[0], description=LENGTH)
    angle: t.AngleTolerance = key(default=DEFAULT_TOLERANCE[1], description="an angle in rad")


class ToleranceOfSeveral(Tolerance):
    """How far from its goal one of several objects is still there."""

    position: t.PositionTolerance = key(default=TOLERANCE_OF_SEVERAL[0], description=LENGTH)
    angle: t.AngleTolerance = key(default=TOLERANCE_OF_SEVERAL[1], description="an angle in rad")


class _Aim(Record):
    """A pose, and after how many equal turns it is the same."""

    pose: t.Pose = key(description="[x, y, theta] in the world")
    symmetry: t.Symmetry = key(
        default=1, description="a whole number: after so many equal turns the frame meant is as it was"
    )


class ObjectGoal(_Aim):
    """Where to bring one of several objects."""

    tolerance: ToleranceOfSeveral = key(
        default_factory=ToleranceOfSeveral, description="{position: ..., angle: ...}"
    )


class GoalPose(_Aim):
    """Where to bring the chain."""

    tolerance: Tolerance = key(default_factory=Tolerance, description="{position: ..., angle: ...}")
    of: str | None = key(
        default=None, description="the name of the object meant; left out, the chain frame is meant"
    )


class PushChoice(Record):
    """What several pushes may come to, and what counts when they are ranked."""

    most: t.Most = key(default=6, description="a whole number")
    switch_cost: t.ArcPrice = key(default=0.1, description=LENGTH)
    transit_weight: t.Weight = key(default=0.1, description="a weight from 0 to 1000")
    approach: t.Travel = key(default=0.05, description=LENGTH)
    retreat: t.Travel = key(default=0.05, description=LENGTH)
    settle: t.Travel = key(default=0.02, description=LENGTH)


class Area(Record):
    """The rectangle in which robot, pusher and objects stay."""

    x: t.Interval = key(description="[min, max] in m")
    y: t.Interval = key(description="[min, max] in m")


_WORLD = "[x, y, theta] in the world"
_UNKNOWN = "obstacle, the default, or free: what a map does not know"


class BoxInRoom(BoxShape):
    """A rectangular obstacle."""

    pose: t.Pose = key(description=_WORLD)


class PolygonInRoom(PolygonShape):
    """A polygonal obstacle; it may stand for a part of a map of which nothing is known."""

    pose: t.Pose | None = key(default=None, description=_WORLD)
    unknown: Literal["obstacle"] | None = key(default=None, description="obstacle")


class CircleInRoom(Record):
    """A round obstacle."""

    circle: t.Size = key(description="a radius in m")
    center: t.Point = key(description="[x, y] in the world")


class MapInRoom(Record):
    """All that a map has."""

    map: t.FileName = key(description="a ROS map (YAML) in the scenario's folder")
    unknown: Literal["obstacle", "free"] | None = key(default=None, description=_UNKNOWN)


Obstacle = Annotated[
    PolygonInRoom | BoxInRoom | CircleInRoom | MapInRoom,
    by_key("polygon", "box", "circle", "map"),
]


class StabilityChoice(Record):
    """Which stable set limits the pusher's twists, and how far inside it they stay."""

    set: Literal[names.STABLE_SETS] = key(  # type: ignore[valid-type]
        default=names.DEFAULT_STABLE_SET, description=_one_of(names.STABLE_SETS)
    )
    margin: t.Margin = key(default=names.AUTO, description="auto, or a margin from 0 to 0.99")


class PlannerChoice(Record):
    """Which planner runs, for how long, with which random numbers."""

    name: Annotated[Literal[names.PLANNERS], Before(t.still_here)] = key(  # type: ignore[valid-type]
        default=names.DEFAULT_PLANNER, description=_one_of(names.PLANNERS)
    )
    time_limit: t.Duration = key(default=2.0, description="a time in s")
    seed: t.Seed = key(default=1, description="a whole number")
    cost: Literal[names.COSTS] = key(  # type: ignore[valid-type]
        default=names.DEFAULT_COST, description=_one_of(names.COSTS)
    )
    weight: t.Weight = key(default=1.0, description="a weight from 0 to 1000")
    gap: t.Gap = key(default=0.0, description="a share from 0 to 100")
    arc_price: t.ArcPrice = key(default=0.03, description=LENGTH)


class RoomFile(Record):
    """What every scenario file states: objects, robot, room and settings, but for where objects are and shall go."""

    format: Literal["pushplan/1"] = key(description=names.SCENARIO_FORMAT)
    name: t.Name | None = key(default=None, description=NAME)
    floor: Floor = key(description="{friction: ...}")
    uncertainty: UncertaintyShares = key(
        default_factory=UncertaintyShares,
        description="{contact_friction: ..., floor_friction: ..., load: ...}",
    )
    snap: SnapChoice | None = key(default=None, description=SNAP)
    objects: Annotated[tuple[Object, ...], Several(1, 200)] = key(
        description="a list of 1 to 200 objects, from the pusher outward"
    )
    contacts: Contacts = key(default_factory=Contacts, description="{friction: ..., between: [...]}")
    pusher: Plate = key(description="{width: ..., friction: ..., ...}")
    robot: Robot = key(default_factory=Robot, description="{footprint: ..., drive: ..., start: ...}")
    pushes: PushChoice | None = key(
        default=None, description="{most: ..., switch_cost: ..., transit_weight: ..., approach: ..., ...}"
    )
    workspace: Area | None = key(default=None, description="{x: [min, max], y: [min, max]}")
    obstacles: Annotated[tuple[Obstacle, ...], Several(0, 10_000)] = key(default=(), description=OBSTACLES)
    clearance: t.Clearance = key(default=names.COLLISION_CLEARANCE, description=LENGTH)
    stability: StabilityChoice = key(default_factory=StabilityChoice, description="{set: ..., margin: ...}")
    trajectory: Literal[names.TRAJECTORIES] = key(  # type: ignore[valid-type]
        default=names.DEFAULT_TRAJECTORY, description=_one_of(names.TRAJECTORIES)
    )
    planner: PlannerChoice = key(
        default_factory=PlannerChoice, description="{name: ..., time_limit: ..., seed: ...}"
    )


class ScenarioFile(RoomFile):
    """One load, in contact with the plate or anywhere."""

    start: t.Pose = key(default=(0.0, 0.0, 0.0), description="[x, y, theta] of the chain frame in the world")
    goal: Annotated[
        GoalPose | Annotated[tuple[GoalPose, ...], Several(1, 100)],
        ONE_OR_LIST,
    ] = key(description=GOAL)


class PlacedObject(Object):
    """One object, apart from the others."""

    pose: t.Pose = key(description="[x, y, theta] in the world, where there are goals")


class PlacedRobot(Robot):
    """The robot, which stands somewhere in the room."""

    start: t.Pose = key(description="[x, y, theta] of the plate's frame in the world")


def _goal_form(value: object) -> int:
    """Tell a pose, a goal and a list of goals: a pose is a list of numbers."""
    if not isinstance(value, list):
        return 1
    return 2 if any(isinstance(one, dict | list) for one in value) else 0


_Goal = Annotated[
    t.Pose | ObjectGoal,
    Chosen(lambda value: int(not isinstance(value, list))),
]
_Goals = Annotated[
    t.Pose | ObjectGoal | Annotated[tuple[_Goal, ...], Several(1, 100)],
    Chosen(_goal_form),
]


class RearrangementFile(RoomFile):
    """Several objects that stand apart, each with goals of its own or without any."""

    objects: Annotated[tuple[PlacedObject, ...], Several(1, 200)] = key(
        description="a list of 1 to 200 objects, each with its pose in the world"
    )
    robot: PlacedRobot = key(description="{footprint: ..., drive: ..., start: ...}")
    goals: dict[str, _Goals] = key(description=GOALS)


class RowGoal(Record):
    """Several objects that shall stand flush in a row, one in front of another as they are pushed."""

    of: Annotated[tuple[t.Name, ...], Several(1, MOST_IN_ROW)] = key(
        description=f"a list of 1 to {MOST_IN_ROW} names of objects, from the pusher outward"
    )
    pose: t.Pose | None = key(
        default=None,
        description="[x, y, theta] in the world of the middle of the row's rear face, +x along the push",
    )
    wall: Literal[names.WALLS] | None = key(  # type: ignore[valid-type]
        default=None, description=f"the wall that the row's front shall be at: {_one_of(names.WALLS)}"
    )
    anywhere: bool | None = key(default=None, description="true: wherever the row comes about")
    order: Literal["any", "given"] = key(default="any", description="any, or given: that of the list")
    tolerance: Tolerance = key(default_factory=Tolerance, description="{position: ..., angle: ...}")
    placed: Annotated[tuple[t.Name, ...], Several(0, MOST_IN_ROW)] = key(
        default=(), description="a list of those that stand in it already, at its front"
    )

    def checked(self) -> RowGoal:
        """Refuse values that do not go together."""
        given = [self.pose is not None, self.wall is not None, bool(self.anywhere)]
        if sum(given) != 1:
            raise NotAllowedError("a row with " + ("no place" if not any(given) else "several places"), ROW)
        return self


class RowGoals(Record):
    """The goals of a file whose objects shall stand in a row."""

    row: RowGoal = key(description=ROW)


class GatheringFile(RearrangementFile):
    """Several objects that stand apart and shall stand in a row; others stay where they are."""

    goals: RowGoals = key(description=f"{{row: {ROW}}}")  # type: ignore[assignment]
    gather: Literal[names.GATHER] = key(  # type: ignore[valid-type]
        default="auto", description=f"whether objects are pushed together: {_one_of(names.GATHER)}"
    )
