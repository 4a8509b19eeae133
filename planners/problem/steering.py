"""Steering paths: exact connections of two poses by three stable arcs (Dubins paths)."""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import inlined, no_refcount
from pushplan.compiled.scratch import scratch, scratch_integers
from pushplan.planners.collision.separation import Scene, step, sweep_is_free
from pushplan.planners.problem.rows import put
from pushplan.util.arrays import FloatArray

LEFT, STRAIGHT, RIGHT = 0, 1, 2
"""Rows of a family: (3, 3) body twists scaled to a cost rate of 1; a row of zeros is a motion that is not used."""

MAX_WORDS = 12
"""Words per family: four turn-straight-turn with up to two roots each, two turn-turn-turn with two apexes."""

MOST_FAMILIES = 3
"""Families that a connection is looked for in, at most."""
MOST_WORDS = MOST_FAMILIES * MAX_WORDS


@no_refcount
def _turn(angle: float) -> float:
    """Angle in [0, 2 pi), with rounding just below a full turn removed."""
    wrapped = angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))  # half the time of %
    return 0.0 if wrapped > 2.0 * math.pi - 1e-11 else max(wrapped, 0.0)


@no_refcount
def _cor(twist: FloatArray) -> tuple[float, float]:
    """Centre of rotation of a turning body twist, in the body frame."""
    return -twist[1] / twist[2], twist[0] / twist[2]


@inlined
def _store(words: FloatArray, n: int, a: int, b: int, c: int, p: float, q: float, r: float) -> int:
    """Write one word: cost, three letters, three lengths; return how many there are now."""
    words[n, 0] = p + q + r
    words[n, 1], words[n, 2], words[n, 3] = a, b, c
    words[n, 4], words[n, 5], words[n, 6] = p, q, r
    return n + 1


@inlined
def _straight_words(
    family: FloatArray, first: int, last: int, start: FloatArray, goal: FloatArray, words: FloatArray, n: int
) -> int:
    """Append the words turn-straight-turn with the given turns; the straight part carries c1 to c2's goal."""
    ux, uy = family[STRAIGHT, 0], family[STRAIGHT, 1]
    c1x, c1y = _cor(family[first])
    c2x, c2y = _cor(family[last])
    px, py = _moved(start, c1x, c1y)
    qx, qy = _moved(goal, c2x, c2y)
    # c1 rests at p during the first turn, c2 at q during the last: in between, R(heading) (e + p u) = d = q - p,
    # with e = c2 - c1 in the body and |u| = 1, so that p = -e.u +- sqrt((e.u)^2 - |e|^2 + |d|^2).
    ex, ey = c2x - c1x, c2y - c1y
    dx, dy = qx - px, qy - py
    along = ex * ux + ey * uy
    under_root = along * along - ex * ex - ey * ey + dx * dx + dy * dy
    if under_root < 0.0:
        return n
    root = math.sqrt(under_root)
    for sign in (1.0, -1.0):
        p = -along + sign * root
        if p < 0.0 or (sign < 0.0 and root == 0.0):
            continue
        heading = start[2]
        # Where d is 0, every heading will do; that of the start saves the first turn.
        if dx * dx + dy * dy > 1e-24:
            heading = math.atan2(dy, dx) - math.atan2(ey + p * uy, ex + p * ux)
        omega1, omega2 = family[first, 2], family[last, 2]
        # Angles count in the sense of their turn: no motion is driven backwards.
        turn1 = _turn(math.copysign(1.0, omega1) * (heading - start[2]))
        turn2 = _turn(math.copysign(1.0, omega2) * (goal[2] - heading))
        n = _store(words, n, first, 1, last, turn1 / abs(omega1), p, turn2 / abs(omega2))
    return n


@inlined
def _turning_words(
    family: FloatArray,
    first: int,
    middle: int,
    start: FloatArray,
    goal: FloatArray,
    words: FloatArray,
    n: int,
) -> int:
    """Append the words turn-turn-turn whose outer turns are alike; the middle COR is the apex of a triangle."""
    c1x, c1y = _cor(family[first])
    c2x, c2y = _cor(family[middle])
    px, py = _moved(start, c1x, c1y)
    qx, qy = _moved(goal, c1x, c1y)
    dx, dy = qx - px, qy - py
    # The apex a is c2 while the middle turn goes on: |a - p| = |a - q| = |c2 - c1|, and half the base of this
    # triangle is arm cos(opening).
    arm = math.hypot(c2x - c1x, c2y - c1y)
    distance = math.hypot(dx, dy)
    if distance > 2.0 * arm or distance < 1e-12:
        return n
    arm_angle = math.atan2(c2y - c1y, c2x - c1x)
    opening = math.acos(distance / (2.0 * arm))
    omega1, omega2 = family[first, 2], family[middle, 2]
    for sign in (1.0, -1.0):
        reach = math.atan2(dy, dx) + sign * opening
        ax, ay = px + arm * math.cos(reach), py + arm * math.sin(reach)
        heading1 = reach - arm_angle
        heading2 = math.atan2(ay - qy, ax - qx) - arm_angle
        turn1 = _turn(math.copysign(1.0, omega1) * (heading1 - start[2]))
        turn2 = _turn(math.copysign(1.0, omega2) * (heading2 - heading1))
        turn3 = _turn(math.copysign(1.0, omega1) * (goal[2] - heading2))
        lengths = turn1 / abs(omega1), turn2 / abs(omega2), turn3 / abs(omega1)
        n = _store(words, n, first, middle, first, lengths[0], lengths[1], lengths[2])
    return n


