"""The scenario file as a typed model, with the defaults of what may be left out; descriptions say what is allowed."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator
from pydantic.json_schema import models_json_schema

from pushplan.scenario import bodies as b
from pushplan.scenario import fields as t
from pushplan.scenario.goals import DEFAULT_TOLERANCE, TOLERANCE_OF_SEVERAL
from pushplan.scenario.units import fault
from pushplan.util import names

GOAL = "[x, y, theta], {pose: [x, y, theta], ...}, or a list of 1 to 100 of these, any of which will do"
GOALS = "a mapping from names of objects to poses [x, y, theta], {pose: ..., symmetry: ...} or lists of these"
ROW = "{of: [name, name, ...], pose: [x, y, theta]}, or wall: ... or anywhere: true in place of the pose"
SNAP = "a length in m, e.g. 5 mm, or {position: 5 mm, angle: 2 deg}"
SHARE = "a share from 0 to 0.9, e.g. 20 %"
MOST_IN_ROW = 30
OBSTACLES = (
    "a list of at most 10000 {polygon: ...}, {box: ..., pose: ...}, {circle: ..., center: ...} and {map: file.yaml}"
)


class Uncertainty(t.Strict):
    """By what share of the stated value coefficients and loads may be off; explicit intervals come before it."""

    contact_friction: t.Share = Field(default=0.0, description=SHARE)
    """Of all coefficients between plate and objects."""
    floor_friction: t.Share = Field(default=0.0, description=SHARE)
    """Of all coefficients between objects and floor."""
    load: t.Share = Field(default=0.0, description=SHARE)
    """Of the load on each foot, or of the pressure at every place, of each object; its weight stays."""


class Snap(t.Strict):
    """How far objects with a stated pose may be from the contact that they are moved onto."""

    position: t.SnapDistance = Field(description=b.LENGTH)
    angle: t.SnapAngle = Field(default=math.radians(2.0), description="an angle in rad")


SnapChoice = Annotated[
    Annotated[t.SnapDistance, Tag("<word>")] | Annotated[Snap, Tag("<mapping>")],
    Discriminator(lambda value: "<mapping>" if isinstance(value, dict | t.Strict) else "<word>"),
]


class Floor(t.Strict):
    """The floor under every object that does not state its own friction."""

    friction: t.FloorFriction = Field(description=b.FRICTION)


class Tolerance(t.Strict):
    """How far from the goal is still at the goal."""

    position: t.PositionTolerance = Field(default=DEFAULT_TOLERANCE[0], description=b.LENGTH)
    angle: t.AngleTolerance = Field(default=DEFAULT_TOLERANCE[1], description="an angle in rad")


class ToleranceOfSeveral(Tolerance):
    """How far from its goal one of several objects is still there."""

    position: t.PositionTolerance = Field(default=TOLERANCE_OF_SEVERAL[0], description=b.LENGTH)
    angle: t.AngleTolerance = Field(default=TOLERANCE_OF_SEVERAL[1], description="an angle in rad")


class _Aim(t.Strict):
    """A pose, and after how many equal turns it is the same."""

    pose: t.Pose = Field(description="[x, y, theta] in the world")
    symmetry: t.Symmetry = Field(
        default=1, description="a whole number: after so many equal turns the frame meant is as it was"
    )


class ObjectGoal(_Aim):
    """Where to bring one of several objects."""

    tolerance: ToleranceOfSeveral = t.with_defaults(ToleranceOfSeveral, "{position: ..., angle: ...}")


class GoalPose(_Aim):
    """Where to bring the chain."""

    tolerance: Tolerance = t.with_defaults(Tolerance, "{position: ..., angle: ...}")
    of: str | None = Field(
        default=None, description="the name of the object meant; left out, the chain frame is meant"
    )


class PushChoice(t.Strict):
    """What several pushes may come to, and what counts when they are ranked."""

    most: t.Most = Field(default=6, description="a whole number")
    switch_cost: t.ArcPrice = Field(default=0.1, description=b.LENGTH)
    transit_weight: t.Weight = Field(default=0.1, description="a weight from 0 to 1000")
    approach: t.Travel = Field(default=0.05, description=b.LENGTH)
    retreat: t.Travel = Field(default=0.05, description=b.LENGTH)
    settle: t.Travel = Field(default=0.02, description=b.LENGTH)


class Area(t.Strict):
    """The rectangle in which robot, pusher and objects stay."""

    x: t.Interval = Field(description="[min, max] in m")
    y: t.Interval = Field(description="[min, max] in m")


_WORLD = "[x, y, theta] in the world"
_UNKNOWN = "obstacle, the default, or free: what a map does not know"


class BoxInRoom(b.BoxShape):
    """A rectangular obstacle."""

    pose: t.Pose = Field(description=_WORLD)


class PolygonInRoom(b.PolygonShape):
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


class StabilitySettings(t.Strict):
    """Which stable set limits the pusher's twists, and how far inside it they stay."""

    set: Literal[names.STABLE_SETS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_STABLE_SET, description=b.one_of(names.STABLE_SETS)
    )
    margin: t.Margin = Field(default=names.AUTO, description="auto, or a margin from 0 to 0.99")
    """The twists' margins exceed this number; `auto` stands for min(0.05, half of the largest margin there is),
    lowered where no path is found with it."""


