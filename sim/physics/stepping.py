"""Objects on the floor and a plate that moves among them in a physics engine (MuJoCo), step by step.

The same world, moved by the same calls, as in `slip.simulator.SlipSimulator`: bodies are cut into the same convex
pieces. Every corner of a piece is a tiny sphere that touches the whole of the others, so that objects may be touched
on any side, leave the plate and come back to it, at full speed and with all inertia.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, PushedObject, inertia_of
from pushplan.scenario.parts import CircleObstacle
from pushplan.sim.feet import feet_of
from pushplan.sim.intake import FARTHEST
from pushplan.sim.physics.engine import ForceMeter, PhysicsError, PhysicsSettings, engine
from pushplan.sim.physics.model import (
    CORNER,
    OVERLAP,
    PLATE_MASS,
    LoadTransfer,
    PhysicsModel,
    add_floor,
    add_pair,
    add_planar,
    compiled,
    impedance_of,
    joint_coordinates,
    set_options,
    stand,
)
from pushplan.sim.slip.packing import Pair, Piece, bodies_of, push_heights
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray, IntArray, frozen, numbers

STEPPED = PhysicsSettings(time_step=1e-3, indentation=5e-6, degree=5)
"""Hard contacts, as pushes of plans have."""
TALL = 0.1
"""Half the height of all pieces, m; what touches does so in the middle of it."""
FAR, RESTING = 0.02, 1e-6
"""Distance (m) of the plate from all objects, and their speed, at which they need not be simulated: they rest."""
SHARP = 1e-3
"""Sine of the turn at a corner below which it is none."""


@dataclass(frozen=True, eq=False)
class Moved:
    """What a move left behind: `wrenches` (m, 3) of the plate in its own frame as in a `core.slip.Trace`."""

    wrenches: FloatArray


class PhysicsSimulator:
    """A `SlipSimulator` of MuJoCo.

    Attributes:
        world: What it began as.
        chain: What is held: the plate is moved in its frame; in the plate frame where that is None.
        jammed: The engine could not go on; nothing moves any more.
        stalled: The plate had to push with more than `robot.limits.force`: it stands until it is moved another way.
    """

    def __init__(self, world: World, settings: PhysicsSettings = STEPPED) -> None:
        """Place plate and objects.

        Args:
            world: Where the objects are, and all that they meet.
            settings: See there; quasi-static ones do not matter.

        Raises:
            MissingEngineError: When the engine is not installed.
            SupportError: When the load under an object is not known, or a push could lift a part of it.
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
        objects, pieces, pairs = bodies_of(world)
        self._outlines = [obj.outline for obj in objects]
        self._carried = [piece.corners for piece in pieces if piece.body == len(objects)]
        self._transfer = LoadTransfer(objects, push_heights(world.chain, objects))
        self._model = _model(world, self._begin, objects, pieces, pairs, settings)
        self._pushed(np.zeros(3), 0.0, settings.run_in)  # so that the feet settle

    def hold(self, chain: Chain | None) -> None:
        """Hold a chain, or nothing; plate and objects stay where they are."""
        self.chain = chain

    @property
    def plate_in_frame(self) -> FloatArray:
        """(3,) pose of the plate frame in the frame that the plate is moved in."""
        return np.zeros(3) if self.chain is None else self.chain.pusher.plate_pose

    @property
    def plate_pose(self) -> FloatArray:
        """(3,) pose in the world of the frame that the plate is moved in."""
        return np.asarray(se2.compose(self._plate, se2.inverse(self.plate_in_frame)))

    @property
    def object_poses(self) -> FloatArray:
        """(n, 3) poses of the objects' own frames in the world."""
        return np.asarray(se2.compose(self._model.motions()[:-1], self._begin[:-1]))

    def place(self, object_poses: ArrayLike, plate_pose: ArrayLike) -> None:
        """Put objects (n, 3) and plate (3,), the latter by its frame, somewhere else in the world, at rest."""
        objects = frozen(object_poses, (len(self._outlines), 3), "poses of the objects")
        self._plate = se2.compose(frozen(plate_pose, (3,), "pose of the plate"), self.plate_in_frame)
        self._put(np.arange(len(self._begin)), np.vstack([objects, self._plate]))

    def move(self, twist: ArrayLike, duration: float) -> Moved:
        """Move the plate with a constant body twist (3,) of its frame, in as many steps as it takes."""
        own = frozen(se2.twist_of(self.plate_in_frame, numbers(twist, "twist")), (3,), "twist")
        if not (np.abs(own).max() * duration <= FARTHEST and duration >= 0.0):
            raise PushplanError(f"a move of {own} for {duration} s; allowed: {FARTHEST:g} m, and time that goes on")
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

    def _pushed(self, twist: FloatArray, duration: float, count: int) -> FloatArray:
        """Move on with the plate frame at a twist (3,); return the wrenches (count, 3) that the plate pushes with.

        Time steps are the engine's; where they do not fill the time, the plate moves that much faster.
        """
        model, dof = self._model, int(self._model.dofs[-1])
        poses = se2.compose(self._plate, se2.exp(twist * (duration / count * np.arange(count + 1))[:, None]))
        ways = joint_coordinates(model.anchors[-1], _motions(poses, self._begin[-1]))
        ways[:, 2] = np.unwrap(ways[:, 2])
        speeds = np.diff(ways, axis=0) / self._settings.time_step
        position, velocity = model.data.qpos[dof : dof + 3], model.data.qvel[dof : dof + 3]  # views
        forces, last = np.empty((count, 3)), count
        for i in range(count):
            now = min(i, last)
            position[:], velocity[:] = ways[now], speeds[now] if i < last else 0.0
            model.step()
            self._transfer.follow(model)
            forces[i] = model.data.qfrc_constraint[dof : dof + 3]  # on the plate, about its middle
            if self._meter.exceeded(*forces[i, :2]) and not self.stalled and twist.any():
                self.stalled, self._against, last = True, twist, i + 1
        model.require_sound()
        self._plate = np.asarray(poses[last])
        self._put(np.array([len(self._outlines)]), poses[last : last + 1])
        into = self.plate_in_frame
        force = -se2.rotate(into[2] - poses[:-1, 2], forces[:, :2])
        moment = -forces[:, 2] + into[0] * force[:, 1] - into[1] * force[:, 0]
        return np.column_stack([force, moment])

    def _put(self, bodies: IntArray, poses: FloatArray) -> None:
        """Put bodies at poses (k, 3) in the world, at rest."""
        model = self._model
        places = model.dofs[bodies, None] + np.arange(3)
        model.data.qpos[places] = joint_coordinates(model.anchors[bodies], _motions(poses, self._begin[bodies]))
        model.data.qvel[places] = 0.0

    def _rests(self) -> bool:
        places = self._model.dofs[:-1, None] + np.arange(3)
        return bool(np.abs(self._model.data.qvel[places]).max() < RESTING)

    def _far(self) -> bool:
        """Tell whether plate and robot are away from all objects."""
        moving = [shapely.Polygon(se2.transform_points(self._plate, part)) for part in self._carried]
        standing = [
            shapely.Polygon(se2.transform_points(pose, outline))
            for pose, outline in zip(self.object_poses, self._outlines, strict=True)
        ]
        return float(shapely.distance(shapely.union_all(moving), standing).min()) > FAR


