"""Where a push is to bring its objects, which may have slid against one another, and how far off they are."""

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
"""Shares of the fine steps by which the nearest pose that can be reached is looked for, one after the other."""
_GRID = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
_WIDE = (np.linspace(-4.0, 4.0, 17),) * 2 + (np.linspace(-2.0, 2.0, 9),)
_FINE = np.linspace(-0.5, 0.5, 9)
"""Shares of the tolerances, of x, y and angle, by which poses about the goal are tried, and then about the best."""
_TURNS = np.array(sorted(np.linspace(-1.0, 1.0, 161), key=abs))
"""Shares of the angle's tolerance by which headings at the goal are tried; none is the first."""


@dataclass(frozen=True, eq=False)
class Aim:
    """Poses that objects are to have.

    Attributes:
        objects: (k,) indices of the goal's object, or of all where it names none.
        wanted: (k, 3) their poses in the world.
        chain_pose: (3,) pose of the chain frame at the goal if nothing has slid.
        tolerance: (2,) distance (m) and angle (rad) that still count.
    """

    objects: IntArray
    wanted: FloatArray
    chain_pose: FloatArray
    tolerance: FloatArray

    @classmethod
    def of(cls, goal: Goal, chain: Chain, position: float, angle: float) -> Aim:
        """Return that of a goal, with wider tolerances where the goal's own are smaller."""
        every = range(len(chain.objects))
        objects = np.array(every if goal.of is None else [chain.index_of(goal.of)])
        wanted = compose(goal.pose_chain, chain.places[objects])
        tolerance = np.array([max(position, goal.position_tolerance), max(angle, goal.angle_tolerance)])
        return cls(objects, wanted, goal.pose_chain, tolerance)

    def errors(self, object_poses: FloatArray) -> FloatArray:
        """Return how far (m) and by what angle (rad) the objects, all (..., n, 3), are off: the worst (..., 2)."""
        off = object_poses[..., self.objects, :] - self.wanted
        distance = np.hypot(off[..., 0], off[..., 1])
        angle = np.abs(wrap_angle(off[..., 2]))
        return np.stack([distance.max(axis=-1), angle.max(axis=-1)], axis=-1)

    def share(self, object_poses: FloatArray) -> FloatArray:
        """Return what share (...) of the tolerances the errors are, the larger one: up to 1 the goal is reached."""
        return np.asarray((self.errors(object_poses) / self.tolerance).max(axis=-1))

    def at_limit(self, object_poses: FloatArray, unsure: FloatArray) -> bool:
        """Tell whether errors that are known to so much (2,), m and rad, may be within or may be beyond."""
        errors = self.errors(object_poses)
        return bool((errors <= self.tolerance + unsure).all() and (errors >= self.tolerance - unsure).any())

    def exact(self, chain: Chain) -> FloatArray:
        """Return the pose (3,) of the chain frame that brings the objects nearest to where they shall be.

        There `share` is least: objects that have slid against one another come nearer to their places if all are
        turned a little, which their headings bear.
        """
        places = chain.places[self.objects]
        ideal = wrap_angle(self.wanted[:, 2] - places[:, 2] - self.chain_pose[2])
        headings = self.chain_pose[2] + ideal.mean() + self.tolerance[1] * _TURNS
        origins = self.wanted[:, :2] - rotate(headings[:, None], places[:, :2])
        middles = 0.5 * (origins.min(axis=1) + origins.max(axis=1))
        poses = np.column_stack([middles, headings])
        return np.asarray(poses[np.argmin(self.share(compose(poses[:, None], chain.places)))])

    def best(self, chain: Chain) -> float:
        """Return the least share of the tolerances that the errors of a chain's objects can be."""
        return float(self.share(compose(self.exact(chain), chain.places)))

    def candidates(self, chain: Chain) -> FloatArray:
        """Return poses (k, 3) of the chain frame at the goal: the exact one, then some within the tolerances."""
        exact, room = self.exact(chain), TOLERANCE_USED * self.tolerance
        poses = self._about(exact, chain, (TOLERANCE_USED * _GRID,) * 3)
        allowed = (self.errors(compose(poses[:, None], chain.places)) <= room + 1e-9).all(axis=1)
        return np.vstack([exact, poses[allowed]])

    def nearest(self, chain: Chain, reach: Callable[[FloatArray], FloatArray]) -> FloatArray | None:
        """Return the pose (3,) of the chain frame that is nearest to the goal of those that can be reached.

        None where none is that is tried: up to four times the tolerance away.

        Args:
            chain: As it is.
            reach: Returns costs of paths to poses (k, 3), infinite where there is none.
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
        """Return poses (k, 3) about a pose (3,) of the chain frame, moved by shares of the tolerances."""
        center = chain.places[self.objects].mean(axis=0) * [1.0, 1.0, 0.0]
        moves = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3) * self.tolerance[[0, 0, 1]]
        return compose(compose(compose(pose, center), moves), inverse(center))
