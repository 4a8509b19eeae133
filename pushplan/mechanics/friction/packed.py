"""A chain as a few plain arrays, the form in which compiled code takes it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pushplan.errors import SupportError
from pushplan.geometry.se2 import rotate, transform_points
from pushplan.mechanics.chain import PLATE, Chain, Contact, PushedObject
from pushplan.mechanics.friction.closed_form import EDGE_COLUMNS
from pushplan.mechanics.friction.series import TERMS, WEIGHTS, ComplexArray, series_coefficients
from pushplan.mechanics.support import UniformSupport
from pushplan.util.arrays import FloatArray, IntArray

UNIFORM, AFFINE, POINTS = 0, 1, 2
"""Kinds of support that the kernels tell apart."""


class PackedChain(NamedTuple):
    """Objects and contacts in the chain frame, for compiled code.

    Attributes:
        objects: (n, 11) friction load mu N (N), anchor x, y, radius (m), density a and gradient b (2) of
            the base pressure of a unit weight, h mu (m), stiffness moments S_xx, S_xy, S_yy. The anchor is
            the centroid of a polygon, the stiffness centre of points.
        parts: (e, 5) polygon edges (see `friction_closed_form`) or points about the anchor: x, y, fraction
            of the weight, stiffness, 0.
        series: (5 n, TERMS) power series of the polygons (see `friction_series`); zero for points.
        links: (n, 4) kind, first part, one past the last part, pushing object or -1.
        rows: (n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length) > 0.
        length: Characteristic length of the chain, m.
    """

    objects: FloatArray
    parts: FloatArray
    series: ComplexArray
    links: IntArray
    rows: FloatArray
    length: float


@lru_cache(maxsize=8)
def pack_chain(chain: Chain) -> PackedChain:
    """Return the arrays of `chain`; every set and judge of a plan asks for the same.

    Raises:
        SupportError: When a load is not known, or a push at the pusher's contact height could lift a part
            of an object.
    """
    pushers = [contact.pusher for contact in chain.contacts]
    length = chain.characteristic_length
    rows = np.array([contact_rows(contact, length) for contact in chain.contacts])
    return _pack(chain.objects, pushers, chain.pusher.contact_height, rows, length)


def pack_object(obj: PushedObject, contact_height: float = 0.0) -> PackedChain:
    """Return the arrays of one object without contacts; see `pack_chain`."""
    return pack_objects([obj], contact_height)


def pack_objects(objects: Sequence[PushedObject], contact_height: float = 0.0) -> PackedChain:
    """Return the arrays of objects without contacts; see `pack_chain`."""
    return _pack(objects, [PLATE] * len(objects), contact_height, np.zeros((0, 4, 3)), 1.0)


def contact_rows(contact: Contact, length: float) -> FloatArray:
    """Return the unit facets (4, 3) of the wrenches that a contact transmits: the paper's [C1] and [C2].

    Args:
        contact: Its force acts on the pushed body, moments are about the chain frame's origin.
        length: Characteristic length by which the moments are divided, m.
    """
    return contact_facets(contact.right, contact.left, np.asarray(contact.friction), length)


def contact_facets(right: FloatArray, left: FloatArray, friction: FloatArray, length: float) -> FloatArray:
    """Return `contact_rows` (..., 4, 3) of contacts with ends (..., 2) and coefficients of friction (...).

    Forces at the two ends of the segment span the cone of these wrenches, and its facets are: the two sides
    of the friction cone, no tipping about the right end, no tipping about the left end.
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
    objects: Sequence[PushedObject],
    pushers: Sequence[int],
    contact_height: float,
    rows: FloatArray,
    length: float,
) -> PackedChain:
    packers = [_pack_support(obj, contact_height) for obj in objects]
    stops = np.cumsum([len(part) for _, _, part, _ in packers])
    links = [
        [kind, stop - len(part), stop, pusher]
        for (kind, _, part, _), stop, pusher in zip(packers, stops, pushers, strict=True)
    ]
    return PackedChain(
        objects=np.array([row for _, row, _, _ in packers]),
        parts=np.concatenate([part for _, _, part, _ in packers]),
        series=np.concatenate([series for _, _, _, series in packers]),
        links=np.array(links, dtype=np.int64),
        rows=rows,
        length=length,
    )


