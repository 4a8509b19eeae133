"""A push problem: a chain, where it stands, where it shall go, and what is in the way."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.scenario.parts import (
    CircleObstacle,
    Goal,
    Obstacle,
    PlannerSettings,
    PolygonObstacle,
    Pushes,
    Snapped,
    Snapping,
    StabilitySettings,
    Uncertainty,
    Workspace,
)
from pushplan.util import names
from pushplan.util.arrays import FloatArray, frozen

if TYPE_CHECKING:
    from pushplan.sets.stable_set import StableSet

__all__ = [
    "CircleObstacle",
    "Goal",
    "Obstacle",
    "PlannerSettings",
    "PolygonObstacle",
    "Pushes",
    "Scenario",
    "Snapped",
    "Snapping",
    "StabilitySettings",
    "Uncertainty",
    "Workspace",
]


@dataclass(frozen=True, eq=False)
class Scenario:
    """One push problem, checked and resolved; equal to another when it states the same problem.

    Attributes:
        name: For people.
        path: The file that it was read from.
        source: The bytes of that file.
        chain: The objects, their contacts and the pusher. Where the file states an interval, the middle stands for a
            load or floor friction, and the lowest value for a contact friction.
        floor_friction: Coefficient, or interval, between the floor and objects that do not state their own.
        start: (3,) pose of the chain frame in the world.
        goal: Where to bring the chain.
        workspace: Where the chain may be; None leaves it free to go anywhere.
        obstacles: What is in the way.
        clearance: Distance that pusher and objects keep from obstacles and walls, m.
        stability: The stable set and the margin to keep.
        planner: How to search.
        trajectory: How to time the path, one of `names.TRAJECTORIES`.
        attachments: Bytes of the files that the scenario refers to, by the name that it uses.
        bodies: What the file states of objects, contacts and pusher, with all defaults filled in.
        interval: The chain with the intervals of masses, loads and floor frictions; None when all are numbers.
        uncertainty: The shares that made intervals of stated numbers; `interval` and `chain` hold these.
        contact_friction: (n, 2) least and largest coefficient of every contact; None stands for the chain's.
        snapping: How measured poses were moved onto their contacts; None when the file does not ask for it.
        pushes: Where the robot is when several pushes are asked for, and how to choose them; None stands for one push
            with the plate in contact.
    """

    name: str
    path: Path
    source: bytes
    chain: Chain
    floor_friction: float | tuple[float, float]
    start: FloatArray
    goal: Goal
    workspace: Workspace | None = None
    obstacles: tuple[Obstacle, ...] = ()
    clearance: float = names.COLLISION_CLEARANCE
    stability: StabilitySettings = field(default_factory=StabilitySettings)
    planner: PlannerSettings = field(default_factory=PlannerSettings)
    trajectory: str = names.DEFAULT_TRAJECTORY
    attachments: Mapping[str, bytes] = field(default_factory=dict)
    bodies: Mapping[str, Any] = field(default_factory=dict)
    interval: IntervalChain | None = None
    uncertainty: Uncertainty = field(default_factory=Uncertainty)
    contact_friction: FloatArray | None = None
    snapping: Snapping | None = None
    pushes: Pushes | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "start"))

    def stable_set(self, name: str | None = None) -> StableSet:
        """Return the stable set of the chain; where the file states intervals, the one that holds for all of them.

        Args:
            name: One of `names.STABLE_SETS`; None stands for that of `stability`.

        Raises:
            PushplanError: See `stable_sets.named.stable_set` and `stable_sets.interval_set.stable_set_over`.
        """
        from pushplan.sets.interval_set import stable_set_over
        from pushplan.sets.named import stable_set

        wanted = name or self.stability.set
        return (
            stable_set(self.chain, wanted)
            if self.interval is None
            else stable_set_over(self.interval, wanted)
        )

    @property
    def required_margin(self) -> float:
        """The margin that planned twists have to exceed.

        Raises:
            PushplanError: When it is `auto`, which is no number yet; planning makes it one (`with_margin`).
        """
        if self.stability.margin == "auto":
            raise PushplanError("stability.margin is 'auto', and no number was chosen for it yet")
        return self.stability.margin

    @property
    def robot_start(self) -> FloatArray:
        """(3,) pose of the robot's frame (see `plans.segment`) before the first of several pushes.

        Raises:
            PushplanError: Where one push is asked for, with the plate in contact.
        """
        if self.pushes is None:
            raise PushplanError("the scenario asks for one push: it has no robot.start")
        return se2.compose(self.pushes.robot_start, se2.inverse(self.chain.pusher.plate_pose))

    @property
    def first_pose(self) -> FloatArray:
        """(3,) where the chain frame, or the robot's frame of several pushes, is before anything moves."""
        return self.start if self.pushes is None else self.robot_start

    def with_margin(self, margin: float) -> Scenario:
        """Return the scenario with a number for `stability.margin`."""
        return dataclasses.replace(self, stability=dataclasses.replace(self.stability, margin=margin))

    def resolved(self) -> dict[str, Any]:
        """Return the scenario as plain data in the form of a scenario file, nothing left open.

        All numbers are SI and finite; every object has its pose. Read again, it gives an equal scenario.
        """
        return {
            "format": names.SCENARIO_FORMAT,
            "name": self.name,
            "floor": {"friction": self.floor_friction},
            **_resolved_uncertainty(self.uncertainty),
            **deepcopy(dict(self.bodies)),
            "start": self.start.tolist(),
            **_resolved_task(self),
            **_resolved_surroundings(self),
            "clearance": self.clearance,
            "stability": dataclasses.asdict(self.stability),
            "trajectory": self.trajectory,
            "planner": _resolved_planner(self),
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
        return hash((self.name, self.floor_friction))


def _resolved_uncertainty(uncertainty: Uncertainty) -> dict[str, Any]:
    """Return the shares as the file has them; what they stand for is made of them again when it is read."""
    shares = dataclasses.asdict(uncertainty)
    return {"uncertainty": shares} if any(shares.values()) else {}


def _resolved_task(scenario: Scenario) -> dict[str, Any]:
    """Return goal and pushes; where the robot starts, and the contacts, are among what the file states of bodies."""
    pushes = scenario.pushes
    if pushes is None:
        return {"goal": _resolved_goal(scenario.goal)}
    numbers = ("most", "switch_cost", "transit_weight", "approach", "retreat", "settle")
    goals = [_resolved_goal(goal) for goal in pushes.goals]
    return {"goal": goals, "pushes": {name: getattr(pushes, name) for name in numbers}}


def _resolved_planner(scenario: Scenario) -> dict[str, Any]:
    """Return what bears on one push, or on several."""
    planner = dataclasses.asdict(scenario.planner)
    return (
        planner if scenario.pushes is None else {key: planner[key] for key in ("time_limit", "seed", "gap")}
    )


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
    return {"polygon": obstacle.outline.tolist(), **({"unknown": "obstacle"} if obstacle.unknown else {})}
