"""A plan: the segments that were found, how good they are, and why there are none where there are none."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np

from pushplan.geometry import se2
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.path import PushPath
from pushplan.plans.segment import Segment, join
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray, IntArray, frozen
from pushplan.util.names import DEFAULT_COST, PUSH

if TYPE_CHECKING:
    from pushplan.plans.execution import Execution
    from pushplan.plans.robustness import Robustness
    from pushplan.scenario.model import Scenario

T = TypeVar("T")


class LazyField(Generic[T]):
    """A field that takes a value, or a function without arguments that returns it.

    Args:
        default: Its value where none is given.
    """

    def __init__(self, default: T) -> None:
        self._default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> T: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: Any, owner: type) -> T:
        """Return the value; without an instance the default, which is how `dataclass` learns of it."""
        if instance is None:
            return self._default
        values = vars(instance)
        if callable(values[self._name]):
            values[self._name] = values[self._name]()
        value: T = values[self._name]
        return value

    def __set__(self, instance: object, value: T | Callable[[], T]) -> None:
        vars(instance)[self._name] = value


@dataclass(frozen=True)
class Improvement:
    """A plan that was better than those before it.

    Attributes:
        seconds: Of planning until then (wall clock).
        cost: Of the plan, m.
        iterations: Of the search until then.
        segments: The plan, not timed; empty in what only tells of one.
    """

    seconds: float
    cost: float
    iterations: int
    segments: tuple[Segment, ...] = field(default=(), compare=False, repr=False)


MOST_PLACES = 3
"""Of obstacles in the way, so many are named."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """Where no plan reaches the goal, the one that ends nearest to it.

    Attributes:
        segments: Free and stable, not timed; empty where there is none.
        error: How far from the goal it ends (m, rad).
    """

    segments: tuple[Segment, ...]
    error: tuple[float, float]


MOST_TOLD = 3
"""Objects that the reason of a partial plan names, at most; `Plan.undelivered` has all."""


def reason_of(undelivered: Mapping[str, str], goals: int) -> str:
    """Return why a plan is not solved that leaves objects out, of a number of objects with goals."""
    each = [why if why.startswith(f"'{name}'") else f"'{name}': {why}" for name, why in undelivered.items()]
    more = [f"and {len(each) - MOST_TOLD} more"] if len(each) > MOST_TOLD else []
    return f"{len(each)} of {goals} objects with goals are not delivered: {'; '.join([*each[:MOST_TOLD], *more])}"


@dataclass(frozen=True, eq=False)
class Plan:
    """How the plate moves so that every object gets to its goal, or why no way was found.

    What takes long and is not always wanted is worked out when it is first asked for.

    Attributes:
        scenario: What was asked.
        segments: In their order; empty without a plan.
        reason: Why there is no plan, or only a partial one; empty when solved.
        planner: Name of the planner that ran.
        stable_set: Name of the stable set that limited the twists.
        seed: Of the random numbers.
        cost: By which plans were compared, m: pushed distance, transits and changes of the contact with their
            weights; of a single push its path's. None when not solved.
        objective: What ranked plans, one of `names.COSTS`.
        lower_bound: What no plan beats of what ranked them: cost (m), or where time did, duration (s); None where
            none is known, as of margins.
        first_solution_s: Wall-clock seconds to the first plan, or None.
        planning_s: Wall-clock seconds of preparing and searching.
        iterations: Of the search, which the setting `iterations` limits: arcs propagated and shortcuts tried. A
            multi-push plan counts batches of poses, a rearrangement transfers, a gathering pushes and transits.
        improvements: Better and better plans.
        margin_asked: What the twists' margins had to exceed at first.
        margin: What they had to exceed in the end: less, where no plan was found with `margin_asked`.
        tree: (q, 2, 3) poses at both ends of the search tree's branches, thinned.
        diagnosis: What kept the search from finding a plan, most certain first.
        nearest: Where there is no plan; None where not even that is known.
        execution: What the kinematic simulator makes of the plan; None when there is none.
        robustness: How far single numbers may be off; None when not solved or not timed.
        remarks: What a user wants to know beside the numbers, in sentences: that a load allows no usual margin, why a
            row was not gathered.
        undelivered: Why objects do not get to their goals, by name. A partial plan brings as many objects as it can:
            it has segments, is executed and recorded like any plan, and is not solved. Its scenario has the goals of
            the others only.
    """

    scenario: Scenario
    segments: tuple[Segment, ...]
    reason: str
    planner: str
    stable_set: str
    seed: int
    cost: float | None = None
    objective: str = DEFAULT_COST
    lower_bound: LazyField[float | None] = LazyField(None)
    first_solution_s: float | None = None
    planning_s: float = 0.0
    iterations: int = 0
    improvements: tuple[Improvement, ...] = ()
    margin_asked: float | None = None
    margin: float | None = None
    tree: FloatArray = field(default_factory=lambda: np.zeros((0, 2, 3)))
    diagnosis: tuple[Diagnosis, ...] = ()
    nearest: Nearest | None = None
    execution: Execution | None = None
    robustness: LazyField[Robustness | None] = LazyField(None)
    remarks: tuple[str, ...] = ()
    undelivered: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Say what it is in a line: all fields are pages, and some take long to work out."""
        driven = "" if self.duration is None else f" in {self.duration:.2f} s"
        count = "1 segment" if len(self.segments) == 1 else f"{len(self.segments)} segments"
        left = f", {len(self.undelivered)} objects left out" if self.undelivered else ""
        found = f"{count}, {self.cost or 0.0:.3f} m{driven}{left}" if self.segments else self.reason
        return f"<Plan of {self.scenario.name!r}: {found}>"

    def _repr_html_(self) -> str:
        """Return its picture, which notebooks show."""
        draw = import_module("pushplan.drawing.plans").plot_plan  # loaded then: drawing knows plans
        picture = base64.b64encode(draw(self)).decode()
        return f'<p>{escape(repr(self))}</p><img alt="" style="max-width:100%" src="data:image/png;base64,{picture}">'

    @property
    def robustness_words(self) -> str:
        """How far single numbers may be off, for people, in lines; empty when not solved or not timed."""
        robustness = self.robustness
        return "" if robustness is None else robustness.sentence(self.scenario.states_intervals)

    def __getstate__(self) -> dict[str, Any]:
        """Work out what was put off: functions cannot be pickled."""
        _ = self.lower_bound, self.robustness
        return vars(self)

    @property
    def solved(self) -> bool:
        """Whether every goal is reached, and the plan passed the validation."""
        return not self.reason

    def aims(self, scenario: Scenario) -> Scenario:
        """Return a scenario with the goals of what the plan delivers, and of a row the place that it gives each."""
        if not self.segments:
            return scenario
        return scenario.settled(self.segments[-1].after).without_goals(self.undelivered)

    @cached_property
    def trajectory(self) -> Trajectory | None:
        """The motion of the plate frame through all segments; None when not solved or not timed."""
        return join(self.segments)

    @cached_property
    def times(self) -> FloatArray:
        """(k + 1,) when each segment begins, and the last one ends, s."""
        ends = np.cumsum([segment.duration for segment in self.segments])
        return frozen(np.concatenate([[0.0], ends]), (None,), "times of the segments")

    def segment_at(self, t: FloatArray) -> IntArray:
        """Return the index of the segment at each time (m,), s."""
        inside = np.searchsorted(self.times, t, side="right") - 1
        return np.asarray(np.clip(inside, 0, len(self.segments) - 1))

    @property
    def pushes(self) -> tuple[Segment, ...]:
        """The pushes; a close belongs to the one before it."""
        return tuple(segment for segment in self.segments if segment.kind == PUSH)

    @property
    def path(self) -> PushPath | None:
        """Of a single push, in the contact's frame; None otherwise."""
        single = len(self.segments) == 1 and self.segments[0].pushes
        return self.segments[0].contact_path if single else None

    @property
    def duration(self) -> float | None:
        """Of the trajectory, s; None where there is none."""
        return None if self.trajectory is None else self.trajectory.duration

    @property
    def min_margin(self) -> float | None:
        """Smallest margin of any contact in any push; of the execution where there is one."""
        if self.execution is not None:
            return self.execution.min_margin
        return min((s.min_margin for s in self.segments if s.min_margin is not None), default=None)

    @property
    def min_dynamic_margin(self) -> float | None:
        """Smallest margin of any contact with inertia during the execution; None where there is none."""
        return None if self.execution is None else self.execution.min_dynamic_margin

    @property
    def max_force(self) -> float | None:
        """Largest force with which the plate has to push, see `Execution.needed_forces`, N; None where not known."""
        return None if self.execution is None else self.execution.max_force()

    @property
    def force_limit(self) -> float | None:
        """Of the robot, N; None where the scenario states none."""
        limit = self.scenario.pusher.limits.force
        return None if math.isinf(limit) else limit

    @property
    def force_words(self) -> str:
        """With what force the plate has to push, and how much the robot has; empty where it is not known."""
        limit = self.scenario.pusher.limits.force
        return "" if self.execution is None else self.execution.force_words(limit)

    @property
    def pushed_distance(self) -> float | None:
        """Cost of all pushes together, m; None without a plan."""
        return sum(segment.cost for segment in self.segments if segment.pushes) if self.segments else None

    @property
    def gap(self) -> float | None:
        """Share by which what ranked the plan is above its lower bound; None where one of them is not known.

        The optimum lies between: the plan wastes no more than this, mostly much less.
        """
        ranked = self.duration if self.objective == "time" else self.cost
        if ranked is None or not self.lower_bound:
            return None
        return max(0.0, ranked / self.lower_bound - 1.0)

    @property
    def lowered(self) -> str:
        """That the margin was lowered, in a sentence; empty if it was not."""
        if self.margin is None or self.margin_asked is None or self.margin >= self.margin_asked:
            return ""
        if not self.segments:
            return f"margins from {self.margin_asked:.2g} down to {self.margin:.2g} were tried"
        return f"margin {self.margin:.2g} instead of {self.margin_asked:.2g}: no path was found with more"

    @property
    def notes(self) -> list[str]:
        """The remarks, and that the margin was lowered, in sentences."""
        return [*self.remarks, *([self.lowered] if self.lowered else [])]

    @property
    def blocking(self) -> frozenset[int]:
        """Indices of the scenario's obstacles that are in the way, as far as that is known."""
        return frozenset(k for found in self.diagnosis for k in found.blocking)

    @property
    def in_the_way(self) -> str:
        """Where the obstacles are that are in the way, for people; empty where that is not known."""
        places = [str(one) for k, one in enumerate(self.scenario.obstacles) if k in self.blocking]
        more = [f"{len(places) - MOST_PLACES} more"] if len(places) > MOST_PLACES else []
        return ", ".join([*places[:MOST_PLACES], *more])

    @property
    def why_not(self) -> list[str]:
        """Why there is no plan, and how near to the goal one comes, in sentences; none where there is one."""
        if self.solved:
            return []
        causes = [found.text for found in self.diagnosis if found.text not in self.reason]
        causes += [f"in the way: {self.in_the_way}"] if self.in_the_way else []
        if self.nearest is None:
            return [self.reason, *causes]
        position, angle = self.nearest.error
        near = f"the nearest path ends {position:.3f} m and {math.degrees(angle):.1f} deg from the goal"
        return [self.reason, *causes, near]

    def metrics(self) -> dict[str, float | int | str | bool | None]:
        """Return the numbers of the plan by name: those that JSON, the terminal, the bench and reports show."""
        execution = self.execution
        error = (None, None) if execution is None else execution.goal_error
        travel = sum(segment.path.cost for segment in self.segments) if self.segments else None
        return {
            "solved": self.solved,
            "reason": self.reason,
            "planner": self.planner,
            "objective": self.objective,
            "set": self.stable_set,
            "seed": self.seed,
            "first_solution_s": self.first_solution_s,
            "planning_s": self.planning_s,
            "iterations": self.iterations,
            "cost": self.cost,
            "path_cost": self.path.cost if self.path is not None else travel,
            "lower_bound": self.lower_bound,
            "gap": self.gap,
            "pushed_distance": self.pushed_distance,
            "travel": travel,
            "pushes": len(self.pushes),
            "arcs": sum(len(segment.path.lengths) for segment in self.pushes),
            "duration_s": self.duration,
            "goal_error_position": error[0],
            "goal_error_angle": error[1],
            "min_margin": self.min_margin,
            "min_dynamic_margin": self.min_dynamic_margin,
            "max_force": self.max_force,
            "force_limit": self.force_limit,
            "margin_asked": self.margin_asked,
            "margin": self.margin,
        }

    def to_dict(self) -> dict[str, object]:
        """Return the plan as plain data, the one form that text and JSON are made from; arrays are lists."""
        numbers = self.metrics()
        arcs, position, angle = (numbers.pop(key) for key in ("arcs", "goal_error_position", "goal_error_angle"))
        del arcs
        loss = None if self.execution is None else self.execution.loss
        robustness = self.robustness
        return {
            "scenario": self.scenario.name,
            **numbers,
            "diagnosis": [vars(found) for found in self.diagnosis],
            "nearest": None if self.nearest is None else _nearest_dict(self.nearest),
            "arcs": _arcs(self.path) if self.path is not None else [],
            "goal_error": None if position is None else {"position": position, "angle": angle},
            "robustness": None if robustness is None else vars(robustness),
            "notes": self.notes,
            "undelivered": dict(self.undelivered),
            "contact_lost": None if loss is None else vars(loss),
            "segments": [self._segment_dict(k) for k in range(len(self.segments))],
        }

    def _segment_dict(self, k: int) -> dict[str, object]:
        segment, (t0, t1) = self.segments[k], self.times[k : k + 2]
        load = segment.load
        moved = load.names if load is not None else tuple(segment.before)
        return {
            "kind": segment.kind,
            "face": None if load is None else load.face,
            "offset": None if load is None else load.offset,
            "onto": self.segments[k].onto or None,
            "load": [] if load is None else [vars(link) for link in load.links],
            "margin": segment.margin,
            "max_force": None if self.execution is None else self.execution.max_force(k),
            "arcs": _arcs(segment.contact_path if segment.pushes else segment.path),
            "robot_before": _wrapped(segment.path.start),
            "robot_after": _wrapped(segment.path.end),
            "object_before": _wrapped(segment.before[moved[0]]),
            "object_after": _wrapped(segment.after[moved[0]]),
            "before": {name: _wrapped(pose) for name, pose in segment.before.items()},
            "after": {name: _wrapped(pose) for name, pose in segment.after.items()},
            "t0": float(t0),
            "t1": float(t1),
        }


def _wrapped(pose: FloatArray) -> list[float]:
    """Return a pose (3,) with its heading from -pi to pi, as files take it: a robot that circles turns on and on."""
    return [*pose[:2].tolist(), float(se2.wrap_angle(pose[2]))]


def _arcs(path: PushPath) -> list[dict[str, object]]:
    return [
        {"twist": twist.tolist(), "length": float(length)}
        for twist, length in zip(path.twists, path.lengths, strict=True)
    ]


def _nearest_dict(nearest: Nearest) -> dict[str, object]:
    position, angle = nearest.error
    arcs = [arc for segment in nearest.segments if segment.pushes for arc in _arcs(segment.contact_path)]
    cost = sum(segment.cost for segment in nearest.segments)
    return {"path_cost": cost, "position": position, "angle": angle, "arcs": arcs}
