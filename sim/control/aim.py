"""Goal poses of a push whose objects can slide relative to one another, and the errors from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pushplan.geometry.se2 import compose, inverse, rotate, wrap_angle
from pushplan.mechanics.chain import Chain
from pushplan.planners.multi.room import TOLERANCE_USED
from pushplan.scenario.goals import Goal
from pushplan.util.arrays import FloatArray, IntArray

FINER = (1.0, 1.0, 1.0, 0.5, 0.25, 0.125)
"""Successive shares of the fine steps in the search of the nearest reachable pose."""
_GRID = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
_WIDE = (np.linspace(-4.0, 4.0, 17),) * 2 + (np.linspace(-2.0, 2.0, 9),)
_FINE = np.linspace(-0.5, 0.5, 9)
"""Grids of tried poses about the goal, and then about the best pose: shares of the tolerances in x, y and angle."""
_TURNS = np.array(sorted(np.linspace(-1.0, 1.0, 161), key=abs))
"""Tried headings at the goal as shares of the angle tolerance, from 0 outwards."""


@dataclass(frozen=True, eq=False)
class Aim:
    """Goal poses of objects.

    Attributes:
        objects: Index of the goal's object, or of all objects if it names none, (k,).
        wanted: Goal poses of these objects in the world, (k, 3).
        chain_pose: Pose of the chain frame at the goal without any slide, (3,).
        tolerance: Tolerances of distance (m) and angle (rad), (2,).
    """

    objects: IntArray
    wanted: FloatArray
    chain_pose: FloatArray
    tolerance: FloatArray

    @classmethod
    def of(cls, goal: Goal, chain: Chain, position: float, angle: float) -> Aim:
        """Return the aim of a goal; its tolerances are widened to at least `position` (m) and `angle` (rad)."""
        every = range(len(chain.objects))
        objects = np.array(every if goal.of is None else [chain.index_of(goal.of)])
        wanted = compose(goal.pose_chain, chain.places[objects])
        tolerance = np.array([max(position, goal.position_tolerance), max(angle, goal.angle_tolerance)])
        return cls(objects, wanted, goal.pose_chain, tolerance)

    def errors(self, object_poses: FloatArray) -> FloatArray:
        """Return the largest distance (m) and angle (rad) from the goal (..., 2), for object poses (..., n, 3)."""
        off = object_poses[..., self.objects, :] - self.wanted
        distance = np.hypot(off[..., 0], off[..., 1])
        angle = np.abs(wrap_angle(off[..., 2]))
        return np.stack([distance.max(axis=-1), angle.max(axis=-1)], axis=-1)

    def share(self, object_poses: FloatArray) -> FloatArray:
        """Return the larger error as a share of its tolerance (...); up to 1 the goal is reached."""
        return np.asarray((self.errors(object_poses) / self.tolerance).max(axis=-1))

    def at_limit(self, object_poses: FloatArray, unsure: FloatArray) -> bool:
        """Return whether errors with an uncertainty (2,), m and rad, can be on either side of the tolerances."""
        errors = self.errors(object_poses)
        return bool((errors <= self.tolerance + unsure).all() and (errors >= self.tolerance - unsure).any())

    def exact(self, chain: Chain) -> FloatArray:
        """Return the pose (3,) of the chain frame with the smallest `share`.

        Objects that have slid relative to one another can come nearer to their goals if all are turned a little,
        within the angle tolerance.
        """
        places = chain.places[self.objects]
        ideal = wrap_angle(self.wanted[:, 2] - places[:, 2] - self.chain_pose[2])
        headings = self.chain_pose[2] + ideal.mean() + self.tolerance[1] * _TURNS
        origins = self.wanted[:, :2] - rotate(headings[:, None], places[:, :2])
        middles = 0.5 * (origins.min(axis=1) + origins.max(axis=1))
        poses = np.column_stack([middles, headings])
        return np.asarray(poses[np.argmin(self.share(compose(poses[:, None], chain.places)))])

    def best(self, chain: Chain) -> float:
        """Return the smallest possible share of the tolerances for a chain."""
        return float(self.share(compose(self.exact(chain), chain.places)))

    def candidates(self, chain: Chain) -> FloatArray:
        """Return goal poses (k, 3) of the chain frame: the exact one, then others within the tolerances."""
        exact, room = self.exact(chain), TOLERANCE_USED * self.tolerance
        poses = self._about(exact, chain, (TOLERANCE_USED * _GRID,) * 3)
        allowed = (self.errors(compose(poses[:, None], chain.places)) <= room + 1e-9).all(axis=1)
        return np.vstack([exact, poses[allowed]])

    def nearest(self, chain: Chain, reach: Callable[[FloatArray], FloatArray]) -> FloatArray | None:
        """Return the reachable pose (3,) of the chain frame nearest to the goal.

        The search covers four times the tolerances; None if no tried pose is reachable.

        Args:
            chain: Chain with its current slides.
            reach: Function that returns costs of paths to poses (k, 3), infinite without a path.
        """
        best = self.exact(chain)
        for grids in (_WIDE, *((share * _FINE,) * 3 for share in FINER)):
            poses = self._about(best, chain, grids)
            shares = self.share(compose(poses[:, None], chain.places))
            shares[~np.isfinite(reach(poses))] = np.inf
            best = poses[np.argmin(shares)]
            if np.isinf(shares.min()):
                return None
        return np.asarray(best)

    def _about(self, pose: FloatArray, chain: Chain, grids: Sequence[FloatArray]) -> FloatArray:
        """Return a grid of poses (k, 3) about a pose (3,) of the chain frame, in shares of the tolerances."""
        center = chain.places[self.objects].mean(axis=0) * [1.0, 1.0, 0.0]
        moves = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3) * self.tolerance[[0, 0, 1]]
        return compose(compose(compose(pose, center), moves), inverse(center))
