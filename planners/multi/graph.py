"""Poses of the load and the pushes between them: a graph with edges worked out where they are needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from pushplan.core.driving import Surroundings, shortest_drives
from pushplan.core.pushes import PackedMode, approaches_are_free, find_passings, find_push, settles, word_costs
from pushplan.core.sequences import cheapest_sequence
from pushplan.core.transit import find_transit, shortened
from pushplan.geometry import se2
from pushplan.planners.multi.room import DETOUR, PushRoom, Query, lower_bounds
from pushplan.planners.problem import sampling_box
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Step:
    """A push of a plan, and how the robot gets to it.

    Attributes:
        contact: Index of the contact.
        before: (3,) pose of the load.
        after: Likewise.
        start: (3,) pose of the robot's frame before it drives there.
        transit: (k, 4) arcs of the robot alone to the contact's approach.
        arcs: (k, 4) of the push, in the contact's frame; of no length where there are fewer.
        cost: Of the push, m.
    """

    contact: int
    before: FloatArray
    after: FloatArray
    start: FloatArray
    transit: FloatArray
    arcs: FloatArray
    cost: float


@dataclass(frozen=True, eq=False)
class PushSequence:
    """A plan: its pushes and what it costs, m.

    The robot's ways, changes of the contact, `room.DETOUR` for an end beside the goal and what comes after the plan,
    `cost_to_go`, are included.
    """

    steps: tuple[Step, ...]
    cost: float
    cost_to_go: float = 0.0


EFFORT = 400
"""Poses drawn in search of a way of the robot, at most."""

SHORTCUTS = 200
"""Tries to shorten a way."""

LONG = 1.05
"""A way that is so much longer than the shortest one where nothing is in the way is looked for once more. In rooms of
ReloPush that makes first plans 4 % shorter; more tries add 0.1 %."""

ALIKE = 8
"""Pushes to the same place by the same contact that are looked at where one costs more than assumed."""

SHORTER = 1e-6
"""Smallest saving of a shorter way, m."""

SAME = 1e-9
"""Costs that differ by less are what was assumed, m."""

PAIRS = 4_000
"""Poses to and from which pushes are worked out between two looks at the clock: some 10 ms."""

FIRST = -1
"""Stands for the contact before the first push: there is none."""

Change = tuple[int, int, int]
"""Node, contact left (or `FIRST`) and contact taken."""


class Graph:
    """Poses of the load, and what leads from one to another.

    Args:
        room: Robot, load and contacts.
        query: From where to where.
        seed: Of the random numbers.
        over: Whether the search has to end.
    """

    def __init__(self, room: PushRoom, query: Query, seed: int, over: Callable[[], bool]) -> None:
        self._room, self._query, self._pushes = room, query, room.scenario.transport
        self._state = np.array([seed], dtype=np.uint64)
        self._box = sampling_box(room.scenario)
        self.goals = len(query.goals)
        self.contacts = len(room.contacts)
        nothing = np.zeros((self.contacts, self.goals))
        self._cost_to_go = nothing if query.cost_to_go is None else query.cost_to_go
        self.poses = np.zeros((0, 3))
        m = self.contacts
        self._push = np.zeros((m, 0, 0))
        self._change = np.zeros((0, m, m))
        self._can_begin, self._can_end = (np.zeros((m, 0), dtype=np.bool_) for _ in range(2))
        self._to, self._on = np.zeros(0), np.zeros(0)
        self._known_pushes: dict[tuple[int, int, int], FloatArray] = {}
        self._known_transits: dict[Change, FloatArray] = {}
        self.looked_at = 0
        self.leaves = np.array([settles(c.scene, c.packed, query.load) for c in room.contacts])
        self.changes = self._changed(room.shortest)
        self.add(np.concatenate([query.load[None], query.goals]), np.inf, over)
        self.begins, self.ends = self._can_begin[:, 0], self._can_end[:, 1:]
        self._first = np.array([self._assumed(k) for k in range(m)])
        least = float(self._first.min()) + self._pushes.settle + self._weighed(self._pushes.retreat)
        self.bound = max(float(self._on[0]), least + float(self._cost_to_go.min(initial=np.inf)))

    def _assumed(self, taken: int) -> float:
        """The least that the way to a first push can cost: as the crow flies."""
        goal = self._room.contacts[taken].packed.robot_at(self.poses[0], self._pushes.approach)
        return self._weighed(float(np.hypot(*(goal - self._query.robot)[:2])) + self._pushes.approach)

    def _weighed(self, way: float) -> float:
        return self._pushes.transit_weight * way

    def _changed(self, way: Any) -> Any:
        """What changes of the contact cost whose ways between retreat and approach are so long, m."""
        return self._pushes.switch_cost + self._weighed(way + self._pushes.retreat + self._pushes.approach)

    @property
    def arrives(self) -> bool:
        """Whether the robot has a way to some contact at the start, or may have one."""
        return bool(np.isfinite(self._first[self.begins]).any())

    def add(self, poses: FloatArray, below: float, over: Callable[[], bool]) -> None:
        """Add poses (k, 3) of the load, and what may lead to and from them in a plan that costs less than `below`.

        What is not worked out before it is `over` leads nowhere.
        """
        bounds = self.lower_bounds(poses)
        useful = bounds[0] + bounds[1] < below
        poses, to, on = poses[useful], *(bound[useful] for bound in bounds)
        old, new = len(self.poses), len(self.poses) + len(poses)
        every = np.concatenate([self.poses, poses])
        self._to, self._on = np.append(self._to, to), np.append(self._on, on)
        push = np.full((self.contacts, new, new), np.inf)
        push[:, :old, :old] = self._push
        change = np.full((new, self.contacts, self.contacts), np.inf)
        change[:old] = self._change
        can_begin, can_end = (
            np.concatenate(
                [known, [approaches_are_free(self._room.robot, c.packed, poses, back) for c in self._room.contacts]],
                axis=1,
            )
            for known, back in ((self._can_begin, False), (self._can_end, True))
        )
        leaves, arrives, fresh = np.arange(new) > self.goals, np.arange(new) > 0, np.arange(new) >= old
        leaves[0] = True  # nothing is pushed from a goal, nor back to the start
        after = np.zeros((self.contacts, new))
        after[:, 1 : 1 + self.goals] = self._cost_to_go
        for k, contact in enumerate(self._room.contacts):
            starts, ends = can_begin[k] & leaves, can_end[k] & arrives
            for rows, columns in ((starts & fresh, ends), (starts & ~fresh, ends & fresh)):
                u, v = rows.nonzero()[0], columns.nonzero()[0]
                if not (u.size and v.size):
                    continue
                for part in np.array_split(u, -(-u.size * v.size // PAIRS)):
                    if over():
                        break
                    costs = word_costs(contact.packed, every[part], every[v], self._to[part], self._on[v], below)
                    push[k, part[:, None], v] = costs + after[k, v]
            change[old:, k] = self.changes[k]
            change[old:, k, k] = 0.0  # the push goes on by another word
        push[:, np.arange(new), np.arange(new)] = np.inf
        self.poses, self._push, self._change = every, push, change
        self._can_begin, self._can_end = can_begin, can_end

    def lower_bounds(self, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what no plan costs less than until the load is at poses (k, 3), and from there with what follows."""
        to, on = lower_bounds(self._room, self._query, poses)
        return to, on + self._cost_to_go.min(initial=np.inf)

    @property
    def stuck(self) -> bool:
        """Whether no first push is free, or the robot cannot back off from any last one."""
        return not (self.begins & self.leaves).any() or not self.ends.any()

    def cheapest(self, below: float, over: Callable[[], bool]) -> PushSequence | None:
        """Return the cheapest sequence of pushes, looking at what is assumed of it.

        None where none costs less than `below`, or before that is known once it is `over`.
        """
        while not over():
            end = self._weighed(self._pushes.retreat)
            cost, steps = cheapest_sequence(self._push, self._change, self._first, self.goals, self._pushes.most)
            if not cost + end < below:
                return None
            rows = [(int(m), int(u), int(v)) for m, u, v in steps]
            if self._all_known(rows):
                return PushSequence(tuple(self._steps(rows)), cost + end, self._after(rows[-1][0], rows[-1][2]))
        return None

    def shorten_transits(self, best: PushSequence) -> PushSequence:
        """Return a plan with shorter ways of the robot."""
        found = [replace(step, transit=self._shorter(step)) for step in best.steps]
        saved = sum(
            float(old.transit[:, 3].sum() - new.transit[:, 3].sum())
            for old, new in zip(best.steps, found, strict=True)
        )
        return replace(best, steps=tuple(found), cost=best.cost - self._weighed(saved))

    def _shorter(self, step: Step) -> FloatArray:
        """Return a shorter way (k, 4) to a push: with shortcuts, and where it stays long, another one."""
        around, wheels = self._room.around(step.before), self._room.wheels
        second = self._room.contacts[step.contact].packed
        goal = second.robot_at(step.before, second.approach)
        least = float(shortest_drives(wheels, step.start[None], goal[None])[0, 0])
        way = step.transit
        if way[:, 3].sum() > least + SHORTER:
            way = shortened(around, wheels, step.start, way, self._state, SHORTCUTS)
        if way[:, 3].sum() > LONG * least:
            other = self._found_transit(around, step.start, goal)
            if other is not None:
                other = shortened(around, wheels, step.start, other, self._state, SHORTCUTS)
                way = min(way, other, key=lambda arcs: float(arcs[:, 3].sum()))
        return way

    def end_near(self, best: PushSequence) -> PushSequence:
        """Return a plan that ends within a goal's tolerance where one of its pushes, or another first one, can."""
        if not self._query.within.all():
            return best
        near, firsts = NearGoals(self._room, self._query), self._first_steps(best.cost)
        starts: list[tuple[tuple[Step, ...], Step]] = [((), first) for first in firsts]
        starts += [(best.steps[:k], step) for k, step in enumerate(best.steps) if k]
        for before, step in starts:
            contact, rest = self._room.contacts[step.contact], self._cost((*before, step)) - step.cost
            for end, price, goal, least in near.to(contact.packed, step.before, best.cost - rest):
                cost_to_go = self._after(step.contact, goal)
                if rest + least + cost_to_go >= best.cost:
                    continue
                cost, arcs = find_push(contact.scene, contact.packed, step.before, end)
                if rest + cost + price + cost_to_go < best.cost:
                    steps = (*before, replace(step, after=end, arcs=arcs, cost=cost))
                    best = PushSequence(steps, rest + cost + price + cost_to_go, cost_to_go)
        return best

    def _first_steps(self, below: float) -> Iterator[Step]:
        """Yield a step of no length for each contact to which the robot has a way, and which may cost less."""
        within = self._query.within
        least = float(self._on[0]) - self._weighed(self._pushes.approach) - within[0] - TURN_WEIGHT * within[1]
        for k in np.flatnonzero(self.begins & self.leaves):
            if self._first[k] + least >= below:
                continue
            change, load = (0, FIRST, int(k)), self.poses[0]
            if change not in self._known_transits:
                self._look_at_transit(change)
            if change in self._known_transits:
                way = self._known_transits[change]
                yield Step(int(k), load, load, self._query.robot, way, np.zeros((0, 4)), 0.0)

    def _cost(self, steps: tuple[Step, ...]) -> float:
        """What pushes cost in all, m."""
        ways = sum(float(step.transit[:, 3].sum()) + self._pushes.approach + self._pushes.retreat for step in steps)
        return sum(step.cost for step in steps) + self._weighed(ways) + (len(steps) - 1) * self._pushes.switch_cost

    def _all_known(self, rows: list[tuple[int, int, int]]) -> bool:
        """Look at what is assumed of a sequence, pushes, then changes, then the first way, until one costs more.

        Where a push costs more, so do most of its like: the next ones are looked at as well, before the cheapest
        sequence is worked out again, which takes five times as long as to look at a push.
        """
        dearer = [row for row in rows if row not in self._known_pushes and not self._look_at_push(row)]
        for m, _, v in dearer:
            least = self._to + self._push[m, :, v]
            for u in np.argpartition(least, min(ALIKE, len(least) - 1))[:ALIKE].tolist():
                if least[u] < np.inf and (m, u, v) not in self._known_pushes:
                    self._look_at_push((m, u, v))
        if dearer:
            return False
        changes = [(v, m, q) for (m, _, v), (q, _, _) in pairwise(rows) if m != q]
        for change in [*changes, (0, FIRST, rows[0][0])]:
            if change not in self._known_transits and not self._look_at_transit(change):
                return False
        return True

    def _look_at_push(self, row: tuple[int, int, int]) -> bool:
        """Find a push; return whether it costs what was assumed."""
        m, u, v = row
        assumed = self._push[m, u, v]
        contact = self._room.contacts[m]
        cost, arcs = find_push(contact.scene, contact.packed, self.poses[u], self.poses[v])
        self._push[m, u, v] = cost + self._after(m, v)
        self._known_pushes[row] = arcs
        self.looked_at += 1
        return bool(self._push[m, u, v] <= assumed + SAME)

    def _after(self, m: int, v: int) -> float:
        """Return what comes after a plan that ends with a contact at a node, m; nothing where no plan ends."""
        return float(self._cost_to_go[m, v - 1]) if 1 <= v <= self.goals else 0.0

    def _look_at_transit(self, change: Change) -> bool:
        """Find the way of a change, return whether it costs what was assumed."""
        v, left, taken = change
        load, second = self.poses[v], self._room.contacts[taken].packed
        start, goal = self._transit_start(change), second.robot_at(load, second.approach)
        arcs, cost = self._found_transit(self._room.around(load), start, goal), np.inf
        self.looked_at += 1
        if arcs is not None:
            length = float(arcs[:, 3].sum())
            self._known_transits[change] = arcs
            cost = self._weighed(length + self._pushes.approach) if left == FIRST else self._changed(length)
        assumed = self._first[taken] if left == FIRST else self._change[v, left, taken]
        if left == FIRST:
            self._first[taken] = cost
        else:
            self._change[v, left, taken] = cost
        return bool(cost <= assumed + SAME)

    def _found_transit(self, around: Surroundings, start: FloatArray, goal: FloatArray) -> FloatArray | None:
        reach = 1.0 + self._room.scenario.chain.reach  # m: how far from the ends poses are drawn
        return find_transit(around, self._room.wheels, start, goal, self._box, reach, self._state, EFFORT)

    def _transit_start(self, change: Change) -> FloatArray:
        """Return where the robot's frame (3,) is before it drives to a contact."""
        v, left, _ = change
        if left == FIRST:
            return self._query.robot
        first = self._room.contacts[left].packed
        return first.robot_at(self.poses[v], first.retreat)

    def _steps(self, rows: list[tuple[int, int, int]]) -> list[Step]:
        """Return the pushes that rows come to: those of one contact that follow one another are one push."""
        found: list[Step] = []
        left = FIRST
        for m, u, v in rows:
            arcs, cost = self._known_pushes[m, u, v], float(self._push[m, u, v]) - self._after(m, v)
            if m == left:
                last = found.pop()
                arcs, cost = np.concatenate([last.arcs, arcs]), last.cost + cost
                found.append(replace(last, after=self.poses[v], arcs=arcs, cost=cost))
                continue
            way, start = self._known_transits[u, left, m], self._transit_start((u, left, m))
            found.append(Step(m, self.poses[u], self.poses[v], start, way, arcs, cost))
            left = m
        return found


