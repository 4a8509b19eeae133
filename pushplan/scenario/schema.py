"""Typed model of the scenario file with its defaults; the descriptions of the fields state the allowed values."""

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

GOAL = "[x, y, theta], {pose: [x, y, theta], ...}, or a list of 1 to 100 alternatives of these"
GOALS = "a mapping from names of objects to poses [x, y, theta], {pose: ..., symmetry: ...} or lists of these"
ROW = "{of: [name, name, ...], pose: [x, y, theta]}, or wall: ... or anywhere: true in place of the pose"
SNAP = "a length in m, e.g. 5 mm, or {position: 5 mm, angle: 2 deg}"
SHARE = "a share from 0 to 0.9, e.g. 20 %"
MOST_IN_ROW = 30
OBSTACLES = (
    "a list of at most 10000 {polygon: ...}, {box: ..., pose: ...}, {circle: ..., center: ...} and {map: file.yaml}"
)


class Uncertainty(t.Strict):
    """Uncertainty of friction and loads, as a share of the nominal value; explicit intervals take precedence."""

    contact_friction: t.Share = Field(default=0.0, description=SHARE)
    """Uncertainty of all contact friction, between objects and between plate and objects."""
    floor_friction: t.Share = Field(default=0.0, description=SHARE)
    """Uncertainty of all friction between objects and floor."""
    load: t.Share = Field(default=0.0, description=SHARE)
    """Uncertainty of the load on each foot, or of the pressure at every point; the weights are known."""


class Snap(t.Strict):
    """Largest distance by which objects with a given pose are moved onto their contact."""

    position: t.SnapDistance = Field(description=b.LENGTH)
    angle: t.SnapAngle = Field(default=math.radians(2.0), description="an angle in rad")


SnapChoice = Annotated[
    Annotated[t.SnapDistance, Tag("<word>")] | Annotated[Snap, Tag("<mapping>")],
    Discriminator(lambda value: "<mapping>" if isinstance(value, dict | t.Strict) else "<word>"),
]


class Floor(t.Strict):
    """The floor under every object without its own floor friction."""

    friction: t.FloorFriction = Field(description=b.FRICTION)


class Tolerance(t.Strict):
    """Tolerance of the goal."""

    position: t.PositionTolerance = Field(default=DEFAULT_TOLERANCE[0], description=b.LENGTH)
    angle: t.AngleTolerance = Field(default=DEFAULT_TOLERANCE[1], description="an angle in rad")


class ToleranceOfSeveral(Tolerance):
    """Tolerance of the goal of one of several objects."""

    position: t.PositionTolerance = Field(default=TOLERANCE_OF_SEVERAL[0], description=b.LENGTH)
    angle: t.AngleTolerance = Field(default=TOLERANCE_OF_SEVERAL[1], description="an angle in rad")


class _Aim(t.Strict):
    """A pose and its rotational symmetry."""

    pose: t.Pose = Field(description="[x, y, theta] in the world")
    symmetry: t.Symmetry = Field(
        default=1, description="a whole number n: the object looks the same after a turn by 360/n deg"
    )


class ObjectGoal(_Aim):
    """Goal of one of several objects."""

    tolerance: ToleranceOfSeveral = t.with_defaults(ToleranceOfSeveral, "{position: ..., angle: ...}")


class GoalPose(_Aim):
    """Goal of the chain."""

    tolerance: Tolerance = t.with_defaults(Tolerance, "{position: ..., angle: ...}")
    of: str | None = Field(
        default=None, description="the name of the object that the pose is of; default: the chain frame"
    )


class PushChoice(t.Strict):
    """Limits and costs of multi-push plans."""

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
_UNKNOWN = "obstacle, the default, or free: treatment of unknown cells"


class BoxInRoom(b.BoxShape):
    """A rectangular obstacle."""

    pose: t.Pose = Field(description=_WORLD)


class PolygonInRoom(b.PolygonShape):
    """A polygonal obstacle; it can represent an unknown part of a map."""

    pose: t.Pose | None = Field(default=None, description=_WORLD)
    unknown: Literal["obstacle"] | None = Field(default=None, description="obstacle")


class CircleInRoom(t.Strict):
    """A round obstacle."""

    circle: t.Size = Field(description="a radius in m")
    center: t.Point = Field(description="[x, y] in the world")


class MapInRoom(t.Strict):
    """The obstacles of a map."""

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
    """Stable set that limits the pusher's twists, and their required margin."""

    set: Literal[names.STABLE_SETS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_STABLE_SET, description=b.one_of(names.STABLE_SETS)
    )
    margin: t.Margin = Field(default=names.AUTO, description="auto, or a margin from 0 to 0.99")
    """Margin that all twists exceed; `auto` is min(0.05, half of the set's largest margin), lowered if there is no
    path with it."""


