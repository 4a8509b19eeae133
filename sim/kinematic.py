"""Kinematic execution: the load follows the plate rigidly while every contact holds; other objects rest."""

from __future__ import annotations

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.contacts import contact_state
from pushplan.mechanics.dynamics import PushForce
from pushplan.plans.execution import Execution, StabilityLoss
from pushplan.plans.goals import worst_at_goal
from pushplan.plans.judge import contact_dynamics, judging_set
from pushplan.plans.segment import Segment, join
from pushplan.plans.trajectory import RESTING, Trajectory, advance
from pushplan.scenario.model import Scenario
from pushplan.sets.known_load_sets import EcofSet
from pushplan.util.arrays import FloatArray, IntArray, columns_of, distinct


def execute(scenario: Scenario, segments: tuple[Segment, ...], planned: str) -> Execution:
    """Execute the segments of a plan: integrate the commanded twist exactly and check every contact.

    The integration does not use the trajectory's own poses. It stops at the first sample at which a contact's margin
    is not positive; the margin includes inertia unless the scenario leaves it out.

    Args:
        scenario: Scenario with the initial object poses and the goals.
        segments: Timed segments.
        planned: Name of the stable set of the plan; it also checks the contacts if the loads are not known.

    Raises:
        PushplanError: If a segment is not timed.
    """
    trajectory = join(segments)
    if trajectory is None:
        raise PushplanError("there is nothing to execute; a plan needs segments, each with a trajectory")
    t, poses = trajectory.t, integrated(trajectory)
    names = tuple(scenario.poses)
    ends = np.cumsum([segment.duration for segment in segments])
    owner = np.clip(np.searchsorted(ends, t, side="right"), 0, len(segments) - 1)
    objects = _carried(scenario, segments, poses, owner)

    def unknown(*each: int) -> FloatArray:
        return np.full((len(t), *each), np.nan)

    judge, count, loss, columns = "", len(t), None, len(names)
    inertia = scenario.pusher.limits.contact == "dynamic"
    known = {"margins": unknown(columns), "dynamic_margins": unknown(columns), "needed_forces": unknown()}
    for k, segment in enumerate(segments):
        if segment.pushes and segment.load is not None:
            inside, moved = _samples(owner, k), [names.index(name) for name in segment.load.names]
            judge, found = contacts_along(segment, planned, t[inside] - (ends[k] - segment.duration))
            for name, values in found.items():
                if name not in known:
                    known[name] = unknown(*((columns, *values.shape[2:]) if values.ndim > 1 else ()))
                known[name][inside if values.ndim == 1 else (inside, moved)] = values
            deciding = np.fmin(found["margins"], found["dynamic_margins"]) if inertia else found["margins"]
            lost = np.flatnonzero((columns_of(deciding) <= 0.0).any(axis=0))
            if len(lost):
                i = inside.start + int(lost[0])
                loss = _loss(segment, k, float(t[i]), poses[i], deciding[lost[0]])
                count = i + 1
                break
    return Execution(
        names,
        judge,
        t[:count],
        poses[:count],
        trajectory.twists[:count],
        objects[:count],
        owner[:count],
        loss=loss,
        goal_error=worst_at_goal(scenario, objects[count - 1]),
        **{name: values[:count] for name, values in known.items()},
    )


def _samples(owner: IntArray, k: int) -> slice:
    """Return the slice of samples that belong to segment k; `owner` is sorted."""
    return slice(*np.searchsorted(owner, [k, k + 1]).tolist())


