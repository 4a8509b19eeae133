"""How the robot drives alone: shortest paths of its wheels (Reeds-Shepp for a car), and whether they are free."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.mechanics.chain import Drive
from pushplan.planners.collision.separation import Scene, step, sweep_is_free
from pushplan.planners.problem.rows import put
from pushplan.planners.problem.steering import cheapest
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray

LEFT, STRAIGHT, RIGHT = 1, 0, -1
"""Letters: the sign of the curvature."""

LETTERS = 5
"""Of a word, at most."""

FORMULAS = 11
MOST_WORDS = 4 * FORMULAS

ROUNDING = 1e-10
"""By so much, in radii of turning, lengths of the wrong sign are zeros; not tuned."""


@inlined
def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@no_refcount
def _tau_omega(u: float, v: float, xi: float, eta: float, phi: float) -> tuple[float, float]:
    delta = wrapped(u - v)
    a, b = math.sin(u) - math.sin(delta), math.cos(u) - math.cos(delta) - 1.0
    first = math.atan2(eta * a - xi * b, xi * a + eta * b)
    second = 2.0 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3.0
    tau = wrapped(first + math.pi) if second < 0.0 else wrapped(first)
    return tau, wrapped(tau - u + v - phi)


@inlined
def _solve(formula: int, x: float, y: float, phi: float, letters: FloatArray, lengths: FloatArray) -> int:
    """Fill in a word that leads from the origin to (x, y, phi); return its number of letters, 0 if there is none."""
    plus = formula in (0, 2, 5)  # the last turn is to the same side as the first
    sign = 1.0 if plus else -1.0
    xi, eta = x - sign * math.sin(phi), y - 1.0 + sign * math.cos(phi)
    rho, theta = math.hypot(xi, eta), math.atan2(eta, xi)
    count = 3
    letters[0] = LEFT
    t = u = v = 0.0
    if formula == 0:  # L S L
        letters[1], letters[2] = STRAIGHT, LEFT
        t, u = theta, rho
        v = wrapped(phi - t)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, u, v
    elif formula == 1:  # L S R
        letters[1], letters[2] = STRAIGHT, RIGHT
        if rho < 2.0:
            return 0
        u = math.sqrt(rho * rho - 4.0)
        t = wrapped(theta + math.atan2(2.0, u))
        v = wrapped(t - phi)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, u, v
    elif formula == 2:  # L R- L
        letters[1], letters[2] = RIGHT, LEFT
        if rho > 4.0:
            return 0
        u = -2.0 * math.asin(0.25 * rho)
        t = wrapped(theta + 0.5 * u + math.pi)
        v = wrapped(phi - t + u)
        if t < -ROUNDING or u > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, u, v
    elif formula == 3:  # L R L- R-
        count, letters[1], letters[2], letters[3] = 4, RIGHT, LEFT, RIGHT
        share = 0.25 * (2.0 + rho)
        if share > 1.0:
            return 0
        u = math.acos(share)
        t, v = _tau_omega(u, -u, xi, eta, phi)
        if t < -ROUNDING or v > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, u, -u, v
    elif formula == 4:  # L R- L- R
        count, letters[1], letters[2], letters[3] = 4, RIGHT, LEFT, RIGHT
        share = (20.0 - rho * rho) / 16.0
        if share < 0.0 or share > 1.0:
            return 0
        u = -math.acos(share)
        t, v = _tau_omega(u, u, xi, eta, phi)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, u, u, v
    elif formula == 5:  # L R- S- L-
        count, letters[1], letters[2], letters[3] = 4, RIGHT, STRAIGHT, LEFT
        if rho < 2.0:
            return 0
        r = math.sqrt(rho * rho - 4.0)
        u = 2.0 - r
        t = wrapped(theta + math.atan2(r, -2.0))
        v = wrapped(phi - 0.5 * math.pi - t)
        if t < -ROUNDING or u > ROUNDING or v > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, -0.5 * math.pi, u, v
    elif formula == 6:  # L R- S- R-
        count, letters[1], letters[2], letters[3] = 4, RIGHT, STRAIGHT, RIGHT
        if rho < 2.0:
            return 0
        t = math.atan2(xi, -eta)
        u = 2.0 - rho
        v = wrapped(t + 0.5 * math.pi - phi)
        if t < -ROUNDING or u > ROUNDING or v > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, -0.5 * math.pi, u, v
    else:  # L R- S- L- R
        count, letters[1], letters[2], letters[3], letters[4] = 5, RIGHT, STRAIGHT, LEFT, RIGHT
        if rho < 2.0:
            return 0
        u = 4.0 - math.sqrt(rho * rho - 4.0)
        if u > ROUNDING:
            return 0
        t = wrapped(math.atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta))
        v = wrapped(t - phi)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, -0.5 * math.pi, u
        lengths[3], lengths[4] = -0.5 * math.pi, v
    return count


@no_refcount
def find_reeds_shepp(
    x: float, y: float, phi: float, counts: FloatArray, letters: FloatArray, lengths: FloatArray
) -> int:
    """Fill in the words that lead from the origin to a pose, in turning radii and rad.

    Args:
        x: Of the pose.
        y: Likewise.
        phi: Likewise.
        counts: (MOST_WORDS,) filled with the number of letters of each word.
        letters: (MOST_WORDS, LETTERS) filled with `LEFT`, `STRAIGHT` and `RIGHT`.
        lengths: (MOST_WORDS, LETTERS) filled with their lengths, < 0 backwards.

    Returns:
        How many there are.
    """
    n = 0
    for formula in range(FORMULAS):
        # The last three are the ones of formulas 2, 5 and 6 with their letters in the opposite order.
        turned = formula >= 8
        base = (2, 5, 6)[formula - 8] if turned else formula
        px, py = x, y
        if turned:
            px, py = x * math.cos(phi) + y * math.sin(phi), x * math.sin(phi) - y * math.cos(phi)
        for flip in (1.0, -1.0):
            for mirror in (1.0, -1.0):
                count = _solve(base, flip * px, mirror * py, flip * mirror * phi, letters[n], lengths[n])
                if count == 0:
                    continue
                for i in range(count):
                    lengths[n, i] *= flip
                    letters[n, i] *= mirror
                if turned:
                    for i in range(count // 2):
                        j = count - 1 - i
                        letters[n, i], letters[n, j] = letters[n, j], letters[n, i]
                        lengths[n, i], lengths[n, j] = lengths[n, j], lengths[n, i]
                counts[n] = count
                n += 1
    return n


OMNIDIRECTIONAL, DIFFERENTIAL, CAR = 0, 1, 2

WORD = 2 + 4 * LETTERS
"""Columns of a word: cost, number of arcs, and of each arc the twist and the length."""

SHORTEST = 1e-12
"""Arcs below this (m, rad) are left out."""


class Wheels(NamedTuple):
    """How the robot can move alone.

    Attributes:
        kind: `OMNIDIRECTIONAL`, `DIFFERENTIAL` or `CAR`.
        axle: (3,) pose in the robot's frame of the point that words are about: the axle's middle with +x forward;
            of an omnidirectional robot, its middle.
        radius: Smallest turning radius of the axle's middle, m (`CAR` only).
    """

    kind: int
    axle: FloatArray
    radius: float


def wheels_of(drive: Drive, middle: FloatArray) -> Wheels:
    """Return how a robot moves alone.

    Args:
        drive: Its drive.
        middle: (2,) of its body, about which an omnidirectional robot turns.
    """
    if drive.axle is None:
        return Wheels(OMNIDIRECTIONAL, np.append(middle, 0.0), 0.0)
    kind = CAR if drive.kind == "car" else DIFFERENTIAL
    return Wheels(kind, np.array(drive.axle), max(drive.min_radius, 1e-9))


@no_refcount
def _add(word: FloatArray, wheels: Wheels, vx: float, vy: float, omega: float, time: float) -> None:
    """Append an arc to a word: the twist (vx, vy, omega) of the axle's frame, which is driven for `time`."""
    if time * (math.hypot(vx, vy) + abs(omega)) <= SHORTEST:
        return
    x, y, heading = wheels.axle
    c, s = math.cos(heading), math.sin(heading)
    # The velocity of the robot's origin, which lies at -(x, y) from the axle's middle.
    ux, uy = c * vx - s * vy + omega * y, s * vx + c * vy - omega * x
    rate = math.hypot(ux, uy) + TURN_WEIGHT * abs(omega)
    at = 2 + 4 * int(word[1])
    word[at], word[at + 1], word[at + 2], word[at + 3] = ux / rate, uy / rate, omega / rate, time * rate
    word[0] += time * rate
    word[1] += 1.0


