"""Converts worlds to the bodies, convex pieces and pairs of pieces that `core.slip` simulates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

import pushplan.core.slip as slip
from pushplan.errors import SupportError
from pushplan.geometry import se2
from pushplan.geometry.convex import bounding_circle, convex_pieces
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.support import Support
from pushplan.scenario.parts import CircleObstacle
from pushplan.slip.feet import Feet, feet_of
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray, IntArray

QUADRATURE = 13
"""Degree up to which the points under a polygon have the moments of its pressure; at most 105 points."""
_ON_OUTLINE = 1e-9
"""Largest distance of an edge's middle from the outline for an edge on the outline, m."""


class Piece(NamedTuple):
    """A convex piece: index of its body, corners (k, 2) in the body's frame, mask of outline edges, rounding (m)."""

    body: int
    corners: FloatArray
    outer: FloatArray
    rounding: float = 0.0


class Pair(NamedTuple):
    """Two pieces that can touch: their indices, index of the chain's contact or -1, and friction coefficient."""

    a: int
    b: int
    contact: int
    friction: float


class Bodies(NamedTuple):
    """All bodies of a world: objects, then the pusher, then fixed bodies.

    Attributes:
        objects: Objects, those of the held chain first.
        outlines: Index of the body and corners (k, 2) in its frame, for all polygons.
        pieces: Convex pieces of all bodies, including circles and walls.
        pairs: Pairs of pieces that can touch.
    """

    objects: list[PushedObject]
    outlines: list[tuple[int, FloatArray]]
    pieces: list[Piece]
    pairs: list[Pair]


def bodies_of(world: World, chain: Chain | None = None) -> Bodies:
    """Return all bodies of a world.

    Args:
        world: World with objects, pusher and fixed bodies.
        chain: Chain that the plate holds, whose contacts are reported and whose frame is that of the pusher. None if
            the plate holds nothing; the pusher is then in the plate frame.
    """
    held = () if chain is None else chain.objects
    names = [obj.name for obj in held]
    objects = [*held, *(obj for obj in world.objects if obj.name not in names)]
    pusher = world.chain.pusher if chain is None else chain.pusher
    plate = se2.inverse(pusher.plate_pose) if chain is None else np.zeros(3)
    carried = [
        se2.transform_points(plate, part) if plate.any() else part for part in (pusher.outline, *pusher.footprint)
    ]
    n = len(objects)
    outlines = [*enumerate(obj.outline for obj in objects), *((n, part) for part in carried)]
    outlines += [(n + 1, one.outline) for one in world.obstacles if not isinstance(one, CircleObstacle)]
    pieces = [piece for number, outline in outlines for piece in cut(number, outline)]
    pieces += _round_and_walls(world, n + 1)
    return Bodies(objects, outlines, pieces, _pairs(world, chain, [obj.name for obj in objects], pieces))


def pack_world(world: World, chain: Chain | None = None) -> slip.World:
    """Return a world for the core, with the objects in the world's order; see `bodies_of`.

    Raises:
        SupportError: If the load under an object is not known, or it has no friction with the floor.
    """
    objects, _, pieces, pairs = bodies_of(world, chain)
    order = np.array([world.names.index(obj.name) for obj in objects])
    held = world.chain if chain is None else chain
    return pack_bodies(objects, pieces, pairs, half_extent(held), push_heights(held, objects), order)


def push_heights(chain: Chain, objects: Sequence[PushedObject]) -> FloatArray:
    """Return the heights (n,) above the floor at which objects are pushed, m: the middles of intervals.

    Objects outside the chain are pushed by the plate at its contact height.
    """
    own = dict(zip((obj.name for obj in chain.objects), chain.contact_heights.mean(axis=1), strict=True))
    others = float(np.mean(chain.pusher.contact_height))
    return np.array([own.get(obj.name, others) for obj in objects])


def pack_bodies(
    objects: Sequence[PushedObject],
    pieces: Sequence[Piece],
    pairs: Sequence[Pair],
    length: float,
    heights: ArrayLike = 0.0,
    order: IntArray | None = None,
) -> slip.World:
    """Return the world of the core for objects and pieces.

    Args:
        objects: Objects whose feet stand on the floor; their poses are ignored.
        pieces: Pieces of objects, pusher and fixed bodies, numbered as in `slip.World`.
        pairs: Pairs of pieces that can touch.
        length: Characteristic length, m.
        heights: Heights (n,) at which objects are pushed, or one for all, m; they shift the loads.
        order: External indices (n,) of the objects; None if they are the same.

    Raises:
        SupportError: If the load under an object is not known, or it has no friction with the floor.
    """
    feet = [_feet(obj, h) for obj, h in zip(objects, np.broadcast_to(heights, len(objects)), strict=True)]
    return slip.World(
        feet=np.concatenate([rows for rows, _, _ in feet]),
        first_foot=np.cumsum([0, *(len(rows) for rows, _, _ in feet)]),
        loads=np.array([load for _, load, _ in feet]),
        center=np.array([center for _, _, center in feet]),
        corners=np.concatenate([_corner_rows(piece) for piece in pieces]),
        parts=_part_rows(pieces),
        circles=np.array([_circle(piece) for piece in pieces]),
        pairs=np.array([[pair.a, pair.b, pair.contact] for pair in pairs], dtype=np.int64),
        friction=np.array([pair.friction for pair in pairs]),
        length=length,
        order=np.arange(len(objects)) if order is None else order,
    )


