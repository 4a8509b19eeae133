"""Which samples of an execution viewers get, and what contacts and frames are called there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pushplan.plans.execution import Execution
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.plans.plan import Plan
    from pushplan.plans.run import Run

WORLD, CHAIN = "world", "chain"
"""Frames of every run, beside the plate's, `PUSHER`; each object adds one of its own name. `CHAIN` is that of the
contact of a single push, fixed to the plate."""

VIEW_RATE = 20.0
"""Samples per second that viewers get of an execution."""

SMOOTHED_RATE = 10.0
"""Poses per second of a timed path in pictures."""

MOST_VIEWED = 12_000
"""Samples and poses that viewers get, at most, so that logs of drives of hours are read within their limits: at the
rates above that is 10 and 20 minutes."""


def contact_names(scenario: Scenario) -> list[str]:
    """Return what the contact of each object is called: who pushes whom, or the object where that changes."""
    if scenario.kind == "push":
        chain = scenario.chain
        return [chain.contact_name(k) for k in range(len(chain.contacts))]
    return list(scenario.poses)


def parts_of(run: Run | RecordedRun) -> list[tuple[float, float, str]]:
    """Return begin and end, s, and a name for each segment that was executed, in order: what is on a time line."""
    execution, plan = run.execution, run.plan
    if execution is None or plan is None or len(execution.t) < 2:
        return []
    owner = execution.segment
    begins = np.concatenate([[0], np.flatnonzero(np.diff(owner)) + 1]).tolist()
    edges = [float(execution.t[k]) for k in begins] + [float(execution.t[-1])]
    count = {k: f"{k + 1}. " for k in range(len(plan.segments))} if len(plan.segments) > 1 else {}
    return [
        (low, high, count.get(int(owner[k]), "") + _part_name(plan, int(owner[k])))
        for k, low, high in zip(begins, edges, edges[1:], strict=False)
    ]


def part_at(run: Run | RecordedRun, time: float) -> str:
    """Return the name of the segment that is executed at a time, s."""
    begun = [name for low, _, name in parts_of(run) if low <= time]
    return begun[-1] if begun else ""


def _part_name(plan: Plan, number: int) -> str:
    segment = plan.segments[min(number, len(plan.segments) - 1)]
    if segment.load is None or not segment.pushes:
        return segment.kind
    return f"{segment.kind} {', '.join(segment.load.names)}"


def smoothed_times(trajectory: Trajectory) -> FloatArray:
    """Return the times (m,) at which a timed path is drawn, its end included, s."""
    step = max(1.0 / SMOOTHED_RATE, trajectory.duration / MOST_VIEWED)
    return np.append(np.arange(0.0, trajectory.duration, step), trajectory.duration)


def viewed(execution: Execution) -> IntArray:
    """Return the samples to show: the first of each 1/20 s and segment, the last, where each margin is smallest.

    Of a long execution it is the first of each `MOST_VIEWED`th part.
    """
    if len(execution.t) == 0:
        return np.zeros(0, dtype=np.int64)
    rate = min(VIEW_RATE, MOST_VIEWED / max(float(execution.t[-1]), 1.0))
    frame = np.floor(execution.t * rate + 1e-6)  # t = 0.35 s is in frame 7, whatever its last bits say
    first = np.flatnonzero(np.diff(frame, prepend=-1.0))
    begun = np.flatnonzero(np.diff(execution.segment, prepend=-1))
    margins = np.where(np.isnan(execution.margins), np.inf, execution.margins)
    smallest = np.argmin(margins, axis=0) if margins.size else []
    return np.unique([*first, *begun, *smallest, len(execution.t) - 1]).astype(np.int64)


def worst_contacts(execution: Execution, most: int = 6) -> list[int]:
    """Return the columns of the contacts with the smallest margins, at most so many, in order; none never pushed."""
    least = np.where(np.isnan(execution.margins), np.inf, execution.margins).min(axis=0, initial=np.inf)
    pushed = np.argsort(least, kind="stable")[: np.isfinite(least).sum()]
    return sorted(pushed[:most].tolist())
