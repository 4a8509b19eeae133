"""Good poses to change the contact at, by random descent where nothing is in the way.

For a sequence of contacts, the poses between its pushes are moved for as long as the sum of the cheapest words gets
less; many such descents from random beginnings find the sequences that are worth looking at in the room.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.planners.collision.separation import step
from pushplan.planners.multi.pushing import PackedMode, joined, seen_from_contact
from pushplan.planners.multi.transit import TURN_LENGTH
from pushplan.planners.problem.problem import random
from pushplan.planners.problem.steering import MAX_WORDS, find_words
from pushplan.util.arrays import FloatArray, IntArray, RandomState

WIDEST = 0.3
"""Scale of the first moves, m; a turn by 1 rad counts `TURN_LENGTH`."""

MOVES = 120
"""Of a random descent, for each pose."""


class PackedModes(NamedTuple):
    """All contacts, stacked: see `PackedMode`; families that one contact has less than others are zeros."""

    families: FloatArray
    contact: FloatArray
    settling: FloatArray
    settle: float


def pack_modes(modes: Sequence[PackedMode]) -> PackedModes:
    """Return contacts stacked."""
    most = max(len(mode.families) for mode in modes)
    families = np.zeros((len(modes), most, 3, 3))
    for i, mode in enumerate(modes):
        families[i, : len(mode.families)] = mode.families
    contact, settling = (
        np.array([getattr(mode, name) for mode in modes]) for name in ("contact", "settling")
    )
    return PackedModes(families, contact, settling, modes[0].settle)


@compiled
def _cost(modes: PackedModes, m: int, start: FloatArray, goal: FloatArray, words: FloatArray) -> float:
    """Cost of the cheapest push by contact m."""
    begin, end = joined(start, modes.contact[m]), joined(goal, modes.contact[m])
    begin[0], begin[1], begin[2] = step(
        begin[0], begin[1], begin[2], modes.settling[m, 0], modes.settling[m, 1], 0.0, modes.settle
    )
    best = np.inf
    for f in range(modes.families.shape[1]):
        for k in range(find_words(modes.families[m, f], begin, end, words)):
            best = min(best, words[k, 0])
    return best + modes.settle


@compiled
def _normal(state: RandomState) -> float:
    """Draw a normally distributed number (Box and Muller 1958)."""
    return math.sqrt(-2.0 * math.log(1.0 - random(state))) * math.cos(2.0 * math.pi * random(state))


@compiled
def pushed_at_random(
    modes: PackedModes, m: int, pose: FloatArray, sense: float, state: RandomState
) -> FloatArray:
    """Return where a random push by contact m brings a load, or, with sense -1, brings it from."""
    twist = modes.families[m, 0, int(3 * random(state))]
    length = 0.03 * 50.0 ** random(state)  # of straight pushes, from 0.03 to 1.5 m
    if twist[2] != 0.0:
        length = 0.75 * math.pi * random(state) / abs(twist[2])
    at = joined(pose, modes.contact[m])
    at[0], at[1], at[2] = step(at[0], at[1], at[2], twist[0], twist[1], twist[2], sense * length)
    return seen_from_contact(at, modes.contact[m])


@compiled
def descend(
    modes: PackedModes,
    sequence: IntArray,
    ends: FloatArray,
    poses: FloatArray,
    scale: float,
    moves: int,
    state: RandomState,
) -> float:
    """Move the poses between pushes so that these get cheaper; return the sum of the pushes' costs.

    Args:
        modes: All contacts.
        sequence: (k,) contact of each push.
        ends: (2, 3) first and last pose of the load.
        poses: (k - 1, 3) between the pushes; changed.
        scale: Of the first moves, m.
        moves: Tried, at most.
        state: Of the random numbers.
    """
    count = len(sequence)
    words, costs, moved = np.empty((MAX_WORDS, 7)), np.empty(count), np.empty(3)
    for i in range(count):
        before = ends[0] if i == 0 else poses[i - 1]
        after = ends[1] if i == count - 1 else poses[i]
        costs[i] = _cost(modes, sequence[i], before, after, words)
    for _ in range(moves):
        if scale < 1e-5:
            break
        i = int(random(state) * (count - 1))
        # Moves without a turn keep a heading that is right already, e.g. that of a straight push.
        turn = 0.0 if random(state) < 0.3 else scale / TURN_LENGTH
        moved[0] = poses[i, 0] + scale * _normal(state)
        moved[1] = poses[i, 1] + scale * _normal(state)
        moved[2] = poses[i, 2] + turn * _normal(state)
        first = _cost(modes, sequence[i], ends[0] if i == 0 else poses[i - 1], moved, words)
        # One move changes two pushes only; the second is looked at where the first leaves it a chance.
        if first < costs[i] + costs[i + 1]:
            second = _cost(modes, sequence[i + 1], moved, ends[1] if i == count - 2 else poses[i + 1], words)
            if first + second < costs[i] + costs[i + 1]:
                poses[i] = moved
                costs[i], costs[i + 1] = first, second
                scale = min(1.6 * scale, WIDEST)
                continue
        scale *= 0.93
    return float(costs.sum())


@compiled
def random_descent(
    modes: PackedModes,
    start: FloatArray,
    goals: FloatArray,
    firsts: IntArray,
    lasts: IntArray,
    most: int,
    changes: FloatArray,
    below: float,
    state: RandomState,
    poses: FloatArray,
) -> int:
    """Draw a sequence of contacts and the poses between its pushes, and descend.

    Args:
        modes: All contacts.
        start: (3,) pose of the load.
        goals: (g, 3).
        firsts: Contacts that a first push can have.
        lasts: Likewise a last one.
        most: Pushes, at most.
        changes: (m, m) the least that changes of the contact cost.
        below: What the whole has to cost less than, m.
        state: Of the random numbers.
        poses: (most - 1, 3) filled with the poses between the pushes.

    Returns:
        How many there are; 0 where the sequence costs too much.
    """
    # Few pushes more often than many.
    count = 2 + int((most - 1) * random(state) ** 2)
    sequence, ends = np.empty(count, dtype=np.int64), np.empty((2, 3))
    ends[0], ends[1] = start, goals[int(random(state) * len(goals))]
    extra = 0.0
    for i in range(count):
        sequence[i] = int(random(state) * modes.contact.shape[0])
        if i == 0:
            sequence[i] = firsts[int(random(state) * len(firsts))]
        elif i == count - 1:
            sequence[i] = lasts[int(random(state) * len(lasts))]
        if i > 0:
            extra += changes[sequence[i - 1], sequence[i]]
            if sequence[i] == sequence[i - 1]:
                return 0
    if extra >= below:
        return 0
    # From both ends towards the middle.
    i, j = 0, count - 2
    front, back = ends[0].copy(), ends[1].copy()
    while i <= j:
        if random(state) < 0.5:
            front = pushed_at_random(modes, sequence[i], front, 1.0, state)
            poses[i] = front
            i += 1
        else:
            back = pushed_at_random(modes, sequence[j + 1], back, -1.0, state)
            poses[j] = back
            j -= 1
    cost = descend(modes, sequence, ends, poses, WIDEST, MOVES * (count - 1), state)
    return count - 1 if cost + extra < below else 0
