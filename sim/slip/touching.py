"""Contact manifolds: for two convex pieces that touch, one normal and one or two points (reference-face clipping).

The face whose line parts the two pieces best is the reference face; the edge of the other piece that looks against
it most is clipped to it (Catto 2006, "Fast and simple physics using sequential impulses"). Both points lie on the
reference face, so that one tangential multiplier serves both. Pieces that lie beside one another's faces touch with
a corner each. Discs are pieces with one corner and a radius.
"""

from __future__ import annotations

import math

from pushplan.compiled import inner, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.sim.slip.state import PackedWorld, Work
from pushplan.util.arrays import FloatArray

_SAME = 1e-9
"""By this share of L the second piece's face has to part better to be the reference: no change by rounding."""
SHORTEST = 1e-9
"""Distance within which two points of a manifold are one, m."""
_FLUSH = 1e-6
"""Sine of the angle, and share of L, up to which two manifolds of two bodies lie on one line."""


@inner
def place_corners(packed: PackedWorld, work: Work) -> None:
    """Bring all corners of bodies to where these are."""
    for p in range(len(packed.parts)):
        body = packed.parts[p, 0]
        x, y, c, s = work.place[body, 0], work.place[body, 1], work.place[body, 2], work.place[body, 3]
        for k in range(packed.parts[p, 1], packed.parts[p, 2]):
            px, py, nx, ny = (
                packed.corners[k, 0],
                packed.corners[k, 1],
                packed.corners[k, 2],
                packed.corners[k, 3],
            )
            work.corners[k, 0], work.corners[k, 1] = x + c * px - s * py, y + s * px + c * py
            work.corners[k, 2], work.corners[k, 3] = c * nx - s * ny, s * nx + c * ny


@inner
def find_manifolds(packed: PackedWorld, work: Work, reach: float) -> int:
    """Fill in all manifolds with a gap below `reach` (m); return their number, or -1 if there are too many."""
    found = 0
    face = scratch(1, 9)[0]
    for q in range(len(packed.pairs)):
        a, b = packed.pairs[q, 0], packed.pairs[q, 1]
        work.found[q] = -1
        if _apart(packed, work, a, b, reach):
            continue
        if not _manifold(packed, work, a, b, reach, face):
            continue
        body_a, body_b = packed.parts[a, 0], packed.parts[b, 0]
        # A face that convex pieces share would have a tangential multiplier for each of them: a singular system.
        work.found[q] = _merged(work, found, body_a, body_b, face, packed.length)
        if work.found[q] >= 0:
            continue
        if found == len(work.who):
            return -1
        _enter(work, found, face)
        work.who[found, 0], work.who[found, 1], work.who[found, 2] = body_a, body_b, q
        work.frame[found, 4] = packed.friction[q]
        work.found[q] = found
        found += 1
    for c in range(found):
        _set_rows(work, c, packed.length)
    return found


@no_refcount
def _apart(packed: PackedWorld, work: Work, a: int, b: int, reach: float) -> bool:
    """Tell whether the circles around two pieces are farther apart than `reach`."""
    one, other = work.place[packed.parts[a, 0]], work.place[packed.parts[b, 0]]
    ca, cb = packed.circles[a], packed.circles[b]
    dx = other[0] + other[2] * cb[0] - other[3] * cb[1] - one[0] - one[2] * ca[0] + one[3] * ca[1]
    dy = other[1] + other[3] * cb[0] + other[2] * cb[1] - one[1] - one[3] * ca[0] - one[2] * ca[1]
    most = ca[2] + cb[2] + reach
    return bool(dx * dx + dy * dy > most * most)


@inner
def _best_face(corners: FloatArray, first: int, last: int, begin: int, end: int) -> tuple[float, int]:
    """Return how far the best face of one piece parts it from another (< 0: overlap), and which corner begins it."""
    best, face = -math.inf, -1
    # A disc has no face.
    if last - first == 1:
        return best, face
    for k in range(first, last):
        x, y, nx, ny = corners[k, 0], corners[k, 1], corners[k, 2], corners[k, 3]
        nearest = math.inf
        for m in range(begin, end):
            nearest = min(nearest, (corners[m, 0] - x) * nx + (corners[m, 1] - y) * ny)
        if nearest > best:
            best, face = nearest, k
    return best, face