@no_refcount
def _moved(pose: FloatArray, x: float, y: float) -> tuple[float, float]:
    """World position of a body-fixed point at a pose."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + c * x - s * y, pose[1] + s * x + c * y


@no_refcount
def find_words(family: FloatArray, start: FloatArray, goal: FloatArray, words: FloatArray) -> int:
    """Fill `words` (MAX_WORDS, 7) with cost, letters and lengths of every word; return how many there are."""
    straight = family[STRAIGHT, 0] != 0.0 or family[STRAIGHT, 1] != 0.0
    n = 0
    # A step of 2 leaves out STRAIGHT, which lies between LEFT and RIGHT.
    for first in range(LEFT, RIGHT + 1, 2):
        for last in range(LEFT, RIGHT + 1, 2):
            if family[first, 2] != 0.0 and family[last, 2] != 0.0:
                if straight:
                    n = _straight_words(family, first, last, start, goal, words, n)
                if first != last:
                    n = _turning_words(family, first, last, start, goal, words, n)
    return n


@inlined
def cheapest(words: FloatArray, n: int, bound: float) -> int:
    """Row of the cheapest of n words that costs less than a bound, -1 without any."""
    best = -1
    for i in range(n):
        if words[i, 0] < bound and (best < 0 or words[i, 0] < words[best, 0]):
            best = i
    return best


@inlined
def word_is_free(scene: Scene, family: FloatArray, word: FloatArray, start: FloatArray) -> bool:
    """Return whether the three arcs of a word keep clear of everything: first the middle one, mostly the longest."""
    x, y, theta = start[0], start[1], start[2]
    first, middle, last = family[int(word[1])], family[int(word[2])], family[int(word[3])]
    x1, y1, theta1 = step(x, y, theta, first[0], first[1], first[2], word[4])
    if not _is_free(scene, x1, y1, theta1, middle, word[5]) or not _is_free(
        scene, x, y, theta, first, word[4]
    ):
        return False
    x2, y2, theta2 = step(x1, y1, theta1, middle[0], middle[1], middle[2], word[5])
    return _is_free(scene, x2, y2, theta2, last, word[6])


@inlined
def _is_free(scene: Scene, x: float, y: float, theta: float, twist: FloatArray, length: float) -> bool:
    return length <= 0.0 or sweep_is_free(scene, x, y, theta, twist[0], twist[1], twist[2], length)


@no_refcount
def connect(
    scene: Scene,
    families: FloatArray,
    start: FloatArray,
    goal: FloatArray,
    bound: float,
    tries: int,
    arcs: FloatArray,
) -> tuple[float, float]:
    """Find the cheapest free connection below a bound.

    Args:
        scene: See `collision.Scene`.
        families: (f, 3, 3) left, straight and right twists; f is at most MOST_FAMILIES.
        start: (3,) pose.
        goal: (3,) pose.
        bound: Only words cheaper than this are looked at.
        tries: So many words, cheapest first, are swept for collisions at most.
        arcs: (3, 4) filled with the twists and lengths of the connection.

    Returns:
        (cost, promise): the connection's cost, infinite if there is none; and the cheapest word's cost,
        free or not.

    Raises:
        ValueError: On more families.
    """
    if families.shape[0] > MOST_FAMILIES:
        raise ValueError("more families than there is room for")
    words, owner = scratch(MOST_WORDS, 7), scratch_integers(MOST_WORDS)
    n = 0
    for f in range(families.shape[0]):
        before, n = n, n + find_words(families[f], start, goal, words[n:])
        for i in range(before, n):
            owner[i] = f
    promise = np.inf
    for i in range(n):
        promise = min(promise, words[i, 0])
    # The cheapest by selection: of at most 36 words, a few are swept, which does not pay for sorting them.
    for _ in range(tries):
        best = cheapest(words, n, bound)
        if best < 0:
            break
        family = families[owner[best]]
        if word_is_free(scene, family, words[best], start):
            for i in range(3):
                put(arcs[i], family[int(words[best, 1 + i])])
                arcs[i, 3] = words[best, 4 + i]
            return words[best, 0], promise
        words[best, 0] = np.inf
    return np.inf, promise