def _carried(scenario: Scenario, segments: tuple[Segment, ...], poses: FloatArray, owner: IntArray) -> FloatArray:
    """Return the poses (m, n, 3) of all objects for plate poses (m, 3) in the segments `owner` (m,)."""
    now = dict(scenario.poses)
    names = tuple(now)
    objects = np.empty((len(poses), len(names), 3))
    for k, segment in enumerate(segments):
        inside = _samples(owner, k)
        objects[inside] = np.stack([now[name] for name in names])
        if not segment.pushes or segment.load is None:
            continue
        begin, end = segment.path.start, _timed(segment).break_poses[-1]
        # Objects rest where the previous push left them, even if the plan differs.
        held = se2.relative(begin, np.array([now[name] for name in segment.load.names]))
        there = poses[inside].copy()
        # The robot can make full turns between two pushes.
        there[:, 2] -= 2.0 * np.pi * np.round((there[:1, 2] - begin[2]) / (2.0 * np.pi))
        moved = se2.compose(there, held[:, None])  # long axis next to last: NumPy is slow along short ones
        objects[inside, [names.index(name) for name in segment.load.names]] = moved.transpose(1, 0, 2)
        now |= zip(segment.load.names, se2.compose(end, held), strict=True)
    return objects


def contacts_along(segment: Segment, planned: str, t: FloatArray) -> tuple[str, dict[str, FloatArray]]:
    """Return the name of the set that checks a push, and its contact data along the push.

    The arrays are those of `Execution` by name, for the contacts of this load: (m, n), `forces` (m, n, 2), and
    `needed_forces` (m,). At rest, they belong to the next twist (at the end: to the last one).

    Args:
        segment: Timed push.
        planned: Name of the stable set of the plan.
        t: Times from the beginning of the push, s, (m,).
    """
    problem = segment.pushed_load.problem
    own = segment.contact_trajectory
    fresh = own.changes_at(t)
    twists, rates = own.directions_at(t[fresh]), own.rates_at(t[fresh])
    judge = judging_set(problem, planned)
    state = contact_state(judge.chain, twists) if judge.loads_known else None
    exact = state is not None and isinstance(judge, EcofSet)
    margins = state.margins if state is not None and exact else judge.contact_margins(twists)
    dynamics = contact_dynamics(problem, judge.name)
    floor = state.wrenches if state is not None and dynamics.chain is judge.chain else None
    force, last = PushForce(dynamics), np.cumsum(fresh) - 1
    known = {
        "margins": margins[last],
        "dynamic_margins": dynamics.margins(twists, rates, floor)[last],
        "needed_forces": force.moving(twists, rates, floor)[last],
    }
    _count_starts(known["needed_forces"], force, segment, t)
    if state is not None:
        known |= {name: getattr(state, name)[last] for name in ("friction_margins", "lambdas", "forces")}
    return judge.name, known


def _count_starts(needed: FloatArray, force: PushForce, segment: Segment, t: FloatArray) -> None:
    """Raise the forces (m,) at the samples next to a stop to at least the breakaway force."""
    own = segment.contact_trajectory
    stops = own.breaks[:-1][np.abs(own.twists_at(own.breaks[:-1])).max(axis=1) < RESTING]
    nearest = np.clip(np.searchsorted(t, stops), 0, len(t) - 1)
    begin = force.dynamics.chain.pusher.limits.breakaway * force.steady(own.directions_at(stops))
    np.maximum.at(needed, nearest, begin)


def integrated(trajectory: Trajectory) -> FloatArray:
    """Return the poses (m, 3) at the sample times, with one exact step between neighbouring samples and breaks."""
    ticks = distinct(np.append(trajectory.t, trajectory.breaks))
    piece = trajectory.piece_at(ticks[:-1])
    begin = ticks[:-1] - trajectory.breaks[piece]
    steps = advance(trajectory.columns.take(piece, axis=2), begin, begin + np.diff(ticks))
    return se2.chained(trajectory.start, steps)[np.searchsorted(ticks, trajectory.t)]


def _timed(segment: Segment) -> Trajectory:
    assert segment.trajectory is not None  # `join` has checked
    return segment.trajectory


def _loss(segment: Segment, k: int, time: float, pose: FloatArray, margins: FloatArray) -> StabilityLoss:
    """Return the loss of the contact with the smallest margin (n,) in segment k, the plate frame at a pose (3,)."""
    load, column = segment.pushed_load, int(np.nanargmin(margins))
    name = load.names[column]
    x, y, theta = map(float, pose)
    return StabilityLoss(time, k, name, load.contact_name(name), float(margins[column]), (x, y, theta))
