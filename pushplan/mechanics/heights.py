"""Pushes above the floor: the shifts of the loads' centres by heights and inertia, and the check against tipping.

Moments about the floor give the centre of pressure c_i of object i with the weight N_i:

    N_i c_i = N_i g_i + h_i F_i - sum over the pushed objects j of h_j F_j - z_i m_i a_i

F_i is the force of the contact that pushes the object at the height h_i, and F_j are the forces with which it pushes
others. z_i is the height of its centre of mass, a_i its acceleration and w_i its floor friction. With Newton's law
F_i = w_i + sum F_j + m_i a_i, this becomes

    c_i = g_i + h_i w_i / N_i + sum (h_i - h_j) F_j / N_i + (h_i - z_i) a_i / g.

The first shift is h mu along the object's own friction; the others are bounded. The forces of the pushed objects
cancel only for equal heights without inertia; a difference in height multiplies all of them. The pressure
distribution is not known, and a part of the object can lift. The sets therefore cover every pressure p >= 0 with this
centre (`core/centred.hpp`), including the partly lifted one of an elastic floor. An object can tip if no such
pressure exists, which means that the centre is outside the hull of its support.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pushplan.errors import TippingError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, Chain, PushedObject
from pushplan.mechanics.contacts import carried_objects
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.packed import push_room
from pushplan.mechanics.support import FeetSupport
from pushplan.util.arrays import FloatArray, frozen

CELLS_MISS = (0.03, 0.012)
"""Additions, as a share and as a part of the load, to the effect of an uncertain pressure for its variation inside
cells. Sums over 30 times as many cells stay below these bounds (`tests/sets/test_interval_sets.py`)."""

_HALVINGS, _ROUNDING = 40, 1e-12


@dataclass(frozen=True, eq=False)
class LoadArea:
    """All pressures with a given centre, in the chain frame.

    Attributes:
        points: Feet (m, 2), or the corners of a convex polygon, counter-clockwise, m.
        solid: Whether the whole polygon can carry load, and not only its corners.
        center: Centre (2,) of the load at rest, m.
        shift: Smallest h mu, m: the shift of this centre against the friction force, for a push at the height h and
            a translation of the object.
        more: Largest addition to `shift`, m.
        drift: Largest shifts (2,) of the centre along x and y from other causes than friction, m.
    """

    points: FloatArray
    solid: bool
    center: FloatArray
    shift: float
    more: float = 0.0
    drift: FloatArray = field(default_factory=lambda: np.zeros(2))

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, (None, 2), "points that may carry load"))
        object.__setattr__(self, "center", frozen(self.center, (2,), "centre of a load"))
        object.__setattr__(self, "drift", frozen(self.drift, (2,), "drift of a load's centre"))

    @property
    def reach(self) -> float:
        """Largest distance of the load's centre from `center` without inertia, m."""
        return self.shift + self.more + float(np.hypot(*self.drift))


def load_areas(chain: Chain, interval: IntervalChain | None = None, off: bool = False) -> tuple[LoadArea, ...]:
    """Return the area that can carry each object's load: its feet, or the convex hull of its support.

    Args:
        chain: Objects and contacts; for known loads, only the centre is used.
        interval: Chain with intervals of masses, floor frictions and loads; None for plain numbers.
        off: Whether uncertain pressures shift the centre, as intervals of load fractions do.

    Raises:
        TippingError: If a push at the contact heights can tip an object.
    """
    areas = _areas(chain, interval, off)
    if loads_move(chain):
        _require_standing(chain, interval, off, areas)
    return areas


def loads_move(chain: Chain) -> bool:
    """Return whether pushes above the floor or inertia shift loads."""
    return bool(chain.contact_heights.any()) or any(obj.center_height is not None for obj in chain.objects)


def is_pressed(chain: Chain) -> bool:
    """Return whether the shifts of the loads have a closed form.

    This requires the same height for all contacts. In addition, no part of an object with a known load may lift, for
    any motion and the largest acceleration that the pusher's limits allow.
    """
    heights = chain.contact_heights
    height = float(heights[0, 0])
    if (heights != height).any():
        return False
    if not loads_move(chain):
        return True
    leaning = _most_shifted(chain, None)
    return all(
        push_room(obj, height) >= lean for obj, lean in zip(chain.objects, leaning, strict=True) if obj.support.known
    )


