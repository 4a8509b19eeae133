"""Chains that are off in one number: built from changed objects, not by the code under test."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from pushplan.errors import SupportError
from pushplan.geometry.polygon import find_touch
from pushplan.geometry.se2 import compose, rotate, transform_points
from pushplan.mechanics.chain import PLATE, Chain, PushedObject
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.plans.trajectory import Trajectory

KINDS = ("contact_friction", "floor_friction", "load", "position", "angle")


def perturbed(chain: Chain, kind: str, size: float) -> Iterator[Chain | None]:
    """Yield every chain that is off by `size` in one number; None where there is no such chain."""
    if kind == "contact_friction":
        yield replace(chain, contacts=tuple(replace(c, friction=c.friction * size) for c in chain.contacts))
        return
    axes = (0, 1) if kind == "load" else (0,)
    for i, sense, axis in product(range(len(chain.objects)), (1.0, -1.0), axes):
        try:
            if kind == "floor_friction":
                friction = chain.objects[i].floor_friction * (1.0 + sense * size)
                yield _with_object(chain, i, replace(chain.objects[i], floor_friction=friction))
            elif kind == "load":
                support = _leaning(chain.objects[i], axis, sense * size)
                yield _with_object(chain, i, replace(chain.objects[i], support=support))
            elif kind == "position":
                yield _aside(chain, i, sense * size)
            else:
                yield _turned(chain, i, sense * size)
        except SupportError:
            yield None


def least_margin(chain: Chain | None, trajectory: Trajectory) -> float:
    """Return the least margin with inertia along the trajectory's samples; -1 for no chain, or a lifted load."""
    if chain is None:
        return -1.0
    try:
        rates = trajectory.rates_at(trajectory.t)
        return float(dynamic_margins(chain, trajectory.directions, rates).min())
    except SupportError:
        return -1.0


def least_at(chain: Chain, trajectory: Trajectory, kind: str, size: float) -> float:
    """Return the least margin of all chains that are off by `size` in one number."""
    return min(least_margin(other, trajectory) for other in perturbed(chain, kind, size))


def _with_object(chain: Chain, i: int, obj: PushedObject) -> Chain:
    return replace(chain, objects=(*chain.objects[:i], obj, *chain.objects[i + 1 :]))


def _leaning(obj: PushedObject, axis: int, share: float) -> Support:
    """Return the support with its load leaning along the chain frame's x or y."""
    e = rotate(-obj.pose_chain[2], np.eye(2)[axis])
    support = obj.support
    if isinstance(support, UniformSupport):
        along = (support.outline - support.moments.centroid) @ e
        shift = share * support.moments.second @ e / support.moments.area / np.abs(along).max()
        return UniformSupport(support.outline, support.center + shift)
    assert isinstance(support, FeetSupport)
    assert support.fractions is not None
    along = (support.positions - support.fractions @ support.positions) @ e
    return FeetSupport(support.positions, support.fractions * (1.0 + share * along / np.abs(along).max()))


def _aside(chain: Chain, i: int, distance: float) -> Chain | None:
    """Move one object along its contact; the contacts are found anew from the outlines."""
    shift = distance * chain.contacts[i].tangent
    obj = chain.objects[i]
    moved = _with_object(chain, i, replace(obj, pose_chain=obj.pose_chain + np.append(shift, 0.0)))
    contacts = list(chain.contacts)
    for k, contact in enumerate(contacts):
        if i in (contact.pushed, contact.pusher):
            by = contact.pusher
            pushing = chain.pusher.outline if by == PLATE else moved.objects[by].outline_chain
            touch = find_touch(pushing, moved.objects[k].outline_chain)
            if touch is None or not len(touch):
                return None
            same = [s for s in touch if (s[1] - s[0]) @ contact.tangent > 0.0]
            contacts[k] = replace(contact, right=same[0][0], left=same[0][1])
    return replace(moved, contacts=tuple(contacts))


def _turned(chain: Chain, i: int, angle: float) -> Chain:
    """Turn one object and all that it carries about the middle of its contact, which stays."""
    middle = 0.5 * (chain.contacts[i].right + chain.contacts[i].left)
    motion = np.append(middle - rotate(angle, middle), angle)
    carried = {i}
    objects, contacts = list(chain.objects), list(chain.contacts)
    for k, contact in enumerate(contacts):
        if contact.pusher in carried:
            carried.add(k)
            right, left = (transform_points(motion, end) for end in (contact.right, contact.left))
            contacts[k] = replace(contact, right=right, left=left)
        if k in carried:
            objects[k] = replace(objects[k], pose_chain=compose(motion, objects[k].pose_chain))
    return replace(chain, objects=tuple(objects), contacts=tuple(contacts))
