"""A world that is pushed piece by piece: for whole trajectories, and for controllers that look in between."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.sim.slip.kernels.march import march
from pushplan.sim.slip.kernels.packed import make_work
from pushplan.sim.slip.kernels.state import (
    CROWDED,
    JAMMED,
    UNSOLVED,
    Trace,
    make_state,
    make_trace,
)
from pushplan.sim.slip.packing import pack_world
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray, frozen

DEFAULTS = SlipSettings()


class SlipSimulator:
    """Objects on the floor and a plate that moves among them; it can be moved on at any time.

    Attributes:
        world: What it began as.
        settings: See there.
        jammed: No motion of the objects satisfied all contacts and balances; nothing moves any more until `place`.
    """

    def __init__(
        self, world: World, plate_pose: ArrayLike | None = None, settings: SlipSettings = DEFAULTS
    ) -> None:
        """Place plate and objects.

        Args:
            world: Where the objects are, and all that they meet.
            plate_pose: (3,) pose of the chain frame in the world; None for the world's start.
            settings: See there.

        Raises:
            SupportError: When the load under an object is not known, or it has no friction with the floor.
        """
        self.world, self.settings = world, settings
        self._packed = pack_world(world)
        self.place(world.object_poses, world.start if plate_pose is None else plate_pose)

    def place(self, object_poses: ArrayLike, plate_pose: ArrayLike) -> None:
        """Put objects (n, 3) and plate (3,) somewhere else in the world, at rest and without contact forces."""
        n = len(self.world.chain.objects)
        objects = frozen(object_poses, (n, 3), "poses of the objects")
        self._work = make_work(self._packed)
        self._state = make_state(np.vstack([objects, frozen(plate_pose, (3,), "pose of the plate")]))
        self.jammed = False

    @property
    def object_poses(self) -> FloatArray:
        """(n, 3) poses of the objects' own frames in the world."""
        return np.array(self._state.poses[:-1])

    @property
    def plate_pose(self) -> FloatArray:
        """(3,) pose of the chain frame in the world."""
        return np.array(self._state.poses[-1])

    def move(self, twist: ArrayLike, duration: float) -> Trace:
        """Move the plate with a constant body twist (3,) in the chain frame, in steps as `settings` says."""
        motion = frozen(twist, (3,), "twist of the plate") * duration
        reach = self.world.chain.reach
        way = float(np.hypot(motion[0], motion[1])) + reach * abs(float(motion[2]))
        count = max(1, int(np.ceil(way / self.settings.step)))
        return self.follow(np.tile(motion / count, (count, 1)))

    def follow(self, motions: FloatArray) -> Trace:
        """Move the plate by body twists times time (m, 3), one step each; after a jam what is left is not done.

        Returns:
            The trace of the steps that were made; a jam is its last one.

        Raises:
            PushplanError: When more bodies touch at once than there is room for.
        """
        trace = make_trace(0 if self.jammed else len(motions), len(self._packed.loads))
        done = march(self._packed, self._work, self._state, motions[: len(trace.end)], trace)
        if done and trace.end[done - 1] == CROWDED:
            raise PushplanError(
                f"more than {len(self._work.who)} contacts at once: that is more than the simulator has room for"
            )
        self.jammed = self.jammed or bool(done and trace.end[done - 1] in (JAMMED, UNSOLVED))
        return Trace._make(values[:done] for values in trace)


def steps_of(poses: FloatArray) -> FloatArray:
    """Return the body twists times time (m, 3) between neighbours of poses (m + 1, 3)."""
    return se2.log(se2.relative(poses[:-1], poses[1:]))
