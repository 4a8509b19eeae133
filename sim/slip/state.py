"""What the slip simulator steps: bodies, contacts and settings packed for compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from pushplan.errors import SupportError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.support import Support
from pushplan.planners.collision.scene import bounding_circle, convex_pieces
from pushplan.scenario.parts import CircleObstacle
from pushplan.sim.feet import Feet, feet_of
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray, IntArray

QUADRATURE = 13
"""Degree up to which the points under a polygon have the moments of its pressure: at most 105 points."""
_ON_OUTLINE = 1e-9
"""Distance (m) from the outline up to which the middle of a piece's edge is on it."""


class Piece(NamedTuple):
    """A convex piece of a body: its number, corners (k, 2) in its frame, whether edges are outline, rounding (m)."""

    body: int
    corners: FloatArray
    outer: FloatArray
    rounding: float = 0.0


class Pair(NamedTuple):
    """Two pieces that may touch: their numbers, the chain's contact that this is, or -1, coefficient of friction."""

    a: int
    b: int
    contact: int
    friction: float


def pack_world(world: World, chain: Chain | None = None) -> tuple[PackedWorld, IntArray]:
    """Return the arrays of a world, and which of its objects they have in what order (n,).

    Args:
        world: All objects, the pusher, and what stands still.
        chain: What the plate holds: its objects come first, and the pusher is in its frame. None for nothing; the
            pusher is in the plate frame then.

    Raises:
        SupportError: When the load under an object is not known, or it has no friction with the floor.
    """
    held = () if chain is None else chain.objects
    names = [obj.name for obj in held]
    objects = [*held, *(obj for obj in world.objects if obj.name not in names)]
    order = np.array([world.names.index(obj.name) for obj in objects])
    pusher = world.chain.pusher if chain is None else chain.pusher
    plate = se2.inverse(pusher.plate_pose) if chain is None else np.zeros(3)
    carried = [
        se2.transform_points(plate, part) if plate.any() else part
        for part in (pusher.outline, *pusher.footprint)
    ]
    n = len(objects)
    pieces = [piece for i, obj in enumerate(objects) for piece in cut(i, obj.outline)]
    pieces += [piece for outline in carried for piece in cut(n, outline)]
    pieces += _standing(world, n + 1)
    pairs = _pairs(world, chain, [obj.name for obj in objects], pieces)
    length = half_extent(world.chain if chain is None else chain)
    return pack_bodies(objects, pieces, pairs, length, pusher.contact_height), order


def pack_bodies(
    objects: Sequence[PushedObject],
    pieces: Sequence[Piece],
    pairs: Sequence[Pair],
    length: float,
    height: float = 0.0,
) -> PackedWorld:
    """Return the arrays of objects and of all pieces, theirs included.

    Args:
        objects: Whose feet stand on the floor; where they are does not matter.
        pieces: Of objects, pusher and what stands still, numbered as in `PackedWorld`.
        pairs: Which of them may touch.
        length: Characteristic length, m.
        height: Of the contact forces above the floor, m.

    Raises:
        SupportError: When the load under an object is not known, or it has no friction with the floor.
    """
    feet = [_feet(obj, height) for obj in objects]
    return PackedWorld(
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
    )


def half_extent(chain: Chain) -> float:
    """Return half of the largest distance between two points of the objects, about, m: the unit of moments."""
    points = np.concatenate([obj.outline_chain for obj in chain.objects])
    return 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))


@lru_cache(maxsize=256)
def _quadrature(support: Support) -> Feet:
    return feet_of(support, QUADRATURE)


def _feet(obj: PushedObject, height: float) -> tuple[FloatArray, list[float], FloatArray]:
    """Return feet, load and centre of an object; see `PackedWorld`."""
    if not obj.floor_friction > 0.0:
        raise SupportError(
            f"{obj.name!r} has no friction with the floor: nothing would stop it; floor friction must be > 0"
        )
    if not obj.support.known:
        raise SupportError(
            f"the load under {obj.name!r} is unknown; simulating slip needs known loads: give load fractions or a "
            f"pressure, or a world with a support (World.with_support)"
        )
    feet = _quadrature(obj.support)
    center = feet.stiffness @ feet.positions
    away = feet.positions - center
    second = (away * feet.stiffness[:, None]).T @ away
    shift = height * obj.floor_friction
    rows = np.column_stack([feet.positions, obj.friction_load * feet.fractions, feet.stiffness])
    return rows, [obj.friction_load, shift, second[0, 0], second[0, 1], second[1, 1]], center


