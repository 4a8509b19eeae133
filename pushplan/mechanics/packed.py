"""Packs a chain into arrays for the core: loads, contacts, and series of the floor wrench for far CORs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

import pushplan.core.contacts as contacts
from pushplan.errors import SupportError
from pushplan.geometry.se2 import rotate, transform_points
from pushplan.mechanics.chain import PLATE, Chain, Contact, PushedObject
from pushplan.mechanics.support import UniformSupport
from pushplan.util.arrays import ComplexArray, FloatArray

ORDER = contacts.ORDER
"""Highest power in the series."""
_PAIRS = [(m, h) for m in range(ORDER + 1) for h in reversed(range((ORDER - m) // 2 + 1))]
"""Powers m of the direction e and h of r^2, in the order of summation."""
WEIGHTS = ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1))
"""Powers of z and conj z in the weights of the integrals of v / |v|."""


_gauss_rule = cache(np.polynomial.legendre.leggauss)
"""Function that returns Gauss nodes and weights (count,) on [-1, 1]."""


def complex_moments(outline: FloatArray, order: int) -> ComplexArray:
    """Return M (order + 1, order + 1): M[p, q] is the integral of z^p conj(z)^q over a polygon, for p + q <= order.

    The integral of a homogeneous function of degree k is the sum over edges e of d_e times its edge integral, divided
    by k + 2. Gauss quadrature is exact for the polynomials along edges.
    """
    z = outline[:, 0] + 1j * outline[:, 1]
    step = np.roll(z, -1) - z
    nodes, weights = _gauss_rule(order // 2 + 1)
    points = (z[:, None] + step[:, None] * (nodes + 1.0) / 2.0).ravel()
    d_ds = (np.imag(np.conj(z) * step)[:, None] * weights / 2.0).ravel()
    powers = np.vander(points, order + 1, increasing=True)
    degree = np.add.outer(np.arange(order + 1), np.arange(order + 1))
    moments = (powers * d_ds[:, None]).T @ powers.conj() / (degree + 2)
    return np.asarray(np.where(degree <= order, moments, 0.0), dtype=np.complex128)


def _binomials(upper: float) -> FloatArray:
    """Return the binomial coefficients of `upper` over 0 ... ORDER (ORDER + 1,)."""
    k = np.arange(ORDER)
    return np.cumprod(np.append(1.0, (upper - k) / (k + 1.0)))


_M, _H = np.array(_PAIRS).T
_FACTORS = np.outer(_binomials(0.5), _binomials(-0.5))
_AHEAD, _BACK = _FACTORS[_M + _H, _H], np.where(_M > 0, _FACTORS[_H, _M + _H], 0.0)
_A, _B = np.array(WEIGHTS).T[:, :, None]
_P, _Q, _P_BACK, _Q_BACK = _M + _H + _A, _H + _B, _H + _A, _M + _H + _B
"""Powers of z and conj z in the columns with p - q = m and with p - q = -m."""


def series_coefficients(outline: FloatArray, radius: float) -> ComplexArray:
    """Return the coefficients (5, contacts.TERMS) of (kappa radius)^p conj(kappa radius)^q, kappa = i omega / v0.

    Row w is the series of the integral of v / |v| times z^a conj(z)^b with (a, b) = WEIGHTS[w], for v0 > 0. Each of
    _PAIRS has two columns: the sum and the difference of the coefficients with p - q = m and p - q = -m. `outline` is
    relative to the anchor point.
    """
    moments = complex_moments(outline / radius, ORDER + 2) * radius**2
    scale = np.array([radius ** (a + b) for a, b in WEIGHTS])[:, None]
    ahead, back = scale * _AHEAD * moments[_P, _Q], scale * _BACK * moments[_P_BACK, _Q_BACK]
    return np.asarray(np.stack([ahead + back, ahead - back], axis=-1).reshape(len(WEIGHTS), contacts.TERMS))


@lru_cache(maxsize=8)
def pack_chain(chain: Chain) -> contacts.PackedChain:
    """Return the arrays of `chain`; they are cached, because all sets and checks of a plan use them.

    Raises:
        SupportError: If a load is not known, contacts have several heights, or a push at their height can lift a part
            of an object.
    """
    pushers = [contact.pusher for contact in chain.contacts]
    return _pack(chain.objects, pushers, chain.contact_height, chain_rows(chain), chain.characteristic_length)


def pack_object(obj: PushedObject, contact_height: float = 0.0) -> contacts.PackedChain:
    """Return the arrays of one object without contacts; see `pack_chain`."""
    return pack_objects([obj], contact_height)


def pack_objects(objects: Sequence[PushedObject], contact_height: float = 0.0) -> contacts.PackedChain:
    """Return the arrays of objects without contacts; see `pack_chain`."""
    return _pack(objects, [PLATE] * len(objects), contact_height, np.zeros((0, 4, 3)), 1.0)


def chain_rows(chain: Chain) -> FloatArray:
    """Return `contact_rows` (n, 4, 3) of all contacts, with moments divided by the chain's characteristic length."""
    return np.array([contact_rows(contact, chain.characteristic_length) for contact in chain.contacts])


