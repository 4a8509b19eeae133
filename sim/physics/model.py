"""Model of bodies on the floor in the physics engine: n objects, then the plate, in a frame of the caller's choice.

A body only slides along x and y and turns about z, so its feet and its contacts do not affect one another. A foot is
a piston: it slides vertically in its body, and a constant force presses it on the floor, so it always carries exactly
its load. Bodies consist of the same convex pieces as in the slip simulator. Every convex corner of an outline has a
tiny sphere that touches all pieces of the other bodies. Objects can therefore touch on any side, separate and meet
again, and the normals of faces are exact.

Contact forces at a height h shift the load of an object from foot to foot: friction F on the object needs a moment
-h F from the floor. The loads on the feet change by -k_i x_i . S^-1 h F, with their stiffnesses k_i and
S = sum_i k_i x_i x_i^T about the stiffness centre, as for a rigid object on springs. Inertial forces are assumed to
act at this height, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pushplan.geometry.se2 import rotate, transform_points
from pushplan.mechanics.chain import GRAVITY, PushedObject, inertia_of
from pushplan.mechanics.packed import pack_object
from pushplan.sim.physics.engine import ForceMeter, PhysicsError, PhysicsSettings, engine
from pushplan.slip.feet import Feet, feet_of
from pushplan.slip.packing import Bodies, bodies_of, push_heights
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray, IntArray

FLOOR = "floor"

_FOOT_MASS = 1e-6
"""Mass of a foot over that of its object."""
_FOOT_RADIUS = 1e-3
_PISTON = 0.1
"""Inertia of a foot's vertical motion times the compliance of its contact with the floor; this is well damped."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Feet of an object on the floor.

    Attributes:
        names: Names of the feet, which their bodies, joints, geoms and contacts share.
        feet: Feet in the object's own frame.
        heading: Initial heading of the object's frame, rad.
        loads: Loads on the feet at rest, N, (k,).
        compliances: Compliances of their contacts with the floor, 1/kg, (k,).
    """

    names: tuple[str, ...]
    feet: Feet
    heading: float
    loads: FloatArray
    compliances: FloatArray

    def load(self, model: Any, data: Any, loads: FloatArray) -> None:
        """Press the feet on the floor with `loads` (k,), N."""
        for name, force in zip(self.names, loads, strict=True):
            data.qfrc_applied[model.joint(name).dofadr] = -force

    def soften(self, model: Any) -> None:
        """Set the compliances of the feet's contacts with the floor.

        In the engine, the compliance of a contact with impedance d is (1 - d) / d times an estimate of the bodies'
        inverse inertia.
        """
        for name, compliance in zip(self.names, self.compliances, strict=True):
            mobility = float(model.body_invweight0[model.body(name).id, 0])
            model.pair_solimp[model.pair(name).id, :2] = 1.0 / (1.0 + compliance / mobility)

    def shift(self, turned: float, moment: FloatArray) -> FloatArray:
        """Return the change of the loads, N, by a moment (2,) on an object that has turned by `turned`, rad."""
        positions, stiffness = self.feet.positions, self.feet.stiffness
        offsets = rotate(self.heading + turned, positions - stiffness @ positions)
        second = (offsets * stiffness[:, None]).T @ offsets
        return np.asarray(stiffness * (offsets @ np.linalg.solve(second, moment)))


def _add_planar(spec: Any, name: str, mass: float, anchor: FloatArray, moment: float) -> Any:
    """Return a new body with joints along x, along y and about z through `anchor` (2,)."""
    joint = engine().mjtJoint
    body = spec.worldbody.add_body(name=name, pos=[*anchor, 0.0])
    body.explicitinertial = True
    body.mass, body.inertia, body.ipos = mass, [moment] * 3, [0.0] * 3  # otherwise ipos is taken from pos
    body.add_joint(name=name, type=joint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
    body.add_joint(type=joint.mjJNT_SLIDE, axis=[0.0, 1.0, 0.0])
    body.add_joint(type=joint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
    return body


def _stand(spec: Any, body: Any, obj: PushedObject, feet: Feet, lift: float, dt: float) -> Standing:
    """Put feet under an object.

    Args:
        spec: Specification of the model.
        body: Body of the object in the model.
        obj: Object.
        feet: Feet of the object.
        lift: Acceleration that the contact model can add to a sliding foot, m/s^2. A softer foot takes more of it up
            by compression, where it does no harm.
        dt: Time step, s.
    """
    loads = obj.mass * GRAVITY * feet.fractions
    compliances = lift / loads
    heading = float(obj.pose_chain[2])
    offsets = rotate(heading, feet.positions - obj.support.center)
    names = tuple(f"{body.name}/foot{j}" for j in range(len(loads)))
    for name, offset, compliance in zip(names, offsets, compliances, strict=True):
        _add_foot(body, name, offset, obj.mass, _PISTON / compliance)
        pair = spec.add_pair(name=name, geomname1=FLOOR, geomname2=name, condim=3)
        pair.friction = [obj.floor_friction, obj.floor_friction, 0.0, 0.0, 0.0]
        pair.solref = pair.solreffriction = [2.0 * dt, 1.0]
    return Standing(names, feet, heading, loads, compliances)


def _add_foot(body: Any, name: str, offset: FloatArray, mass: float, armature: float) -> None:
    mujoco = engine()
    foot = body.add_body(name=name, pos=[*offset, 0.0])
    foot.explicitinertial = True
    foot.mass, foot.inertia, foot.ipos = (_FOOT_MASS * mass, [_FOOT_MASS * mass * _FOOT_RADIUS**2] * 3, [0.0] * 3)
    foot.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0], armature=armature)
    foot.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[_FOOT_RADIUS, 0.0, 0.0],
        pos=[0.0, 0.0, _FOOT_RADIUS],
        contype=0,
        conaffinity=0,
    )


_CORNER = 2e-3
"""Radius of a corner over the length of the body's shortest edge."""
_OVERLAP = 1e-8
"""Initial depth of corners in faces, over the same length, so that they touch from the start."""
_SHARP = 1e-3
"""Smallest sine of the turn at a corner."""
_TALL = 0.1
"""Half the height of all pieces, m; contacts are at half height."""
_SOFTEST = 0.3
"""Largest compliance of the contacts times an object's mass; softer contacts would oscillate."""


