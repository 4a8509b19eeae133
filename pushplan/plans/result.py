"""What planning and running a push return."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.plans import plan as plans
from pushplan.plans import run as runs
from pushplan.plans.path import PushPath
from pushplan.plans.plan import CAUSES as CAUSES
from pushplan.plans.plan import Diagnosis as Diagnosis
from pushplan.plans.segment import Segment, trajectory_of
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray
from pushplan.util.lazy_field import LazyField
from pushplan.util.names import DEFAULT_COST, PUSH

if TYPE_CHECKING:
    from pushplan.plans.execution import Execution
    from pushplan.plans.robustness import Robustness
    from pushplan.scenario.model import Scenario


@dataclass(frozen=True)
class ProgressPoint:
    """The cost (m) of the best path known after `seconds` of planning (wall clock).

    `path` is that path; None in logs of older versions.
    """

    seconds: float
    cost: float
    iterations: int
    path: PushPath | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class PlanResult:
    """The outcome of planning; what takes long and is not always wanted is worked out when it is first asked for.

    Attributes:
        solved: A path to the goal was found and passed the independent checker.
        reason: Why not, in words; empty when solved.
        planner: Name of the planner that ran.
        stable_set: Name of the stable set that limited the controls.
        seed: Of the random numbers.
        path: The path found; None when not solved.
        trajectory: The timed path; None when not solved.
        first_solution_s: Wall-clock seconds to the first path, or None.
        planning_s: Wall-clock seconds spent planning.
        progress: Cost of the best path over time.
        extensions: Number of arcs propagated.
        min_margin: Smallest margin along the path, or None.
        tree: (q, 2, 3) poses at both ends of the search tree's branches, thinned.
        lower_bound: Cost (m) that no path beats; it knows turning limits and, roughly, obstacles, not both at once.
        diagnosis: What kept the planner from finding a path, most certain first; empty when solved.
        approximate_path: Where none was found, the free and stable path that ends nearest to the goal, or None.
        approximate_error: How far (m, rad) from the goal that is, or None.
        objective: What ranked paths, one of `names.COSTS`; empty in logs of older versions.
        margin_asked: What the twists' margins had to exceed at first; None in logs of older versions.
        margin: What they had to exceed in the end: less, where no path was found with `margin_asked`.
        execution: What the kinematic simulator makes of the plan; None when there is none.
        segments: Of a plan of several pushes, in their order: `path` and `trajectory` are then those of the robot's
            frame (see `plans.segment`) through all of them. Empty for a single push.
        objective_cost: What such a plan costs in all: way pushed, ways of the robot alone, changes of the contact, m.
        robustness: How far numbers may be off; None when not solved, and in older logs.
    """

    solved: bool
    reason: str
    planner: str
    stable_set: str
    seed: int
    path: PushPath | None
    trajectory: Trajectory | None
    first_solution_s: float | None
    planning_s: float
    progress: tuple[ProgressPoint, ...]
    extensions: int
    min_margin: float | None
    tree: FloatArray
    lower_bound: LazyField[float | None] = LazyField(None)
    diagnosis: tuple[Diagnosis, ...] = ()
    approximate_path: PushPath | None = None
    approximate_error: tuple[float, float] | None = None
    robustness: LazyField[Robustness | None] = LazyField(None)
    objective: str = DEFAULT_COST
    margin_asked: float | None = None
    margin: float | None = None
    execution: Execution | None = None
    segments: tuple[Segment, ...] = ()
    objective_cost: float | None = None

    def as_plan(self, scenario: Scenario, execution: Execution | None = None) -> plans.Plan:
        """Return the same as a `Plan`, for what is written for that already.

        Args:
            scenario: What was asked.
            execution: In place of its own.
        """
        segments = tuple(_segments(scenario, self))
        executed = self.execution if execution is None else execution
        near = None
        if self.approximate_path is not None and self.approximate_error is not None and not self.segments:
            load = plans.Load.of(scenario)
            ended = plans.Segment.push(load, self.approximate_path, scenario.poses, 0.0)
            near = plans.Nearest((ended,) if scenario.pushes is None else (), self.approximate_error)
        return plans.Plan(
            scenario,
            segments,
            self.reason,
            self.planner,
            self.stable_set,
            self.seed,
            cost=(self.path.cost if self.objective_cost is None else self.objective_cost)
            if self.path
            else None,
            objective=self.objective,
            lower_bound=lambda: self.lower_bound,
            first_solution_s=self.first_solution_s,
            planning_s=self.planning_s,
            iterations=self.extensions,
            margin_asked=self.margin_asked,
            margin=self.margin,
            tree=self.tree,
            diagnosis=self.diagnosis,
            nearest=near,
            execution=None if executed is None else _execution(scenario, self.segments, executed),
            robustness=lambda: self.robustness,
        )

    @property
    def min_dynamic_margin(self) -> float | None:
        """Smallest margin of any contact with inertia during the execution; None where there is none."""
        return None if self.execution is None else self.execution.min_dynamic_margin

    @property
    def lowered(self) -> str:
        """That the margin was lowered, in a sentence; empty if it was not."""
        if self.margin is None or self.margin_asked is None or self.margin >= self.margin_asked:
            return ""
        if self.path is None:
            return f"margins from {self.margin_asked:.2g} down to {self.margin:.2g} were tried"
        return f"margin {self.margin:.2g} instead of {self.margin_asked:.2g}: no path was found with more"

    @property
    def why_not(self) -> list[str]:
        """Why there is no path, and how near to the goal one comes, in sentences; none where there is one."""
        if self.path is not None:
            return []
        causes = [found.text for found in self.diagnosis if found.text not in self.reason]
        if self.approximate_error is None:
            return [self.reason, *causes]
        position, angle = self.approximate_error
        near = f"the nearest path ends {position:.3f} m and {math.degrees(angle):.1f} deg from the goal"
        return [self.reason, *causes, near]

    @property
    def gap(self) -> float | None:
        """Share by which the path costs more than the lower bound; None without a path.

        The optimum lies between: the path wastes no more than this, mostly much less.
        """
        if self.path is None or not self.lower_bound:
            return None
        cost = self.path.cost if self.objective_cost is None else self.objective_cost
        return max(0.0, cost / self.lower_bound - 1.0)

    @property
    def way_pushed(self) -> float | None:
        """Cost of all pushes together, m; None without a path."""
        if self.path is None:
            return None
        pushes = [segment.path.cost for segment in self.segments if segment.pushes]
        return sum(pushes) if pushes else self.path.cost


@dataclass(frozen=True, eq=False)
class Run:
    """A plan, its execution and the log of both.

    Attributes:
        scenario: What was asked.
        plan: What was planned.
        execution: What the simulator made of it; None when there was nothing to execute.
        log: The log file; None when there is none, or it could not be written to its end.
        seconds: Wall-clock time by phase: `posing`, `search`, `timing`, `checking`, `execution`, `logging`; s.
    """

    scenario: Scenario
    plan: PlanResult
    execution: Execution | None
    log: Path | None
    seconds: Mapping[str, float] = field(default_factory=dict)


def _segments(scenario: Scenario, result: PlanResult) -> Iterator[plans.Segment]:
    """Yield the segments of a plan as those of the plate frame."""
    plate, now = scenario.chain.pusher.plate_pose, dict(scenario.poses)
    whole = result.trajectory
    if result.path is not None and not result.segments:
        push = plans.Segment.push(plans.Load.of(scenario), result.path, now, result.margin or 0.0)
        yield replace(
            push, trajectory=None if whole is None else whole.of_frame(plate), min_margin=result.min_margin
        )
    for one in result.segments:
        problem = replace(scenario, chain=_part(scenario.chain, one.objects)) if one.objects else scenario
        moved = {obj.name: se2.compose(one.load_after, obj.pose_chain) for obj in problem.chain.objects}
        before, now = now, {**now, **moved} if one.pushes else now
        path = one.robot_path.of_frame(plate)
        timed = None
        if whole is not None:
            timed = trajectory_of(one, whole).of_frame(se2.compose(one.robot, plate))
        load = plans.Load.of(problem, one.face, one.offset) if one.pushes else None
        yield plans.Segment(one.kind, path, before, now, load, one.margin, timed)


def _part(chain: Chain, names: tuple[str, ...]) -> Chain:
    """Return the objects of these names, which follow one another, as a chain of their own."""
    first, count = chain.index_of(names[0]), len(names)
    contacts = [
        replace(one, pushed=one.pushed - first, pusher=max(PLATE, one.pusher - first))
        for one in chain.contacts[first : first + count]
    ]
    return Chain(chain.objects[first : first + count], tuple(contacts), chain.pusher)


def _execution(scenario: Scenario, segments: tuple[Segment, ...], execution: Execution) -> runs.Execution:
    """Return an execution as one of the plate frame; margins are NaN where nothing is pushed."""
    chain, plate = scenario.chain, scenario.chain.pusher.plate_pose
    names = tuple(obj.name for obj in chain.objects)
    objects = execution.object_poses
    if objects is None:
        objects = se2.compose(execution.load_poses[:, None], chain.places)
    ends = np.array([segment.t1 for segment in segments[:-1]])
    owner = np.searchsorted(ends, execution.t, side="right")
    margins, dynamic = (
        None if one is None else np.array(one) for one in (execution.margins, execution.dynamic_margins)
    )
    for k, segment in enumerate(segments):
        pushed = [segment.kind == PUSH and (name in segment.objects or not segment.objects) for name in names]
        for columns in (margins, dynamic):
            if columns is not None:
                columns[np.ix_(owner == k, np.logical_not(pushed))] = np.nan
    loss = None
    if execution.loss is not None:
        at = int(np.searchsorted(ends, execution.loss.time, side="right"))
        k, (x, y, theta) = execution.loss.contact, se2.compose(execution.loss.pose, plate).tolist()
        named = names[k], chain.contact_name(k)
        loss = runs.StabilityLoss(execution.loss.time, at, *named, execution.loss.margin, (x, y, theta))
    poses, twists = se2.compose(execution.poses, plate), se2.twist_of(plate, execution.twists)
    assert margins is not None
    return runs.Execution(
        names, "", execution.t, poses, twists, objects, owner, margins, loss, execution.goal_error, dynamic
    )
