"""Pushes above the floor: how far they, and inertia, move the centres of the loads, and whether all objects stand.

Moments about the floor give the centre of pressure c_i of object i with the weight N_i:

    N_i c_i = N_i g_i + h_i F_i - sum over what it pushes of h_j F_j - z_i m_i a_i,

F_i the force through the contact that pushes it, at the height h_i, F_j those through which it pushes others, z_i the
height of its centre of mass, a_i its acceleration. With Newton's F_i = w_i + sum F_j + m_i a_i, w_i what the floor's
friction takes,

    c_i = g_i + h_i w_i / N_i + sum (h_i - h_j) F_j / N_i + (h_i - z_i) a_i / g.

The first part is the shift h mu along the friction of the object itself; the others are bounded. Only with equal
heights, and without inertia, the forces of what is in front cancel: otherwise a difference in height is multiplied by
all of them. How the pressure then spreads, and whether a part of the object lifts, is left open: any pressure p >= 0
with that centre may be the real one (`core/centred.hpp`), the partly lifted one of an elastic floor too. An object
would tip where no such pressure exists: where the centre leaves the hull of its support.
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
"""Share, and part of the load, added to what a pressure that is off changes for what varies inside cells; sums over
30 times as many cells stay below (`tests/sets/test_interval_sets.py`)."""

_HALVINGS, _ROUNDING = 40, 1e-12


@dataclass(frozen=True, eq=False)
class LoadArea:
    """Any pressure with a given centre, in the chain frame.

    Attributes:
        points: (m, 2) feet, or the corners of a convex polygon, counter-clockwise, m.
        solid: Whether the whole polygon may carry load, or only its corners.
        center: (2,) centre of the load at rest, m.
        shift: Least h mu (m): by how much a push at height h moves that centre, against the friction force, when
            the whole load slides in one direction.
        more: How much more it may be, m.
        drift: (2,) how far the centre may be elsewhere along x and y, whatever the friction, m.
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
        """Farthest that the centre may be from `center` without inertia, m."""
        return self.shift + self.more + float(np.hypot(*self.drift))


def load_areas(chain: Chain, interval: IntervalChain | None = None, off: bool = False) -> tuple[LoadArea, ...]:
    """Return where the load of every object may rest: its feet, or the convex hull of its support.

    Args:
        chain: Objects and contacts; a load that is known counts by its centre alone.
        interval: The chain with intervals of masses, floor frictions and loads; None where they are numbers.
        off: Whether pressures that are off put the centre elsewhere, too, as load fractions in intervals do.

    Raises:
        TippingError: If a push at the contact heights could tip an object.
    """
    areas = _areas(chain, interval, off)
    if loads_move(chain):
        _require_standing(chain, interval, off, areas)
    return areas


def loads_move(chain: Chain) -> bool:
    """Whether pushes above the floor, or inertia, move loads."""
    return bool(chain.contact_heights.any()) or any(obj.center_height is not None for obj in chain.objects)


def is_pressed(chain: Chain) -> bool:
    """Whether loads shift in the one way that has a closed form.

    That is for one height of all contacts at which no part of an object with a known load lifts, wherever it moves
    and with the largest acceleration that the pusher's limits admit.
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
    """Whether of each load the centre alone is counted, so that heights, and loads that inertia moves, are tolerated.

    So they are where a load that moves has no closed form, or one of the chain's numbers is an interval.
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
    """Return by how much (n, n) an acceleration of object k moves the load of object i at most, m per m/s^2.

    Objects whose centre of mass has no stated height stand as they are whatever moves.
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
    """Return by how much (n,) loads could move on, m, before their objects tip; None where nothing moves loads.

    That is from the farthest that heights, intervals, and the largest acceleration that the pusher's limits admit can
    put their centres, `off` as for `load_areas`; below 0 where an object could tip.
    """
    return _spare(chain, interval, _areas(chain, interval, off)) if loads_move(chain) else None


# --- centres ---


def _areas(chain: Chain, interval: IntervalChain | None, off: bool) -> tuple[LoadArea, ...]:
    """Return the load areas, whether objects stand or not."""
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
    """Return the least and the largest (2,) of sum (h_i - h_j) F_j / N_i over what object i pushes, m.

    F_j is in the friction cone of its contact, which is what the contact conditions demand, and at most as large as
    the friction of all that it carries.
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
    """Return the least and the largest difference in height of the contacts that push objects i and j, m."""
    return np.array([heights[i, 0] - heights[j, 1], heights[i, 1] - heights[j, 0]])


def _masses(chain: Chain, interval: IntervalChain | None) -> FloatArray:
    return np.array([[obj.mass] * 2 for obj in chain.objects]) if interval is None else interval.mass


def _load_error(obj: PushedObject, i: int, interval: IntervalChain, off: bool) -> FloatArray:
    """Return how far (2,) an uncertain load puts the centre elsewhere along the axes of the chain frame, m."""
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
    """Return the largest sum of p_j v_j over parts p_j in intervals (k, 2) that sum to 0: a fractional knapsack."""
    order = np.argsort(-values)
    low, width = parts[order, 0], parts[order, 1] - parts[order, 0]
    filled = np.clip(-low.sum() - np.concatenate([[0.0], np.cumsum(width)[:-1]]), 0.0, width)
    return float((low + filled) @ values[order])


# --- tipping ---


def _require_standing(chain: Chain, interval: IntervalChain | None, off: bool, areas: tuple[LoadArea, ...]) -> None:
    """Raise TippingError unless every load's centre stays in the hull of its support, wherever it may move."""
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
    possible = f"up to {1e3 * low * height:.4g} mm can be planned" if low > 0.0 else "no height can be planned"
    raise TippingError(
        f"a push at {1e3 * height:.4g} mm could tip {chain.objects[i].name!r}: its load's centre may move "
        f"{-1e3 * spare[i]:.4g} mm out of its support; {possible}"
    )


def _most_shifted(chain: Chain, interval: IntervalChain | None) -> FloatArray:
    """Return how far (n,) inertia moves loads with the largest acceleration that the pusher's limits admit, m."""
    limits = chain.pusher.limits
    speed, push, turn, spin = (
        max(limits.both(name)) for name in ("speed", "acceleration", "angular_speed", "angular_acceleration")
    )
    centers = np.array([transform_points(obj.pose_chain, obj.support.center) for obj in chain.objects])
    most = push + speed * turn + (spin + turn**2) * np.hypot(*centers.T)
    return np.asarray(inertia_shifts(chain, interval) @ most)


def _scaled(chain: Chain, share: float) -> Chain:
    """Return the chain with all contact heights times a share."""
    contacts = tuple(
        replace(contact, height=(share * low, share * high))
        for contact, (low, high) in zip(chain.contacts, chain.contact_heights, strict=True)
    )
    return replace(chain, contacts=contacts)


def _spare(chain: Chain, interval: IntervalChain | None, areas: tuple[LoadArea, ...]) -> FloatArray:
    """Return by how much (n,) loads could move on before their centres leave the supports, m; negative outside.

    Inertia counts with the largest acceleration that the pusher's limits admit.
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
