"""The contacts of a physics model: corners that meet faces.

Of the two edges that meet in a contact, each end is a corner, a tiny sphere that touches the flat face along the
other edge. So a contact can slide and open in every way that two edges can, and its normal is exact.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pushplan.mechanics.chain import GRAVITY, PLATE, Chain, Contact
from pushplan.sim.physics.model.contact_edges import edge_extent
from pushplan.sim.physics.model.engine import engine
from pushplan.util.arrays import FloatArray

_CORNER = 2e-3
"""Radius of a corner over the length of the contact segment."""
_OVERLAP = 1e-8
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
    friction = max(obj.floor_friction for obj in chain.objects)
    compliance = min(indentation / (4.0 * dt**2 * friction * GRAVITY), _SOFTEST)
    impedance = 1.0 / (1.0 + compliance)
    for k, contact in enumerate(chain.contacts):
        for own, other, side in (
            (contact.pushed, contact.pusher, 1.0),
            (contact.pusher, contact.pushed, -1.0),
        ):
            face = f"contact{k}/face{other}"
            _add_face(bodies[other], face, contact, edge_extent(contact, _outline(chain, other)), -side)
            for end, place in enumerate(edge_extent(contact, _outline(chain, own))):
                corner = f"contact{k}/corner{own}.{end}"
                _add_corner(bodies[own], corner, contact, place, side)
                _add_pair(spec, face, corner, contact.friction, dt, impedance, slip_time)


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
    radius = _CORNER * contact.length
    point = contact.right + place * contact.tangent + side * radius * contact.normal
    body.add_geom(
        name=name,
        type=engine().mjtGeom.mjGEOM_SPHERE,
        size=[radius + _OVERLAP * contact.length, 0.0, 0.0],
        pos=[*(point - body.pos[:2]), 0.0],
        contype=0,
        conaffinity=0,
    )


def _add_pair(
    spec: Any, face: str, corner: str, friction: float, dt: float, impedance: float, slip_time: float
) -> None:
    pair = spec.add_pair(geomname1=face, geomname2=corner, condim=3)
    pair.friction = [friction, friction, 0.0, 0.0, 0.0]
    pair.solref, pair.solreffriction = [2.0 * dt, 1.0], [2.0 * dt * slip_time, 1.0]
    pair.solimp = [impedance, impedance, 1e-3, 0.5, 2.0]
