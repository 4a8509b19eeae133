"""Chains that differ from the plan's model: other friction, mass or load, and slid or turned objects.

Robustness, simulated worlds, Monte Carlo samples, measured chains and the closed loop's cautious model use these.
Displacements exist for many sizes at once (`slide`, `displace`: a `Motion`), and as the chain of one size (`slid`).
All contacts of a displaced chain are flush.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import ChainError, PushplanError
from pushplan.geometry.polygon import SHORTEST_CONTACT, TOUCH
from pushplan.geometry.se2 import compose, rotate
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.mechanics.contacts import carried_objects
from pushplan.util.arrays import FloatArray, frozen

PARALLEL = 1e-3
"""Largest angle between a contact and the edges that it lies on, rad."""

NEAR = 4.0 * TOUCH
"""Largest distance of an edge from the contact's line, at the point of the edge nearest the contact's middle, m."""

_NOWHERE = 1e6
"""Right end of a contact without a segment, m; its left end is at minus this value."""


def with_objects(chain: Chain, index: int | None, **changes: Any) -> Chain:
    """Return the chain with changed attributes of one object or of all; a callable gets the object."""
    objects = list(chain.objects)
    for i in range(len(objects)) if index is None else (index,):
        values = {key: value(objects[i]) if callable(value) else value for key, value in changes.items()}
        objects[i] = replace(objects[i], **values)
    return replace(chain, objects=tuple(objects))


def with_contact_friction(chain: Chain, factor: float, index: int | None = None) -> Chain:
    """Return the chain with the friction of one contact, or of all contacts and the plate, multiplied by `factor`."""
    which = range(len(chain.contacts)) if index is None else (index,)
    contacts = tuple(
        replace(contact, friction=factor * contact.friction) if k in which else contact
        for k, contact in enumerate(chain.contacts)
    )
    own = chain.pusher.friction * (factor if index is None else 1.0)
    return replace(chain, contacts=contacts, pusher=replace(chain.pusher, friction=own))


def with_floor_friction(chain: Chain, factor: float, index: int | None = None) -> Chain:
    """Return the chain with the floor friction of one object, or of all, multiplied by `factor`."""
    return with_objects(chain, index, floor_friction=lambda obj: factor * obj.floor_friction)


def with_mass(chain: Chain, factor: float, index: int | None = None) -> Chain:
    """Return the chain with the mass of one object, or of all, multiplied by `factor`."""
    return with_objects(chain, index, mass=lambda obj: factor * obj.mass)


def with_leaning_load(chain: Chain, direction: ArrayLike, share: float, index: int | None = None) -> Chain:
    """Return the chain with the load of one object, or of all, shifted to one side; see `Support.leaning`.

    Args:
        chain: Objects with known loads.
        direction: Unit vector (2,) in the chain frame.
        share: Increase of the outermost load on that side, and decrease on the other, as a share.
        index: Index of the object; None for all.

    Raises:
        PushplanError: If the direction is zero.
        SupportError: If a load is not known, or would be negative at a point.
    """
    e = frozen(direction, (2,), "direction of a leaning load")
    if not e.any():
        raise PushplanError("the direction of a leaning load is zero; allowed: a nonzero vector (x, y)")
    return with_objects(chain, index, support=lambda obj: obj.support.leaning(rotate(-obj.pose_chain[2], e), share))


@dataclass(frozen=True, eq=False)
class Motion:
    """Displaced objects and their contacts, for q sizes of one displacement.

    Attributes:
        poses: Displacements (q, n, 3) of the objects, as motions in the chain frame.
        ends: Right and left end (q, n, 2, 2) of every contact, m.
        lengths: Lengths (q, n) of the contacts along their lines, m; not positive if a contact is lost.
    """

    poses: FloatArray
    ends: FloatArray
    lengths: FloatArray

    def applied(self, chain: Chain) -> Chain:
        """Return the chain of the first size.

        Raises:
            ChainError: If a contact is lost.
        """
        if (self.lengths[0] < SHORTEST_CONTACT).any():
            k = int(self.lengths[0].argmin())
            raise ChainError(f"object {chain.objects[k].name!r} has slid off the body that pushes it")
        objects = tuple(
            replace(obj, pose_chain=compose(pose, obj.pose_chain)) if pose.any() else obj
            for obj, pose in zip(chain.objects, self.poses[0], strict=True)
        )
        contacts = tuple(
            replace(contact, right=ends[0], left=ends[1])
            if (ends != [contact.right, contact.left]).any()
            else contact
            for contact, ends in zip(chain.contacts, self.ends[0], strict=True)
        )
        return replace(chain, objects=objects, contacts=contacts)


def displace(chain: Chain, slides: FloatArray, turns: FloatArray) -> Motion:
    """Return all objects slid by (q, n), m (see `slide`), and then turned by (q, n), rad.

    An object turns about its contact's middle, together with all objects that it carries. The contact remains flush:
    the displacement is an error of the angle between the object's frame and its face.

    Raises:
        ChainError: If a contact does not lie on edges of both bodies.
    """
    slid = slide(chain, slides)
    poses, ends, carried = slid.poses, slid.ends, carried_objects(chain)
    for k in reversed(range(len(chain.contacts))):  # carried objects first, because a turn moves them along
        size = turns[:, k]
        if not size.any():
            continue
        middle = ends[:, k].mean(axis=1)
        for i in np.flatnonzero(carried[k]):
            poses[:, i, :2] = middle + rotate(size, poses[:, i, :2] - middle)
            poses[:, i, 2] += size
            if i != k:
                ends[:, i] = middle[:, None] + rotate(size[:, None], ends[:, i] - middle[:, None])
    return slid


def slide(chain: Chain, slides: FloatArray) -> Motion:
    """Return all objects slid along the contacts that push them, with all that they carry, to the left by (q, n), m.

    A contact is the overlap of the edges on its line.

    Raises:
        ChainError: If a contact does not lie on edges of both bodies.
    """
    many = np.asarray(slides, dtype=np.float64)
    shifts = np.zeros((len(many), len(chain.contacts) + 1, 2))  # the last row is the plate's
    ends = np.repeat(contact_ends(chain)[None], len(many), axis=0)
    lengths = np.repeat([[contact.length for contact in chain.contacts]], len(many), axis=0)
    sliding = np.asarray(many.any(axis=0))
    for k, contact in enumerate(chain.contacts):
        shifts[:, k] = shifts[:, contact.pusher]
        ends[:, k] += shifts[:, contact.pusher, None]
        if sliding[k]:
            shifts[:, k] += many[:, k, None] * contact.tangent
            edges = contact_edges(chain, k)
            change = overlap(*edges, many[:, k]) - overlap(*edges, np.zeros(1))
            ends[:, k] += change[..., None] * contact.tangent
            lengths[:, k] += change[:, 1] - change[:, 0]
    poses = np.concatenate([shifts[:, :-1], np.zeros((*many.shape, 1))], axis=2)
    return Motion(poses, ends, lengths)


def aside_slides(chain: Chain, distances: FloatArray) -> FloatArray:
    """Return the slides (q, n), m, that displace every object to the left by its own distance (q, n), m.

    The objects that it carries are not displaced with it. If a carried object has a contact in another direction, it
    follows along the contact's normal until it touches.
    """
    slides = distances.copy()
    for k, contact in enumerate(chain.contacts):
        if contact.pusher != PLATE:
            back = chain.contacts[contact.pusher].tangent @ contact.tangent
            slides[:, k] -= back * distances[:, contact.pusher]
    return slides


def slid(chain: Chain, slides: Sequence[float] | FloatArray) -> Chain:
    """Return the chain of `slide` by (n,), m.

    Raises:
        ChainError: If a contact is lost.
    """
    return slide(chain, np.atleast_2d(np.asarray(slides, dtype=np.float64))).applied(chain)


def contact_ends(chain: Chain) -> FloatArray:
    """Return the right and left end (n, 2, 2) of every contact, m."""
    return np.array([[contact.right, contact.left] for contact in chain.contacts])


@lru_cache(maxsize=64)
def contact_edges(chain: Chain, k: int) -> tuple[FloatArray, FloatArray]:
    """Return the edges (a, 2) of the pushing body and (b, 2) of the pushed body on the line of contact k.

    The edges are intervals of the coordinate from the contact's right end to its left end, m.

    Raises:
        ChainError: If the contact does not lie on edges of both bodies.
    """
    contact = chain.contacts[k]
    by_plate = contact.pusher == PLATE
    outline = chain.pusher.outline if by_plate else chain.objects[contact.pusher].outline_chain
    pushing = _edges_along(outline, contact, 1.0)
    pushed = _edges_along(chain.objects[k].outline_chain, contact, -1.0)
    right, left = overlap(pushing, pushed, np.zeros(1))[0]
    if not left > right:
        raise ChainError(f"contact {chain.contact_name(k)} does not lie on an edge of both bodies")
    return pushing, pushed


def overlap(pushing: FloatArray, pushed: FloatArray, slides: FloatArray) -> FloatArray:
    """Return the right and left end (q, 2) of the overlap of edges (a, 2) with edges (b, 2) slid by (q,), m."""
    low = np.maximum(pushing[:, None, None, 0], pushed[None, :, None, 0] + slides)
    high = np.minimum(pushing[:, None, None, 1], pushed[None, :, None, 1] + slides)
    touching = high - low > TOUCH
    right = np.where(touching, low, _NOWHERE).min(axis=(0, 1), initial=_NOWHERE)
    left = np.where(touching, high, -_NOWHERE).max(axis=(0, 1), initial=-_NOWHERE)
    return np.stack([right, left], axis=1)


def _edges_along(outline: FloatArray, contact: Contact, sense: float) -> FloatArray:
    """Return the edges (a, 2) of a counter-clockwise outline along the contact's line, or against it for sense -1."""
    s, away = ((outline - contact.right) @ axis for axis in (contact.tangent, contact.normal))
    run, rise = (np.roll(values, -1) - values for values in (s, away))
    kept = (sense * run > 0.0) & (np.abs(rise) <= PARALLEL * np.abs(run))
    s, away, run, rise = s[kept], away[kept], run[kept], rise[kept]
    low, high = np.minimum(s, s + run), np.maximum(s, s + run)
    nearest = np.clip(0.5 * contact.length, low, high)
    near = np.abs(away + (nearest - s) * rise / run) <= NEAR
    return np.asarray(np.stack([low, high], axis=1)[near])
