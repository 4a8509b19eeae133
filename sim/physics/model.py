"""A chain as a model of the physics engine, in the chain frame at the start: the n objects, then the plate.

A body slides along x and y and turns about z, nothing else, so that its feet and its contacts cannot disturb one
another. A foot is a piston: it slides up and down in its body and a constant force presses it on the floor, so that
it carries exactly its load whatever its neighbours do. Of the two edges that meet in a contact, each end is a corner,
a tiny sphere that touches the flat face along the other edge. So a contact can slide and open in every way that two
edges can, and its normal is exact.

Contact forces at a height shift the load of an object from foot to foot: friction F on it asks the floor for the
moment -h F when the forces that overcome it act at height h. The loads on the feet change by -k_i x_i . S^-1 h F,
with their stiffnesses k_i and S = sum_i k_i x_i x_i^T about the centre of these, as under a stiff object on springs.
Inertial forces are taken to act at that height as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import GRAVITY, PLATE, Chain, Contact, PushedObject, inertia_of
from pushplan.mechanics.packed import pack_object
from pushplan.sim.feet import Feet, feet_of
from pushplan.sim.physics.engine import PhysicsError, PhysicsSettings, engine
from pushplan.util.arrays import FloatArray, IntArray

FLOOR = "floor"

_FOOT_MASS = 1e-6
"""Mass of a foot over that of its object."""
_FOOT_RADIUS = 1e-3
_PISTON = 0.1
"""Inertia of a foot's vertical motion times the compliance of its contact with the floor: well damped."""


@dataclass(frozen=True, eq=False)
class Standing:
    """How an object stands on the floor.

    Attributes:
        names: Of its feet: of their bodies, joints, geoms and contacts alike.
        feet: Where they are, in the object's own frame.
        heading: Of the object's frame at the start, rad.
        loads: (k,) on the feet while nothing is pushed, N.
        compliances: (k,) of their contacts with the floor, 1/kg.
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
        """Give the feet's contacts with the floor their compliances.

        The engine takes a contact's compliance as (1 - d) / d times an estimate of the bodies' inverse inertia, d
        being its impedance.
        """
        for name, compliance in zip(self.names, self.compliances, strict=True):
            mobility = float(model.body_invweight0[model.body(name).id, 0])
            model.pair_solimp[model.pair(name).id, :2] = 1.0 / (1.0 + compliance / mobility)


def add_planar(spec: Any, name: str, mass: float, anchor: FloatArray, moment: float) -> Any:
    """Return a new body with joints along x, along y and about z through `anchor` (2,)."""
    joint = engine().mjtJoint
    body = spec.worldbody.add_body(name=name, pos=[*anchor, 0.0])
    body.explicitinertial = True
    body.mass, body.inertia, body.ipos = mass, [moment] * 3, [0.0] * 3  # otherwise ipos is taken from pos
    body.add_joint(name=name, type=joint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
    body.add_joint(type=joint.mjJNT_SLIDE, axis=[0.0, 1.0, 0.0])
    body.add_joint(type=joint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
    return body


def add_floor(spec: Any) -> None:
    """Add the floor."""
    plane = engine().mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name=FLOOR, type=plane, size=[1.0, 1.0, 1.0], contype=0, conaffinity=0)


def stand(spec: Any, body: Any, obj: PushedObject, feet: Feet, lift: float, dt: float) -> Standing:
    """Put feet under an object.

    Args:
        spec: The model.
        body: The object's body in it.
        obj: The object.
        feet: Its feet.
        lift: Acceleration that the contact model may add to a sliding foot, m/s^2; the softer a foot, the more of
            it goes into compressing its contact, where it does no harm.
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


_ON_LINE = 1e-6
"""Distance from the contact's line within which a corner belongs to it, m."""


