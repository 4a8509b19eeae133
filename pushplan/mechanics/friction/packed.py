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
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
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

    Forces at the two ends of the segment span the cone of these wrenches, and its facets are: the two sides
    of the friction cone, no tipping about the right end, no tipping about the left end.

    Args:
        contact: Its force acts on the pushed body, moments are about the chain frame's origin.
        length: Characteristic length by which the moments are divided, m.
    """
    normal, tangent, mu = contact.normal, contact.tangent, contact.friction
    right, left = contact.right, contact.left
    rows = np.array(
        [
            [*(mu * normal - tangent), 0.0],
            [*(mu * normal + tangent), 0.0],
            [-right[1], right[0], -length],
            [left[1], -left[0], length],
        ]
    )
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True), dtype=np.float64)


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
    support = obj.support
    if isinstance(support, UniformSupport):
        return _pack_polygon(obj, support, height)
    if isinstance(support, FeetSupport) and support.fractions is not None:
        even = np.full(len(support.positions), 1.0 / len(support.positions))
        return _pack_points(obj, support.positions, support.fractions, even, height)
    if isinstance(support, PressureMapSupport):
        return _pack_points(obj, support.points, support.fractions, support.fractions, height)
    raise SupportError(
        f"the load under {obj.name!r} is unknown; this needs known loads: give load fractions or a pressure, "
        f"or use the stable set 'stable' or 'robust'"
    )


def _pack_polygon(
    obj: PushedObject, support: UniformSupport, height: float
) -> tuple[int, list[float], FloatArray, ComplexArray]:
    turn = float(obj.pose_chain[2])
    moments = support.moments
    corners = rotate(turn, support.outline - moments.centroid)
    gradient = rotate(turn, support.gradient)
    rotation = rotate(turn, np.eye(2)).T
    second = rotation @ moments.second @ rotation.T
    radius = float(np.linalg.norm(corners, axis=1).max())
    density = 1.0 / moments.area
    shift = height * obj.floor_friction
    _require_pressed(obj, density + corners @ gradient, np.ones(len(corners)), corners, second, height)
    anchor = transform_points(obj.pose_chain, moments.centroid)
    row = [obj.friction_load, *anchor, radius, density, *gradient, shift, *second[[0, 0, 1], [0, 1, 1]]]
    kind = AFFINE if shift > 0.0 or gradient.any() else UNIFORM
    return kind, row, _edges(corners), series_coefficients(corners, radius)


def _pack_points(
    obj: PushedObject, points: FloatArray, fractions: FloatArray, stiffness: FloatArray, height: float
) -> tuple[int, list[float], FloatArray, ComplexArray]:
    center = stiffness @ points
    offsets = rotate(float(obj.pose_chain[2]), points - center)
    second = (offsets * stiffness[:, None]).T @ offsets
    radius = float(np.linalg.norm(offsets, axis=1).max())
    shift = height * obj.floor_friction
    _require_pressed(obj, fractions, stiffness, offsets, second, height)
    anchor = transform_points(obj.pose_chain, center)
    row = [obj.friction_load, *anchor, radius, 0.0, 0.0, 0.0, shift, *second[[0, 0, 1], [0, 1, 1]]]
    parts = np.column_stack([offsets, fractions, stiffness, np.zeros(len(points))])
    return POINTS, row, parts, np.zeros((len(WEIGHTS), TERMS), dtype=np.complex128)


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


def _require_pressed(
    obj: PushedObject,
    base: FloatArray,
    stiffness: FloatArray,
    offsets: FloatArray,
    second: FloatArray,
    height: float,
) -> None:
    """Raise SupportError if the load's shift, up to h mu in any direction, could make a pressure negative."""
    if height * obj.floor_friction == 0.0:
        return
    values = np.linalg.eigvalsh(second)
    if values[0] <= 1e-12 * values[1]:
        raise SupportError(
            f"the support points of {obj.name!r} lie on a line: a push at height {height:.6g} m would tip it"
        )
    lever = np.linalg.norm(np.linalg.solve(second, offsets.T), axis=0) * stiffness
    highest = float(np.min(base / np.maximum(lever, 1e-300))) / obj.floor_friction
    if height > highest:
        raise SupportError(
            f"a push at height {height:.6g} m could lift a part of {obj.name!r}: the load's centre moves by up "
            f"to {height * obj.floor_friction:.6g} m; the contact height must be at most {highest:.6g} m"
        )
