"""A push problem: a chain, where it stands, where it shall go, and what is in the way."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pushplan import names
from pushplan.arrays import FloatArray, frozen
from pushplan.chain import Chain


@dataclass(frozen=True, eq=False)
class Goal:
    """Where to bring the chain.

    Attributes:
        pose: (3,) pose in the world of the object `of`, or of the chain frame, as stated.
        of: Name of the object whose frame is meant; None stands for the chain frame.
        pose_chain: (3,) pose of the chain frame in the world at the goal.
        position_tolerance: Distance that still counts as reached, m.
        angle_tolerance: Angle that still counts as reached, rad.
    """

    pose: FloatArray
    of: str | None
    pose_chain: FloatArray
    position_tolerance: float
    angle_tolerance: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", frozen(self.pose, (3,), "pose of the goal"))
        object.__setattr__(self, "pose_chain", frozen(self.pose_chain, (3,), "chain's pose at the goal"))


@dataclass(frozen=True)
class Workspace:
    """The rectangle, in the world, that pusher and objects do not leave, m."""

    xmin: float
    xmax: float
    ymin: float
    ymax: float


@dataclass(frozen=True, eq=False)
class PolygonObstacle:
    """A simple polygon that stands still.

    Attributes:
        outline: (v, 2) corners in the world, m, counter-clockwise.
    """

    outline: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", frozen(self.outline, (None, 2), "outline of an obstacle"))


@dataclass(frozen=True, eq=False)
class CircleObstacle:
    """A disc that stands still.

    Attributes:
        center: (2,) in the world, m.
        radius: m.
    """

    center: FloatArray
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen(self.center, (2,), "centre of an obstacle"))


Obstacle = PolygonObstacle | CircleObstacle


@dataclass(frozen=True)
class StabilitySettings:
    """The stable set that limits the pusher's twists, and the margin that they keep inside it."""

    set: str = names.DEFAULT_STABLE_SET
    margin: float = 0.0


@dataclass(frozen=True)
class PlannerSettings:
    """The planner, its wall-clock limit (s), and the seed of its random numbers."""

    name: str = names.DEFAULT_PLANNER
    time_limit: float = 2.0
    seed: int = 1


@dataclass(frozen=True, eq=False)
class Scenario:
    """One push problem, checked and resolved; equal to another when it states the same problem.

    Attributes:
        name: For people.
        path: The file that it was read from.
        source: The bytes of that file.
        chain: The objects, their contacts and the pusher.
        floor_friction: Coefficient between the floor and objects that do not state their own.
        start: (3,) pose of the chain frame in the world.
        goal: Where to bring the chain.
        workspace: Where the chain may be; None leaves it free to go anywhere.
        obstacles: What is in the way.
        stability: The stable set and the margin to keep.
        planner: How to search.
        trajectory: How to time the path, one of `names.TRAJECTORIES`.
        attachments: Bytes of the files that the scenario refers to, by the name that it uses.
        bodies: What the file states of objects, contacts and pusher, with all defaults filled in.
    """

    name: str
    path: Path
    source: bytes
    chain: Chain
    floor_friction: float
    start: FloatArray
    goal: Goal
    workspace: Workspace | None = None
    obstacles: tuple[Obstacle, ...] = ()
    stability: StabilitySettings = StabilitySettings()
    planner: PlannerSettings = PlannerSettings()
    trajectory: str = names.DEFAULT_TRAJECTORY
    attachments: Mapping[str, bytes] = field(default_factory=dict)
    bodies: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "start"))

    def resolved(self) -> dict[str, Any]:
        """Return the scenario as plain data in the form of a scenario file, nothing left open.

        All numbers are SI and finite; every object has its pose. Read again, it gives an equal scenario.
        """
        return {
            "format": names.SCENARIO_FORMAT,
            "name": self.name,
            "floor": {"friction": self.floor_friction},
            **self.bodies,
            "start": self.start.tolist(),
            "goal": _resolved_goal(self.goal),
            **_resolved_surroundings(self),
            "stability": dataclasses.asdict(self.stability),
            "trajectory": self.trajectory,
            "planner": dataclasses.asdict(self.planner),
        }

    def to_json(self) -> str:
        """Return `resolved` as JSON text."""
        return json.dumps(self.resolved(), allow_nan=False, indent=1)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scenario):
            return NotImplemented
        mine, theirs = (dict(scenario.attachments) for scenario in (self, other))
        return mine == theirs and self.resolved() == other.resolved()

    def __hash__(self) -> int:
        return hash((self.name, self.source))


def _resolved_goal(goal: Goal) -> dict[str, Any]:
    of = {} if goal.of is None else {"of": goal.of}
    tolerance = {"position": goal.position_tolerance, "angle": goal.angle_tolerance}
    return {"pose": goal.pose.tolist(), **of, "tolerance": tolerance}


def _resolved_surroundings(scenario: Scenario) -> dict[str, Any]:
    area = scenario.workspace
    room = {} if area is None else {"workspace": {"x": [area.xmin, area.xmax], "y": [area.ymin, area.ymax]}}
    return {**room, "obstacles": [_resolved_obstacle(obstacle) for obstacle in scenario.obstacles]}


def _resolved_obstacle(obstacle: Obstacle) -> dict[str, Any]:
    if isinstance(obstacle, CircleObstacle):
        return {"circle": obstacle.radius, "center": obstacle.center.tolist()}
    return {"polygon": obstacle.outline.tolist()}