@no_refcount
def find_drives(wheels: Wheels, start: FloatArray, goal: FloatArray, words: FloatArray) -> int:
    """Fill `words` (MOST_WORDS, WORD) with the words between two poses (3,) of the robot; return how many."""
    ax, ay, ah = wheels.axle
    cs, ss, cg, sg = math.cos(start[2]), math.sin(start[2]), math.cos(goal[2]), math.sin(goal[2])
    dx = goal[0] + cg * ax - sg * ay - start[0] - cs * ax + ss * ay
    dy = goal[1] + sg * ax + cg * ay - start[1] - ss * ax - cs * ay
    heading = start[2] + ah
    c, s = math.cos(heading), math.sin(heading)
    x, y, phi = c * dx + s * dy, -s * dx + c * dy, wrapped(goal[2] - start[2])
    for i in range(words.shape[0]):
        words[i, 0] = words[i, 1] = 0.0
    if wheels.kind == CAR:
        n = _car_words(wheels, x, y, phi, words)
    elif wheels.kind == DIFFERENTIAL:
        n = _differential_words(wheels, x, y, phi, words)
    else:
        n = _free_words(wheels, x, y, phi, words)
    return n


@inlined
def _car_words(wheels: Wheels, x: float, y: float, phi: float, words: FloatArray) -> int:
    counts, letters, lengths = scratch(44, 1), scratch(44, 5), scratch(44, 5)  # MOST_WORDS, LETTERS
    r = wheels.radius
    n = find_reeds_shepp(x / r, y / r, phi, counts[:, 0], letters, lengths)
    for i in range(n):
        for k in range(int(counts[i, 0])):
            ahead = math.copysign(1.0, lengths[i, k])
            _add(words[i], wheels, ahead, 0.0, ahead * letters[i, k] / r, abs(lengths[i, k]) * r)
    return n


