"""Contacts: friction cones, friction centres (ECOF, COF), transmitted wrenches, and margins against slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import pushplan.core.contacts as contacts
import pushplan.core.sphere as sphere
from pushplan.errors import UndefinedEcofError
from pushplan.geometry.polygon import convex_hull
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import PLATE, Chain, Contact, PushedObject
from pushplan.mechanics.packed import pack_chain, pack_object
from pushplan.mechanics.sphere import checked_twists, twists_about
from pushplan.util.arrays import BoolArray, FloatArray, frozen


def friction_cone(contact: Contact, apex: FloatArray, tall: float) -> FloatArray:
    """Return friction cones as triangles (..., 3, 2) with a corner at `apex` (..., 2).

    Args:
        contact: Contact with the normal and the friction coefficient of the cone.
        apex: Points in the chain frame, m.
        tall: Height of the triangles, m.
    """
    along, aside = tall * contact.normal, contact.friction * tall * contact.tangent
    return np.stack([apex, apex + along - aside, apex + along + aside], axis=-2)


_AXES = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
_ROUNDING = 1e-12


def carried_objects(chain: Chain) -> BoolArray:
    """Return whether contact k carries object i, (n, n): the paper's objects 1..k."""
    n = len(chain.objects)
    carried = np.eye(n, dtype=np.bool_)
    for i in reversed(range(n)):
        pusher = chain.contacts[i].pusher
        if pusher != PLATE:
            carried[pusher] |= carried[i]
    return carried


def common_centers(carried: BoolArray, loads: FloatArray, centers: FloatArray) -> FloatArray:
    """Return the centres of friction (n, 2) of the objects that each contact carries, m.

    The centre is G_k = sum of F_i g_i / sum of F_i. If no carried object has floor friction, there is no force, and
    the mean of the centres is returned.

    Args:
        carried: See `carried_objects`.
        loads: Friction loads F_i = mu_i m_i g (n,), N.
        centers: Centres g_i (n, 2), m.
    """
    weights = np.where(carried, loads, 0.0)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0.0, weights, carried.astype(np.float64))
    return np.asarray(weights @ centers / weights.sum(axis=1, keepdims=True), dtype=np.float64)


def center_range(loads: FloatArray, centers: FloatArray) -> FloatArray:
    """Return the corners (v, 2) of the region of possible common centres of friction of some objects, m.

    A corner is the farthest centre in some direction: the objects farther in that direction have their largest load,
    the others their smallest. The normals of the known edges are the directions in which more corners are searched.

    Args:
        loads: Smallest and largest friction loads (m, 2) of the objects, N.
        centers: Centres of friction (m, 2) of the objects, m.
    """
    if loads[:, 1].sum() == 0.0:
        return np.asarray(centers.mean(axis=0)[None], dtype=np.float64)
    rounding = _ROUNDING * float(np.abs(centers - centers[0]).max())
    corners = convex_hull(np.array([_farthest(loads, centers, axis) for axis in _AXES]))
    while len(corners) > 1:
        step = np.roll(corners, -1, axis=0) - corners
        normals = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1, keepdims=True)
        found = np.array([_farthest(loads, centers, normal) for normal in normals])
        beyond = ((found - corners) * normals).sum(axis=1) > rounding
        if not beyond.any():
            break
        corners = convex_hull(np.concatenate([corners, found[beyond]]))
    return corners


