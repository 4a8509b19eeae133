"""Contacts: cones, friction centres (ECOF, COF), what each has to carry, and how far it is from slip."""

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
    """Return triangles (..., 3, 2) from `apex` (..., 2) on: the directions of force that friction allows there.

    Args:
        contact: The contact; the cone opens along its normal, by its friction coefficient to either side.
        apex: Points in the chain frame, m.
        tall: Height of the triangles, m.
    """
    along, aside = tall * contact.normal, contact.friction * tall * contact.tangent
    return np.stack([apex, apex + along - aside, apex + along + aside], axis=-2)


_AXES = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
_ROUNDING = 1e-12


def carried_objects(chain: Chain) -> BoolArray:
    """Return (n, n) whether contact k carries object i: the paper's objects 1..k."""
    n = len(chain.objects)
    carried = np.eye(n, dtype=np.bool_)
    for i in reversed(range(n)):
        pusher = chain.contacts[i].pusher
        if pusher != PLATE:
            carried[pusher] |= carried[i]
    return carried


def common_centers(carried: BoolArray, loads: FloatArray, centers: FloatArray) -> FloatArray:
    """Return the centre of friction (n, 2) of the objects that each contact carries, m.

    G_k = sum of F_i g_i / sum of F_i. Where no carried object has any floor friction, the plain mean stands
    in; no force acts there.

    Args:
        carried: See `carried_objects`.
        loads: (n,) friction loads F_i = mu_i m_i g, N.
        centers: (n, 2) centres g_i, m.
    """
    weights = np.where(carried, loads, 0.0)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0.0, weights, carried.astype(np.float64))
    return np.asarray(weights @ centers / weights.sum(axis=1, keepdims=True), dtype=np.float64)


def center_range(loads: FloatArray, centers: FloatArray) -> FloatArray:
    """Return the corners (v, 2) of all centres of friction that some objects can have together, m.

    A corner is farthest in some direction: the objects farther than it in that direction have their largest
    load, the others their least. The normals of the edges found so far say where to look for more.

    Args:
        loads: (m, 2) least and largest friction load of every object, N.
        centers: (m, 2) centres of the objects, m.
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
        obj: The object; its load must be known.
        twists: (k, 3) body twists in the chain frame; only their directions matter.
        contact_height: Height of the contact forces above the floor, m; shifts the load.

    Raises:
        PushplanError: On twists that are zero, not finite or not (k, 3).
        SupportError: If the load is not known, or the push at that height could lift a part of the object.
    """
    packed = pack_object(obj, contact_height)
    return -contacts.object_wrenches_of(packed, checked_twists(twists))


def ecof(obj: PushedObject, cor: ArrayLike, sense: int = +1, contact_height: float = 0.0) -> FloatArray:
    """Return the effective centre of friction (2,): the point of friction's line of action nearest the COR.

    `ECOF - c = m_c (f_y, -f_x) / |f|^2` with the wrench (f, m_c) about the COR c (Harada et al. 2006,
    appendix).

    Args:
        obj: The object; its load must be known.
        cor: (2,) centre of rotation in the chain frame, m.
        sense: +1 or -1; matters only when a push height shifts the load.
        contact_height: See `friction_wrench`.

    Raises:
        UndefinedEcofError: If the friction force vanishes, as for a COR at the COF of a symmetric load.
        SupportError: As `friction_wrench`.
    """
    c = frozen(cor, (2,), "centre of rotation")
    fx, fy, moment = friction_wrench(obj, twists_about(c, sense)[None], contact_height)[0]
    about_cor = moment - (c[0] * fy - c[1] * fx)
    if np.hypot(fx, fy) <= 1e-12 * obj.friction_load:
        raise UndefinedEcofError(
            f"the friction force on {obj.name!r} vanishes for a rotation about ({c[0]:.6g}, {c[1]:.6g}), "
            f"so that it has no line of action; its COF is at ({cof(obj)[0]:.6g}, {cof(obj)[1]:.6g})"
        )
    return np.asarray(c + about_cor * np.array([fy, -fx]) / (fx * fx + fy * fy), dtype=np.float64)


def cof(obj: PushedObject) -> FloatArray:
    """Return the centre of friction (2,) in the chain frame, m; mu is even, so the centre of pressure."""
    return transform_points(obj.pose_chain, obj.support.center)


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


def contact_state(chain: Chain, twists: ArrayLike) -> ContactState:
    """Return the state of the contacts of `chain` at body twists (m, 3) in the chain frame.

    Args:
        chain: Objects and contacts; the loads must be known.
        twists: Only their directions matter.

    Raises:
        PushplanError: On twists that are zero, not finite or not (m, 3).
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