def _standing(world: World, body: int) -> list[Piece]:
    """Return the pieces of obstacles and walls."""
    found: list[Piece] = []
    for obstacle in world.obstacles:
        if isinstance(obstacle, CircleObstacle):
            found.append(Piece(body, obstacle.center[None], np.ones(1), obstacle.radius))
        else:
            found += cut(body, obstacle.outline)
    area = world.workspace
    if area is not None:
        x0, x1, y0, y1 = area.xmin, area.xmax, area.ymin, area.ymax
        ends = np.array([[x0, y0], [x0, y1], [x1, y1], [x1, y0]])
        sides = zip(ends, np.roll(ends, -1, axis=0), strict=True)
        found += [Piece(body, np.array(side), np.array([1.0, 0.0])) for side in sides]
    return found


def cut(body: int, outline: FloatArray) -> list[Piece]:
    """Return the convex pieces of an outline, and which of their edges lie on it."""
    pieces = list(convex_pieces([outline]))
    if len(pieces) == 1:
        return [Piece(body, pieces[0], np.ones(len(pieces[0])))]
    ring = shapely.LinearRing(outline)
    shapely.prepare(ring)
    found = []
    for corners in pieces:
        middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
        away = shapely.distance(shapely.points(middles), ring)
        found.append(Piece(body, corners, np.where(away < _ON_OUTLINE, 1.0, 0.0)))
    return found


def _corner_rows(piece: Piece) -> FloatArray:
    """Return x, y, outward normal of the edge that begins there, and whether that is outline (k, 5)."""
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
    """Return which pieces may touch; those of the chain's contacts come first."""
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


class PackedWorld(NamedTuple):
    """What does not change while a world is simulated.

    Bodies are counted: the n objects, then the pusher (n), then all that stands still (n + 1).

    Attributes:
        feet: (f, 4) x, y in the object's frame (m), mu N (N), share in carrying a load that shifts.
        first_foot: (n + 1,) where the feet of each object begin.
        loads: (n, 5) sum of mu N (N), h mu (m), second moments of the stiffness xx, xy, yy (m^2).
        center: (n, 2) stiffness centre in the object's frame, m.
        corners: (v, 5) x, y (m) and outward normal of the edge that begins there, in the body's frame; 1 where that
            edge is a piece of the outline, 0 where it only parts two convex pieces.
        parts: (p, 3) body, first corner, one past the last, of each convex piece; one corner is a disc.
        circles: (p, 4) centre and radius (m) of a circle around each piece, in the body's frame, and the radius that
            its corners are rounded by.
        pairs: (q, 3) pieces a and b that may touch, and the chain's contact whose bodies these are, or -1.
        friction: (q,) coefficient between them.
        length: Characteristic length L, m.
    """

    feet: FloatArray
    first_foot: IntArray
    loads: FloatArray
    center: FloatArray
    corners: FloatArray
    parts: IntArray
    circles: FloatArray
    pairs: IntArray
    friction: FloatArray
    length: float


class Work(NamedTuple):
    """What a step works on; c is the largest number of manifolds.

    All places are in world axes about the plate's reference point O at the step's start; twists are (v_x, v_y, L w)
    about O, moments are divided by L.

    Attributes:
        poses: (n + 1, 3) of objects and plate for which the contacts are looked up.
        place: (n + 2, 4) x, y, cosine and sine of the heading of every body.
        corners: (v, 4) x, y and outward normals of all corners.
        feet: (f, 3) x / L, y / L, mu N of all feet.
        twists: (n + 2, 3) U, displacements in this step.
        gradient: (n, 3) g, friction wrench on the floor.
        secant: (n, 6) K, as xx, xy, xw, yy, yw, ww.
        curvature: (n, 6) H, likewise.
        inverse: (n, 6) of the step's matrix, likewise.
        who: (c, 4) body a, body b, pair, number of points of every manifold.
        frame: (c, 5) normal from a into b, tangent, coefficient of friction.
        spots: (c, 4) x, y of the right and the left point.
        gaps: (c, 2) at the points, m.
        rows: (c, 3, 3) of right normal, left normal and tangent: row . (U_b - U_a) is the relative displacement.
        forces: (c, 3) multipliers, N.
        modes: (c, 3) 1 where a normal is active; tangent: 0 free, 1 sticks, 2 or -2 slips with a force of that sign.
        linked: (n + 2,) 1 for bodies that active contacts connect with the pusher.
        matrix: (3 c, 3 c + 1) linear system of the multipliers.
        found: (q,) the manifold that every pair belongs to, or -1; pairs that touch on one line share one.
        memory: (q, 4) multipliers of every pair in the last step, and its number of points.
        tableau: (5 c, 10 c + 2) of Lemke's method.
        basis: (5 c,) likewise.
        kept_twists: (n, 3) U of the fallback's solution.
        kept_forces: (c, 3) multipliers of the fallback's solution.
    """

    poses: FloatArray
    place: FloatArray
    corners: FloatArray
    feet: FloatArray
    twists: FloatArray
    gradient: FloatArray
    secant: FloatArray
    curvature: FloatArray
    inverse: FloatArray
    who: IntArray
    frame: FloatArray
    spots: FloatArray
    gaps: FloatArray
    rows: FloatArray
    forces: FloatArray
    modes: IntArray
    linked: IntArray
    matrix: FloatArray
    found: IntArray
    memory: FloatArray
    tableau: FloatArray
    basis: IntArray
    kept_twists: FloatArray
    kept_forces: FloatArray