def _motions(poses: FloatArray, begin: FloatArray) -> FloatArray:
    """Return how bodies that began at `begin` have moved, as `PhysicsModel.motions`."""
    return np.asarray(se2.compose(poses, se2.inverse(begin)))


def _model(
    world: World,
    begin: FloatArray,
    objects: Sequence[PushedObject],
    pieces: Sequence[Piece],
    pairs: Sequence[Pair],
    settings: PhysicsSettings,
) -> PhysicsModel:
    """Return the model of all bodies where they are at first (n + 1, 3), the plate last."""
    spec, dt, pusher = engine().MjSpec(), settings.time_step, world.chain.pusher
    set_options(spec, dt, settings)
    add_floor(spec)
    there = [replace(obj, pose_chain=pose) for obj, pose in zip(objects, begin[:-1], strict=True)]
    bodies = [add_planar(spec, f"object{i}", *inertia_of(obj)) for i, obj in enumerate(there)]
    mass = PLATE_MASS * sum(obj.mass for obj in objects)
    bodies.append(add_planar(spec, "plate", mass, begin[-1, :2], mass))
    speed = max(pusher.limits.both("speed")) + world.chain.reach * max(pusher.limits.both("angular_speed"))
    lift = settings.softness * speed / dt
    standing = tuple(
        stand(spec, body, obj, feet_of(obj.support, settings.degree), lift * obj.floor_friction, dt)
        for body, obj in zip(bodies, there, strict=False)
    )
    poses = [*begin, np.zeros(3)]
    balls: list[list[str]] = [[] for _ in poses]
    for number, outline in _outlines(world, objects):
        body = bodies[number] if number < len(bodies) else spec.worldbody
        at = se2.transform_points(poses[number], outline) - np.asarray(body.pos)[:2]
        for middle, radius in _corners(at):
            balls[number].append(f"body{number}/{len(balls[number])}")
            _add_ball(body, balls[number][-1], middle, radius)
    for k, piece in enumerate(pieces):
        body = bodies[piece.body] if piece.body < len(bodies) else spec.worldbody
        at = se2.transform_points(poses[piece.body], piece.corners) - np.asarray(body.pos)[:2]
        _add_solid(spec, body, f"piece{k}", at, piece.rounding)
        if len(at) == 1:
            balls[piece.body].append(f"piece{k}")
    frictions = {
        (f"piece{solid}", ball): pair.friction
        for pair in pairs
        for solid, other in ((pair.a, pair.b), (pair.b, pair.a))
        for ball in balls[pieces[other].body]
    }
    impedance = impedance_of(objects, dt, settings.indentation * world.chain.characteristic_length)
    for (solid, ball), friction in frictions.items():
        add_pair(spec, solid, ball, friction, dt, impedance, settings.slip_time)
    return compiled(spec, bodies, standing)