def half_extent(chain: Chain) -> float:
    """Return half of the diagonal of the objects' bounding box, m: the unit of moments."""
    points = np.concatenate([obj.outline_chain for obj in chain.objects])
    return 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))


@lru_cache(maxsize=256)
def _quadrature(support: Support) -> Feet:
    return feet_of(support, QUADRATURE)


def _feet(obj: PushedObject, height: float) -> tuple[FloatArray, list[float], FloatArray]:
    """Return feet, load and centre of an object; see `slip.World`."""
    if not obj.floor_friction > 0.0:
        raise SupportError(
            f"{obj.name!r} has no floor friction, so nothing would stop it; floor friction must be > 0"
        )
    if not obj.support.known:
        raise SupportError(
            f"the load under {obj.name!r} is unknown; the slip simulation needs known loads: give load fractions, a "
            f"pressure, or a world with a support (World.with_support)"
        )
    feet = _quadrature(obj.support)
    center = feet.stiffness @ feet.positions
    away = feet.positions - center
    second = (away * feet.stiffness[:, None]).T @ away
    shift = height * obj.floor_friction
    rows = np.column_stack([feet.positions, obj.friction_load * feet.fractions, feet.stiffness])
    return rows, [obj.friction_load, shift, second[0, 0], second[0, 1], second[1, 1]], center


def _round_and_walls(world: World, body: int) -> list[Piece]:
    """Return the pieces of fixed bodies without an outline: circles and walls."""
    circles = (one for one in world.obstacles if isinstance(one, CircleObstacle))
    found = [Piece(body, circle.center[None], np.ones(1), circle.radius) for circle in circles]
    area = world.workspace
    if area is not None:
        x0, x1, y0, y1 = area.xmin, area.xmax, area.ymin, area.ymax
        ends = np.array([[x0, y0], [x0, y1], [x1, y1], [x1, y0]])
        sides = zip(ends, np.roll(ends, -1, axis=0), strict=True)
        found += [Piece(body, np.array(side), np.array([1.0, 0.0])) for side in sides]
    return found


def cut(body: int, outline: FloatArray) -> list[Piece]:
    """Return the convex pieces of an outline, with the mask of their edges on the outline."""
    return [Piece(body, *piece) for piece in _pieces(np.asarray(outline, dtype=np.float64).tobytes())]


@lru_cache(maxsize=256)
def _pieces(corners: bytes) -> tuple[tuple[FloatArray, FloatArray], ...]:
    outline = np.frombuffer(corners).reshape(-1, 2)
    pieces = list(convex_pieces([outline]))
    if len(pieces) == 1:
        return ((pieces[0], np.ones(len(pieces[0]))),)
    ring = shapely.LinearRing(outline)
    shapely.prepare(ring)
    middles = [0.5 * (piece + np.roll(piece, -1, axis=0)) for piece in pieces]
    away = [shapely.distance(shapely.points(points), ring) for points in middles]
    return tuple((piece, np.where(d < _ON_OUTLINE, 1.0, 0.0)) for piece, d in zip(pieces, away, strict=True))


def _corner_rows(piece: Piece) -> FloatArray:
    """Return rows (k, 5): corner x, y, outward normal of the edge that begins there, whether it is on the outline."""
    edge = np.roll(piece.corners, -1, axis=0) - piece.corners
    length = np.maximum(np.linalg.norm(edge, axis=1), 1e-300)
    return np.column_stack([piece.corners, edge[:, 1] / length, -edge[:, 0] / length, piece.outer])


def _part_rows(pieces: Sequence[Piece]) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    starts = np.cumsum([0, *(len(piece.corners) for piece in pieces)])
    return np.column_stack([[piece.body for piece in pieces], starts[:-1], starts[1:]]).astype(np.int64)


def _circle(piece: Piece) -> FloatArray:
    circle = np.append(piece.corners[0], 0.0) if len(piece.corners) == 1 else bounding_circle(piece.corners)
    return np.append(circle + np.array([0.0, 0.0, piece.rounding]), piece.rounding)


def _pairs(world: World, chain: Chain | None, names: Sequence[str], pieces: Sequence[Piece]) -> list[Pair]:
    """Return the pairs of pieces that can touch, those of the chain's contacts first."""
    n = len(names)
    contacts = () if chain is None else chain.contacts
    contact_of = {(c.pusher if c.pusher >= 0 else n, c.pushed): k for k, c in enumerate(contacts)}
    found = []
    for a, one in enumerate(pieces):
        for b, other in enumerate(pieces):
            if one.body < other.body < n or (one.body >= n and other.body < n):
                known = contact_of.get((one.body, other.body), -1)
                if known >= 0:
                    friction = contacts[known].friction
                elif one.body > n:
                    friction = world.other_friction
                else:
                    friction = world.friction(None if one.body == n else names[one.body], names[other.body])
                found.append(Pair(a, b, known, friction))
    return sorted(found, key=lambda pair: pair.contact < 0)