def make_work(packed: PackedWorld) -> Work:
    """Return room for a world; up to 16 manifolds an object and 16 more."""
    n, most = len(packed.loads), min(16 * len(packed.loads) + 16, len(packed.pairs))
    return Work(
        poses=np.zeros((n + 1, 3)),
        place=np.zeros((n + 2, 4)),
        corners=np.zeros((len(packed.corners), 4)),
        feet=np.zeros((len(packed.feet), 3)),
        twists=np.zeros((n + 2, 3)),
        gradient=np.zeros((n, 3)),
        secant=np.zeros((n, 6)),
        curvature=np.zeros((n, 6)),
        inverse=np.zeros((n, 6)),
        who=np.zeros((most, 4), dtype=np.int64),
        frame=np.zeros((most, 5)),
        spots=np.zeros((most, 4)),
        gaps=np.zeros((most, 2)),
        rows=np.zeros((most, 3, 3)),
        forces=np.zeros((most, 3)),
        modes=np.zeros((most, 3), dtype=np.int64),
        linked=np.zeros(n + 2, dtype=np.int64),
        matrix=np.zeros((3 * most, 3 * most + 1)),
        found=np.zeros(len(packed.pairs), dtype=np.int64),
        memory=np.zeros((len(packed.pairs), 4)),
        tableau=np.zeros((5 * most, 10 * most + 2)),
        basis=np.zeros(5 * most, dtype=np.int64),
        kept_twists=np.zeros((n, 3)),
        kept_forces=np.zeros((most, 3)),
    )


OPEN, STICK, SLIDE, ROLL, ROLL_SLIDE = 0, 1, 2, 3, 4
"""What a contact does: nothing; both ends hold; both touch and slide; one end holds; one touches and slides."""

CONVERGED, FALLBACK, UNSOLVED, JAMMED, CROWDED = 0, 1, 2, 3, 4
"""How a step ended: by Newton's method; with the fallback's help; no motion was found that balances all forces; no
motion satisfies all contacts; more manifolds than there is room for. After the last three nothing has moved."""


class State(NamedTuple):
    """Where everything is, and the last step's solution, with which the next one begins.

    Attributes:
        poses: (n + 1, 3) poses of the objects and, last, of the chain frame (the plate), in the world.
        twists: (n, 3) U of the last step over the plate's size of step, in the plate's axes.
        drag: (n, 2) force that every object drags over the floor with, in the object's axes, N.
        steps: (1,) steps since the beginning.
    """

    poses: FloatArray
    twists: FloatArray
    drag: FloatArray
    steps: IntArray


class Trace(NamedTuple):
    """What m steps leave behind.

    Attributes:
        poses: (m, n, 3) of the objects after every step.
        modes: (m, n) of the chain's contacts, `OPEN` to `ROLL_SLIDE`.
        forces: (m, n, 3) of the chain's contacts: normal force at the right and the left end, tangential force, N.
        wrenches: (m, 3) with which the plate pushes on all that it touches, in the chain frame: N, N, N m.
        others: (m, n) number of other active contacts of every object: with obstacles, walls, or bodies it was not
            stacked on.
        residual: (m,) of the balance, over the sum of mu N of all objects.
        end: (m,) how every step ended, `CONVERGED` to `CROWDED`.
    """

    poses: FloatArray
    modes: IntArray
    forces: FloatArray
    wrenches: FloatArray
    others: IntArray
    residual: FloatArray
    end: IntArray


def make_state(poses: FloatArray) -> State:
    """Return the state of objects and plate (n + 1, 3) that have not moved yet."""
    n = len(poses) - 1
    return State(
        poses=np.array(poses, dtype=np.float64),
        twists=np.zeros((n, 3)),
        drag=np.zeros((n, 2)),
        steps=np.zeros(1, dtype=np.int64),
    )


def make_trace(steps: int, objects: int) -> Trace:
    """Return room for what `steps` steps leave behind."""
    return Trace(
        np.zeros((steps, objects, 3)),
        np.zeros((steps, objects), dtype=np.int64),
        np.zeros((steps, objects, 3)),
        np.zeros((steps, 3)),
        np.zeros((steps, objects), dtype=np.int64),
        np.zeros(steps),
        np.zeros(steps, dtype=np.int64),
    )