def _outlines(world: World, objects: Sequence[PushedObject]) -> Iterator[tuple[int, FloatArray]]:
    """Yield number and outline of all bodies, in their frames, as `packing.bodies_of` numbers them."""
    pusher, n = world.chain.pusher, len(objects)
    yield from ((i, obj.outline) for i, obj in enumerate(objects))
    for part in (pusher.outline, *pusher.footprint):
        yield n, se2.transform_points(se2.inverse(pusher.plate_pose), part)
    for obstacle in world.obstacles:
        if not isinstance(obstacle, CircleObstacle):
            yield n + 1, obstacle.outline


def _corners(at: FloatArray) -> Iterator[tuple[FloatArray, float]]:
    """Yield middles (2,) and radii of balls in the convex corners of an outline (k, 2)."""
    edges = np.roll(at, -1, axis=0) - at
    lengths = np.linalg.norm(edges, axis=1)
    along, least = edges / lengths[:, None], float(lengths.min())
    for corner, before, after in zip(at, np.roll(along, 1, axis=0), along, strict=True):
        sine = float(before[0] * after[1] - before[1] * after[0])
        if sine > SHARP:
            yield corner + CORNER * least * (after - before) / sine, (CORNER + OVERLAP) * least


def _add_ball(body: Any, name: str, middle: FloatArray, radius: float) -> None:
    body.add_geom(
        name=name,
        type=engine().mjtGeom.mjGEOM_SPHERE,
        size=[radius, 0.0, 0.0],
        pos=[*middle, 0.0],
        contype=0,
        conaffinity=0,
    )


def _add_solid(spec: Any, body: Any, name: str, at: FloatArray, rounding: float) -> None:
    """Add the whole of a piece with corners (k, 2): a disc, a wall, a box or a prism."""
    kinds = engine().mjtGeom
    if len(at) == 1:
        _add_ball(body, name, at[0], rounding)
        return
    edge = at[1] - at[0]
    length = float(np.linalg.norm(edge))
    common = {"name": name, "contype": 0, "conaffinity": 0}
    if len(at) == 2:  # a wall: its outside is to the right of the edge
        x, y = edge[1] / length, -edge[0] / length
        half = np.sqrt(0.5)  # a plane's z axis is its outside: a quarter turn about (-y, x, 0)
        middle = [*(0.5 * (at[0] + at[1])), 0.0]
        body.add_geom(
            type=kinds.mjGEOM_PLANE, size=[1.0, 1.0, 1.0], pos=middle, quat=[half, -half * y, half * x, 0.0], **common
        )
        return
    square = len(at) == 4 and np.allclose(at[0] + at[2], at[1] + at[3], atol=1e-12)
    side = at[-1] - at[0]
    if square and abs(float(edge @ side)) < 1e-12:
        turn = 0.5 * float(np.arctan2(edge[1], edge[0]))
        body.add_geom(
            type=kinds.mjGEOM_BOX,
            size=[0.5 * length, 0.5 * float(np.linalg.norm(side)), TALL],
            pos=[*at.mean(axis=0), 0.0],
            quat=[np.cos(turn), 0.0, 0.0, np.sin(turn)],
            **common,
        )
        return
    corners = np.vstack([np.column_stack([at, np.full(len(at), z)]) for z in (-TALL, TALL)])
    spec.add_mesh(name=name, uservert=corners.ravel())
    body.add_geom(type=kinds.mjGEOM_MESH, meshname=name, **common | {"contype": 1})  # else it gets no hull