def _add_contacts(
    spec: Any,
    bodies: Sequence[Any],
    poses: Sequence[FloatArray],
    parts: Bodies,
    dt: float,
    indentation: float,
    slip_time: float,
) -> None:
    """Add the geometry and the contact pairs of all bodies.

    Args:
        spec: Specification of the model.
        bodies: Bodies of the objects, of the plate, and of the fixed world.
        poses: Poses of their frames in the frame of the model, each (3,).
        parts: Outlines and pieces of the bodies, and the pairs of pieces that can touch.
        dt: Time step, s.
        indentation: Depth to which a corner sinks into a face under the friction of one object, m. The engine's
            convex contact model would lift a sliding corner again and again if it did not sink in.
        slip_time: Ratio of time constants in `PhysicsSettings`.
    """
    balls: list[list[str]] = [[] for _ in bodies]

    def placed(number: int, points: FloatArray) -> FloatArray:
        return np.asarray(transform_points(poses[number], points) - bodies[number].pos[:2])

    for number, outline in parts.outlines:
        for middle, radius in _corners(placed(number, outline)):
            balls[number].append(f"body{number}/{len(balls[number])}")
            _add_ball(bodies[number], balls[number][-1], middle, radius)
    for k, piece in enumerate(parts.pieces):
        _add_solid(spec, bodies[piece.body], f"piece{k}", placed(piece.body, piece.corners), piece.rounding)
        if len(piece.corners) == 1:
            balls[piece.body].append(f"piece{k}")
    friction = max(obj.floor_friction for obj in parts.objects)
    impedance = 1.0 / (1.0 + min(indentation / (4.0 * dt**2 * friction * GRAVITY), _SOFTEST))
    frictions = {
        (f"piece{solid}", ball): pair.friction
        for pair in parts.pairs
        for solid, other in ((pair.a, pair.b), (pair.b, pair.a))
        for ball in balls[parts.pieces[other].body]
    }
    for (solid, ball), mu in frictions.items():
        pair = spec.add_pair(geomname1=solid, geomname2=ball, condim=3)
        pair.friction = [mu, mu, 0.0, 0.0, 0.0]
        pair.solref, pair.solreffriction = [2.0 * dt, 1.0], [2.0 * dt * slip_time, 1.0]
        pair.solimp = [impedance, impedance, 1e-3, 0.5, 2.0]


def _corners(at: FloatArray) -> Iterator[tuple[FloatArray, float]]:
    """Yield centres (2,) and radii of balls in the convex corners of an outline (k, 2)."""
    edges = np.roll(at, -1, axis=0) - at
    lengths = np.linalg.norm(edges, axis=1)
    along, least = edges / lengths[:, None], float(lengths.min())
    for corner, before, after in zip(at, np.roll(along, 1, axis=0), along, strict=True):
        sine = float(before[0] * after[1] - before[1] * after[0])
        if sine > _SHARP:
            yield corner + _CORNER * least * (after - before) / sine, (_CORNER + _OVERLAP) * least


