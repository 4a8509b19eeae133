"""Keep a blended motion away from what it touches by changing the arcs' lengths instead of stopping.

Every touch gives one linear condition on the lengths, from the gradient of the separation: the pose that touches
has to move by what is missing. Together with the conditions on the end, the smallest change of the lengths
that meets them all is taken (`goal_fit`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.blending.sweep import Touches, separations
from pushplan.planners.collision.separation import Scene
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray

APART = 0.2
"""Touches closer together than this (s) count as one: the worst of them is pushed away."""

ROOM = 2.0
"""What a nudge aims at beyond the clearance, as a multiple of what may be lost between the poses looked at."""

STEP = 1e-5
"""Step of the separation's finite differences, m and, times the body's reach, rad."""


class LengthRows(NamedTuple):
    """Linear conditions on the lengths x (k,) of a path's arcs: matrix (c, k) x >= values (c,)."""

    matrix: FloatArray
    values: FloatArray

    def joined(self, other: LengthRows) -> LengthRows:
        """Return the conditions of both."""
        return LengthRows(np.vstack([self.matrix, other.matrix]), np.append(self.values, other.values))


def no_rows(count: int) -> LengthRows:
    """Return no conditions on `count` lengths."""
    return LengthRows(np.zeros((0, count)), np.zeros(0))


def effects_on(pose: FloatArray, path: PushPath) -> FloatArray:
    """Return (3, k): the body twist by which a later `pose` (3,) moves per unit of each arc's length."""
    knots = se2.relative(pose, path.knots[1:])
    v, omega = se2.rotate(knots[:, 2], path.twists[:, :2]), path.twists[:, 2]
    return np.stack([v[:, 0] + omega * knots[:, 1], v[:, 1] - omega * knots[:, 0], omega])


def nudges(
    scene: Scene, path: PushPath, trajectory: Trajectory, lengths: FloatArray, touches: Touches, reach: float
) -> LengthRows:
    """Return the conditions under which the motion leaves the places where it touches something.

    Args:
        scene: What moves and what stands still.
        path: The path that was blended.
        trajectory: The blended motion.
        lengths: (k,) of its arcs.
        touches: Where it touches.
        reach: Of the body, m.
    """
    rows = no_rows(len(lengths))
    for group in np.split(np.arange(len(touches.times)), np.flatnonzero(np.diff(touches.times) > APART) + 1):
        worst = group[np.argmin(touches.gaps[group])]
        time = touches.times[worst]
        pose = trajectory.poses_at([time])[0]
        before = np.arange(len(lengths)) < trajectory.arc[trajectory.piece_at([time])[0]]
        row = np.where(before, _gradient(scene, pose, reach) @ effects_on(pose, path), 0.0)
        missing = scene.clearance + ROOM * (scene.clearance - scene.kept) - touches.gaps[worst]
        rows = rows.joined(LengthRows(row[None], np.array([row @ lengths + missing])))
    return rows


def _gradient(scene: Scene, pose: FloatArray, reach: float) -> FloatArray:
    """Change (3,) of the separation per unit of a body twist at a pose (3,)."""
    steps = STEP * np.array([1.0, 1.0, 1.0 / reach])
    poses = [se2.compose(pose, se2.exp(sign * step)) for step in np.diag(steps) for sign in (1.0, -1.0)]
    ahead, behind = separations(scene, np.array(poses), 1.0).reshape(3, 2).T
    return np.asarray((ahead - behind) / (2.0 * steps))