@inner
def _manifold(packed: PackedWorld, work: Work, a: int, b: int, reach: float, out: FloatArray) -> bool:
    """Fill `out` (9,): normal from a into b, right point, left point, gaps there (infinite: no such point), count."""
    a0, a1, b0, b1 = packed.parts[a, 1], packed.parts[a, 2], packed.parts[b, 1], packed.parts[b, 2]
    rounding_a, rounding_b = packed.circles[a, 3], packed.circles[b, 3]
    rounding = rounding_a + rounding_b
    away_a, face_a = _best_face(work.corners, a0, a1, b0, b1)
    away_b, face_b = _best_face(work.corners, b0, b1, a0, a1)
    if max(away_a, away_b) - rounding >= reach:
        return False
    if face_a < 0 and face_b < 0:
        return _corner_pair(work.corners, a0, b0, rounding_a, rounding, reach, out)
    # Parallel faces part alike: without a preference rounding would choose anew in every step.
    if away_b > away_a + _SAME * packed.length:
        if packed.corners[face_b, 4] == 0.0:
            return False
        after = face_b + 1 if face_b + 1 < b1 else b0
        touched = _clip(packed, work, face_b, after, a0, a1, rounding_b, rounding, reach, out)
        return _turned_round(out) if touched else False
    # That face is inside of the body, where two of its pieces meet: another piece has the contact.
    if packed.corners[face_a, 4] == 0.0:
        return False
    after = face_a + 1 if face_a + 1 < a1 else a0
    return _clip(packed, work, face_a, after, b0, b1, rounding_a, rounding, reach, out)


@no_refcount
def _clip(
    packed: PackedWorld,
    work: Work,
    face: int,
    after: int,
    begin: int,
    end: int,
    inset: float,
    rounding: float,
    reach: float,
    out: FloatArray,
) -> bool:
    """Clip the edge of the piece `begin` to `end` that looks against the face to it; see `_manifold`."""
    corners = work.corners
    x, y, nx, ny = corners[face, 0], corners[face, 1], corners[face, 2], corners[face, 3]
    # Along the face s, away from it d; 1 and 2 are the edge's ends in the order of s.
    tx, ty = -ny, nx  # from the right to the left end
    length = (corners[after, 0] - x) * tx + (corners[after, 1] - y) * ty
    one = begin
    most = math.inf
    if end - begin > 1:
        for m in range(begin, end):
            along = corners[m, 2] * nx + corners[m, 3] * ny
            if packed.corners[m, 4] != 0.0 and along < most:
                most, one = along, m
    other = one + 1 if one + 1 < end else begin
    s2, d2 = (
        (corners[one, 0] - x) * tx + (corners[one, 1] - y) * ty,
        (corners[one, 0] - x) * nx + (corners[one, 1] - y) * ny,
    )
    s1, d1 = (
        (corners[other, 0] - x) * tx + (corners[other, 1] - y) * ty,
        (corners[other, 0] - x) * nx + (corners[other, 1] - y) * ny,
    )
    if s1 > s2:
        s1, s2, d1, d2, one, other = s2, s1, d2, d1, other, one
    # Wholly beside the face: corner meets corner, and the normal is the line between them.
    if s2 < 0.0:
        return _corner_pair(corners, face, one, inset, rounding, reach, out)
    if s1 > length:
        return _corner_pair(corners, after, other, inset, rounding, reach, out)
    # Gaps where the ends of face and edge lie opposite each other.
    slope = (d2 - d1) / (s2 - s1) if s2 > s1 else 0.0
    low, high = max(s1, 0.0), min(s2, length)
    gap_low, gap_high = d1 + slope * (low - s1) - rounding, d1 + slope * (high - s1) - rounding
    if s2 - s1 <= 0.0:
        gap_low = gap_high = min(d1, d2) - rounding
    has_low, has_high = gap_low < reach, gap_high < reach and high - low > SHORTEST
    if not has_low and not has_high:
        return False
    out[0], out[1] = nx, ny
    out[2], out[3] = x + low * tx + inset * nx, y + low * ty + inset * ny
    out[4], out[5] = x + high * tx + inset * nx, y + high * ty + inset * ny
    out[6], out[7] = gap_low if has_low else math.inf, gap_high if has_high else math.inf
    out[8] = 1.0
    return True