class PlannerSettings(t.Strict):
    """Which planner runs, for how long, with which random numbers."""

    name: Annotated[Literal[names.PLANNERS], BeforeValidator(t.still_here)] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_PLANNER, description=b.one_of(names.PLANNERS)
    )
    time_limit: t.Duration = Field(default=2.0, description="a time in s")
    """Wall-clock limit, s."""
    seed: t.Seed = Field(default=1, description="a whole number")
    cost: Literal[names.COSTS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_COST, description=b.one_of(names.COSTS)
    )
    """What ranks paths."""
    weight: t.Weight = Field(default=1.0, description="a weight from 0 to 1000")
    """Of the margin in `cost: margin`: what a metre at the set's boundary costs more than one at the safest twist, as
    a share."""
    gap: t.Gap = Field(default=0.0, description="a share from 0 to 100")
    """Share above the lower bound at which a path is good enough to stop."""
    arc_price: t.ArcPrice = Field(default=0.03, description=b.LENGTH)
    """What an arc counts beside its length when paths are ranked, m."""


class RoomFile(t.Strict):
    """What every scenario file states: objects, robot, room and settings, but for where objects are and shall go."""

    format: Literal["pushplan/1"] = Field(description=names.SCENARIO_FORMAT)
    name: t.Name | None = Field(default=None, description=b.NAME)
    floor: Floor = Field(description="{friction: ...}")
    uncertainty: Uncertainty = t.with_defaults(Uncertainty, "{contact_friction: ..., floor_friction: ..., load: ...}")
    snap: SnapChoice | None = Field(default=None, description=SNAP)
    objects: Annotated[tuple[b.Object, ...], t.Several(1, 200)] = Field(
        description="a list of 1 to 200 objects, from the pusher outward"
    )
    contacts: b.Contacts = t.with_defaults(b.Contacts, "{friction: ..., between: [...]}")
    pusher: b.Plate = Field(description="{width: ..., friction: ..., ...}")
    robot: b.Robot = t.with_defaults(b.Robot, "{footprint: ..., drive: ..., start: ...}")
    pushes: PushChoice | None = Field(
        default=None, description="{most: ..., switch_cost: ..., transit_weight: ..., approach: ..., ...}"
    )
    workspace: Area | None = Field(default=None, description="{x: [min, max], y: [min, max]}")
    obstacles: Annotated[tuple[Obstacle, ...], t.Several(0, 10_000)] = Field(default=(), description=OBSTACLES)
    clearance: t.Clearance = Field(default=names.COLLISION_CLEARANCE, description=b.LENGTH)
    stability: StabilitySettings = t.with_defaults(StabilitySettings, "{set: ..., margin: ...}")
    trajectory: Literal[names.TRAJECTORIES] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_TRAJECTORY, description=b.one_of(names.TRAJECTORIES)
    )
    planner: PlannerSettings = t.with_defaults(PlannerSettings, "{name: ..., time_limit: ..., seed: ...}")


def _goal_form(value: object) -> str:
    """Tell a goal from a list of goals: a pose is a list of numbers."""
    if not isinstance(value, list | tuple):
        return "<one>"
    several = any(isinstance(one, dict | list | tuple | t.Strict) for one in value)
    return "<list>" if several else "<bare>"