def edge_extent(contact: Contact, outline: FloatArray) -> tuple[float, float]:
    """Return how far a body's edge reaches along the contact: (right, left) end as coordinates of its tangent, m.

    The coordinate is 0 at the right end of the segment and its length at the left end. Where the body has no
    edge under the whole segment, the segment itself is the edge.

    Args:
        contact: In the same frame as the outline.
        outline: (v, 2) corners of the body, m.
    """
    offsets = outline - contact.right
    along, across = offsets @ contact.tangent, offsets @ contact.normal
    on_line = np.abs(across) < _ON_LINE
    edges = on_line & np.roll(on_line, -1)
    spans = np.sort(np.stack([along, np.roll(along, -1)], axis=1)[edges], axis=1)
    low, high = 0.0, contact.length
    for begin, end in np.tile(spans, (len(spans), 1)):  # again and again: an edge may be cut into many
        if begin <= high + _ON_LINE and end >= low - _ON_LINE:
            low, high = min(low, float(begin)), max(high, float(end))
    return low, high


CORNER = 2e-3
"""Radius of a corner over the length of the contact segment."""
OVERLAP = 1e-8
"""How deep corners reach into faces, over the length of the segment, so that they touch from the start."""
_SOFTEST = 0.3
"""Compliance of the contacts times an object's mass, at most: softer ones would swing."""
_THICKNESS = 0.05
"""Half the thickness of a face over the length of the segment."""


def add_contacts(
    spec: Any, chain: Chain, bodies: list[Any], dt: float, indentation: float, slip_time: float = 1.0
) -> None:
    """Add what touches in all contacts of a chain.

    Args:
        spec: The model.
        chain: The chain.
        bodies: The bodies of its objects, then the plate's, so that `bodies[PLATE]` is right.
        dt: Time step, s.
        indentation: How deep a corner may sink into a face under the friction of one object, m. A sliding corner is
            lifted off by the convex contact model of the engine, again and again, if it has not sunk in.
        slip_time: See `PhysicsSettings`.
    """
    impedance = impedance_of(chain.objects, dt, indentation)
    for k, contact in enumerate(chain.contacts):
        for own, other, side in ((contact.pushed, contact.pusher, 1.0), (contact.pusher, contact.pushed, -1.0)):
            face = f"contact{k}/face{other}"
            _add_face(bodies[other], face, contact, edge_extent(contact, _outline(chain, other)), -side)
            for end, place in enumerate(edge_extent(contact, _outline(chain, own))):
                corner = f"contact{k}/corner{own}.{end}"
                _add_corner(bodies[own], corner, contact, place, side)
                add_pair(spec, face, corner, contact.friction, dt, impedance, slip_time)


def impedance_of(objects: Sequence[PushedObject], dt: float, indentation: float) -> float:
    """Return the impedance of contacts in which a corner sinks in that far (m) under the friction of one object."""
    friction = max(obj.floor_friction for obj in objects)
    return 1.0 / (1.0 + min(indentation / (4.0 * dt**2 * friction * GRAVITY), _SOFTEST))


def _outline(chain: Chain, body: int) -> FloatArray:
    return chain.pusher.outline if body == PLATE else chain.objects[body].outline_chain


def _add_face(body: Any, name: str, contact: Contact, extent: tuple[float, float], side: float) -> None:
    """Add the face along a body's edge; `side` is +1 where the body lies ahead of the contact."""
    right, left = extent
    thick = _THICKNESS * contact.length
    middle = contact.right + 0.5 * (right + left) * contact.tangent + side * thick * contact.normal
    turn = 0.5 * float(np.arctan2(contact.normal[1], contact.normal[0]))
    body.add_geom(
        name=name,
        type=engine().mjtGeom.mjGEOM_BOX,
        size=[thick, 0.5 * (left - right), thick],
        pos=[*(middle - body.pos[:2]), 0.0],
        quat=[np.cos(turn), 0.0, 0.0, np.sin(turn)],
        contype=0,
        conaffinity=0,
    )


def _add_corner(body: Any, name: str, contact: Contact, place: float, side: float) -> None:
    """Add the corner at a place along the contact's tangent."""
    radius = CORNER * contact.length
    point = contact.right + place * contact.tangent + side * radius * contact.normal
    body.add_geom(
        name=name,
        type=engine().mjtGeom.mjGEOM_SPHERE,
        size=[radius + OVERLAP * contact.length, 0.0, 0.0],
        pos=[*(point - body.pos[:2]), 0.0],
        contype=0,
        conaffinity=0,
    )


