"""Poses of the load between which pushes may lead: random ones, and descents that shorten whole sequences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.geometry import se2
from pushplan.planners.collision.separation import step
from pushplan.planners.multi.graph import PushSequence
from pushplan.planners.multi.room import PackedMode, PushRoom, Question, joined, seen_from_contact
from pushplan.planners.multi.transit import TURN_LENGTH
from pushplan.planners.problem.problem import random, sampling_box
from pushplan.planners.problem.steering import MAX_WORDS, find_words
from pushplan.util.arrays import BoolArray, FloatArray, IntArray, RandomState

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


def crossings(start: FloatArray, goals: FloatArray, modes: list[PackedMode]) -> FloatArray:
    """Return poses (k, 3) where a straight push from the start, or from a tight turn there, meets one into a goal."""
    directions = np.array(
        [se2.rotate(mode.contact[2], mode.settling[:2]) for mode in modes]
    )  # in the load's frame
    found = [_crossings(start, goals, directions)]
    for mode in modes:
        for goal in goals:
            for pose in _turned_to(start, float(goal[2]), mode, 1.0):
                found += [pose[None], _crossings(pose, goal[None], directions)]
            for pose in _turned_to(goal, float(start[2]), mode, -1.0):
                found += [pose[None], _crossings(start, pose[None], directions)]
    return np.concatenate(found)


@compiled
def _crossings(start: FloatArray, goals: FloatArray, directions: FloatArray) -> FloatArray:
    """Poses (k, 3) where straight pushes from a start (3,) in directions (m, 2) meet others into goals (g, 3)."""
    out, n = np.empty((len(goals) * len(directions) ** 2, 3)), 0
    c, s = math.cos(start[2]), math.sin(start[2])
    for goal in goals:
        if abs((goal[2] - start[2] + math.pi) % (2.0 * math.pi) - math.pi) > 1e-9:
            continue
        dx, dy = (
            c * (goal[0] - start[0]) + s * (goal[1] - start[1]),
            c * (goal[1] - start[1]) - s * (goal[0] - start[0]),
        )
        for a in directions:
            for b in directions:
                det = a[0] * b[1] - a[1] * b[0]
                if abs(det) < 1e-6:  # parallel rays do not cross
                    continue
                ahead = (dx * b[1] - dy * b[0]) / det
                if ahead > 0.0 and (a[0] * dy - a[1] * dx) / det > 0.0:
                    x, y = ahead * a[0], ahead * a[1]
                    out[n, 0], out[n, 1], out[n, 2] = (
                        start[0] + c * x - s * y,
                        start[1] + s * x + c * y,
                        start[2],
                    )
                    n += 1
    return out[:n]


def _turned_to(pose: FloatArray, heading: float, mode: PackedMode, sense: float) -> Iterator[FloatArray]:
    """Yield the poses to which the tightest turns, driven on or back, turn a load so that it has a heading."""
    for letter in (0, 2):
        twist = mode.families[0, letter]
        if twist[2] == 0.0:
            continue
        angle = float((sense * np.sign(twist[2]) * (heading - pose[2])) % (2.0 * np.pi))
        if 1e-9 < angle < math.pi + 1e-9:
            yield _moved(pose, mode, twist, sense * angle / abs(twist[2]))


def _moved(pose: FloatArray, mode: PackedMode, twist: FloatArray, length: float) -> FloatArray:
    """Return where a twist in the contact's frame, driven so far, brings the load (3,)."""
    contact = se2.compose(se2.compose(pose, mode.contact), se2.exp(twist * length))
    return se2.compose(contact, se2.inverse(mode.contact))


class Sampler:
    """Draws poses of the load.

    Args:
        room: Robot, load and contacts.
        question: From where to where.
        changes: (m, m) the least that changes of the contact cost, m.
        firsts: (m,) whether a contact can be pushed at first.
        lasts: (m, g) whether the robot can back off from it at a goal.
        seed: Of the random numbers.
    """

    def __init__(
        self,
        room: PushRoom,
        question: Question,
        changes: FloatArray,
        firsts: BoolArray,
        lasts: BoolArray,
        seed: int,
    ) -> None:
        assert room.scenario.pushes is not None
        self._question, self._changes = question, changes
        self._firsts, self._lasts = np.flatnonzero(firsts), np.flatnonzero(lasts.any(axis=1))
        self._modes = pack_modes([contact.packed for contact in room.contacts])
        self._box, self._most = np.array(sampling_box(room.scenario)), room.scenario.pushes.most
        self._random = np.random.default_rng(seed)
        self._state = np.array([seed], dtype=np.uint64)

    def draw(self, count: int, best: PushSequence | None) -> FloatArray:
        """Return poses (count or a few more, 3), most of them near the changes of a plan or where descents end."""
        found: list[FloatArray] = []
        if best is not None and len(best.steps) > 1:
            found += self._polished(best)
        while len(found) < count:
            found += self._some(best)
        return np.array(found)

    def _some(self, best: PushSequence | None) -> list[FloatArray]:
        kind = self._random.random()
        # 30 % near those of the best plan, 20 % where random pushes lead, 2 % uniform, others where descents end.
        if kind < 0.3 and best is not None and len(best.steps) > 1:
            return [self._near(best.steps[self._random.integers(len(best.steps) - 1)].after)]
        if kind < 0.5:
            return [self._pushed()]
        if kind < 0.52 or self._most < 2:
            low, high = self._box[:2], self._box[2:]
            return [np.append(self._random.uniform(low, high), self._random.uniform(-np.pi, np.pi))]
        return self._descended(math.inf if best is None else best.cost)

    def _near(self, pose: FloatArray) -> FloatArray:
        """A pose beside another."""
        scale = self._scale()
        step = self._random.normal(size=3) * [scale, scale, 2.0 * scale]
        if self._random.random() < 0.5:
            step[2] = 0.0
        return se2.compose(pose, step)

    def _scale(self) -> float:
        """Scale of the moves of a pose, m, drawn evenly between orders of magnitude."""
        return math.exp(self._random.uniform(math.log(1e-3), math.log(0.5)))

    def _pushed(self) -> FloatArray:
        """A pose that a random push leads to from the start, or from which one leads to a goal."""
        back = self._random.random() < 0.5
        goals = self._question.goals
        pose = goals[self._random.integers(len(goals))] if back else self._question.load
        contact = int(self._random.choice(self._lasts if back else self._firsts))
        return pushed_at_random(self._modes, contact, pose, -1.0 if back else 1.0, self._state)

    def _descended(self, below: float) -> list[FloatArray]:
        """The poses between pushes where one of 12 descents ends that costs less than `below`, or one at random."""
        question, poses = self._question, np.zeros((self._most - 1, 3))
        for _ in range(12):
            n = random_descent(
                self._modes,
                question.load,
                question.goals,
                self._firsts,
                self._lasts,
                self._most,
                self._changes,
                below,
                self._state,
                poses,
            )
            if n:
                return list(poses[:n])
        return [self._pushed()]

    def _polished(self, best: PushSequence) -> list[FloatArray]:
        """The poses at which a plan changes the contact, after a descent from where they are."""
        poses = np.array([step.after for step in best.steps[:-1]])
        ends = np.stack([best.steps[0].before, best.steps[-1].after])
        sequence = np.array([step.contact for step in best.steps])
        descend(self._modes, sequence, ends, poses, self._scale(), 300, self._state)
        return list(poses)
