"""The bodies of a physics model: planar objects that stand on pistons, and the heavy plate that is driven.

A body slides along x and y and turns about z, nothing else, so that its feet and its contacts cannot disturb one
another. A foot is a piston: it slides up and down in its body and a constant force presses it on the floor, so that
it carries exactly its load whatever its neighbours do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import GRAVITY, PushedObject
from pushplan.sim.physics.model.engine import engine
from pushplan.sim.physics.model.feet import Feet
from pushplan.util.arrays import FloatArray

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
    foot.mass, foot.inertia, foot.ipos = (
        _FOOT_MASS * mass,
        [_FOOT_MASS * mass * _FOOT_RADIUS**2] * 3,
        [0.0] * 3,
    )
    foot.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0], armature=armature)
    foot.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[_FOOT_RADIUS, 0.0, 0.0],
        pos=[0.0, 0.0, _FOOT_RADIUS],
        contype=0,
        conaffinity=0,
    )