def counts_by_centre(chain: Chain, interval: IntervalChain | None = None) -> bool:
    """Return whether only the centre of each load is used, which covers all heights and shifts by inertia.

    This is necessary if a shifted load has no closed form, or if a number of the chain is an interval.
    """
    if not chain.loads_known or not loads_move(chain):
        return False
    uncertain = interval is not None and bool(
        interval.fractions
        or interval.pressures
        or (interval.floor_friction[:, 0] < interval.floor_friction[:, 1]).any()
    )
    inertia = interval is not None and any(obj.center_height is not None for obj in chain.objects)
    return inertia or uncertain or not is_pressed(chain)


def inertia_shifts(chain: Chain, interval: IntervalChain | None = None) -> FloatArray:
    """Return the largest shift (n, n) of the load of object i by an acceleration of object k, m per m/s^2.

    The load of an object whose centre of mass has no known height does not shift.
    """
    heights, mass, carried = chain.contact_heights, _masses(chain, interval), carried_objects(chain)
    found = np.zeros((len(chain.objects), len(chain.objects)))
    for i, obj in enumerate(chain.objects):
        if obj.center_height is None:
            continue
        found[i, i] = np.abs(heights[i] - obj.center_height).max() / GRAVITY
        for j, contact in enumerate(chain.contacts):
            if contact.pusher == i:
                found[i] += np.abs(_step(heights, i, j)).max() * carried[j] * mass[:, 1] / (mass[i, 0] * GRAVITY)
    return found


def tipping_room(chain: Chain, interval: IntervalChain | None = None, off: bool = False) -> FloatArray | None:
    """Return the reserve (n,) of the loads' centres against tipping, m; None if nothing shifts loads.

    The reserve is the distance from the edge of the support for the worst shift by heights, intervals and the largest
    acceleration that the pusher's limits allow. It is negative if an object can tip. See `load_areas` for `off`.
    """
    return _spare(chain, interval, _areas(chain, interval, off)) if loads_move(chain) else None


# --- centres ---


def _areas(chain: Chain, interval: IntervalChain | None, off: bool) -> tuple[LoadArea, ...]:
    """Return the load areas without a check against tipping."""
    friction = (
        np.array([[obj.floor_friction] * 2 for obj in chain.objects]) if interval is None else interval.floor_friction
    )
    shift = chain.contact_heights * friction
    areas = []
    for i, obj in enumerate(chain.objects):
        points, solid = obj.support.carriers
        low, high = _pushed_back(chain, interval, i)
        drift = np.zeros(2) if interval is None else _load_error(obj, i, interval, off)
        areas.append(
            LoadArea(
                transform_points(obj.pose_chain, points),
                solid,
                transform_points(obj.pose_chain, obj.support.center) + 0.5 * (low + high),
                float(shift[i, 0]),
                float(shift[i, 1] - shift[i, 0]),
                0.5 * (high - low) + drift,
            )
        )
    return tuple(areas)