_BARE_OR_ONE = Discriminator(lambda value: "<bare>" if isinstance(value, list | tuple) else "<one>")
_Goal = Annotated[Annotated[t.Pose, Tag("<bare>")] | Annotated[GoalPose, Tag("<one>")], _BARE_OR_ONE]
_ObjectGoal = Annotated[Annotated[t.Pose, Tag("<bare>")] | Annotated[ObjectGoal, Tag("<one>")], _BARE_OR_ONE]
_Goals = Annotated[
    Annotated[t.Pose, Tag("<bare>")]
    | Annotated[ObjectGoal, Tag("<one>")]
    | Annotated[Annotated[tuple[_ObjectGoal, ...], t.Several(1, 100)], Tag("<list>")],
    Discriminator(_goal_form),
]


class ScenarioFile(RoomFile):
    """One load, in contact with the plate or anywhere."""

    start: t.Pose = Field(default=(0.0, 0.0, 0.0), description="[x, y, theta] of the chain frame in the world")
    goal: Annotated[
        Annotated[t.Pose, Tag("<bare>")]
        | Annotated[GoalPose, Tag("<one>")]
        | Annotated[Annotated[tuple[_Goal, ...], t.Several(1, 100)], Tag("<list>")],
        Discriminator(_goal_form),
    ] = Field(description=GOAL)


class RearrangementFile(RoomFile):
    """Several objects that stand apart, each with goals of its own or without any."""

    objects: Annotated[tuple[b.PlacedObject, ...], t.Several(1, 200)] = Field(
        description="a list of 1 to 200 objects, each with its pose in the world"
    )
    robot: b.PlacedRobot = Field(description="{footprint: ..., drive: ..., start: ...}")
    goals: Annotated[dict[str, _Goals], Field(min_length=1)] = Field(description=GOALS)


class RowGoal(t.Strict):
    """Several objects that shall stand flush in a row, one in front of another as they are pushed."""

    of: Annotated[tuple[t.Name, ...], t.Several(1, MOST_IN_ROW)] = Field(
        description=f"a list of 1 to {MOST_IN_ROW} names of objects, from the pusher outward"
    )
    pose: t.Pose | None = Field(
        default=None, description="[x, y, theta] in the world of the middle of the row's rear face, +x along the push"
    )
    wall: Literal[names.WALLS] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"the wall that the row's front shall be at: {b.one_of(names.WALLS)}"
    )
    anywhere: bool | None = Field(default=None, description="true: wherever the row comes about")
    order: Literal["any", "given"] = Field(default="any", description="any, or given: that of the list")
    tolerance: Tolerance = t.with_defaults(Tolerance, "{position: ..., angle: ...}")
    placed: Annotated[tuple[t.Name, ...], t.Several(0, MOST_IN_ROW)] = Field(
        default=(), description="a list of those that stand in it already, at its front"
    )

    @model_validator(mode="after")
    def _one_place(self) -> RowGoal:
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
        default="auto", description=f"whether objects are pushed together: {b.one_of(names.GATHER)}"
    )


def scenario_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files.

    It accepts every file that the loader accepts. The loader also checks what no schema can say: the range of numbers
    with a unit, polygons that cross themselves, contacts, collisions.
    """
    models = (ScenarioFile, RearrangementFile, GatheringFile)
    named, schema = models_json_schema([(model, "validation") for model in models])
    one, several, row = (named[model, "validation"] for model in models)
    of_row = {"properties": {"goals": {"properties": {"row": {"required": ["of"]}}, "required": ["row"]}}}
    with_goals = {"if": of_row, "then": row, "else": several}
    chosen = {"if": {"required": ["goals"]}, "then": with_goals, "else": one}
    return finished({"type": "object", **schema, **chosen}, "pushplan scenario")


def schema_text(schema: dict[str, Any]) -> str:
    """Return a schema as it is printed and packaged."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def schema_file(name: str = "scenario") -> Path:
    """Return the file in which the package holds the schema of scenario files, or of suites."""
    return (Path(__file__).parents[1] / f"{name}.schema.json").resolve()


def finished(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """Return a schema of pydantic's with a title, and without those that it makes from keys."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_without_titles(schema), "title": title}


def _without_titles(node: Any) -> Any:
    """Return a schema without the titles that pydantic makes from the keys: editors show them beside the keys."""
    if isinstance(node, list):
        return [_without_titles(child) for child in node]
    if not isinstance(node, dict):
        return node
    kept = {key: child for key, child in node.items() if key != "title"}
    for key, child in kept.items():
        named = key in ("properties", "$defs")  # whose keys are names, `title` too
        kept[key] = {name: _without_titles(one) for name, one in child.items()} if named else _without_titles(child)
    return kept
