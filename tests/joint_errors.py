"""Chains with combinations of errors, each built anew from changed objects: what robustness is judged by."""

from dataclasses import replace

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry.polygon import SHORTEST_CONTACT
from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.mechanics.perturb import Motion, aside_slides, displace
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.sim.joint_robustness import ErrorBox
from pushplan.sim.moments import Moments
from pushplan.util.arrays import FloatArray


def leaning(obj: PushedObject, shares: FloatArray) -> Support:
    """Return the load of an object leaning along the chain frame's x and y by (2,) shares at once."""
    support, axes = obj.support, rotate(-float(obj.pose_chain[2]), np.eye(2))
    if isinstance(support, UniformSupport):
        center = support.center
        for axis, share in zip(axes, shares, strict=True):
            center = center + support.leaning(axis, share).center - support.center
        return UniformSupport(support.outline, center)
    positions, fractions, _ = support.point_loads
    about = (positions - fractions @ positions) @ axes.T
    return FeetSupport(positions, fractions * (1.0 + about / np.abs(about).max(axis=0) @ shares))


def one_off(chain: Chain, index: int, aside: float = 0.0, angle: float = 0.0) -> Motion:
    """Return one object aside (m) or turned about its contact's middle (rad), with all others as believed."""
    distances, turns = np.zeros((2, 1, len(chain.objects)))
    distances[0, index], turns[0, index] = aside, angle
    return displace(chain, aside_slides(chain, distances), turns)


def off_by(box: ErrorBox, scale: float, point: FloatArray) -> Chain:
    """Return the chain at a point (n, 6) of the scaled box, contact frictions at their lowest.

    Raises:
        PushplanError: When there is no such chain.
    """
    chain, off = box.chain, scale * point * box.widths
    for k in range(len(chain.objects)):
        moved = one_off(chain, k, aside=float(off[k, 4]))
        if (moved.lengths < SHORTEST_CONTACT).any():
            raise PushplanError("no contact is left")
        chain = moved.applied(chain)
    for k in reversed(range(len(chain.objects))):
        chain = one_off(chain, k, angle=float(off[k, 5])).applied(chain)
    objects = tuple(
        replace(
            there,
            floor_friction=obj.floor_friction * (1.0 + row[0]),
            mass=obj.mass * (1.0 + row[1]),
            support=leaning(obj, row[2:4]),
        )
        for there, obj, row in zip(chain.objects, box.chain.objects, off, strict=True)
    )
    contacts = tuple(
        replace(contact, friction=contact.friction * (1.0 - scale * share))
        for contact, share in zip(chain.contacts, box.contact_friction, strict=True)
    )
    return replace(chain, objects=objects, contacts=contacts)


def least(box: ErrorBox, scale: float, point: FloatArray, moments: Moments) -> float:
    """Return the least margin of that chain at all moments, -1 where there is none."""
    try:
        return float(dynamic_margins(off_by(box, scale, point), moments.twists, moments.rates).min())
    except PushplanError:
        return -1.0