@inlined
def _differential_words(wheels: Wheels, x: float, y: float, phi: float, words: FloatArray) -> int:
    """Turn, drive straight ahead or back, turn; each turn by either side."""
    distance, n = math.hypot(x, y), 0
    for ahead in (1.0, -1.0):
        way = 0.0 if distance < SHORTEST else math.atan2(ahead * y, ahead * x)
        first, last = wrapped(way), wrapped(phi - way)
        for far_first in range(2):
            for far_last in range(2):
                one = first - far_first * math.copysign(2.0 * math.pi, first)
                two = last - far_last * math.copysign(2.0 * math.pi, last)
                _add(words[n], wheels, 0.0, 0.0, math.copysign(1.0, one), abs(one))
                _add(words[n], wheels, ahead, 0.0, 0.0, distance)
                _add(words[n], wheels, 0.0, 0.0, math.copysign(1.0, two), abs(two))
                n += 1
    return n


@inlined
def _free_words(wheels: Wheels, x: float, y: float, phi: float, words: FloatArray) -> int:
    """Both at once on one circle; move, then turn; turn, then move; by either side."""
    distance = math.hypot(x, y)
    ux, uy = (x / distance, y / distance) if distance > SHORTEST else (0.0, 0.0)
    n = 0
    for side in range(2):
        angle = phi - side * math.copysign(2.0 * math.pi, phi)
        half = 0.5 * angle
        # A full turn on one circle ends where it began: no circle leads elsewhere.
        if abs(half) < math.pi - 1e-6:
            # half / tan(half) = 1 - half^2 / 3 - ...: 1 to the last bit.
            diagonal = 1.0 if abs(half) < 1e-8 else half / math.tan(half)
            _add(words[n], wheels, diagonal * x + half * y, -half * x + diagonal * y, angle, 1.0)
            n += 1
        _add(words[n], wheels, ux, uy, 0.0, distance)
        _add(words[n], wheels, 0.0, 0.0, math.copysign(1.0, angle), abs(angle))
        n += 1
        # After the turn, the same way has another direction in the body.
        c, s = math.cos(angle), math.sin(angle)
        _add(words[n], wheels, 0.0, 0.0, math.copysign(1.0, angle), abs(angle))
        _add(words[n], wheels, c * ux + s * uy, -s * ux + c * uy, 0.0, distance)
        n += 1
    return n