def _farthest(loads: FloatArray, centers: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the common centre (2,) that is farthest in a direction."""
    order = np.argsort(-(centers @ direction))
    largest = np.tri(len(order) + 1, len(order), -1, dtype=np.bool_)
    weights = np.where(largest, loads[order, 1], loads[order, 0])
    weights = weights[weights.sum(axis=1) > 0.0]
    common = weights @ centers[order] / weights.sum(axis=1, keepdims=True)
    return np.asarray(common[np.argmax(common @ direction)], dtype=np.float64)


def friction_wrench(obj: PushedObject, twists: ArrayLike, contact_height: float = 0.0) -> FloatArray:
    """Return the wrench (k, 3) of the floor friction on an object about the chain frame's origin: N, N, N m.

    Args:
        obj: Object with a known load.
        twists: Body twists (k, 3) in the chain frame; only their directions matter.
        contact_height: Height of the contact forces above the floor, which shifts the load, m.

    Raises:
        PushplanError: If twists are zero, not finite or not (k, 3).
        SupportError: If the load is not known, or the push at that height can lift a part of the object.
    """
    packed = pack_object(obj, contact_height)
    return -contacts.object_wrenches_of(packed, checked_twists(twists))


def ecof(obj: PushedObject, cor: ArrayLike, sense: int = +1, contact_height: float = 0.0) -> FloatArray:
    """Return the effective centre of friction (2,): the point on the friction force's line of action nearest the COR.

    `ECOF - c = m_c (f_y, -f_x) / |f|^2` with the wrench (f, m_c) about the COR c (Harada et al. 2006,
    appendix).

    Args:
        obj: Object with a known load.
        cor: Centre of rotation (2,) in the chain frame, m.
        sense: +1 or -1; relevant only if a push height shifts the load.
        contact_height: See `friction_wrench`.

    Raises:
        UndefinedEcofError: If the friction force vanishes, for example for a COR at the COF of a symmetric load.
        SupportError: See `friction_wrench`.
    """
    c = frozen(cor, (2,), "centre of rotation")
    fx, fy, moment = friction_wrench(obj, twists_about(c, sense)[None], contact_height)[0]
    about_cor = moment - (c[0] * fy - c[1] * fx)
    if np.hypot(fx, fy) <= 1e-12 * obj.friction_load:
        raise UndefinedEcofError(
            f"the friction force on {obj.name!r} vanishes for a rotation about ({c[0]:.6g}, {c[1]:.6g}), "
            f"so it has no line of action; the COF is at ({cof(obj)[0]:.6g}, {cof(obj)[1]:.6g})"
        )
    return np.asarray(c + about_cor * np.array([fy, -fx]) / (fx * fx + fy * fy), dtype=np.float64)


def cof(obj: PushedObject) -> FloatArray:
    """Return the centre of friction (2,) in the chain frame, m: the centre of pressure, because mu is uniform."""
    return transform_points(obj.pose_chain, obj.support.center)


@dataclass(frozen=True, eq=False)
class ContactState:
    """State of n contacts at m twists, for known loads, in the chain frame.

    Attributes:
        margins: Smallest sine (m, n) of the angle between the contact's wrench and a facet of its cone.
        friction_margins: Angle (m, n) from the force to the nearer edge of the friction cone, rad; negative outside,
            and minus the friction angle if there is no force.
        lambdas: Position (m, n) of the force's line of action on the segment, 0 at the right end and 1 at the left
            end; infinite if the force is zero or parallel to the segment.
        forces: Force (m, n, 2) on the pushed body, N.
        wrenches: Wrench (m, n, 3) of this force about the chain frame's origin, N, N m.
    """

    margins: FloatArray
    friction_margins: FloatArray
    lambdas: FloatArray
    forces: FloatArray
    wrenches: FloatArray


def contact_state(chain: Chain, twists: ArrayLike) -> ContactState:
    """Return the state of the contacts of `chain` at body twists (m, 3) in the chain frame.

    Args:
        chain: Objects with known loads, and contacts.
        twists: Body twists; only their directions matter.

    Raises:
        PushplanError: If twists are zero, not finite or not (m, 3).
        SupportError: If a load is not known.
    """
    arrays = pack_chain(chain)
    checked = checked_twists(twists)
    owner, first = sphere.directions(checked, chain.characteristic_length)
    wrenches = contacts.wrenches_of(arrays, checked[first])
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
    found = (contacts.contact_margins_of(arrays, wrenches), friction_margins, lambdas, force, wrenches)
    return ContactState(*(_read_only(values[owner]) for values in found))


def _read_only(values: FloatArray) -> FloatArray:
    values.setflags(write=False)
    return values