def contact_rows(contact: Contact, length: float) -> FloatArray:
    """Return the unit facets (4, 3) of the wrenches that a contact can transmit: the paper's [C1] and [C2].

    Args:
        contact: Contact whose force acts on the pushed body; moments are about the chain frame's origin.
        length: Characteristic length that divides the moments, m.
    """
    return contact_facets(contact.right, contact.left, np.asarray(contact.friction), length)


def contact_facets(right: FloatArray, left: FloatArray, friction: FloatArray, length: float) -> FloatArray:
    """Return `contact_rows` (..., 4, 3) of contacts with ends (..., 2) and friction coefficients (...).

    Forces at the two ends of the segment span the cone of the wrenches. Its facets are the two sides of the friction
    cone, no rotation about the right end, and no rotation about the left end.
    """
    along = left - right
    tangent = along / np.sqrt((along * along).sum(axis=-1, keepdims=True))
    t_x, t_y, mu, zero = tangent[..., 0], tangent[..., 1], friction, np.zeros(right.shape[:-1])
    n_x, n_y, arm = t_y, -t_x, np.full(right.shape[:-1], length)
    rows = np.array(
        [
            [mu * n_x - t_x, mu * n_y - t_y, zero],
            [mu * n_x + t_x, mu * n_y + t_y, zero],
            [-right[..., 1], right[..., 0], -arm],
            [left[..., 1], -left[..., 0], arm],
        ]
    )
    rows /= np.sqrt((rows * rows).sum(axis=1, keepdims=True))
    return np.ascontiguousarray(np.moveaxis(rows, (0, 1), (-2, -1)))


def _pack(
    objects: Sequence[PushedObject], pushers: Sequence[int], contact_height: float, rows: FloatArray, length: float
) -> contacts.PackedChain:
    packers = [_pack_support(obj, contact_height) for obj in objects]
    stops = np.cumsum([len(part) for _, _, part, _ in packers])
    links = [
        [kind, stop - len(part), stop, pusher]
        for (kind, _, part, _), stop, pusher in zip(packers, stops, pushers, strict=True)
    ]
    return contacts.PackedChain(
        objects=np.array([row for _, row, _, _ in packers]),
        parts=np.concatenate([part for _, _, part, _ in packers]),
        series=np.concatenate([series for _, _, _, series in packers]),
        links=np.array(links, dtype=np.int64),
        rows=rows,
        length=length,
    )


def _pack_support(obj: PushedObject, height: float) -> tuple[int, list[float], FloatArray, ComplexArray]:
    """Return kind, `objects` row, parts and series of one object; see `contacts.PackedChain`."""
    support, turn = obj.support, float(obj.pose_chain[2])
    spread, shift = _Spread.of(obj), height * obj.floor_friction
    _require_pressed(obj, spread, height)
    radius = float(np.linalg.norm(spread.offsets, axis=1).max())
    last = [shift, *spread.second[[0, 0, 1], [0, 1, 1]]]
    if isinstance(support, UniformSupport):
        anchor, gradient = (
            transform_points(obj.pose_chain, support.moments.centroid),
            rotate(turn, support.gradient),
        )
        row = [obj.friction_load, *anchor, radius, 1.0 / support.moments.area, *gradient, *last]
        kind = contacts.AFFINE if shift > 0.0 or gradient.any() else contacts.UNIFORM
        return kind, row, _edges(spread.offsets), series_coefficients(spread.offsets, radius)
    positions, fractions, stiffness = support.point_loads
    row = [obj.friction_load, *transform_points(obj.pose_chain, stiffness @ positions), radius, 0.0, 0.0, 0.0, *last]
    parts = np.column_stack([spread.offsets, fractions, stiffness, np.zeros(len(positions))])
    return contacts.POINTS, row, parts, np.zeros((len(WEIGHTS), contacts.TERMS), dtype=np.complex128)


