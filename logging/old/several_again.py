"""A recorded plan of several pushes made anew: timed, executed and judged as when it was planned."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pushplan.logging.old.check import Check
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult
from pushplan.plans.segment import Segment, join_paths
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.several.execution import execute_segments
from pushplan.several.modes import Mode, find_modes
from pushplan.several.plan import least_margin, objective_cost
from pushplan.several.robustness import least_robustness
from pushplan.several.segments import mode_of, timed
from pushplan.several.verdict import verdict_on
from pushplan.sim.judging import execute


def segments_again(scenario: Scenario, plan: PlanResult, trajectory: Trajectory) -> PlanResult:
    """Return a plan with everything in it that follows from the scenario and the segments' paths.

    Raises:
        PushplanError: When a segment cannot be driven, or pushes from where no contact is.
    """
    modes = find_modes(scenario, plan.stable_set)
    kept = tuple(_with_margin(segment, modes) for segment in plan.segments)
    segments, again = timed(scenario, kept, modes, trajectory.rate)
    return replace(
        plan,
        segments=segments,
        path=join_paths(segments),
        trajectory=again,
        objective=scenario.planner.cost,
        objective_cost=objective_cost(scenario, segments),
        min_margin=least_margin(segments, modes),
        robustness=None if plan.robustness is None else least_robustness(segments, again, modes),
    )


def _with_margin(segment: Segment, modes: tuple[Mode, ...]) -> Segment:
    """Return a segment with a margin that is tried: which of them, only the search can tell."""
    if not segment.pushes:
        return replace(segment, margin=0.0)
    tried = mode_of(segment, modes).margins
    return segment if segment.margin in tried else replace(segment, margin=tried[0])


def execute_again(scenario: Scenario, plan: PlanResult) -> Execution | None:
    """Return what the kinematic simulator makes of one push or several; None where there is no trajectory."""
    if not plan.segments or plan.trajectory is None:
        return execute(scenario, plan)
    modes = find_modes(scenario, plan.stable_set)
    return execute_segments(scenario, plan.stable_set, plan.segments, plan.trajectory, modes)


def check_segments(scenario: Scenario, plan: PlanResult, execution: Execution) -> Iterator[Check]:
    """Yield whether segments join, are free, stable and within the limits, by the checks that planning ends with."""
    assert plan.trajectory is not None
    modes = find_modes(scenario, plan.stable_set)
    wrong = verdict_on(scenario, plan.segments, plan.trajectory, execution, modes)
    for k, segment in enumerate(plan.segments):
        what = f"segment {k + 1}, {segment.kind}"
        yield Check(
            f"{what}: begins and ends at rest",
            float(np.abs(plan.trajectory.twists_at(np.array([segment.t0, segment.t1]))).max()),
        )
    yield Check("segments", math.inf if wrong else 0.0, 0.0, what=wrong or "join, free and stable")
