"""What a scenario asks for: a push with the plate in contact, or the transport of loads that stand anywhere."""

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
    """A property of one load was read in a scenario that has several."""


@dataclass(frozen=True, eq=False)
class Task(ABC):
    """Loads and their goals.

    Attributes:
        loads: What has to be brought somewhere, and what may have to be moved out of the way.
        goals: Where the loads shall be. A load without a goal is moved only if it is in the way.
    """

    loads: tuple[PlacedLoad, ...]
    goals: tuple[TaskGoal, ...]

    planner_keys: ClassVar[Collection[str] | None] = None
    """Keys of `planner` in a file that matter for the task; None stands for all."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """What messages call the task: one of `names.TASK_KINDS`."""

    @property
    @abstractmethod
    def plate_start(self) -> FloatArray:
        """(3,) pose of the plate frame in the world before anything moves."""

    @property
    @abstractmethod
    def held(self) -> tuple[PlacedLoad, ...]:
        """The loads that the plate touches before anything moves."""

    @abstractmethod
    def asked(self, start: FloatArray | None, goals: FloatArray | None, robot: FloatArray | None) -> Task:
        """Return the task with another start (3,), goals (g, 3) and place of the plate (3,); None keeps each.

        Raises:
            PlanningError: If the task has no such thing.
        """

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """Return the task in the form of a scenario file, nothing left open."""

    @property
    @abstractmethod
    def one_load(self) -> bool:
        """Whether a file states the task as that of one load, which has a chain, a start and a goal."""

    @cached_property
    def by_name(self) -> dict[str, PlacedLoad]:
        """The loads by name."""
        return {load.name: load for load in self.loads}

    @property
    def load(self) -> PlacedLoad:
        """The load, where there is one.

        Raises:
            NotOneLoadError: If there are several.
        """
        if len(self.loads) != 1:
            known = ", ".join(f"'{load.name}'" for load in self.loads)
            raise NotOneLoadError(
                f"the scenario has {len(self.loads)} loads, and no chain, start or goal that they share; "
                f"allowed: scenario.alone(name), the name one of {known}"
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
        """Whether some loads end flush with one another."""
        return any(goal.flush for goal in self.goals)

    @cached_property
    def candidates(self) -> dict[str, tuple[Goal, ...]]:
        """The poses that may be tried for each load, by its name; only loads that have any."""
        found = {load.name: [goal.candidates(load.name) for goal in self.goals] for load in self.loads}
        return {name: tuple(sum(each, ())) for name, each in found.items() if any(each)}


@dataclass(frozen=True, eq=False)
class Push(Task):
    """The plate is in contact with the load, and one push brings it to its goal."""

    @property
    def kind(self) -> str:
        """See `Task`."""
        return "push"

    @classmethod
    def of(cls, load: PlacedLoad, goal: Goal | None = None) -> Push:
        """Return the push of a load to a goal; None stands for where it is."""
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

    def asked(self, start: FloatArray | None, goals: FloatArray | None, robot: FloatArray | None) -> Task:
        """See `Task`."""
        if goals is not None and len(goals) > 1:
            raise PlanningError(f"a single push has one goal, not {len(goals)}")
        if robot is not None:
            raise PlanningError("robot: allowed where the scenario has a robot.start; here the plate is in contact")
        return self._with_ends(start, goals)

    def document(self) -> dict[str, Any]:
        """See `Task`."""
        (goal,) = self.candidates[self.load.name]
        return {**_load_document(self.load), "goal": goal.document()}


@dataclass(frozen=True, eq=False)
class Transport(Task):
    """The robot stands anywhere, and brings loads that stand anywhere to their goals by several pushes.

    Attributes:
        robot_start: (3,) pose of the plate's frame in the world.
        contacts: What the file states of contacts, in its form: of all loads.
        faces: Names of `names.FACES` and angles of outward normals in the chain frame, rad, that the plate may push;
            None stands for all.
        offsets: Offsets of the plate's middle from the middle of the face, to the left of the push, m.
        most: Number of pushes, at most.
        switch_cost: What a change of the contact counts when plans are ranked, m.
        transit_weight: What a metre of a transit counts, as a share of a metre of pushing.
        approach: Length of the straight path to a contact, m.
        retreat: Length of the straight path back from it, m.
        settle: Length of the straight push with which every push begins, m.
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
        """The row that objects shall stand in.

        Raises:
            PushplanError: If no goal is a row.
        """
        for goal in self.goals:
            if isinstance(goal, Row):
                return goal
        raise PushplanError("the scenario asks for no row; allowed: goals.row in its file")

    @property
    def plate_start(self) -> FloatArray:
        """See `Task`."""
        return self.robot_start

    @property
    def held(self) -> tuple[PlacedLoad, ...]:
        """See `Task`."""
        return ()

    def asked(self, start: FloatArray | None, goals: FloatArray | None, robot: FloatArray | None) -> Task:
        """See `Task`."""
        given = {"start": start, "goal": goals, "robot": robot}
        wrong = [name for name, value in given.items() if value is not None]
        if not self.one_load and wrong:
            what = "allowed where there is one load; here each object has a place of its own"
            raise PlanningError(f"{', '.join(wrong)}: {what}")
        task = self._with_ends(start, goals)
        return task if robot is None else replace(task, robot_start=robot)

    def alone(self, name: str) -> Transport:
        """Return the task of one load; one without goals has its own place for a goal."""
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
"""Fields of a `Transport` that a file has under `pushes`."""


def _load_document(load: PlacedLoad) -> dict[str, Any]:
    """Return a load in the form of a file of one load."""
    return {**load.document(), "start": load.start.tolist()}


def _object_document(load: PlacedLoad) -> dict[str, Any]:
    """Return a load in the form of a file of several objects: an object with its pose in the world."""
    (obj,) = deepcopy(load.stated["objects"])
    del obj["offset"]
    return {**obj, "pose": load.pose.tolist()}