class PlannerSettings(t.Strict):
    """Planner, its limits and its objective."""

    name: Annotated[Literal[names.PLANNERS], BeforeValidator(t.still_here)] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_PLANNER, description=b.one_of(names.PLANNERS)
    )
    time_limit: t.Duration = Field(default=2.0, description="a time in s")
    """Wall-clock limit, s."""
    seed: t.Seed = Field(default=1, description="a whole number")
    cost: Literal[names.COSTS] = Field(  # type: ignore[valid-type]
        default=names.DEFAULT_COST, description=b.one_of(names.COSTS)
    )
    """Objective that ranks paths."""
    weight: t.Weight = Field(default=1.0, description="a weight from 0 to 1000")
    """Weight of the margin in `cost: margin`: extra cost of a metre at the set's boundary, as a share of the cost of
    a metre at the safest twist."""
    gap: t.Gap = Field(default=0.0, description="a share from 0 to 100")
    """Optimality gap at which the search ends, as a share of the lower bound."""
    arc_price: t.ArcPrice = Field(default=0.03, description=b.LENGTH)
    """Cost of each arc in addition to its length, m."""


class RoomFile(t.Strict):
    """The part that all scenario files share: objects, robot, room and settings, without starts and goals."""

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
    """Return the tag of a goal: a list of numbers is a pose, any other list is a list of goals."""
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
    """Several separate objects, each with its own goals or without a goal."""

    objects: Annotated[tuple[b.PlacedObject, ...], t.Several(1, 200)] = Field(
        description="a list of 1 to 200 objects, each with its pose in the world"
    )
    robot: b.PlacedRobot = Field(description="{footprint: ..., drive: ..., start: ...}")
    goals: Annotated[dict[str, _Goals], Field(min_length=1)] = Field(description=GOALS)


class RowGoal(t.Strict):
    """A row of objects that stand flush, one in front of another along the push."""

    of: Annotated[tuple[t.Name, ...], t.Several(1, MOST_IN_ROW)] = Field(
        description=f"a list of 1 to {MOST_IN_ROW} names of objects, from the pusher outward"
    )
    pose: t.Pose | None = Field(
        default=None, description="[x, y, theta] in the world of the middle of the row's rear face, +x along the push"
    )
    wall: Literal[names.WALLS] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"the wall at the row's front: {b.one_of(names.WALLS)}"
    )
    anywhere: bool | None = Field(default=None, description="true: the planner chooses the place of the row")
    order: Literal["any", "given"] = Field(default="any", description="any, or given: the order of the list")
    tolerance: Tolerance = t.with_defaults(Tolerance, "{position: ..., angle: ...}")
    placed: Annotated[tuple[t.Name, ...], t.Several(0, MOST_IN_ROW)] = Field(
        default=(), description="a list of the objects that already stand at the front of the row"
    )

    @model_validator(mode="after")
    def _one_place(self) -> RowGoal:
        given = [self.pose is not None, self.wall is not None, bool(self.anywhere)]
        if sum(given) != 1:
            raise fault("the row has " + ("no place" if not any(given) else "several places"), ROW)
        return self


class RowGoals(t.Strict):
    """The goals of a gathering: one row."""

    row: RowGoal = Field(description=ROW)


class GatheringFile(RearrangementFile):
    """Several separate objects, some of which are gathered into a row."""

    goals: RowGoals = Field(description=f"{{row: {ROW}}}")  # type: ignore[assignment]
    gather: Literal[names.GATHER] = Field(  # type: ignore[valid-type]
        default="auto", description=f"whether objects are pushed together: {b.one_of(names.GATHER)}"
    )


def scenario_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files.

    The schema accepts every file that the loader accepts. The loader checks more than a schema can express: the range
    of numbers with a unit, polygons that cross themselves, contacts and collisions.
    """
    models = (ScenarioFile, RearrangementFile, GatheringFile)
    named, schema = models_json_schema([(model, "validation") for model in models])
    one, several, row = (named[model, "validation"] for model in models)
    of_row = {"properties": {"goals": {"properties": {"row": {"required": ["of"]}}, "required": ["row"]}}}
    with_goals = {"if": of_row, "then": row, "else": several}
    chosen = {"if": {"required": ["goals"]}, "then": with_goals, "else": one}
    return finished({"type": "object", **schema, **chosen}, "pushplan scenario")


def schema_text(schema: dict[str, Any]) -> str:
    """Return a schema as JSON text, as printed and packaged."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def schema_file(name: str = "scenario") -> Path:
    """Return the path of a packaged schema: `scenario` or `suite`."""
    return (Path(__file__).parents[1] / f"{name}.schema.json").resolve()


def finished(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """Return a pydantic schema with a title of its own and without pydantic's titles."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_without_titles(schema), "title": title}


def _without_titles(node: Any) -> Any:
    """Return a schema without the titles that pydantic derives from keys, which editors show beside the keys."""
    if isinstance(node, list):
        return [_without_titles(child) for child in node]
    if not isinstance(node, dict):
        return node
    kept = {key: child for key, child in node.items() if key != "title"}
    for key, child in kept.items():
        named = key in ("properties", "$defs")  # their keys are names, and one can be `title`
        kept[key] = {name: _without_titles(one) for name, one in child.items()} if named else _without_titles(child)
    return kept
