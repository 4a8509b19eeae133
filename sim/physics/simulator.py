"""Stepwise simulation of a plate and objects on the floor in a physics engine (MuJoCo).

It has the same world and methods as `slip.simulator.SlipSimulator`, but runs at full speed and with inertia.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.sim.physics.engine import ForceMeter, PhysicsError, PhysicsSettings
from pushplan.sim.physics.model import build_model, joint_coordinates
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray, IntArray, frozen, numbers
from pushplan.util.names import FARTHEST

HARD = PhysicsSettings(time_step=1e-3, indentation=5e-6)
"""Settings with hard contacts, which creep least and allow a longer time step; slipping contacts slip too far."""
STEPPED = replace(HARD, degree=5)
"""Settings for closed loops, with fewer feet."""
_BARELY = 1e-9
"""Smallest sliding speed for the design of the feet, m/s."""
FAR, RESTING = 0.02, 1e-6
"""Distance (m) of the plate from all objects above which, and their speed below which, no simulation is needed."""


@dataclass(frozen=True, eq=False)
class Moved:
    """Result of a move: `wrenches` (m, 3) of the plate in its own frame, as in `core.slip.Trace`."""

    wrenches: FloatArray


class PhysicsSimulator:
    """Counterpart of `SlipSimulator` in MuJoCo.

    Attributes:
        world: Initial world.
        chain: Held chain, whose frame is moved; None to move the plate frame.
        jammed: Whether the engine has failed; nothing moves any more.
        stalled: Whether the push exceeded `robot.limits.force`; the plate then stands until it moves elsewhere.
    """

    def __init__(self, world: World, settings: PhysicsSettings = STEPPED, sliding: float | None = None) -> None:
        """Place plate and objects.

        Args:
            world: Initial world.
            settings: Settings of the simulation.
            sliding: Largest speed of the objects, m/s, see `sliding_speed`; None for the pusher's limits.

        Raises:
            MissingExtraError: If the engine is not installed.
            SupportError: If the load under an object is not known, or a push could lift a part of it.
        """
        self.world, self.jammed, self.stalled = world, False, False
        self._against: FloatArray = np.zeros(3)
        self.chain = world.chain if world.plate is None else None
        pusher = world.chain.pusher
        first = se2.compose(world.start, pusher.plate_pose) if world.plate is None else world.plate
        self._plate: FloatArray = np.array(first)
        self._begin = np.vstack([world.object_poses, first])
        self._settings = settings
        self._meter = ForceMeter(pusher.limits.force, settings.time_step)
        if sliding is None:
            limits = pusher.limits
            sliding = max(limits.both("speed")) + world.chain.reach * max(limits.both("angular_speed"))
        self._model = build_model(world, self._begin, max(sliding, _BARELY), settings)
        self._outlines = [obj.outline for obj in world.objects]
        into = se2.inverse(pusher.plate_pose)
        self._carried = [se2.transform_points(into, part) for part in (pusher.outline, *pusher.footprint)]
        self._pushed(np.zeros(3), 0.0, settings.run_in)  # let the feet settle

    def hold(self, chain: Chain | None) -> None:
        """Hold a chain, or nothing for None; plate and objects do not move."""
        self.chain = chain

    @property
    def plate_in_frame(self) -> FloatArray:
        """Pose of the plate frame in the moved frame, (3,)."""
        return np.zeros(3) if self.chain is None else self.chain.pusher.plate_pose

    @property
    def plate_pose(self) -> FloatArray:
        """Pose of the moved frame in the world, (3,)."""
        return np.asarray(se2.compose(self._plate, se2.inverse(self.plate_in_frame)))

    @property
    def object_poses(self) -> FloatArray:
        """Poses of the objects' own frames in the world, (n, 3)."""
        return np.asarray(se2.compose(self._model.motions()[:-1], self._begin[:-1]))

    def place(self, object_poses: ArrayLike, plate_pose: ArrayLike) -> None:
        """Place objects (n, 3) and the moved frame of the plate (3,) in the world, at rest."""
        objects = frozen(object_poses, (len(self._outlines), 3), "poses of the objects")
        self._plate = se2.compose(frozen(plate_pose, (3,), "pose of the plate"), self.plate_in_frame)
        self._put(np.arange(len(self._begin)), np.vstack([objects, self._plate]))

    def move(self, twist: ArrayLike, duration: float) -> Moved:
        """Move the plate with a constant body twist (3,) of its moved frame for a duration, s."""
        own = frozen(se2.twist_of(self.plate_in_frame, numbers(twist, "twist")), (3,), "twist")
        if not (np.abs(own).max() * duration <= FARTHEST and duration >= 0.0):
            raise PushplanError(f"a move of {own} for {duration} s; allowed: up to {FARTHEST:g} m, and a time >= 0")
        if self.jammed:
            return Moved(np.zeros((1, 3)))
        if self._rests() and (not own.any() or self._far()):
            self._plate = np.asarray(se2.compose(self._plate, se2.exp(own * duration)))
            self._put(np.array([len(self._outlines)]), self._plate[None])
            return Moved(np.zeros((1, 3)))
        self.stalled = self.stalled and float(own @ (self._against * [1.0, 1.0, self.world.chain.reach**2])) > 0.0
        if self.stalled:
            own = np.zeros(3)
        try:
            return Moved(self._pushed(own, duration, max(1, round(duration / self._settings.time_step))))
        except PhysicsError:
            self.jammed = True
        return Moved(np.zeros((1, 3)))

    def move_along(self, frames: FloatArray) -> FloatArray:
        """Move the plate through poses (m + 1, 3) of its moved frame, one time step between two, up to a stall.

        Returns:
            Wrenches of the plate in the executed steps, in its frame: N, N, N m, (k, 3).

        Raises:
            PhysicsError: If the simulation diverges.
        """
        return self._followed(se2.compose(frames, self.plate_in_frame), self._meter)

    def _followed(self, poses: FloatArray, meter: ForceMeter | None) -> FloatArray:
        """Move the plate frame through poses; see `move_along`."""
        forces, self.stalled = self._model.march(_motions(poses, self._begin[-1]), meter)
        self._model.require_sound()
        done, into = len(forces), self.plate_in_frame
        self._plate = np.array(poses[done])
        force = -se2.rotate(into[2] - poses[:done, 2], forces[:, :2])
        moment = -forces[:, 2] + into[0] * force[:, 1] - into[1] * force[:, 0]
        return np.column_stack([force, moment])

    def _pushed(self, twist: FloatArray, duration: float, count: int) -> FloatArray:
        """Move the plate frame at a twist (3,) and return the wrenches of the plate (count, 3).

        The engine's time steps are fixed; if they do not add up to the duration, the speed is scaled.
        """
        poses = se2.compose(self._plate, se2.exp(twist * (duration / count * np.arange(count + 1))[:, None]))
        stood = self.stalled
        wrenches = self._followed(poses, None if stood or not twist.any() else self._meter)
        if self.stalled:
            self._against = twist
            self._meter.reset()
            stands = np.repeat(self._plate[None], count - len(wrenches) + 1, axis=0)
            wrenches, stood = np.vstack([wrenches, self._followed(stands, None)]), True
        self.stalled = stood
        return wrenches

    def _put(self, bodies: IntArray, poses: FloatArray) -> None:
        """Place bodies at poses (k, 3) in the world, at rest."""
        model = self._model
        places = model.dofs[bodies, None] + np.arange(3)
        model.data.qpos[places] = joint_coordinates(model.anchors[bodies], _motions(poses, self._begin[bodies]))
        model.data.qvel[places] = 0.0

    def _rests(self) -> bool:
        places = self._model.dofs[:-1, None] + np.arange(3)
        return bool(np.abs(self._model.data.qvel[places]).max() < RESTING)

    def _far(self) -> bool:
        """Return whether plate and robot are farther than `FAR` from all objects."""
        moving = [shapely.Polygon(se2.transform_points(self._plate, part)) for part in self._carried]
        standing = [
            shapely.Polygon(se2.transform_points(pose, outline))
            for pose, outline in zip(self.object_poses, self._outlines, strict=True)
        ]
        return float(shapely.distance(shapely.union_all(moving), standing).min()) > FAR


def sliding_speed(chain: Chain, frames: FloatArray, dt: float) -> float:
    """Return the largest speed of any point of the objects without slip, m/s.

    Args:
        chain: Pushed chain.
        frames: Poses of its frame, (k + 1, 3).
        dt: Time from each pose to the next, s.
    """
    twists = se2.relative(frames[:-1], frames[1:]) / dt
    corners = np.concatenate([obj.outline_chain for obj in chain.objects])
    x = twists[:, 0, None] - twists[:, 2, None] * corners[:, 1]
    y = twists[:, 1, None] + twists[:, 2, None] * corners[:, 0]
    return float(np.hypot(x, y).max())


def _motions(poses: FloatArray, begin: FloatArray) -> FloatArray:
    """Return the motions of bodies from poses `begin` to `poses`, as in `PhysicsModel.motions`."""
    return np.asarray(se2.compose(poses, se2.inverse(begin)))
