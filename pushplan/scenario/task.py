"""Tasks of a scenario: a push with the plate in contact, or the transport of loads from anywhere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

from pushplan.errors import PlanningError, PushplanError
from pushplan.geometry import se2
from pushplan.scenario.goals import DEFAULT_TOLERANCE, Goal, Poses, Row, TaskGoal
from pushplan.scenario.loads import PlacedLoad
from pushplan.util.arrays import FloatArray, frozen


class NotOneLoadError(PushplanError):
    """A property of a single load was read in a scenario with several loads."""


@dataclass(frozen=True, eq=False)
class Task(ABC):
    """Loads and their goals.

    Attributes:
        loads: All loads, including those without a goal.
        goals: Goals of the loads. A load without a goal is moved only if it is in the way.
    """

    loads: tuple[PlacedLoad, ...]
    goals: tuple[TaskGoal, ...]

    planner_keys: ClassVar[Collection[str] | None] = None
    """Keys of `planner` in a file that apply to the task; None for all."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """Kind of the task: one of `names.TASK_KINDS`."""

    @property
    @abstractmethod
    def plate_start(self) -> FloatArray:
        """Start pose (3,) of the plate frame in the world."""

    @property
    @abstractmethod
    def held(self) -> tuple[PlacedLoad, ...]:
        """Loads in contact with the plate at the start."""

    @abstractmethod
    def with_poses(self, start: FloatArray | None, goals: FloatArray | None, robot: FloatArray | None) -> Task:
        """Return the task with another start (3,), goals (g, 3) and plate pose (3,); None keeps a value.

        Raises:
            PlanningError: If the task does not allow one of them.
        """

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """Return the task in the form of a scenario file, with all defaults filled in."""

    @property
    @abstractmethod
    def one_load(self) -> bool:
        """Whether the task has a single load with a chain, a start and a goal."""

    @cached_property
    def by_name(self) -> dict[str, PlacedLoad]:
        """The loads by name."""
        return {load.name: load for load in self.loads}

    @property
    def load(self) -> PlacedLoad:
        """The single load.

        Raises:
            NotOneLoadError: If there are several.
        """
        if len(self.loads) != 1:
            known = ", ".join(f"'{load.name}'" for load in self.loads)
            raise NotOneLoadError(
                f"the scenario has {len(self.loads)} loads, so it has no single chain, start or goal; "
                f"allowed: scenario.alone(name) with one of the names {known}"
            )
        return self.loads[0]

    def _with_ends(self, start: FloatArray | None, goals: FloatArray | None) -> Self:
        """Return the task of one load with another start (3,) and goals (g, 3) of its chain frame."""
        load = self.load if start is None else replace(self.load, start=start)
        if goals is None:
            return replace(self, loads=(load,))
        tolerance = self.candidates[load.name][0].tolerance
        return replace(
            self, loads=(load,), goals=(Poses(load.name, tuple(Goal.of_chain(goal, tolerance) for goal in goals)),)
        )

    @property
    def flush(self) -> bool:
        """Whether some loads end flush with each other."""
        return any(goal.flush for goal in self.goals)

    @cached_property
    def candidates(self) -> dict[str, tuple[Goal, ...]]:
        """Goal poses to try for each load, by name, without loads that have none."""
        found = {load.name: [goal.candidates(load.name) for goal in self.goals] for load in self.loads}
        return {name: tuple(sum(each, ())) for name, each in found.items() if any(each)}


@dataclass(frozen=True, eq=False)
class Push(Task):
    """A single push that brings a load to its goal; the plate is in contact at the start."""

    @property
    def kind(self) -> str:
        """See `Task`."""
        return "push"

    @classmethod
    def of(cls, load: PlacedLoad, goal: Goal | None = None) -> Push:
        """Return the push of a load to a goal; None for its start pose."""
        return cls((load,), (Poses(load.name, (goal or Goal.of_chain(load.start),)),))

    @property
    def one_load(self) -> bool:
        """See `Task`."""
        return True

    @property
    def plate_start(self) -> FloatArray:
        """See `Task`."""
        return se2.compose(self.load.start, self.load.chain.pusher.plate_pose)

    @property
    def held(self) -> tuple[PlacedLoad, ...]:
        """See `Task`."""
        return self.loads

    def with_poses(self, start: FloatArray | None, goals: FloatArray | None, robot: FloatArray | None) -> Task:
        """See `Task`."""
        if goals is not None and len(goals) > 1:
            raise PlanningError(f"a single push has one goal, not {len(goals)}")
        if robot is not None:
            raise PlanningError("robot: allowed only if the scenario has a robot.start; here the plate is in contact")
        return self._with_ends(start, goals)

    def document(self) -> dict[str, Any]:
        """See `Task`."""
        (goal,) = self.candidates[self.load.name]
        return {**_load_document(self.load), "goal": goal.document()}


@dataclass(frozen=True, eq=False)
class Transport(Task):
    """The transport of loads to their goals by several pushes; robot and loads start anywhere.

    Attributes:
        robot_start: Start pose (3,) of the plate's frame in the world.
        contacts: Contacts of all loads in the form of the file.
        faces: Faces that the plate may push: names of `names.FACES` and angles of outward normals in the chain
            frame, rad; None for all.
        offsets: Offsets of the plate's middle from the middle of the face, to the left of the push, m.
        most: Largest number of pushes.
        switch_cost: Cost of a change of the contact, m.
        transit_weight: Cost of a metre of transit, as a share of a metre of pushing.
        approach: Length of the straight path to a contact, m.
        retreat: Length of the straight path back from a contact, m.
        settle: Length of the straight motion at the beginning of every push, m.
    """

    robot_start: FloatArray
    contacts: Mapping[str, Any] = field(default_factory=dict)
    faces: tuple[str | float, ...] | None = None
    offsets: tuple[float, ...] = (0.0,)
    most: int = 6
    switch_cost: float = 0.1
    transit_weight: float = 0.1
    approach: float = 0.05
    retreat: float = 0.05
    settle: float = 0.02

    planner_keys = ("time_limit", "seed", "gap")

    def __post_init__(self) -> None:
        object.__setattr__(self, "robot_start", frozen(self.robot_start, (3,), "start of the robot"))

    @property
    def kind(self) -> str:
        """See `Task`."""
        return "multi-push" if self.one_load else "rearrangement"

    @property
    def one_load(self) -> bool:
        """See `Task`."""
        return len(self.loads) == 1 and all(isinstance(goal, Poses) for goal in self.goals)

    @property
    def row(self) -> Row:
        """The goal that is a row.

        Raises:
            PushplanError: If no goal is a row.
        """
        for goal in self.goals:
            if isinstance(goal, Row):
                return goal
        raise PushplanError("the scenario has no row; add goals.row to its file")

    @property
    def plate_start(self) -> FloatArray:
        """See `Task`."""
        return self.robot_start

    @property
    def held(self) -> tuple[PlacedLoad, ...]:
        """See `Task`."""
        return ()

    def with_poses(self, start: FloatArray | None, goals: FloatArray | None, robot: FloatArray | None) -> Task:
        """See `Task`."""
        given = {"start": start, "goal": goals, "robot": robot}
        wrong = [name for name, value in given.items() if value is not None]
        if not self.one_load and wrong:
            what = "allowed only for a single load; here each object has its own start and goal"
            raise PlanningError(f"{', '.join(wrong)}: {what}")
        task = self._with_ends(start, goals)
        return task if robot is None else replace(task, robot_start=robot)

    def alone(self, name: str) -> Transport:
        """Return the task of one load; if it has no goal, its start is its goal."""
        load = self.by_name[name]
        goals = self.candidates.get(name) or (Goal(load.pose, name, load.start, *DEFAULT_TOLERANCE),)
        return replace(self, loads=(load,), goals=(Poses(name, goals),), contacts=load.stated["contacts"])

    def document(self) -> dict[str, Any]:
        """See `Task`."""
        if self.one_load:
            (load,) = self.loads
            found = _load_document(load)
            found["goal"] = [goal.document() for goal in self.candidates[load.name]]
        else:
            found = {**self.loads[0].document(), "contacts": deepcopy(dict(self.contacts))}
            found["objects"] = [_object_document(load) for load in self.loads]
            found["goals"] = {}
            for goal in self.goals:
                stated = goal.document()
                found = {**found, **stated, "goals": {**found["goals"], **stated["goals"]}}
        found["robot"] = {**found.get("robot", {}), "start": self.robot_start.tolist()}
        return {**found, "pushes": {name: getattr(self, name) for name in PUSHES}}


PUSHES = ("most", "switch_cost", "transit_weight", "approach", "retreat", "settle")
"""Fields of a `Transport` under the key `pushes` of a file."""


def _load_document(load: PlacedLoad) -> dict[str, Any]:
    """Return a load in the form of a file of one load."""
    return {**load.document(), "start": load.start.tolist()}


def _object_document(load: PlacedLoad) -> dict[str, Any]:
    """Return a load in the form of a file of several objects: an object with its pose in the world."""
    (obj,) = deepcopy(load.stated["objects"])
    del obj["offset"]
    return {**obj, "pose": load.pose.tolist()}
