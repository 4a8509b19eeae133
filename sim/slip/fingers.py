"""One object that round fingers push: how robots push in most measurements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import PushedObject
from pushplan.sim.slip.simulator import steps_of
from pushplan.sim.slip.state import (
    CONVERGED,
    FALLBACK,
    PackedWorld,
    Pair,
    Piece,
    cut,
    make_state,
    make_trace,
    make_work,
    pack_bodies,
)
from pushplan.sim.slip.step import march
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class FingerPush:
    """An object and the fingers of a hand.

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
    def packed(self) -> PackedWorld:
        """The arrays of the compiled simulator."""
        pieces = cut(0, self.obj.outline)
        discs = [Piece(1, disc[None, :2], np.ones(1), float(disc[2])) for disc in self.fingers]
        count = len(pieces)
        pairs = [Pair(count + k, i, -1, self.friction) for k in range(len(discs)) for i in range(len(pieces))]
        length = 0.5 * float(np.linalg.norm(np.ptp(self.obj.outline, axis=0)))
        return pack_bodies([self.obj], [*pieces, *discs], pairs, length)

    def push(self, object_pose: FloatArray, hand_poses: FloatArray) -> FloatArray:
        """Move the hand through poses and return those of the object.

        Args:
            object_pose: (3,) where the object is at the beginning, in the world.
            hand_poses: (m + 1, 3) poses of the hand in the world, one step between two.

        Returns:
            (m + 1, 3) poses of the object.

        Raises:
            PushplanError: When the object jams.
        """
        state = make_state(np.stack([object_pose, hand_poses[0]]))
        trace = make_trace(len(hand_poses) - 1, 1)
        done = march(self.packed, make_work(self.packed), state, steps_of(hand_poses), trace)
        if done and trace.end[done - 1] != CONVERGED and trace.end[done - 1] != FALLBACK:
            raise PushplanError(f"{self.obj.name!r} jams in step {done} of {len(trace.end)}")
        return np.concatenate([object_pose[None], trace.poses[:, 0]])
