"""Kinematic execution of several pushes: the load follows the plate while every contact holds, and else rests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pushplan.geometry import se2
from pushplan.plans.execution import Execution, StabilityLoss
from pushplan.plans.judge import contact_dynamics, judging_set
from pushplan.plans.segment import Segment, trajectory_of
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Goal, Scenario
from pushplan.several.modes import Mode
from pushplan.several.segments import mode_of, push_problem
from pushplan.sim.rigid import integrated
from pushplan.util.arrays import FloatArray

NOTHING_TO_LOSE = 1.0
"""Margin where nothing is pushed."""


def execute_segments(
    scenario: Scenario,
    planned: str,
    segments: tuple[Segment, ...],
    trajectory: Trajectory,
    modes: tuple[Mode, ...],
) -> Execution:
    """Return what the kinematic simulator makes of several pushes.

    It stops at the first sample at which a contact's margin is not positive, with inertia unless the scenario leaves
    that out.

    Args:
        scenario: What was asked.
        planned: Name of the stable set that was planned in; it judges where the loads are not known.
        segments: With their times.
        trajectory: Of the robot's frame through all of them.
        modes: The contacts.
    """
    t, poses = trajectory.t, integrated(trajectory)
    contacts = len(scenario.chain.contacts)
    margins, dynamic = (
        np.full((len(t), contacts), NOTHING_TO_LOSE),
        np.full((len(t), contacts), NOTHING_TO_LOSE),
    )
    loads = np.empty((len(t), 3))
    load = np.array(scenario.start)
    for k, segment in enumerate(segments):
        # The load rests where the push before has left it, whatever the plan says.
        last = k == len(segments) - 1
        inside = np.flatnonzero((t >= segment.t0) & ((t < segment.t1) | last))
        own = replace(segment, load_before=load)
        loads[inside] = own.load_at(poses[inside])
        if segment.pushes:
            mode = mode_of(segment, modes)
            margins[inside], dynamic[inside] = _margins(
                segment, trajectory, mode, planned, t[inside] - segment.t0
            )
            end = trajectory_of(segment, trajectory).break_poses[-1]
            load = own.load_at(se2.compose(end, segment.robot)[None])[0]
    loads[:, 2] = np.unwrap(loads[:, 2])  # the robot may have turned fully since the last push
    decides = scenario.chain.pusher.limits.contact == "dynamic"
    deciding = np.minimum(margins, dynamic) if decides else margins
    lost = np.flatnonzero(deciding.min(axis=1) <= 0.0)
    count = int(lost[0]) + 1 if len(lost) else len(t)
    loss = _loss(t, poses, deciding, count - 1) if len(lost) else None
    goal = reached_goal(scenario, loads[count - 1])
    return Execution(
        t[:count],
        poses[:count],
        trajectory.twists[:count],
        margins[:count],
        None,
        None,
        None,
        loss,
        se2.pose_error(loads[count - 1], goal.pose_chain),
        dynamic[:count],
        loads[:count],
    )


def reached_goal(scenario: Scenario, load: FloatArray) -> Goal:
    """Return the goal that is nearest to where the load is (3,)."""
    assert scenario.pushes is not None
    reach = scenario.chain.reach

    def away(goal: Goal) -> float:
        distance, angle = se2.pose_error(load, goal.pose_chain)
        return distance + reach * angle

    return min(scenario.pushes.goals, key=away)


def _margins(
    segment: Segment, trajectory: Trajectory, mode: Mode, planned: str, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Margins (k, n) of the contacts without and with inertia at times (k,) of a push, in the order of the scenario.

    A contact is known by the object that it moves, or by the two objects that it lies between: pushed from another
    side, a chain passes its forces on in another order.
    """
    own = trajectory_of(segment, trajectory)
    problem = push_problem(segment, mode)
    judge = judging_set(problem, planned)
    asked = own.directions_at(t)
    margins = judge.contact_margins(asked)
    dynamic = contact_dynamics(problem, judge.name).margins(asked, own.rates_at(t))
    order = mode.contact_order
    return margins[:, order], dynamic[:, order]


def _loss(t: FloatArray, poses: FloatArray, margins: FloatArray, i: int) -> StabilityLoss:
    contact = int(np.argmin(margins[i]))
    x, y, theta = (float(value) for value in poses[i])
    return StabilityLoss(float(t[i]), contact, float(margins[i, contact]), (x, y, theta))
