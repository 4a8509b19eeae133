"""What happens at every contact while the chain is pushed: forces, where they pass, and how far from slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts.contact_kernel import contact_margins_of, wrenches_of
from pushplan.mechanics.directions import directions
from pushplan.mechanics.friction.packed import PackedChain, pack_chain
from pushplan.mechanics.sphere import checked_twists
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ContactState:
    """The n contacts at m twists, with known loads; all in the chain frame.

    Attributes:
        margins: (m, n) smallest sine of the angle between the contact's wrench and a facet of its cone.
        friction_margins: (m, n) angle from the force to the nearer edge of the friction cone, rad; negative
            outside, and minus the friction angle where there is no force.
        lambdas: (m, n) where the force passes through the segment, 0 at the right end, 1 at the left end;
            infinite where it is parallel to the segment or there is none.
        forces: (m, n, 2) force on the pushed body, N.
        wrenches: (m, n, 3) that force with its moment about the chain frame's origin, N, N m.
    """

    margins: FloatArray
    friction_margins: FloatArray
    lambdas: FloatArray
    forces: FloatArray
    wrenches: FloatArray


def contact_state(chain: Chain, twists: ArrayLike, packed: PackedChain | None = None) -> ContactState:
    """Return the state of the contacts of `chain` at body twists (m, 3) in the chain frame.

    Args:
        chain: Objects and contacts; the loads must be known.
        twists: Only their directions matter.
        packed: `pack_chain(chain)`, when it is at hand.

    Raises:
        PushplanError: On twists that are zero, not finite or not (m, 3).
        SupportError: When a load is not known.
    """
    arrays = pack_chain(chain) if packed is None else packed
    checked = checked_twists(twists)
    owner, first = directions(checked, chain.characteristic_length)
    wrenches = wrenches_of(arrays, checked[first])
    force, moment = wrenches[..., :2], wrenches[..., 2]
    normal = np.array([contact.normal for contact in chain.contacts])
    tangent = np.array([contact.tangent for contact in chain.contacts])
    right = np.array([contact.right for contact in chain.contacts])
    length = np.array([contact.length for contact in chain.contacts])
    mu = np.array([contact.friction for contact in chain.contacts])
    f_n, f_t = (force[..., 0] * along[:, 0] + force[..., 1] * along[:, 1] for along in (normal, tangent))
    about_right = moment - (right[:, 0] * force[..., 1] - right[:, 1] * force[..., 0])
    angle = np.where(np.hypot(f_n, f_t) > 0.0, np.abs(np.arctan2(f_t, f_n)), 2.0 * np.arctan(mu))
    with np.errstate(divide="ignore", invalid="ignore"):
        lambdas = np.where(f_n != 0.0, -about_right / (f_n * length), np.inf)
    friction_margins = np.arctan(mu) - angle
    found = (contact_margins_of(arrays, wrenches), friction_margins, lambdas, force, wrenches)
    return ContactState(*(_read_only(values[owner]) for values in found))


def _read_only(values: FloatArray) -> FloatArray:
    values.setflags(write=False)
    return values