def _pushed_back(chain: Chain, interval: IntervalChain | None, i: int) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and largest (2,) sum of (h_i - h_j) F_j / N_i over the objects that object i pushes, m.

    By the contact conditions, F_j is in the friction cone of its contact. It is at most the friction of all objects
    that the contact carries.
    """
    heights, mass, carried = chain.contact_heights, _masses(chain, interval), carried_objects(chain)
    loads = np.array([obj.friction_load for obj in chain.objects]) if interval is None else interval.loads[:, 1]
    low, high = np.zeros(2), np.zeros(2)
    for j, contact in enumerate(chain.contacts):
        if contact.pusher != i:
            continue
        most = float(loads[carried[j]].sum())
        aside = contact.friction / np.hypot(1.0, contact.friction) * contact.tangent
        forces = most * np.stack([contact.normal * n + aside * t for n in (0.0, 1.0) for t in (-1.0, 1.0)])
        moved = np.concatenate([step * forces for step in _step(heights, i, j)]) / (mass[i, 0] * GRAVITY)
        low, high = low + moved.min(axis=0), high + moved.max(axis=0)
    return low, high


def _step(heights: FloatArray, i: int, j: int) -> FloatArray:
    """Return the smallest and largest difference in height of the contacts that push objects i and j, m."""
    return np.array([heights[i, 0] - heights[j, 1], heights[i, 1] - heights[j, 0]])


def _masses(chain: Chain, interval: IntervalChain | None) -> FloatArray:
    return np.array([[obj.mass] * 2 for obj in chain.objects]) if interval is None else interval.mass


def _load_error(obj: PushedObject, i: int, interval: IntervalChain, off: bool) -> FloatArray:
    """Return the largest shifts (2,) of the centre by an uncertain load along the axes of the chain frame, m."""
    spans, share = interval.fractions.get(i), interval.pressures.get(i, 0.0)
    if spans is not None and isinstance(obj.support, FeetSupport) and obj.support.fractions is not None:
        places = transform_points(obj.pose_chain, obj.support.positions)
        parts = spans - obj.support.fractions[:, None]
        return np.array([max(_most(s * x, parts) for s in (1.0, -1.0)) for x in places.T])
    if share == 0.0 or not off:
        return np.zeros(2)
    cells, loads = obj.support.cells()
    places = transform_points(obj.pose_chain, cells)
    parts = share * np.column_stack([-loads, loads])
    missed = CELLS_MISS[1] * share * np.ptp(places, axis=0)
    return np.asarray(missed + [(1.0 + CELLS_MISS[0]) * _most(x, parts) for x in places.T])


def _most(values: FloatArray, parts: FloatArray) -> float:
    """Return the largest sum of p_j v_j for p_j in intervals (k, 2) with sum 0: a fractional knapsack problem."""
    order = np.argsort(-values)
    low, width = parts[order, 0], parts[order, 1] - parts[order, 0]
    filled = np.clip(-low.sum() - np.concatenate([[0.0], np.cumsum(width)[:-1]]), 0.0, width)
    return float((low + filled) @ values[order])


# --- tipping ---


def _require_standing(chain: Chain, interval: IntervalChain | None, off: bool, areas: tuple[LoadArea, ...]) -> None:
    """Raise TippingError if a load's centre can leave the hull of its support."""
    spare = _spare(chain, interval, areas)
    i = int(spare.argmin())
    if spare[i] >= -_ROUNDING:
        return
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        lower = _scaled(chain, share)
        fits = (_spare(lower, interval, _areas(lower, interval, off)) >= -_ROUNDING).all()
        low, high = (share, high) if fits else (low, share)
    height = float(chain.contact_heights[i, 1])
    possible = f"heights up to {1e3 * low * height:.4g} mm" if low > 0.0 else "no height"
    raise TippingError(
        f"a push at the height {1e3 * height:.4g} mm could tip {chain.objects[i].name!r}: the centre of its load can "
        f"be {-1e3 * spare[i]:.4g} mm outside its support; allowed: {possible}"
    )


def _most_shifted(chain: Chain, interval: IntervalChain | None) -> FloatArray:
    """Return the shifts (n,) of the loads by the largest acceleration that the pusher's limits allow, m."""
    limits = chain.pusher.limits
    speed, push, turn, spin = (
        max(limits.both(name)) for name in ("speed", "acceleration", "angular_speed", "angular_acceleration")
    )
    centers = np.array([transform_points(obj.pose_chain, obj.support.center) for obj in chain.objects])
    most = push + speed * turn + (spin + turn**2) * np.hypot(*centers.T)
    return np.asarray(inertia_shifts(chain, interval) @ most)


def _scaled(chain: Chain, share: float) -> Chain:
    """Return the chain with all contact heights multiplied by a share."""
    contacts = tuple(
        replace(contact, height=(share * low, share * high))
        for contact, (low, high) in zip(chain.contacts, chain.contact_heights, strict=True)
    )
    return replace(chain, contacts=contacts)


def _spare(chain: Chain, interval: IntervalChain | None, areas: tuple[LoadArea, ...]) -> FloatArray:
    """Return the distances (n,) of the loads' centres from the edges of the supports, m; negative outside.

    They include the shift by the largest acceleration that the pusher's limits allow.
    """
    leaning = _most_shifted(chain, interval)
    spare = np.zeros(len(areas))
    for i, (obj, area) in enumerate(zip(chain.objects, areas, strict=True)):
        hull = transform_points(obj.pose_chain, obj.support.hull)
        room = 0.0
        if len(hull) > 2:
            step = np.roll(hull, -1, axis=0) - hull
            normal = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1, keepdims=True)
            inside = ((hull - area.center) * normal).sum(axis=1)
            room = float((inside - np.abs(normal) @ area.drift).min())
        spare[i] = room - area.shift - area.more - leaning[i]
    return spare
