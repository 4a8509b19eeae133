"""Executes a recorded plan again, from the attached scenario, and compares everything with what was recorded."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pushplan.geometry.se2 import compose, exp
from pushplan.logging.old.check import TOLERANCE, Check
from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.plan_again import timed_by_other_rules
from pushplan.logging.old.several_again import check_segments, execute_again, segments_again
from pushplan.logging.old.verify_file import verify_file
from pushplan.planners.trajectories import make_trajectory
from pushplan.planners.validation.clearance import find_collision
from pushplan.plans.execution import Execution
from pushplan.plans.judge import planning_set
from pushplan.plans.path import PushPath
from pushplan.plans.result import PlanResult
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

_SERIES = {
    "t": "time",
    "poses": "pose",
    "twists": "twist",
    "margins": "margin",
    "dynamic_margins": "margin with inertia",
    "friction_margins": "friction margin",
    "lambdas": "point of application (lambda)",
    "forces": "contact force",
    "loads": "pose of the objects",
}


@dataclass(frozen=True)
class VerifyReport:
    """All comparisons of one run; `checks` is empty when nothing was executed."""

    checks: tuple[Check, ...]

    @property
    def matches(self) -> bool:
        """Whether every comparison is within its tolerance."""
        return all(check.matches for check in self.checks)

    @property
    def mismatches(self) -> tuple[Check, ...]:
        """The comparisons that are not."""
        return tuple(check for check in self.checks if not check.matches)


def verify(run: RecordedRun) -> VerifyReport:
    """Execute the plan of `run` again and compare.

    Compared are the timing of the path, every sample of the execution, the loss of stability, the goal error,
    that nothing is touched on the way, and every message and word in the file that follows from scenario and plan.
    Where the log ends early or has gaps, what it has is compared. The timing of
    paths that older versions timed by other rules is not. Of an execution with slip, whose world is not in the
    log, only the way of the plate is; of a closed loop, `control.again.check_closed_loop` compares the rest.

    Raises:
        PushplanError: When the recorded plan cannot be executed at all.
    """
    plan = run.plan
    if run.execution is not None and run.execution.object_poses is not None:
        return VerifyReport((check_way(run.execution),))
    if plan is None or plan.path is None or plan.trajectory is None:
        return VerifyReport(())
    if plan.segments:
        scenario, again = run.scenario, segments_again(run.scenario, plan, plan.trajectory)
        checks = [*_same_timing(plan.trajectory, again.trajectory or plan.trajectory)]
    else:
        scenario = run.scenario if plan.margin is None else run.scenario.with_margin(plan.margin)
        checks = [*_timing(scenario, plan, plan.trajectory, plan.path)]
        checks.append(_clear_way(scenario, plan.trajectory))
    replayed = execute_again(scenario, plan)
    if plan.segments and replayed is not None:
        checks += check_segments(scenario, plan, replayed)
    if run.execution is not None and replayed is not None:
        checks += _execution(run.execution, _aligned(run, run.execution, replayed))
    return VerifyReport((*checks, *verify_file(run.path, run.number)))


def check_way(execution: Execution) -> Check:
    """Compare the poses of an execution with slip with the twists between them."""
    steps = np.diff(execution.t)[:, None]
    after = compose(execution.poses[:-1], exp(execution.twists[:-1] * steps))
    return _series("way of the plate", execution.t[1:], execution.poses[1:], after)


def _timing(scenario: Scenario, plan: PlanResult, trajectory: Trajectory, path: PushPath) -> Iterator[Check]:
    """Compare the trajectory with the path timed again, as the scenario asks for."""
    if timed_by_other_rules(scenario, plan):
        what = "not compared: when this was recorded, contacts kept no margin with inertia"
        yield Check("timing", 0.0, 0.0, what=what)
        return
    stable = planning_set(scenario, plan.stable_set)
    yield from _same_timing(trajectory, make_trajectory(scenario, path, stable, trajectory.rate))


def _same_timing(trajectory: Trajectory, again: Trajectory) -> Iterator[Check]:
    yield Check("duration", abs(again.duration - trajectory.duration))
    yield _series("commanded twist", trajectory.t, trajectory.twists, again.twists_at(trajectory.t))
    yield _series("commanded pose", trajectory.t, trajectory.poses, again.poses_at(trajectory.t))


def _clear_way(scenario: Scenario, trajectory: Trajectory) -> Check:
    """Look for a collision on the way, with the checker that the planners do not use."""
    hit = find_collision(scenario, trajectory.poses)
    if hit is None:
        return Check("collision", 0.0, 0.0, what="none")
    return Check("collision", math.inf, 0.0, what=str(hit))


def _aligned(run: RecordedRun, recorded: Execution, replayed: Execution) -> Execution:
    """Return the samples of an execution at the times that a log with gaps has kept."""
    if not (run.losses or metadata.RECOVERY in run.words) or not len(replayed.t):
        return replayed
    places = np.minimum(np.searchsorted(replayed.t, recorded.t - TOLERANCE), len(replayed.t) - 1)
    series = {name: getattr(replayed, name) for name in _SERIES}
    kept = {name: None if values is None else values[places] for name, values in series.items()}
    return replace(replayed, **kept)  # type: ignore[arg-type]


def _execution(recorded: Execution, replayed: Execution) -> Iterator[Check]:
    """Compare two executions; the recorded one may have lost its end."""
    cut = math.isnan(recorded.goal_error[0])
    count = min(len(recorded.t), len(replayed.t))
    if not cut:
        yield Check("number of samples", abs(len(recorded.t) - len(replayed.t)), 0.0)
    for name, words in _SERIES.items():
        first, second = getattr(recorded, name), getattr(replayed, name)
        if name == "dynamic_margins" and first is None:  # a log of an older version
            continue
        if name == "loads" and first is None and second is None:
            continue
        if first is None or second is None:
            missing = first is not second
            yield Check(
                words, math.inf if missing else 0.0, what="unknown on one side" if missing else "unknown"
            )
        else:
            scale = max(1.0, float(np.abs(second).max(initial=0.0))) if name == "forces" else 1.0
            yield _series(words, recorded.t[:count], first[:count], second[:count], TOLERANCE * scale)
    if not cut:
        yield Check("goal error", float(np.abs(np.subtract(recorded.goal_error, replayed.goal_error)).max()))
        yield _loss(recorded, replayed)


def _loss(recorded: Execution, replayed: Execution) -> Check:
    places = [None if run.loss is None else run.loss.contact for run in (recorded, replayed)]
    if places[0] != places[1]:
        return Check("lost contact", math.inf, 0.0, what=f"recorded {places[0]}, executed again {places[1]}")
    time = 0.0
    if recorded.loss is not None and replayed.loss is not None:
        time = abs(recorded.loss.time - replayed.loss.time)
    return Check("lost contact", time, what="none" if recorded.loss is None else "")


def _series(
    quantity: str, t: FloatArray, first: FloatArray, second: FloatArray, tolerance: float = TOLERANCE
) -> Check:
    """Compare two arrays (m, ...), sample by sample at times `t` (m,)."""
    apart = np.abs(first - second).reshape(len(t), -1).max(axis=1, initial=0.0)
    if len(apart) == 0:
        return Check(quantity, 0.0, tolerance)
    worst = int(np.argmax(np.where(np.isnan(apart), np.inf, apart)))
    return Check(quantity, float(apart[worst]), tolerance, float(t[worst]))
