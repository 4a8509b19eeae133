"""An execution with slip, as logs and players know executions."""

from __future__ import annotations

import numpy as np

from pushplan.geometry import se2
from pushplan.plans.execution import Execution
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


def executed(
    t: FloatArray,
    poses: FloatArray,
    object_poses: FloatArray,
    wrenches: FloatArray,
    judge: StableSet,
    goal_error: FloatArray,
) -> Execution:
    """Return an execution whose margins are those that its twists had if all contacts were as the judge has them.

    Args:
        t: (m,) times, s.
        poses: (m, 3) of the chain frame in the world.
        object_poses: (m, n, 3) of the objects in the world.
        wrenches: (m - 1, 3) of the plate from each pose to the next, chain frame: N, N, N m.
        judge: A stable set of the chain.
        goal_error: (2,) m and rad.
    """
    twists = _twists(t, poses)
    return Execution(
        t=t,
        poses=poses,
        twists=twists,
        margins=judge.contact_margins(_moving(twists)),
        friction_margins=None,
        lambdas=None,
        forces=None,
        loss=None,
        goal_error=(float(goal_error[0]), float(goal_error[1])),
        object_poses=object_poses,
        wrenches=at_poses(wrenches),
    )


def at_poses(wrenches: FloatArray) -> FloatArray:
    """Return wrenches (m, 3) of the plate at poses, given those of the steps between them (m - 1, 3).

    A step's is that in its middle: at a pose it is the mean of the steps before and after. Where the plate rests in
    one of the two, nothing is known of the forces there, and the other one counts.
    """
    before, after = np.vstack([wrenches[:1], wrenches]), np.vstack([wrenches, wrenches[-1:]])
    moves = [rows.any(axis=1, keepdims=True) for rows in (before, after)]
    return np.asarray((before + after) / np.maximum(1, moves[0].astype(float) + moves[1]))


def _twists(t: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the twists (m, 3) from each pose to the next; none at the last one."""
    twists = np.zeros(poses.shape)
    twists[:-1] = se2.log(se2.relative(poses[:-1], poses[1:])) / np.diff(t)[:, None]
    return twists


def _moving(twists: FloatArray) -> FloatArray:
    """Return the twists (m, 3); where the plate rests, the one that comes next, at the end the one that came last."""
    moves = np.flatnonzero(np.abs(twists).max(axis=1) > 0.0)
    if not len(moves):
        return np.tile([1.0, 0.0, 0.0], (len(twists), 1))
    coming = np.minimum(np.searchsorted(moves, np.arange(len(twists))), len(moves) - 1)
    return np.asarray(twists[moves[coming]])