def add_pair(
    spec: Any, face: str, corner: str, friction: float, dt: float, impedance: float, slip_time: float
) -> None:
    """Let a corner touch a face, both named."""
    pair = spec.add_pair(geomname1=face, geomname2=corner, condim=3)
    pair.friction = [friction, friction, 0.0, 0.0, 0.0]
    pair.solref, pair.solreffriction = [2.0 * dt, 1.0], [2.0 * dt * slip_time, 1.0]
    pair.solimp = [impedance, impedance, 1e-3, 0.5, 2.0]


PLATE_MASS = 1e8
"""Mass of the plate over that of all objects: no contact slows it down."""
_CARRIED = 1e8
"""Inertia of a body that is carried along, kg or kg m^2."""
_ITERATIONS, _LINE_SEARCHES, _PRECISION = 50, 500, 1e-12
"""Of the solver. With less it stops early now and then, and a contact that holds slips for one step."""


@dataclass(frozen=True, eq=False)
class PhysicsModel:
    """The engine's model and state, and where to find things in it.

    Attributes:
        model: The engine's model.
        data: Its state.
        anchors: (n + 1, 2) points about which the bodies turn, chain frame at the start, m.
        dofs: (n + 1,) first of the three degrees of freedom (x, y, theta) of each body.
        standing: How each object stands on the floor; None where there is no friction.
    """

    model: Any
    data: Any
    anchors: FloatArray
    dofs: IntArray
    standing: tuple[Standing | None, ...]

    def step(self) -> None:
        """Advance the engine by one time step."""
        engine().mj_step(self.model, self.data)

    def require_sound(self) -> None:
        """Raise PhysicsError if the engine had to complain or anything is not finite."""
        complaints = sum(warning.number for warning in self.data.warning)
        if complaints or not np.isfinite(self.data.qpos).all():
            raise PhysicsError(
                f"the simulation went astray after {self.data.time:.3g} s: {complaints} complaints of the engine; "
                f"try a smaller `step` or `time_step`"
            )

    def carry(self, carried: bool) -> None:
        """Make all bodies so heavy that nothing keeps them from going where they are driven, or end that."""
        places = self.dofs[:, None] + np.arange(3)
        self.model.dof_armature[places] = _CARRIED if carried else 0.0

    def drive(self, bodies: IntArray, begin: FloatArray, end: FloatArray) -> None:
        """Set bodies on their way from one motion to another within one time step.

        Args:
            bodies: (k,) their indices.
            begin: (3,) or (k, 3) how they have moved (see `motions`).
            end: Likewise, after the step.
        """
        anchors = self.anchors[bodies]
        before, after = joint_coordinates(anchors, begin), joint_coordinates(anchors, end)
        places = self.dofs[bodies, None] + np.arange(3)
        self.data.qpos[places] = before
        self.data.qvel[places] = (after - before) / self.model.opt.timestep

    def motions(self) -> FloatArray:
        """Return how each body has moved (n + 1, 3), as the pose of a frame that began as the chain frame."""
        moved = self.data.qpos[self.dofs[:, None] + np.arange(3)]
        places = self.anchors + moved[:, :2] - rotate(moved[:, 2], self.anchors)
        return np.column_stack([places, moved[:, 2]])

    def floor_forces(self) -> FloatArray:
        """Return the friction of the floor (n, 2) on each object in the last time step, N."""
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
    """Return joint coordinates (..., 3) of bodies with `anchors` (..., 2) that have moved by `motions` (..., 3)."""
    shift = motions[..., :2] + rotate(motions[..., 2], anchors) - anchors
    turn = np.broadcast_to(motions[..., 2], shift.shape[:-1])
    return np.concatenate([shift, turn[..., None]], axis=-1)


