"""The slip step: objects on the floor, whose contacts may slip, and a plate that moves among them.

Quasi-static: only paths count, not how fast they are driven.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

import pushplan.core.slip as core
from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.slip.packing import pack_world
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray, frozen, numbers
from pushplan.util.names import FARTHEST

STEP = 1e-3
"""How far the fastest corner of plate and stacked objects moves in a step at most, m."""


class SlipSimulator:
    """Objects on the floor and a plate that moves among them; it can be moved on at any time.

    The plate is moved in the frame of the chain that it holds (see `hold`), which it does from the beginning in a
    world where it is in contact; in the plate frame else.

    Attributes:
        world: What it began as.
        step: Longest step, see `STEP`.
        jammed: No motion of the objects satisfied all contacts and balances; nothing moves any more until `place`.
        stalled: In the last move the plate would have had to push with more than `robot.limits.force`, and stood.
        chain: What is held: its contacts are told of; None while the plate is alone.
    """

    def __init__(self, world: World, plate_pose: ArrayLike | None = None, step: float = STEP) -> None:
        """Place plate and objects.

        Args:
            world: Where the objects are, and all that they meet.
            plate_pose: (3,) pose of the frame that the plate is moved in; None for where it is in the world.
            step: How far the fastest corner moves in a step at most, m.

        Raises:
            PushplanError: If the step is no length.
            SupportError: If the load under an object is not known, or it has no friction with the floor.
        """
        if not 0.0 < step < np.inf:
            raise PushplanError(f"step is {step}; it must be finite and > 0")
        self.world, self.step = world, step
        self.chain = world.chain if world.plate is None else None
        self._limit = world.chain.pusher.limits.force
        self._packed = pack_world(world, self.chain)
        first = world.start if world.plate is None else world.plate
        self.place(world.object_poses, first if plate_pose is None else plate_pose)

    def hold(self, chain: Chain | None) -> None:
        """Hold a chain, with objects and frictions as they are in the world, or nothing; the plate stays there."""
        objects, plate = self.object_poses, se2.compose(self.plate_pose, self.plate_in_frame)
        self.chain = chain
        self._packed = pack_world(self.world, chain)
        self.place(objects, se2.compose(plate, se2.inverse(self.plate_in_frame)))

    @property
    def plate_in_frame(self) -> FloatArray:
        """(3,) pose of the plate frame in the frame that the plate is moved in."""
        return np.zeros(3) if self.chain is None else self.chain.pusher.plate_pose

    def place(self, object_poses: ArrayLike, plate_pose: ArrayLike) -> None:
        """Put objects (n, 3) and plate (3,) somewhere else in the world, at rest and without contact forces."""
        objects = frozen(object_poses, (len(self.world.objects), 3), "poses of the objects")
        plate = frozen(plate_pose, (3,), "pose of the plate")
        self._simulation = core.Simulation(self._packed, objects, plate)
        self.jammed = self.stalled = False

    @property
    def object_poses(self) -> FloatArray:
        """(n, 3) poses of the objects' own frames in the world."""
        return self._simulation.object_poses

    @property
    def plate_pose(self) -> FloatArray:
        """(3,) pose in the world of the frame that the plate is moved in."""
        return self._simulation.plate_pose

    @property
    def reach(self) -> float:
        """Distance of the farthest point of robot, plate and held objects from the frame's origin, m."""
        return self.world.chain.reach if self.chain is None else self.chain.reach

    def move(self, twist: ArrayLike, duration: float) -> core.Trace:
        """Move the plate with a constant body twist (3,), in steps of at most `step`."""
        with np.errstate(invalid="ignore"):  # 0 for an infinite time, which is refused as no number
            motion = frozen(numbers(twist, "twist") * duration, (3,), "motion of the plate")
        way = float(np.hypot(motion[0], motion[1])) + self.reach * abs(float(motion[2]))
        if not (way <= FARTHEST and duration >= 0.0):
            raise PushplanError(
                f"a move of {way:.3g} m in {duration} s; allowed: {FARTHEST:g} m, and time that goes on"
            )
        count = max(1, int(np.ceil(way / self.step)))
        return self.follow(np.tile(motion / count, (count, 1)))

    def follow(self, motions: FloatArray) -> core.Trace:
        """Move the plate by body twists times time (m, 3), one step each; after a jam or stall the rest is not done.

        Returns:
            The trace of the steps that were made; a jam or a stall is its last one. Columns are those of the world's
            objects.

        Raises:
            PushplanError: If more bodies touch at once than there is room for.
        """
        trace = self._simulation.march(motions[:0] if self.jammed else motions, self._limit)
        if (trace.end == core.CROWDED).any():
            raise PushplanError(
                f"more than {self._packed.room} contacts at once: that is more than the simulator has room for"
            )
        self.jammed = self.jammed or bool(((trace.end == core.JAMMED) | (trace.end == core.UNSOLVED)).any())
        self.stalled = bool((trace.end == core.STALLED).any())
        return trace
