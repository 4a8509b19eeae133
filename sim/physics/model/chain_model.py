"""A chain as a model of the physics engine, in the chain frame at the start: the n objects, then the plate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.inertia import inertia_of
from pushplan.sim.physics.model.bodies import FLOOR, Standing, add_floor, add_planar, stand
from pushplan.sim.physics.model.contacts import add_contacts
from pushplan.sim.physics.model.engine import PhysicsError, engine
from pushplan.sim.physics.model.feet import feet_of
from pushplan.sim.physics.model.settings import PhysicsSettings
from pushplan.util.arrays import FloatArray, IntArray

_PLATE_MASS = 1e8
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
    mujoco = engine()
    feet = [feet_of(obj.support, settings.degree) for obj in chain.objects]
    spec = mujoco.MjSpec()
    _set_options(mujoco, spec, dt, settings)
    add_floor(spec)
    bodies = [add_planar(spec, f"object{i}", *inertia_of(obj)) for i, obj in enumerate(chain.objects)]
    total = sum(obj.mass for obj in chain.objects)
    bodies.append(add_planar(spec, "plate", _PLATE_MASS * total, np.zeros(2), _PLATE_MASS * total))
    lift = settings.softness * sliding / dt
    standing = tuple(
        stand(spec, body, obj, each, lift * obj.floor_friction, dt) if obj.floor_friction > 0.0 else None
        for body, obj, each in zip(bodies[:-1], chain.objects, feet, strict=True)
    )
    indentation = settings.indentation * chain.characteristic_length
    add_contacts(spec, chain, bodies, dt, indentation, settings.slip_time)
    model = spec.compile()
    data = mujoco.MjData(model)
    for each in standing:
        if each is not None:
            each.soften(model)
            each.load(model, data, each.loads)
    dofs = [int(model.jnt_dofadr[model.joint(body.name).id]) for body in bodies]
    anchors = np.array([body.pos[:2] for body in bodies])
    return PhysicsModel(model, data, anchors, np.array(dofs, dtype=np.int64), standing)


def _set_options(mujoco: Any, spec: Any, dt: float, settings: PhysicsSettings) -> None:
    option = spec.option
    option.timestep = dt
    option.gravity = [0.0, 0.0, 0.0]  # the loads on the feet are forces
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = settings.friction_stiffness
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations, option.ls_iterations = _ITERATIONS, _LINE_SEARCHES
    option.tolerance = _PRECISION / _PLATE_MASS  # the engine measures with the mean inertia, so the plate's
