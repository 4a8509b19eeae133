"""The scenario: the room, the task and the settings."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pushplan.errors import ChainError, PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, PushedObject, Pusher, outline_of_all
from pushplan.mechanics.intervals import IntervalChain
from pushplan.scenario.goals import Goal, Poses
from pushplan.scenario.loads import PlacedLoad
from pushplan.scenario.parts import Obstacle, Workspace
from pushplan.scenario.schema import PlannerSettings, StabilitySettings, Uncertainty
from pushplan.scenario.source import Source
from pushplan.scenario.task import Push, Task, Transport
from pushplan.util import names
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from pushplan.sets.stable_set import StableSet

MOVED = {
    "pushes": "scenario.transport",
    "bodies": "scenario.loads",
    "row": "scenario.transport.row",
    "tasks": "scenario.loads and scenario.goals",
    "stated": "scenario.load.stated",
    "snapping": "scenario.load.snapping",
    "with_row_at": "scenario.settled",
    "row_order": "scenario.transport.row.order_at",
}
"""Attributes of earlier versions, and their replacements."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """A checked planning problem. Two scenarios are equal if they specify the same problem.

    If the task has a single load, properties such as `chain`, `start` and `goal` belong to it.

    Attributes:
        name: Name of the scenario.
        path: File of the scenario.
        source: Bytes of this file.
        task: Loads, goals and start of the robot: a `Push` or a `Transport`.
        floor_friction: Coefficient, or interval, of floor friction for objects without their own.
        workspace: Rectangle that robot and objects stay in; None for no limits.
        obstacles: Obstacles of the room.
        clearance: Distance that robot and objects keep from obstacles and walls, m.
        stability: Stable set and required margin.
        planner: Settings of the search.
        trajectory: Kind of timing, one of `names.TRAJECTORIES`.
        attachments: Bytes of the files that the scenario refers to, by their names in the scenario.
        uncertainty: Shares that turned nominal numbers into intervals; the loads hold the intervals.
        origin: Parsed file, for messages with line and column; None if there is none.
    """

    name: str
    path: Path
    source: bytes
    task: Task
    floor_friction: float | tuple[float, float]
    workspace: Workspace | None = None
    obstacles: tuple[Obstacle, ...] = ()
    clearance: float = names.COLLISION_CLEARANCE
    stability: StabilitySettings = field(default_factory=StabilitySettings)
    planner: PlannerSettings = field(default_factory=PlannerSettings)
    trajectory: str = names.DEFAULT_TRAJECTORY
    attachments: Mapping[str, bytes] = field(default_factory=dict)
    uncertainty: Uncertainty = field(default_factory=Uncertainty)
    origin: Source | None = field(default=None, repr=False)

    if not TYPE_CHECKING:  # type checkers report the names themselves

        def __getattr__(self, name: str) -> Any:
            """Raise an error that names the replacement of an attribute of earlier versions."""
            if name in MOVED:
                raise AttributeError(f"Scenario.{name} is {MOVED[name]} now")
            raise AttributeError(f"'Scenario' has no attribute {name!r}")

    def __repr__(self) -> str:
        """Return one line with name, kind and objects."""
        return f"<Scenario {self.name!r}: {self.kind} of {', '.join(self.poses)}>"

    # --- the task ---

    @property
    def kind(self) -> str:
        """Kind of the task: `push`, `multi-push` (one load) or `rearrangement` (several loads)."""
        return self.task.kind

    @property
    def loads(self) -> tuple[PlacedLoad, ...]:
        """All loads."""
        return self.task.loads

    @property
    def goals(self) -> dict[str, tuple[Goal, ...]]:
        """Alternative goals of each load by name, for the loads that have goals."""
        return self.task.candidates

    @property
    def load(self) -> PlacedLoad:
        """The single load.

        Raises:
            NotOneLoadError: If there are several.
        """
        return self.task.load

    @property
    def chain(self) -> Chain:
        """The chain of the load. See `load`."""
        return self.load.chain

    @property
    def start(self) -> FloatArray:
        """Start pose (3,) of the load's chain frame in the world. See `load`."""
        return self.load.start

    @property
    def goal(self) -> Goal:
        """The first goal of the load. See `load`."""
        return self.goals[self.load.name][0]

    @property
    def interval(self) -> IntervalChain | None:
        """The load's chain with its intervals; None if it has none. See `load`."""
        return self.load.interval

    @property
    def contact_friction(self) -> FloatArray | None:
        """Lowest and highest coefficients (n, 2) of the contacts; None for those of the chain. See `load`."""
        return self.load.contact_friction

    @property
    def transport(self) -> Transport:
        """The task of a robot that need not be in contact at the start.

        Raises:
            PushplanError: If the plate is in contact at the start.
        """
        if isinstance(self.task, Transport):
            return self.task
        raise PushplanError("the scenario is a single push: it has no robot.start, the plate's pose in the world")

    def with_task(self, **changes: Any) -> Scenario:
        """Return the scenario with other fields in its task."""
        return dataclasses.replace(self, task=dataclasses.replace(self.task, **changes))

    def with_load(self, **changes: Any) -> Scenario:
        """Return the scenario with other fields in its load. See `load`."""
        return self.with_task(loads=(dataclasses.replace(self.load, **changes),))

    def with_goal(self, goal: Goal) -> Scenario:
        """Return the scenario with another goal for its load. See `load`."""
        return self.with_task(goals=(Poses(self.load.name, (goal,)),))

    def push_of(self, load: PlacedLoad, goal: Goal | None = None) -> Scenario:
        """Return the push problem of a load with the plate in contact, in the same room with the same settings."""
        return dataclasses.replace(self, task=Push.of(load, goal))

    def settled(self, poses: Mapping[str, FloatArray]) -> Scenario:
        """Return the scenario with the goals of a plan that ends with the objects at poses (3,), by name."""
        goals = tuple(goal.settled(self.task.by_name, poses) for goal in self.task.goals)
        same = all(one is other for one, other in zip(goals, self.task.goals, strict=True))
        return self if same else self.with_task(goals=goals)

    def without_goals(self, names: Collection[str]) -> Scenario:
        """Return the scenario without the goals of the named loads, which can still be moved out of the way."""
        goals = tuple(goal for goal in self.task.goals if not set(goal.names) & set(names))
        return self if len(goals) == len(self.task.goals) else self.with_task(goals=goals)

    def alone(self, name: str) -> Scenario:
        """Return the problem of one load, alone in the same room.

        If the load has no goal, its start is its goal.

        Raises:
            ChainError: If no load has that name.
        """
        if name not in self.task.by_name:
            raise ChainError(f"no object is called {name!r}; allowed: {', '.join(self.task.by_name)}")
        if name not in self._alone:
            one = dataclasses.replace(self, source=b"", origin=None, task=self.transport.alone(name))
            self._alone[name] = dataclasses.replace(one, source=one.to_json().encode())
        return self._alone[name]

    def each_alone(self) -> list[Scenario]:
        """Return the problem of each load alone in the room; for a single load, the scenario itself."""
        return [self] if self.task.one_load else [self.alone(load.name) for load in self.loads]

    @cached_property
    def _alone(self) -> dict[str, Scenario]:
        return {}

    def stable_set(self, name: str | None = None) -> StableSet:
        """Return the stable set of the chain; with intervals, the set that is stable for all their values.

        Args:
            name: One of `names.STABLE_SETS`; None for that of `stability`.

        Raises:
            PushplanError: See `sets.named.stable_set` and `stable_set_over`.
        """
        from pushplan.sets.named import stable_set, stable_set_over

        wanted = name or self.stability.set
        return stable_set(self.chain, wanted) if self.interval is None else stable_set_over(self.interval, wanted)

    @property
    def pusher(self) -> Pusher:
        """The plate and the robot that carries it."""
        return self.loads[0].chain.pusher

    @property
    def footprint(self) -> FloatArray:
        """Outline (v, 2) of robot, plate and the objects that it holds at the start, in the base frame, m.

        The outline is counter-clockwise.
        """
        parts = [body for load in self.task.held for body in load.chain.bodies] or list(self.loads[0].chain.carried)
        return se2.transform_points(se2.inverse(self.pusher.base_pose), outline_of_all(tuple(parts)))

    @property
    def has_intervals(self) -> bool:
        """Whether masses, loads or floor frictions are intervals."""
        return any(load.interval is not None for load in self.loads)

    @property
    def states_intervals(self) -> bool:
        """Whether contact frictions, masses, loads or floor frictions are intervals."""
        frictions = [load.contact_friction for load in self.loads]
        return self.has_intervals or any(f is not None and bool((f[:, 0] < f[:, 1]).any()) for f in frictions)

    @cached_property
    def objects(self) -> tuple[PushedObject, ...]:
        """All objects, in the order of `poses`."""
        return tuple(obj for load in self.loads for obj in load.chain.objects)

    @property
    def poses(self) -> dict[str, FloatArray]:
        """Start poses (3,) of all objects' own frames in the world, by name."""
        return {name: pose for load in self.loads for name, pose in load.poses().items()}

    @property
    def plate_start(self) -> FloatArray:
        """Start pose (3,) of the plate frame in the world."""
        return self.task.plate_start

    @property
    def required_margin(self) -> float:
        """The margin that planned twists must exceed.

        Raises:
            PushplanError: If it is still `auto`; planning replaces it by a number (`with_margin`).
        """
        if self.stability.margin == "auto":
            raise PushplanError("stability.margin is 'auto'; planning has not replaced it by a number yet")
        return self.stability.margin

    @property
    def robot_start(self) -> FloatArray:
        """Start pose (3,) of the robot's frame (see `plans.segment`) in a multi-push plan.

        Raises:
            PushplanError: If the plate is in contact at the start.
        """
        return se2.compose(self.transport.robot_start, se2.inverse(self.pusher.plate_pose))

    def with_margin(self, margin: float | Literal["auto"]) -> Scenario:
        """Return the scenario with another `stability.margin`."""
        if margin == self.stability.margin:
            return self
        return dataclasses.replace(self, stability=self.stability.model_copy(update={"margin": margin}))

    def with_planner(self, **changes: Any) -> Scenario:
        """Return the scenario with other settings in `planner`, such as `cost="travel"`."""
        if all(getattr(self.planner, name) == value for name, value in changes.items()):
            return self
        return dataclasses.replace(self, planner=self.planner.model_copy(update=changes))

    def resolved(self) -> dict[str, Any]:
        """Return the scenario as plain data in the form of a scenario file, with all defaults filled in.

        All numbers are SI and finite, and every object has its pose. Reading the result gives an equal scenario.
        """
        # The shares of the uncertainty are kept: reading computes the intervals from them again.
        shares, planner, area = self.uncertainty.model_dump(), self.planner.model_dump(), self.workspace
        kept = self.task.planner_keys
        room = {} if area is None else {"workspace": {"x": [area.xmin, area.xmax], "y": [area.ymin, area.ymax]}}
        return {
            "format": names.SCENARIO_FORMAT,
            "name": self.name,
            "floor": {"friction": self.floor_friction},
            **({"uncertainty": shares} if any(shares.values()) else {}),
            **self.task.document(),
            **room,
            "obstacles": [obstacle.document() for obstacle in self.obstacles],
            "clearance": self.clearance,
            "stability": self.stability.model_dump(),
            "trajectory": self.trajectory,
            "planner": {key: value for key, value in planner.items() if kept is None or key in kept},
        }

    def to_json(self) -> str:
        """Return `resolved` as JSON text."""
        return json.dumps(self.resolved(), allow_nan=False, indent=1)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for other processes, without the parsed file, which is large."""
        return {**self.__dict__, "origin": None, "_alone": {}}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scenario):
            return NotImplemented
        mine, theirs = (dict(scenario.attachments) for scenario in (self, other))
        return mine == theirs and self.resolved() == other.resolved()

    def __hash__(self) -> int:
        return hash((self.name, self.floor_friction))