def _add_ball(body: Any, name: str, middle: FloatArray, radius: float) -> None:
    kind = engine().mjtGeom.mjGEOM_SPHERE
    body.add_geom(name=name, type=kind, size=[radius, 0.0, 0.0], pos=[*middle, 0.0], contype=0, conaffinity=0)


def _add_solid(spec: Any, body: Any, name: str, at: FloatArray, rounding: float) -> None:
    """Add a piece with corners (k, 2): a disc, a wall, a box or a prism."""
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
            size=[0.5 * length, 0.5 * float(np.linalg.norm(side)), _TALL],
            pos=[*at.mean(axis=0), 0.0],
            quat=[np.cos(turn), 0.0, 0.0, np.sin(turn)],
            **common,
        )
        return
    corners = np.vstack([np.column_stack([at, np.full(len(at), z)]) for z in (-_TALL, _TALL)])
    spec.add_mesh(name=name, uservert=corners.ravel())
    body.add_geom(type=kinds.mjGEOM_MESH, meshname=name, **common | {"contype": 1})  # a contype of 0 gives no hull


_PLATE_MASS = 1e8
"""Mass of the plate over that of all objects, so large that no contact slows the plate down."""
_FOLLOWING = 0.3
"""Share of a force change that the loads on the feet follow in one time step."""
_ITERATIONS, _LINE_SEARCHES, _PRECISION = 50, 500, 1e-12
"""Limits and tolerance of the solver. With less, it sometimes stops early, and a held contact slips for one step."""


@dataclass(frozen=True, eq=False)
class PhysicsModel:
    """Model and state of the engine, with the indices of its bodies.

    Attributes:
        model: Model of the engine.
        data: State of the engine.
        anchors: Points about which the bodies turn, in the frame of the model, m, (n + 1, 2).
        dofs: Index of the first of the three degrees of freedom (x, y, theta) of each body, (n + 1,).
        standing: Feet of each object; None without floor friction.
        heights: Heights at which the objects are pushed, m, (n,).
        friction: Filtered floor friction on each object, N, (n, 2), which sets the loads on the feet; changes in
            every step.
    """

    model: Any
    data: Any
    anchors: FloatArray
    dofs: IntArray
    standing: tuple[Standing | None, ...]
    heights: FloatArray
    friction: FloatArray

    def step(self) -> None:
        """Advance the engine by one time step, and shift the loads on the feet by the floor friction."""
        engine().mj_step(self.model, self.data)
        if self.heights.any():
            self.friction[:] += _FOLLOWING * (self.floor_forces() - self.friction)
            turned = self.motions()[:, 2]
            for i, standing in enumerate(self.standing):
                if standing is not None:
                    shift = standing.shift(float(turned[i]), -self.heights[i] * self.friction[i])
                    standing.load(self.model, self.data, standing.loads + shift)

    def march(self, motions: FloatArray, meter: ForceMeter | None = None) -> tuple[FloatArray, bool]:
        """Move the plate through motions (m + 1, 3), one time step between two.

        Args:
            motions: Motions of the plate, as in `motions`.
            meter: Force meter that ends the motion at its limit; None for no limit.

        Returns:
            Force and moment of the bodies on the plate in each executed step, (k, 3), about its anchor in the axes of
            the model; and whether the meter has ended the motion.
        """
        plate = int(self.dofs[-1])
        ways = joint_coordinates(self.anchors[-1], motions)
        ways[:, 2] = np.unwrap(ways[:, 2])
        speeds = np.diff(ways, axis=0) / self.model.opt.timestep
        position, velocity = self.data.qpos[plate : plate + 3], self.data.qvel[plate : plate + 3]  # views
        force, forces, stalled = self.data.qfrc_constraint[plate : plate + 3], np.zeros((len(speeds), 3)), False
        done = 0
        while done < len(speeds) and not stalled:
            position[:], velocity[:] = ways[done], speeds[done]
            self.step()
            forces[done] = force
            stalled = meter is not None and meter.exceeded(*force[:2])
            done += 1
        position[:] = ways[done]
        return forces[:done], stalled

    def require_sound(self) -> None:
        """Raise PhysicsError if the engine has issued warnings or a coordinate is not finite."""
        complaints = int(self.data.warning.number.sum())
        if complaints or not np.isfinite(self.data.qpos).all():
            raise PhysicsError(
                f"the simulation diverged after {self.data.time:.3g} s: {complaints} warnings of the engine; "
                f"try a smaller `step` or `time_step`"
            )

    def motions(self) -> FloatArray:
        """Return the motions of the bodies (n + 1, 3): poses of body-fixed frames that start as the chain frame."""
        moved = self.data.qpos[self.dofs[:, None] + np.arange(3)]
        places = self.anchors + moved[:, :2] - rotate(moved[:, 2], self.anchors)
        return np.column_stack([places, moved[:, 2]])

    def floor_forces(self) -> FloatArray:
        """Return the floor friction (n, 2) on each object in the last time step, N."""
        data, model = self.data, self.model
        geoms = np.asarray(data.contact.geom)
        floor = geoms[:, 0] == model.geom(FLOOR).id
        frames = np.asarray(data.contact.frame)[floor].reshape(-1, 3, 3)
        rows = np.asarray(data.contact.efc_address)[floor, None] + np.arange(3)
        pushes = np.einsum("ci,cij->cj", data.efc_force[rows], frames)[:, :2]
        roots = model.body_rootid[model.geom_bodyid[geoms[floor, 1]]]
        total = np.zeros((len(self.standing), 2))
        np.add.at(total, np.searchsorted(model.dof_bodyid[self.dofs], roots), pushes)
        return total