class _Spread(NamedTuple):
    """Distribution of a load over the k corners of a polygon, or over k points, along the axes of the chain frame.

    Attributes:
        base: Pressure per weight (k,) at the corners, 1/m^2, or load fractions (k,) of points.
        stiffness: Share (k,) of each corner or point in a load that a push shifts.
        offsets: Offsets (k, 2) from the centre of the stiffness, m.
        second: Second moments (2, 2) of the stiffness.
    """

    base: FloatArray
    stiffness: FloatArray
    offsets: FloatArray
    second: FloatArray

    @classmethod
    def of(cls, obj: PushedObject) -> _Spread:
        """Return the distribution of a known load.

        Raises:
            SupportError: If the load is not known.
        """
        support, turn = obj.support, float(obj.pose_chain[2])
        if isinstance(support, UniformSupport):
            corners, rotation = (rotate(turn, support.outline - support.moments.centroid), rotate(turn, np.eye(2)).T)
            base = 1.0 / support.moments.area + corners @ rotate(turn, support.gradient)
            return cls(base, np.ones(len(corners)), corners, rotation @ support.moments.second @ rotation.T)
        if not support.known:
            raise SupportError(
                f"the load under {obj.name!r} is unknown; it must be known here: give load fractions or a pressure, "
                f"or use the stable set 'stable' or 'robust'"
            )
        positions, fractions, stiffness = support.point_loads
        offsets = rotate(turn, positions - stiffness @ positions)
        return cls(fractions, stiffness, offsets, (offsets * stiffness[:, None]).T @ offsets)

    @property
    def highest_push(self) -> float:
        """Largest shift h mu (m) of the load by a push in any direction that keeps all its parts positive."""
        values = np.linalg.eigvalsh(self.second)
        if values[0] <= 1e-12 * values[1]:
            return 0.0  # all points are on a line
        lever = np.linalg.norm(np.linalg.solve(self.second, self.offsets.T), axis=0) * self.stiffness
        return float(np.min(self.base / np.maximum(lever, 1e-300)))


def push_room(obj: PushedObject, height: float) -> float:
    """Return the largest additional shift (m) of an object's load, during a push at a height, that lifts no part.

    Raises:
        SupportError: If the load is not known.
    """
    return _Spread.of(obj).highest_push - height * obj.floor_friction


def _edges(corners: FloatArray) -> FloatArray:
    """Return the edges (e, 5) of a counter-clockwise polygon around the anchor, without edges of length 0.

    The columns are t_x, t_y, n . p, t . p and the length, where p is the first vertex of the edge.
    """
    step = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(step[:, 0], step[:, 1])
    kept = length > 0.0
    corners, length, tangent = corners[kept], length[kept], step[kept] / length[kept, None]
    n_p = tangent[:, 1] * corners[:, 0] - tangent[:, 0] * corners[:, 1]
    t_p = (tangent * corners).sum(axis=1)
    return np.column_stack([tangent, n_p, t_p, length])


def _require_pressed(obj: PushedObject, spread: _Spread, height: float) -> None:
    """Raise SupportError if a shift of the load by h mu in any direction can make a pressure negative."""
    if height * obj.floor_friction == 0.0:
        return
    highest = spread.highest_push / obj.floor_friction
    if highest == 0.0:
        raise SupportError(
            f"the support points of {obj.name!r} are on a line: a push at height {height:.6g} m would tip it"
        )
    if height > highest:
        raise SupportError(
            f"a push at height {height:.6g} m could lift a part of {obj.name!r}: the load's centre shifts by up "
            f"to {height * obj.floor_friction:.6g} m; the contact height must be at most {highest:.6g} m"
        )