def _pack_support(obj: PushedObject, height: float) -> tuple[int, list[float], FloatArray, ComplexArray]:
    """Return kind, row of `objects`, parts and series of one object."""
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
        kind = AFFINE if shift > 0.0 or gradient.any() else UNIFORM
        return kind, row, _edges(spread.offsets), series_coefficients(spread.offsets, radius)
    positions, fractions, stiffness = support.point_loads
    row = [
        obj.friction_load,
        *transform_points(obj.pose_chain, stiffness @ positions),
        radius,
        0.0,
        0.0,
        0.0,
        *last,
    ]
    parts = np.column_stack([spread.offsets, fractions, stiffness, np.zeros(len(positions))])
    return POINTS, row, parts, np.zeros((len(WEIGHTS), TERMS), dtype=np.complex128)


class _Spread(NamedTuple):
    """How a load is spread over the k corners of a polygon, or over k points, in the chain frame's directions.

    Attributes:
        base: (k,) pressure per weight at the corners, 1/m^2, or load fractions of points.
        stiffness: (k,) how much each takes of a load that a push shifts.
        offsets: (k, 2) from the stiffness' centre, m.
        second: (2, 2) second moments of the stiffness.
    """

    base: FloatArray
    stiffness: FloatArray
    offsets: FloatArray
    second: FloatArray

    @classmethod
    def of(cls, obj: PushedObject) -> _Spread:
        """Return that of a known load.

        Raises:
            SupportError: When it is not known.
        """
        support, turn = obj.support, float(obj.pose_chain[2])
        if isinstance(support, UniformSupport):
            corners, rotation = (
                rotate(turn, support.outline - support.moments.centroid),
                rotate(turn, np.eye(2)).T,
            )
            base = 1.0 / support.moments.area + corners @ rotate(turn, support.gradient)
            return cls(base, np.ones(len(corners)), corners, rotation @ support.moments.second @ rotation.T)
        if not support.known:
            raise SupportError(
                f"the load under {obj.name!r} is unknown; this needs known loads: give load fractions or a pressure, "
                f"or use the stable set 'stable' or 'robust'"
            )
        positions, fractions, stiffness = support.point_loads
        offsets = rotate(turn, positions - stiffness @ positions)
        return cls(fractions, stiffness, offsets, (offsets * stiffness[:, None]).T @ offsets)

    @property
    def highest_push(self) -> float:
        """The largest h mu (m) by which a push may shift the load any way, no part of it turning negative."""
        values = np.linalg.eigvalsh(self.second)
        if values[0] <= 1e-12 * values[1]:
            return 0.0  # on a line
        lever = np.linalg.norm(np.linalg.solve(self.second, self.offsets.T), axis=0) * self.stiffness
        return float(np.min(self.base / np.maximum(lever, 1e-300)))


def push_room(obj: PushedObject, height: float) -> float:
    """Return by how much more (m) a push at a height could shift the load of an object before a part of it lifts.

    Raises:
        SupportError: When the load is not known.
    """
    return _Spread.of(obj).highest_push - height * obj.floor_friction


def _edges(corners: FloatArray) -> FloatArray:
    """Return the edges (e, 5) of a counter-clockwise polygon about the anchor, those of length 0 left out."""
    step = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(step[:, 0], step[:, 1])
    kept = length > 0.0
    corners, length, tangent = corners[kept], length[kept], step[kept] / length[kept, None]
    n_p = tangent[:, 1] * corners[:, 0] - tangent[:, 0] * corners[:, 1]
    t_p = (tangent * corners).sum(axis=1)
    edges = np.column_stack([tangent, n_p, t_p, length])
    assert edges.shape[1] == EDGE_COLUMNS
    return edges


def _require_pressed(obj: PushedObject, spread: _Spread, height: float) -> None:
    """Raise SupportError if the load's shift, up to h mu in any direction, could make a pressure negative."""
    if height * obj.floor_friction == 0.0:
        return
    highest = spread.highest_push / obj.floor_friction
    if highest == 0.0:
        raise SupportError(
            f"the support points of {obj.name!r} lie on a line: a push at height {height:.6g} m would tip it"
        )
    if height > highest:
        raise SupportError(
            f"a push at height {height:.6g} m could lift a part of {obj.name!r}: the load's centre moves by up "
            f"to {height * obj.floor_friction:.6g} m; the contact height must be at most {highest:.6g} m"
        )
