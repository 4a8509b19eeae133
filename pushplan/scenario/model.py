"""A push problem: a chain, where it stands, where it shall go, and what is in the way."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pushplan.errors import ChainError, PushplanError
from pushplan.geometry import polygon, se2
from pushplan.mechanics.chain import Chain, PushedObject, Pusher, outline_of_all
from pushplan.mechanics.intervals import IntervalChain
from pushplan.scenario.parts import (
    DEFAULT_TOLERANCE,
    Goal,
    Obstacle,
    PlacedObject,
    Pushes,
    Row,
    Snapping,
    Task,
    Workspace,
)
from pushplan.scenario.schema import PlannerSettings, PushChoice, StabilitySettings, Uncertainty
from pushplan.scenario.source import Source
from pushplan.util import names
from pushplan.util.arrays import FloatArray, frozen

if TYPE_CHECKING:
    from pushplan.sets.stable_set import StableSet


class NotOneLoadError(PushplanError, AttributeError):
    """What is asked of one load is asked of a scenario whose objects stand apart."""


class NotOneLoad:
    """Stands for chain, start and goal of a scenario whose objects stand apart: whoever uses it is told so.

    Args:
        what: `chain`, `start` or `goal`.
        names: Of the objects.
    """

    def __init__(self, what: str, names: Iterable[str]) -> None:
        self._what, self._names = what, tuple(names)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise self._error()

    def __array__(self, *_: object, **__: object) -> FloatArray:
        raise self._error()

    def __iter__(self) -> Iterator[float]:
        raise self._error()

    def __getitem__(self, _: object) -> float:
        raise self._error()

    def _error(self) -> NotOneLoadError:
        known = ", ".join(f"'{name}'" for name in self._names)
        return NotOneLoadError(
            f"the objects of the scenario stand apart, and no {self._what} for all; "
            f"allowed: scenario.alone(name), the name one of {known}"
        )


@dataclass(frozen=True, eq=False)
class Scenario:
    """A push problem, checked and resolved; equal to another when it states the same problem.

    It is for one load, which the plate touches (`kind` is push) or which stands anywhere (multi-push), or for several
    objects that stand apart (rearrangement). These are `bodies`, and have no chain, start and goal in common.

    Attributes:
        name: For people.
        path: The file that it was read from.
        source: The bytes of that file.
        origin: The file as it was read, for messages about places in it; None where there is none.
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
        stated: What the file states of objects, contacts, pusher and robot, with all defaults filled in.
        interval: The chain with the intervals of masses, loads and floor frictions; None when all are numbers.
        uncertainty: The shares that made intervals of stated numbers; `interval` and `chain` hold these.
        contact_friction: (n, 2) least and largest coefficient of every contact; None stands for the chain's.
        snapping: How measured poses were moved onto their contacts; None when the file does not ask for it.
        pushes: Where the robot is when several pushes are asked for, and how to choose them; None stands for one push
            with the plate in contact.
        bodies: The objects that stand apart, by name; none where there is one load.
        row: What some of `bodies` shall stand in; None where each has goals of its own. Only a plan says which place
            in it each one has, see `with_row_at`.
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
    stated: Mapping[str, Any] = field(default_factory=dict)
    interval: IntervalChain | None = None
    uncertainty: Uncertainty = field(default_factory=Uncertainty)
    contact_friction: FloatArray | None = None
    snapping: Snapping | None = None
    pushes: Pushes | None = None
    bodies: Mapping[str, PlacedObject] = field(default_factory=dict)
    row: Row | None = None
    origin: Source | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if not self.bodies:
            object.__setattr__(self, "start", frozen(self.start, (3,), "start"))

    def __repr__(self) -> str:
        """Say what it is in a line."""
        names = list(self.bodies) or [obj.name for obj in self.chain.objects]
        return f"<Scenario {self.name!r}: {self.kind} of {', '.join(names)}>"

    @property
    def kind(self) -> Literal["push", "multi-push", "rearrangement"]:
        """What is asked for: one push, several pushes of one load, or several objects each to a goal of its own."""
        if self.bodies:
            return "rearrangement"
        return "push" if self.pushes is None else "multi-push"

    @property
    def goals(self) -> dict[str, tuple[Goal, ...]]:
        """The goals of each of `bodies` that has any; any of an object's goals will do."""
        return {name: body.goals for name, body in self.bodies.items() if body.goals}

    def with_row_at(self, poses: Mapping[str, FloatArray]) -> Scenario:
        """Return the scenario with goals for the objects of its row: the poses (3,) that a plan has them at.

        A plan for some of them, as replans are, says nothing of the row.
        """
        if self.row is None or not set(self.row.of) <= set(poses):
            return self
        bodies = dict(self.bodies)
        for name in self.row.of:
            body = bodies[name]
            obj, goals = body.chain.objects[0], []
            for turn in polygon.symmetries(obj.outline):  # a row that looks the same is the same
                pose = se2.compose(poses[name], turn)
                there = se2.compose(pose, se2.inverse(obj.pose_chain))
                goals.append(Goal(pose, name, there, *self.row.tolerance))
            bodies[name] = dataclasses.replace(body, goals=tuple(goals))
        return dataclasses.replace(self, bodies=bodies)

    def row_order(self, poses: Mapping[str, FloatArray], heading: float) -> tuple[str, ...]:
        """Return the objects of the row, from its rear to its front, where they stand at poses (3,).

        Args:
            poses: By name.
            heading: Direction in the world that the row is pushed along, rad.
        """
        assert self.row is not None
        ahead = [math.cos(heading), math.sin(heading)]

        def front(name: str) -> float:
            outline = self.bodies[name].chain.objects[0].outline
            return float((se2.transform_points(poses[name], outline) @ ahead).max())

        return tuple(sorted(self.row.of, key=front))

    def alone(self, name: str) -> Scenario:
        """Return the problem of one of `bodies`, alone in the same room.

        One without goals has its own place for a goal.

        Raises:
            ChainError: When no object has that name.
        """
        if name not in self.bodies or self.pushes is None:
            raise ChainError(f"no object is called {name!r}; there are {', '.join(self.bodies)}")
        if name not in self._alone:
            self._alone[name] = self._made_alone(name, self.pushes)
        return self._alone[name]

    @cached_property
    def _alone(self) -> dict[str, Scenario]:
        return {}

    def _made_alone(self, name: str, pushes: Pushes) -> Scenario:
        body = self.bodies[name]
        start = body.start
        goals = body.goals or (Goal(body.pose, name, start, *DEFAULT_TOLERANCE),)
        one = dataclasses.replace(
            self,
            source=b"",
            origin=None,
            chain=body.chain,
            start=start,
            goal=goals[0],
            stated=body.stated,
            interval=body.interval,
            contact_friction=body.contact_friction,
            pushes=dataclasses.replace(pushes, goals=goals),
            bodies={},
            row=None,
        )
        return dataclasses.replace(one, source=one.to_json().encode())

    def stable_set(self, name: str | None = None) -> StableSet:
        """Return the stable set of the chain; where the file states intervals, the one that holds for all of them.

        Args:
            name: One of `names.STABLE_SETS`; None stands for that of `stability`.

        Raises:
            PushplanError: See `sets.named.stable_set` and `stable_set_over`.
        """
        from pushplan.sets.named import stable_set, stable_set_over

        wanted = name or self.stability.set
        return stable_set(self.chain, wanted) if self.interval is None else stable_set_over(self.interval, wanted)

    @property
    def pusher(self) -> Pusher:
        """The plate and the robot that carries it."""
        return self.tasks[0].chain.pusher

    @property
    def footprint(self) -> FloatArray:
        """(v, 2) outline of all that moves with the robot, in the frame of its base, m, counter-clockwise.

        That is robot and plate and, of a single push, the objects, which the plate never leaves.
        """
        chain = self.tasks[0].chain
        around = outline_of_all(chain.bodies if self.kind == "push" else chain.carried)
        return se2.transform_points(se2.inverse(chain.pusher.base_pose), around)

    @property
    def has_intervals(self) -> bool:
        """Whether masses, loads or floor frictions are intervals."""
        return any(body.interval is not None for body in self.bodies.values()) or self.interval is not None

    @property
    def states_intervals(self) -> bool:
        """Whether contact frictions, masses, loads or floor frictions are intervals."""
        frictions = [self.contact_friction, *(body.contact_friction for body in self.bodies.values())]
        return self.has_intervals or any(f is not None and bool((f[:, 0] < f[:, 1]).any()) for f in frictions)

    @cached_property
    def tasks(self) -> tuple[Task, ...]:
        """What has to be brought where, one for each load that is pushed on its own."""
        if self.bodies:
            return tuple(Task(body.chain, body.start, body.goals) for body in self.bodies.values())
        goals = (self.goal,) if self.pushes is None else self.pushes.goals
        return (Task(self.chain, self.start, goals),)

    @property
    def objects(self) -> tuple[PushedObject, ...]:
        """All objects, in the order of `poses`."""
        return tuple(obj for task in self.tasks for obj in task.chain.objects)

    @property
    def poses(self) -> dict[str, FloatArray]:
        """(3,) poses of all objects' own frames in the world before anything moves, by name."""
        return {name: pose for task in self.tasks for name, pose in task.poses(task.start).items()}

    @property
    def plate_start(self) -> FloatArray:
        """(3,) pose of the plate frame in the world before anything moves."""
        if self.pushes is not None:
            return self.pushes.robot_start
        return se2.compose(self.start, self.chain.pusher.plate_pose)

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
        """Return the scenario as plain data in the form of a scenario file, nothing left open.

        All numbers are SI and finite; every object has its pose. Read again, it gives an equal scenario.
        """
        # Shares stay shares: what they stand for is made of them again. Of several pushes only some settings bear.
        shares, planner, area = self.uncertainty.model_dump(), self.planner.model_dump(), self.workspace
        if self.pushes is not None:
            planner = {key: planner[key] for key in ("time_limit", "seed", "gap")}
        room = {} if area is None else {"workspace": {"x": [area.xmin, area.xmax], "y": [area.ymin, area.ymax]}}
        return {
            "format": names.SCENARIO_FORMAT,
            "name": self.name,
            "floor": {"friction": self.floor_friction},
            **({"uncertainty": shares} if any(shares.values()) else {}),
            **_resolved_bodies(self),
            **_resolved_task(self),
            **room,
            "obstacles": [obstacle.document() for obstacle in self.obstacles],
            "clearance": self.clearance,
            "stability": self.stability.model_dump(),
            "trajectory": self.trajectory,
            "planner": planner,
        }

    def to_json(self) -> str:
        """Return `resolved` as JSON text."""
        return json.dumps(self.resolved(), allow_nan=False, indent=1)

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process gets: all but the file as it was read, whose tree is large."""
        return {**self.__dict__, "origin": None, "_alone": {}}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scenario):
            return NotImplemented
        mine, theirs = (dict(scenario.attachments) for scenario in (self, other))
        return mine == theirs and self.resolved() == other.resolved()

    def __hash__(self) -> int:
        return hash((self.name, self.floor_friction))


def _resolved_bodies(scenario: Scenario) -> dict[str, Any]:
    """Return objects, contacts, pusher and robot, and where they are."""
    stated = deepcopy(dict(scenario.stated))
    if scenario.pushes is not None:
        stated["robot"] = {**stated.get("robot", {}), "start": scenario.pushes.robot_start.tolist()}
    if not scenario.bodies:
        return {**stated, "start": scenario.start.tolist()}
    objects = []
    for body in scenario.bodies.values():
        (obj,) = deepcopy(body.stated["objects"])
        del obj["offset"]
        objects.append({**obj, "pose": body.pose.tolist()})
    return {**stated, "objects": objects}


def _resolved_task(scenario: Scenario) -> dict[str, Any]:
    """Return goals and pushes; which contacts these may choose is among what the file states of the pusher."""
    pushes = scenario.pushes
    if pushes is None:
        return {"goal": _resolved_goal(scenario.goal)}
    choice = {"pushes": {name: getattr(pushes, name) for name in PushChoice.model_fields}}
    if not scenario.bodies:
        return {"goal": [_resolved_goal(goal) for goal in pushes.goals], **choice}
    if scenario.row is not None:
        return {"goals": {"row": _resolved_row(scenario.row)}, "gather": scenario.row.gather, **choice}
    goals = {name: [_resolved_goal(goal) for goal in goals] for name, goals in scenario.goals.items()}
    for goal in (goal for several in goals.values() for goal in several):
        del goal["of"]
    return {"goals": goals, **choice}


def _resolved_row(row: Row) -> dict[str, Any]:
    place: dict[str, Any] = {"anywhere": True} if row.wall is None else {"wall": row.wall}
    if row.pose is not None:
        place = {"pose": row.pose.tolist()}
    tolerance = {"position": row.tolerance[0], "angle": row.tolerance[1]}
    found = {"of": list(row.of), **place, "order": row.order, "tolerance": tolerance}
    return {**found, "placed": list(row.placed)} if row.placed else found


def _resolved_goal(goal: Goal) -> dict[str, Any]:
    of = {} if goal.of is None else {"of": goal.of}
    tolerance = {"position": goal.position_tolerance, "angle": goal.angle_tolerance}
    return {"pose": goal.pose.tolist(), **of, "tolerance": tolerance}
