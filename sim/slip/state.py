"""A world as flat arrays, what it remembers from step to step, and the room to work in, for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.util.arrays import FloatArray, IntArray


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