class Surroundings(NamedTuple):
    """What the robot must not touch when it drives alone.

    Attributes:
        room: The robot among what stands in the room.
        load: The robot among the objects, these in the frame of the load.
        place: (3,) pose of that frame in the world.
    """

    room: Scene
    load: Scene
    place: FloatArray


@no_refcount
def seen_from(place: FloatArray, x: float, y: float, theta: float) -> tuple[float, float, float]:
    """Return a pose in the frame that is at `place` (3,)."""
    c, s = math.cos(place[2]), math.sin(place[2])
    dx, dy = x - place[0], y - place[1]
    return c * dx + s * dy, -s * dx + c * dy, theta - place[2]


@no_refcount
def arc_is_free(around: Surroundings, x: float, y: float, theta: float, arc: FloatArray) -> bool:
    """Return whether the robot keeps clear of everything along an arc (4,) from a pose."""
    if arc[3] <= 0.0:
        return True
    if not sweep_is_free(around.room, x, y, theta, arc[0], arc[1], arc[2], arc[3]):
        return False
    a, b, c = seen_from(around.place, x, y, theta)
    return sweep_is_free(around.load, a, b, c, arc[0], arc[1], arc[2], arc[3])


@inlined
def _word_is_free(around: Surroundings, start: FloatArray, word: FloatArray) -> bool:
    """Return whether the robot keeps clear of everything along a word from a pose (3,)."""
    x, y, theta = start[0], start[1], start[2]
    free = True
    for k in range(int(word[1])):
        at = 2 + 4 * k
        free = free and arc_is_free(around, x, y, theta, word[at : at + 4])
        x, y, theta = step(x, y, theta, word[at], word[at + 1], word[at + 2], word[at + 3])
    return free


@no_refcount
def drive(
    around: Surroundings,
    wheels: Wheels,
    start: FloatArray,
    goal: FloatArray,
    bound: float,
    tries: int,
    arcs: FloatArray,
) -> tuple[float, int]:
    """Find the cheapest free word between two poses.

    Args:
        around: What not to touch.
        wheels: How the robot moves.
        start: (3,) pose of the robot.
        goal: Likewise.
        bound: Only cheaper words count.
        tries: So many are swept, cheapest first, at most.
        arcs: (LETTERS, 4) filled with the arcs.

    Returns:
        The cost, infinite if there is none, and the number of arcs.
    """
    words = scratch(44, 22)  # MOST_WORDS, WORD
    n = find_drives(wheels, start, goal, words)
    for _ in range(tries):
        best = cheapest(words, n, bound)
        if best < 0:
            break
        if _word_is_free(around, start, words[best]):
            count = int(words[best, 1])
            for k in range(count):
                put(arcs[k], words[best, 2 + 4 * k : 6 + 4 * k])
            return words[best, 0], count
        words[best, 0] = np.inf
    return np.inf, 0


@compiled
def shortest_drive(wheels: Wheels, start: FloatArray, goal: FloatArray) -> float:
    """Return the cost of the cheapest word between two poses where nothing is in the way."""
    words = np.empty((MOST_WORDS, WORD))
    return float(words[: find_drives(wheels, start, goal, words), 0].min())
