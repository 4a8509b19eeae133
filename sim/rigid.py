"""Kinematic execution: the chain follows the pusher rigidly for as long as every contact holds."""

from __future__ import annotations

import numpy as np

from pushplan.geometry import se2
from pushplan.mechanics.contacts.contact_state import contact_state
from pushplan.mechanics.dynamics.contact_dynamics import ContactDynamics
from pushplan.plans.execution import Execution, StabilityLoss
from pushplan.plans.trajectory import Trajectory, advance
from pushplan.sets.ecof_set import EcofSet
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, columns_of


def simulate_rigid(
    trajectory: Trajectory,
    judge: StableSet,
    goal: FloatArray,
    contacts: ContactDynamics | None = None,
    inertia_decides: bool = True,
) -> Execution:
    """Execute a trajectory: integrate the commanded twist exactly and watch every contact.

    The integration does not use the trajectory's own poses. It stops at the first sample at which a
    contact's margin is not positive.

    Args:
        trajectory: What is commanded.
        judge: The stable set whose margins decide; the exact one (`ecof`) where the loads are known.
        goal: (3,) pose of the chain frame in the world, for the error at the end.
        contacts: The contact conditions with inertia; None leaves inertia out.
        inertia_decides: A contact is lost, too, where its margin with inertia is not positive.
    """
    poses = integrated(trajectory)
    asked = trajectory.directions
    state = contact_state(judge.chain, asked) if judge.loads_known else None
    exact = state is not None and isinstance(judge, EcofSet)
    margins = deciding = state.margins if state is not None and exact else judge.contact_margins(asked)
    floor = (
        state.wrenches
        if state is not None and contacts is not None and contacts.chain is judge.chain
        else None
    )
    dynamic = None if contacts is None else contacts.margins(asked, trajectory.rates_at(trajectory.t), floor)
    if dynamic is not None and inertia_decides:
        deciding = np.minimum(margins, dynamic)
    lost = np.flatnonzero(columns_of(deciding).min(axis=0) <= 0.0)
    last = int(lost[0]) + 1 if len(lost) else len(poses)
    loss = _loss(trajectory, poses, deciding, last - 1) if len(lost) else None
    return Execution(
        trajectory.t[:last],
        poses[:last],
        trajectory.twists[:last],
        margins[:last],
        None if state is None else state.friction_margins[:last],
        None if state is None else state.lambdas[:last],
        None if state is None else state.forces[:last],
        loss,
        se2.pose_error(poses[last - 1], goal),
        None if dynamic is None else dynamic[:last],
    )


def integrated(trajectory: Trajectory) -> FloatArray:
    """Return the poses (m, 3) at the sample times: one exact step between any two of samples and breaks."""
    ticks = np.union1d(trajectory.t, trajectory.breaks)
    piece = trajectory.piece_at(ticks[:-1])
    begin = ticks[:-1] - trajectory.breaks[piece]
    steps = advance(trajectory.columns.take(piece, axis=2), begin, begin + np.diff(ticks))
    return se2.chained(trajectory.start, steps)[np.searchsorted(ticks, trajectory.t)]


def _loss(trajectory: Trajectory, poses: FloatArray, margins: FloatArray, i: int) -> StabilityLoss:
    contact = int(np.argmin(margins[i]))
    x, y, theta = (float(value) for value in poses[i])
    return StabilityLoss(float(trajectory.t[i]), contact, float(margins[i, contact]), (x, y, theta))
