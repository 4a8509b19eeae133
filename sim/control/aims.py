"""Where the chain has to go for its goal: with objects that have slid, and with what the tolerances leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.geometry.se2 import compose, inverse, wrap_angle
from pushplan.mechanics.chain import Chain
from pushplan.scenario.parts import Goal
from pushplan.util.arrays import FloatArray, IntArray

SHARE = 0.6
"""Part of the tolerances that goals may use up beside the exact one."""
_GRID = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])


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

    def reached(self, object_poses: FloatArray, share: float = 1.0) -> bool:
        """Tell whether the objects (n, 3) are within a share of the tolerances."""
        return bool((self.errors(object_poses) <= share * self.tolerance).all())

    def exact(self, chain: Chain) -> FloatArray:
        """Return the pose (3,) of the chain frame that brings the objects nearest to where they shall be."""
        ideal = compose(self.wanted, inverse(chain.places[self.objects]))
        angle = ideal[0, 2] + wrap_angle(ideal[:, 2] - ideal[0, 2]).mean()
        middle = 0.5 * (ideal[:, :2].min(axis=0) + ideal[:, :2].max(axis=0))
        return np.append(middle, angle)

    def best(self, chain: Chain) -> FloatArray:
        """Return the smallest errors (2,) that the objects of a chain can have."""
        return self.errors(compose(self.exact(chain), chain.places))

    def candidates(self, chain: Chain) -> FloatArray:
        """Return poses (k, 3) of the chain frame at the goal: the exact one, then some within the tolerances."""
        exact, places = self.exact(chain), chain.places
        center = places[self.objects].mean(axis=0) * [1.0, 1.0, 0.0]
        x, y, turn = (grid.ravel() for grid in np.meshgrid(_GRID, _GRID, _GRID, indexing="ij"))
        room = SHARE * self.tolerance
        moves = np.column_stack([x * room[0], y * room[0], turn * room[1]])
        poses = compose(compose(compose(exact, center), moves), inverse(center))
        errors = self.errors(compose(poses[:, None], places))
        allowed = (errors <= room + 1e-9).all(axis=1)
        return np.vstack([exact, poses[allowed]])