BESIDE = np.array(
    [(x, y, turn) for x, y in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)) for turn in (0, 1, -1)], dtype=float
)
"""Where an object may end: at the goal, and beside it, as shares of what may be used of its tolerance."""

NEAR_TRIES = 4
"""Poses within the tolerance that are tried for each push but the last, those first that cost least."""


class NearGoals:
    """Poses of a load at its goals and beside them.

    Args:
        room: Robot, load and contacts.
        query: With goals, and how far from them a plan may end.
    """

    def __init__(self, room: PushRoom, query: Query) -> None:
        self._room, self._within = room, query.within
        self._inner = room.scenario.chain.objects[0].pose_chain
        self._goals = se2.compose(query.goals, self._inner)
        grid = se2.compose(self._goals[:, None], self._within[[0, 0, 1]] * BESIDE).reshape(-1, 3)
        self._grid = se2.compose(grid, se2.inverse(self._inner))
        self._prices = np.full(len(grid), DETOUR)
        self._prices[:: len(BESIDE)] = 0.0
        self._nodes = 1 + np.repeat(np.arange(len(self._goals)), len(BESIDE))

    def to(self, mode: PackedMode, load: FloatArray, below: float) -> list[tuple[FloatArray, float, int, float]]:
        """Return poses (3,) to which pushes by a contact lead, what that costs beyond the push, and nodes of goals.

        They are on a grid, and where turns and straight pushes come nearest; those that cost least come first. What
        push and end cost at least, m, stands last.

        Args:
            mode: The contact.
            load: (3,) pose that the pushes begin at.
            below: They cost less than this, with what they cost beyond the push, m.
        """
        far = 1.5 * float(np.hypot(*(self._goals - load)[:, :2].T).max())
        passed, goals = find_passings(mode, load, self._inner, self._goals, self._within, far)
        ends = np.concatenate([self._grid, passed])
        prices = np.concatenate([self._prices, np.full(len(passed), DETOUR)])
        nodes = np.concatenate([self._nodes, 1 + goals])
        costs = word_costs(mode, load[None], ends, np.zeros(1), prices, below)[0] + prices
        cheap = np.flatnonzero(costs < below)
        free = cheap[approaches_are_free(self._room.robot, mode, ends[cheap], True)]
        best = free[np.argsort(costs[free], kind="stable")[:NEAR_TRIES]]
        return [(ends[k], float(prices[k]), int(nodes[k]), float(costs[k])) for k in best]