def build_model(chain: Chain, dt: float, sliding: float, settings: PhysicsSettings) -> PhysicsModel:
    """Return the model of a chain that stands on its feet.

    Args:
        chain: Objects with known loads.
        dt: Time step, s.
        sliding: Greatest speed at which a foot will slide, m/s.
        settings: See there.

    Raises:
        MissingEngineError: When the engine is not installed.
        SupportError: When a load is not known.
    """
    feet = [feet_of(obj.support, settings.degree) for obj in chain.objects]
    spec = engine().MjSpec()
    set_options(spec, dt, settings)
    add_floor(spec)
    bodies = [add_planar(spec, f"object{i}", *inertia_of(obj)) for i, obj in enumerate(chain.objects)]
    total = sum(obj.mass for obj in chain.objects)
    bodies.append(add_planar(spec, "plate", PLATE_MASS * total, np.zeros(2), PLATE_MASS * total))
    lift = settings.softness * sliding / dt
    standing = tuple(
        stand(spec, body, obj, each, lift * obj.floor_friction, dt) if obj.floor_friction > 0.0 else None
        for body, obj, each in zip(bodies[:-1], chain.objects, feet, strict=True)
    )
    indentation = settings.indentation * chain.characteristic_length
    add_contacts(spec, chain, bodies, dt, indentation, settings.slip_time)
    return compiled(spec, bodies, standing)


def compiled(spec: Any, bodies: Sequence[Any], standing: tuple[Standing | None, ...]) -> PhysicsModel:
    """Return the model of `bodies`, the objects and then the plate, that stand on their feet."""
    model = spec.compile()
    data = engine().MjData(model)
    for each in standing:
        if each is not None:
            each.soften(model)
            each.load(model, data, each.loads)
    dofs = [int(model.jnt_dofadr[model.joint(body.name).id]) for body in bodies]
    anchors = np.array([body.pos[:2] for body in bodies])
    return PhysicsModel(model, data, anchors, np.array(dofs, dtype=np.int64), standing)


def set_options(spec: Any, dt: float, settings: PhysicsSettings) -> None:
    """Set the engine's options."""
    mujoco = engine()
    option = spec.option
    option.timestep = dt
    option.gravity = [0.0, 0.0, 0.0]  # the loads on the feet are forces
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = settings.friction_stiffness
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations, option.ls_iterations = _ITERATIONS, _LINE_SEARCHES
    option.tolerance = _PRECISION / PLATE_MASS  # the engine measures with the mean inertia, so the plate's


_FOLLOWING = 0.3
"""Share of a change of force that the loads follow within one time step."""


class LoadTransfer:
    """Keeps the loads on the feet of all objects in balance with the friction that the engine finds under them.

    Raises:
        SupportError: When the push at the contact height could lift a part of an object.
    """

    def __init__(self, objects: Sequence[PushedObject], heights: ArrayLike) -> None:
        self._heights = np.broadcast_to(np.asarray(heights, dtype=np.float64), len(objects))
        for obj, height in zip(objects, self._heights, strict=True):
            pack_object(obj, float(height))  # refuses what would lift
        self._friction = np.zeros((len(objects), 2))

    def follow(self, model: PhysicsModel) -> None:
        """Shift the loads to where the friction of the last time steps wants them."""
        if not self._heights.any():
            return
        self._friction += _FOLLOWING * (model.floor_forces() - self._friction)
        turned = model.motions()[:, 2]
        for i, standing in enumerate(model.standing):
            if standing is not None:
                shift = self._shift(standing, float(turned[i]), -self._heights[i] * self._friction[i])
                standing.load(model.model, model.data, standing.loads + shift)

    def _shift(self, standing: Standing, turned: float, moment: FloatArray) -> FloatArray:
        positions, stiffness = standing.feet.positions, standing.feet.stiffness
        offsets = rotate(standing.heading + turned, positions - stiffness @ positions)
        second = (offsets * stiffness[:, None]).T @ offsets
        return np.asarray(stiffness * (offsets @ np.linalg.solve(second, moment)))
