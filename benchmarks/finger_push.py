"""An object and the round fingers of a hand in the slip simulator, as in most measurements of pushes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import pushplan.core.slip as core
from pushplan.errors import PushplanError
from pushplan.mechanics.chain import PushedObject
from pushplan.sim.slip import steps_of
from pushplan.slip.packing import Pair, Piece, cut, pack_bodies
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class FingerPush:
    """An object and the round fingers of a hand: how robots push in most measurements.

    Attributes:
        obj: The object; its `pose_chain` does not matter.
        fingers: (k, 3) places x, y in the hand's frame, and radii, m.
        friction: Coefficient between fingers and object.
    """

    obj: PushedObject
    fingers: FloatArray
    friction: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "fingers", frozen(self.fingers, (None, 3), "fingers"))

    @cached_property
    def packed(self) -> core.World:
        """Packed bodies for `core.slip`."""
        pieces = cut(0, self.obj.outline)
        discs = [Piece(1, disc[None, :2], np.ones(1), float(disc[2])) for disc in self.fingers]
        count = len(pieces)
        pairs = [Pair(count + k, i, -1, self.friction) for k in range(len(discs)) for i in range(len(pieces))]
        length = 0.5 * float(np.linalg.norm(np.ptp(self.obj.outline, axis=0)))
        return pack_bodies([self.obj], [*pieces, *discs], pairs, length)

    def push(self, object_pose: FloatArray, hand_poses: FloatArray) -> FloatArray:
        """Move the hand through poses (m + 1, 3) and return those of the object (m + 1, 3), all in the world.

        Raises:
            PushplanError: If the object jams.
        """
        simulation = core.Simulation(self.packed, object_pose[None], hand_poses[0])
        motions = steps_of(hand_poses)
        trace = simulation.march(motions)
        if not np.isin(trace.end, (core.CONVERGED, core.FALLBACK)).all():
            raise PushplanError(f"{self.obj.name!r} jams in step {len(trace.end)} of {len(motions)}")
        return np.concatenate([object_pose[None], trace.poses[:, 0]])