@inner
def _corner_pair(
    corners: FloatArray, one: int, other: int, inset: float, rounding: float, reach: float, out: FloatArray
) -> bool:
    """Fill `out` for two corners with nothing between them; see `_manifold`."""
    dx, dy = corners[other, 0] - corners[one, 0], corners[other, 1] - corners[one, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    # At one place the line between two corners has no direction.
    if distance - rounding >= reach or distance <= 1e-12:
        return False
    nx, ny = dx / distance, dy / distance
    out[0], out[1] = nx, ny
    out[2], out[3] = corners[one, 0] + inset * nx, corners[one, 1] + inset * ny
    out[4], out[5] = out[2], out[3]
    out[6], out[7] = distance - rounding, math.inf
    return True


@inner
def _turned_round(out: FloatArray) -> bool:
    """Make the normal point the other way; right and left change places."""
    out[0], out[1] = -out[0], -out[1]
    for k in range(2):
        out[2 + k], out[4 + k] = out[4 + k], out[2 + k]
    out[6], out[7] = out[7], out[6]
    return True


@no_refcount
def _enter(work: Work, c: int, found: FloatArray) -> None:
    """Write a manifold down; its only point counts as the first."""
    nx, ny = found[0], found[1]
    work.frame[c, 0], work.frame[c, 1], work.frame[c, 2], work.frame[c, 3] = nx, ny, -ny, nx
    count = 0
    for k in range(2):
        if found[6 + k] < math.inf:
            work.spots[c, 2 * count], work.spots[c, 2 * count + 1] = found[2 + 2 * k], found[3 + 2 * k]
            work.gaps[c, count] = found[6 + k]
            count += 1
    work.who[c, 3] = count


@inner
def _merged(work: Work, found: int, a: int, b: int, new: FloatArray, length: float) -> int:
    """Add the points to an earlier manifold of the same bodies on the same line; return its number, or -1."""
    for c in range(found):
        if work.who[c, 0] != a or work.who[c, 1] != b:
            continue
        nx, ny = work.frame[c, 0], work.frame[c, 1]
        aside = (new[2] - work.spots[c, 0]) * nx + (new[3] - work.spots[c, 1]) * ny
        if (
            nx * new[0] + ny * new[1] < 0.0
            or abs(nx * new[1] - ny * new[0]) > _FLUSH
            or abs(aside) > _FLUSH * length
        ):
            continue
        for k in range(2):
            if new[6 + k] < math.inf:
                _widen(work, c, new[2 + 2 * k], new[3 + 2 * k], new[6 + k])
        return c
    return -1


@inner
def _widen(work: Work, c: int, x: float, y: float, gap: float) -> None:
    """Keep the outermost two of a manifold's points and a new one."""
    tx, ty = work.frame[c, 2], work.frame[c, 3]
    s = (x - work.spots[c, 0]) * tx + (y - work.spots[c, 1]) * ty
    if abs(s) <= SHORTEST:  # a corner that two pieces share
        return
    if work.who[c, 3] == 1:
        k = 1
        if s < 0.0:
            work.spots[c, 2], work.spots[c, 3], work.gaps[c, 1] = (
                work.spots[c, 0],
                work.spots[c, 1],
                work.gaps[c, 0],
            )
            k = 0
        work.who[c, 3] = 2
    elif s < 0.0:
        k = 0
    elif (x - work.spots[c, 2]) * tx + (y - work.spots[c, 3]) * ty > 0.0:
        k = 1
    else:
        return
    work.spots[c, 2 * k], work.spots[c, 2 * k + 1], work.gaps[c, k] = x, y, gap


@inner
def _set_rows(work: Work, c: int, length: float) -> None:
    """Fill the rows of a manifold: n and t as wrenches about O, moments over L."""
    nx, ny, tx, ty = work.frame[c, 0], work.frame[c, 1], work.frame[c, 2], work.frame[c, 3]
    for k in range(2):
        x, y = work.spots[c, 2 * k], work.spots[c, 2 * k + 1]
        row = work.rows[c, k]
        row[0], row[1], row[2] = nx, ny, (x * ny - y * nx) / length
    x, y = work.spots[c, 0], work.spots[c, 1]
    row = work.rows[c, 2]
    row[0], row[1], row[2] = tx, ty, (x * ty - y * tx) / length
