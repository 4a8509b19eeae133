"""A plan: its segments, its quality, and the reason if it is not solved."""

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

PLAN_FORMAT = "pushplan-plan/2"
"""Format of the JSON document of a plan."""

T = TypeVar("T")


class LazyField(Generic[T]):
    """A field that takes a value, or a function without arguments that returns it and is called once.

    Args:
        default: Default value.
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
        """Return the value, or the default without an instance: `dataclass` reads it that way."""
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
    """A plan that was better than all before it.

    Attributes:
        seconds: Wall-clock time of planning until then, s.
        cost: Cost of the plan, m.
        iterations: Iterations of the search until then.
        segments: Segments of the plan, not timed; can be empty.
    """

    seconds: float
    cost: float
    iterations: int
    segments: tuple[Segment, ...] = field(default=(), compare=False, repr=False)


MOST_PLACES = 3
"""Largest number of obstacles in the way that a text names."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """Path that ends nearest to the goal, if no plan reaches it.

    Attributes:
        segments: Collision-free stable segments, not timed; can be empty.
        error: Distance of its end from the goal (m, rad).
    """

    segments: tuple[Segment, ...]
    error: tuple[float, float]


MOST_TOLD = 3
"""Largest number of objects that the reason of a partial plan names; `Plan.undelivered` has all."""


def reason_of(undelivered: Mapping[str, str], goals: int) -> str:
    """Return the reason of a partial plan.

    Args:
        undelivered: Reasons by name of the object, as in `Plan`.
        goals: Number of objects with goals.
    """
    each = [why if why.startswith(f"'{name}'") else f"'{name}': {why}" for name, why in undelivered.items()]
    more = [f"and {len(each) - MOST_TOLD} more"] if len(each) > MOST_TOLD else []
    return f"{len(each)} of {goals} objects with goals are not delivered: {'; '.join([*each[:MOST_TOLD], *more])}"


@dataclass(frozen=True, eq=False)
class Plan:
    """Motion of the plate that brings every object to its goal, or the reason why none was found.

    `lower_bound` and `robustness` take long and are computed at first use.

    Attributes:
        scenario: Scenario that was planned.
        segments: Segments in order of time; empty without a plan.
        reason: Why there is no plan, or only a partial one; empty if solved.
        planner: Name of the planner.
        stable_set: Name of the stable set that limited the twists.
        seed: Seed of the random numbers.
        cost: Cost of the plan, m; None without segments. For a single push, the cost of its path. Otherwise the
            weighted sum of pushed distance, transits and changes of the contact.
        objective: Quantity that ranked the plans, one of `names.COSTS`.
        lower_bound: Lower bound of that quantity for all plans: cost (m), or duration (s) if time ranks; None if
            unknown, as for `margin`.
        first_solution_s: Wall-clock time to the first plan, s; None without one.
        planning_s: Wall-clock time of preparation and search, s.
        iterations: Iterations of the search, which the setting `iterations` limits: propagated arcs and tried
            shortcuts. A multi-push plan counts batches of poses, a rearrangement transfers, a gathering pushes and
            transits.
        improvements: Plans of decreasing cost.
        margin_asked: Requested lower limit of the margins.
        margin: Actual lower limit of the margins, below `margin_asked` if that allowed no plan.
        tree: (q, 2, 3) poses at both ends of the search tree's branches, thinned.
        diagnosis: Reasons why the search found no plan, most certain first.
        nearest: Path that ends nearest to the goal, if there is no plan; None if unknown.
        execution: Result of the kinematic simulator; None without a plan.
        robustness: Tolerated model errors; None if not solved or not timed.
        remarks: Sentences for the user, such as why a row was not gathered.
        undelivered: Reasons why objects do not reach their goals, by name. A partial plan delivers the others: it
            has segments, is executed and recorded like any plan, and is not solved. Its scenario has only the goals
            of the others.
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
        """Return one line: all fields would fill pages, and some take long to compute."""
        driven = "" if self.duration is None else f" in {self.duration:.2f} s"
        count = "1 segment" if len(self.segments) == 1 else f"{len(self.segments)} segments"
        left = f", {len(self.undelivered)} objects left out" if self.undelivered else ""
        found = f"{count}, {self.cost or 0.0:.3f} m{driven}{left}" if self.segments else self.reason
        return f"<Plan of {self.scenario.name!r}: {found}>"

    def _repr_html_(self) -> str:
        """Return its picture, which notebooks show."""
        draw = import_module("pushplan.drawing.plans").plot_plan  # imported late: drawing imports plans
        picture = base64.b64encode(draw(self)).decode()
        return f'<p>{escape(repr(self))}</p><img alt="" style="max-width:100%" src="data:image/png;base64,{picture}">'

    @property
    def robustness_words(self) -> str:
        """Text of the robustness in lines; empty if not solved or not timed."""
        robustness = self.robustness
        return "" if robustness is None else robustness.sentence(self.scenario.states_intervals)

    def __getstate__(self) -> dict[str, Any]:
        """Compute the lazy fields: functions cannot be pickled."""
        _ = self.lower_bound, self.robustness
        return vars(self)

    @property
    def solved(self) -> bool:
        """Whether the plan reaches every goal and passed the validation."""
        return not self.reason

    def aims(self, scenario: Scenario) -> Scenario:
        """Return a scenario with the goals of the delivered objects only; a row has its chosen poses."""
        if not self.segments:
            return scenario
        return scenario.settled(self.segments[-1].after).without_goals(self.undelivered)

    @cached_property
    def trajectory(self) -> Trajectory | None:
        """Motion of the plate frame through all segments; None without segments or if one is not timed."""
        return join(self.segments)

    @cached_property
    def times(self) -> FloatArray:
        """(k + 1,) start times of the segments, and the end of the last one, s."""
        ends = np.cumsum([segment.duration for segment in self.segments])
        return frozen(np.concatenate([[0.0], ends]), (None,), "times of the segments")

    def segment_at(self, t: FloatArray) -> IntArray:
        """Return the index of the segment at each time (m,), s."""
        inside = np.searchsorted(self.times, t, side="right") - 1
        return np.asarray(np.clip(inside, 0, len(self.segments) - 1))

    @property
    def pushes(self) -> tuple[Segment, ...]:
        """Push segments, without closes."""
        return tuple(segment for segment in self.segments if segment.kind == PUSH)

    @property
    def path(self) -> PushPath | None:
        """Path of a single push in the contact's frame; None for other plans."""
        single = len(self.segments) == 1 and self.segments[0].pushes
        return self.segments[0].contact_path if single else None

    @property
    def duration(self) -> float | None:
        """Duration of the trajectory, s; None without one."""
        return None if self.trajectory is None else self.trajectory.duration

    @property
    def min_margin(self) -> float | None:
        """Smallest margin of any contact in any push, from the execution if there is one."""
        if self.execution is not None:
            return self.execution.min_margin
        return min((s.min_margin for s in self.segments if s.min_margin is not None), default=None)

    @property
    def min_dynamic_margin(self) -> float | None:
        """Smallest margin of any contact with inertia during the execution; None without one."""
        return None if self.execution is None else self.execution.min_dynamic_margin

    @property
    def max_force(self) -> float | None:
        """Largest required pushing force, N, see `Execution.needed_forces`; None if unknown."""
        return None if self.execution is None else self.execution.max_force()

    @property
    def force_limit(self) -> float | None:
        """Force limit of the robot, N; None if the scenario states none."""
        limit = self.scenario.pusher.limits.force
        return None if math.isinf(limit) else limit

    @property
    def force_words(self) -> str:
        """Text of the required pushing force and the robot's limit; empty if unknown."""
        limit = self.scenario.pusher.limits.force
        return "" if self.execution is None else self.execution.force_words(limit)

    @property
    def pushed_distance(self) -> float | None:
        """Cost of all pushes together, m; None without a plan."""
        return sum(segment.cost for segment in self.segments if segment.pushes) if self.segments else None

    @property
    def gap(self) -> float | None:
        """Relative distance of the objective (cost or duration) from its lower bound; None if either is unknown.

        The optimum lies between bound and plan, so the plan is at most this share above it, mostly much less.
        """
        ranked = self.duration if self.objective == "time" else self.cost
        if ranked is None or not self.lower_bound:
            return None
        return max(0.0, ranked / self.lower_bound - 1.0)

    @property
    def lowered(self) -> str:
        """Note that the margin was lowered; empty if it was not."""
        if self.margin is None or self.margin_asked is None or self.margin >= self.margin_asked:
            return ""
        if not self.segments:
            return f"the search tried margins from {self.margin_asked:.2g} down to {self.margin:.2g}"
        return f"margin {self.margin:.2g} instead of {self.margin_asked:.2g}: no path was found with a larger one"

    @property
    def notes(self) -> list[str]:
        """All remarks, including a lowered margin."""
        return [*self.remarks, *([self.lowered] if self.lowered else [])]

    @property
    def blocking(self) -> frozenset[int]:
        """Indices of the obstacles that are in the way, as far as known."""
        return frozenset(k for found in self.diagnosis for k in found.blocking)

    @property
    def in_the_way(self) -> str:
        """Text of the obstacles that are in the way; empty if unknown."""
        places = [str(one) for k, one in enumerate(self.scenario.obstacles) if k in self.blocking]
        more = [f"{len(places) - MOST_PLACES} more"] if len(places) > MOST_PLACES else []
        return ", ".join([*places[:MOST_PLACES], *more])

    @property
    def why_not(self) -> list[str]:
        """Reasons why there is no plan, and the distance of the nearest path from the goal; empty if solved."""
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
        """Return the numbers of the plan by name, in SI units, as JSON and the terminal show them."""
        execution = self.execution
        error = (None, None) if execution is None else execution.goal_error
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
            "path_cost": self.cost,
            "lower_bound": self.lower_bound,
            "gap": self.gap,
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
        """Return the plan as plain data for text and JSON; arrays are lists."""
        numbers = self.metrics()
        arcs, position, angle = (numbers.pop(key) for key in ("arcs", "goal_error_position", "goal_error_angle"))
        del arcs
        loss = None if self.execution is None else self.execution.loss
        robustness = self.robustness
        return {
            "format": PLAN_FORMAT,
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
    """Return a pose (3,) with its heading wrapped to -pi to pi, as files need it."""
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