def joint_coordinates(anchors: FloatArray, motions: FloatArray) -> FloatArray:
    """Return the joint coordinates (..., 3) of bodies with `anchors` (..., 2) after `motions` (..., 3)."""
    shift = motions[..., :2] + rotate(motions[..., 2], anchors) - anchors
    turn = np.broadcast_to(motions[..., 2], shift.shape[:-1])
    return np.concatenate([shift, turn[..., None]], axis=-1)


def build_model(world: World, begin: FloatArray, sliding: float, settings: PhysicsSettings) -> PhysicsModel:
    """Return the model of a world, in the frame of the poses `begin`.

    Args:
        world: Objects with known loads, and obstacles.
        begin: Initial poses of the objects and of the plate frame, (n + 1, 3).
        sliding: Largest sliding speed of a foot, m/s.
        settings: Settings of the simulation.

    Raises:
        MissingExtraError: If the engine is not installed.
        SupportError: If a load is not known, or the push at the contact height could lift a part of an object.
    """
    spec, dt = engine().MjSpec(), settings.time_step
    _set_options(spec, settings)
    plane = engine().mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name=FLOOR, type=plane, size=[1.0, 1.0, 1.0], contype=0, conaffinity=0)
    parts = bodies_of(world)
    objects, heights = parts.objects, push_heights(world.chain, parts.objects)
    for obj, height in zip(objects, heights, strict=True):
        pack_object(obj, float(height))  # raises SupportError if the push would lift the object
    there = [replace(obj, pose_chain=pose) for obj, pose in zip(objects, begin[:-1], strict=True)]
    bodies = [_add_planar(spec, f"object{i}", *inertia_of(obj)) for i, obj in enumerate(there)]
    mass = _PLATE_MASS * sum(obj.mass for obj in objects)
    bodies.append(_add_planar(spec, "plate", mass, begin[-1, :2], mass))
    lift = settings.softness * sliding / dt
    standing = tuple(
        _stand(spec, body, obj, feet_of(obj.support, settings.degree), lift * obj.floor_friction, dt)
        if obj.floor_friction > 0.0
        else None
        for body, obj in zip(bodies, there, strict=False)
    )
    sinks = settings.indentation * world.chain.characteristic_length
    _add_contacts(spec, [*bodies, spec.worldbody], [*begin, np.zeros(3)], parts, dt, sinks, settings.slip_time)
    model = spec.compile()
    data = engine().MjData(model)
    for each in standing:
        if each is not None:
            each.soften(model)
            each.load(model, data, each.loads)
    dofs = [int(model.jnt_dofadr[model.joint(body.name).id]) for body in bodies]
    anchors = np.array([body.pos[:2] for body in bodies])
    places, friction = np.array(dofs, dtype=np.int64), np.zeros((len(objects), 2))
    return PhysicsModel(model, data, anchors, places, standing, heights, friction)


def _set_options(spec: Any, settings: PhysicsSettings) -> None:
    """Set the engine's options."""
    mujoco = engine()
    option = spec.option
    option.timestep = settings.time_step
    option.gravity = [0.0, 0.0, 0.0]  # the loads on the feet are forces
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = settings.friction_stiffness
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations, option.ls_iterations = _ITERATIONS, _LINE_SEARCHES
    option.tolerance = _PRECISION / _PLATE_MASS  # the engine scales by the mean inertia, which is the plate's
