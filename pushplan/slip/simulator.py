"""Simulator of objects on the floor with slipping contacts, and a plate that moves among them.

The simulation is quasi-static: the result depends on the path of the plate, but not on its speed.
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
"""Largest motion of any corner of plate and stacked objects in a step, m."""


class SlipSimulator:
    """Simulates objects on the floor and a plate that moves among them, move by move.

    Motions of the plate are given in the frame of the chain that it holds (see `hold`). If it holds nothing, they are
    given in the plate frame. In a world with the plate in contact, it holds the chain from the beginning.

    Attributes:
        world: Initial world.
        step: Longest step, see `STEP`.
        jammed: Whether no motion of the objects satisfied all contacts and force balances; nothing moves until
            `place`.
        stalled: Whether the plate stopped in the last move, because it needed more than `robot.limits.force`.
        chain: Held chain, whose contacts are reported; None while the plate holds nothing.
    """

    def __init__(self, world: World, plate_pose: ArrayLike | None = None, step: float = STEP) -> None:
        """Place plate and objects.

        Args:
            world: World with objects, plate and fixed bodies.
            plate_pose: Pose (3,) of the frame in which the plate is moved; None for its pose in the world.
            step: Largest motion of any corner in a step, m.

        Raises:
            PushplanError: If the step is not a positive length.
            SupportError: If the load under an object is not known, or it has no floor friction.
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
        """Hold a chain with the objects and frictions of the world, or nothing; the plate does not move."""
        objects, plate = self.object_poses, se2.compose(self.plate_pose, self.plate_in_frame)
        self.chain = chain
        self._packed = pack_world(self.world, chain)
        self.place(objects, se2.compose(plate, se2.inverse(self.plate_in_frame)))

    @property
    def plate_in_frame(self) -> FloatArray:
        """Pose (3,) of the plate frame in the frame in which the plate is moved."""
        return np.zeros(3) if self.chain is None else self.chain.pusher.plate_pose

    def place(self, object_poses: ArrayLike, plate_pose: ArrayLike) -> None:
        """Set the poses of objects (n, 3) and plate (3,) in the world, at rest and without contact forces."""
        objects = frozen(object_poses, (len(self.world.objects), 3), "poses of the objects")
        plate = frozen(plate_pose, (3,), "pose of the plate")
        self._simulation = core.Simulation(self._packed, objects, plate)
        self.jammed = self.stalled = False

    @property
    def object_poses(self) -> FloatArray:
        """Poses (n, 3) of the objects' own frames in the world."""
        return self._simulation.object_poses

    @property
    def plate_pose(self) -> FloatArray:
        """Pose (3,) in the world of the frame in which the plate is moved."""
        return self._simulation.plate_pose

    @property
    def reach(self) -> float:
        """Distance of the farthest point of robot, plate and held objects from the frame's origin, m."""
        return self.world.chain.reach if self.chain is None else self.chain.reach

    def move(self, twist: ArrayLike, duration: float) -> core.Trace:
        """Move the plate with a constant body twist (3,), in steps of at most `step`."""
        with np.errstate(invalid="ignore"):  # 0 times infinity is NaN, which `frozen` refuses
            motion = frozen(numbers(twist, "twist") * duration, (3,), "motion of the plate")
        distance = float(np.hypot(motion[0], motion[1])) + self.reach * abs(float(motion[2]))
        if not (distance <= FARTHEST and duration >= 0.0):
            raise PushplanError(
                f"the move is {distance:.3g} m in {duration} s; allowed: up to {FARTHEST:g} m in at least 0 s"
            )
        count = max(1, int(np.ceil(distance / self.step)))
        return self.follow(np.tile(motion / count, (count, 1)))

    def follow(self, motions: FloatArray) -> core.Trace:
        """Move the plate by body twists times time (m, 3), one step each, until a jam or stall.

        Returns:
            The trace of the simulated steps, with a jam or stall as the last one. Its columns follow the world's
            objects.

        Raises:
            PushplanError: If there are more contacts at once than the simulator can handle.
        """
        trace = self._simulation.march(motions[:0] if self.jammed else motions, self._limit)
        if (trace.end == core.CROWDED).any():
            raise PushplanError(
                f"there are more than {self._packed.room} contacts at once, the limit of the simulator"
            )
        self.jammed = self.jammed or bool(((trace.end == core.JAMMED) | (trace.end == core.UNSOLVED)).any())
        self.stalled = bool((trace.end == core.STALLED).any())
        return trace
