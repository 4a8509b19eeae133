"""Graph of load poses and the pushes between them. Edges are computed when they are needed."""

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
    """A push of a plan and the transit to it.

    Attributes:
        contact: Index of the contact.
        before: (3,) pose of the load before the push.
        after: (3,) pose of the load after the push.
        start: (3,) pose of the robot's frame before the transit.
        transit: (k, 4) arcs of the transit to the contact's approach.
        arcs: (k, 4) arcs of the push in the contact's frame, padded with arcs of zero length.
        cost: Cost of the push, m.
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
    """The pushes of a plan and its total cost, m.

    The cost includes transits, changes of the contact, `room.DETOUR` for an end beside the goal, and `cost_to_go` for
    what follows the plan.
    """

    steps: tuple[Step, ...]
    cost: float
    cost_to_go: float = 0.0


EFFORT = 400
"""Maximum number of poses drawn in the search for a transit."""

SHORTCUTS = 200
"""Number of attempts to shorten a transit."""

LONG = 1.05
"""A transit that exceeds the shortest obstacle-free one by this factor is searched for a second time.

In rooms of ReloPush, this makes first plans 4 % shorter. More attempts add 0.1 %.
"""

ALIKE = 8
"""Number of similar pushes (same contact, same end) to check after one costs more than assumed."""

SHORTER = 1e-6
"""Excess over the shortest transit below which a transit is not shortened, m."""

SAME = 1e-9
"""Tolerance within which a cost equals the assumed one, m."""

PAIRS = 4_000
"""Pairs of poses evaluated between two checks of the clock: about 10 ms."""

FIRST = -1
"""Placeholder for the contact before the first push."""

Change = tuple[int, int, int]
"""A change of the contact: node, previous contact (or `FIRST`) and next contact."""


class Graph:
    """Poses of the load, with the pushes and contact changes between them.

    Args:
        room: Robot, load and contacts.
        query: Start and goals.
        seed: Seed of the random numbers.
        over: Returns whether the search must stop.
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
        """Return a lower bound of the first transit's cost: that of the straight line."""
        goal = self._room.contacts[taken].packed.robot_at(self.poses[0], self._pushes.approach)
        return self._weighed(float(np.hypot(*(goal - self._query.robot)[:2])) + self._pushes.approach)

    def _weighed(self, way: float) -> float:
        return self._pushes.transit_weight * way

    def _changed(self, way: Any) -> Any:
        """Return the cost of contact changes, given the length of the transits between retreat and approach, m."""
        return self._pushes.switch_cost + self._weighed(way + self._pushes.retreat + self._pushes.approach)

    @property
    def arrives(self) -> bool:
        """Whether a transit to some contact at the start exists or was not yet ruled out."""
        return bool(np.isfinite(self._first[self.begins]).any())

    def add(self, poses: FloatArray, below: float, over: Callable[[], bool]) -> None:
        """Add poses (k, 3) of the load and the pushes that a plan cheaper than `below` could use.

        Pushes that are not evaluated before `over` returns true are left out.
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
                [flags, [approaches_are_free(self._room.robot, c.packed, poses, back) for c in self._room.contacts]],
                axis=1,
            )
            for flags, back in ((self._can_begin, False), (self._can_end, True))
        )
        leaves, arrives, fresh = np.arange(new) > self.goals, np.arange(new) > 0, np.arange(new) >= old
        leaves[0] = True  # no push begins at a goal or ends at the start
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
            change[old:, k, k] = 0.0  # the push continues with another steering path
        push[:, np.arange(new), np.arange(new)] = np.inf
        self.poses, self._push, self._change = every, push, change
        self._can_begin, self._can_end = can_begin, can_end

    def lower_bounds(self, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return lower bounds (k,) of a plan's cost up to load poses (k, 3), and (k,) from there on, m."""
        to, on = lower_bounds(self._room, self._query, poses)
        return to, on + self._cost_to_go.min(initial=np.inf)

    @property
    def stuck(self) -> bool:
        """Whether no first push is free, or the robot cannot back off after any last push."""
        return not (self.begins & self.leaves).any() or not self.ends.any()

    def cheapest(self, below: float, over: Callable[[], bool]) -> PushSequence | None:
        """Return the cheapest sequence of pushes after checking its assumed costs.

        Return None if no sequence costs less than `below`, or if `over` returns true first.
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
        """Return the plan with shortened transits."""
        found = [replace(step, transit=self._shorter(step)) for step in best.steps]
        saved = sum(
            float(old.transit[:, 3].sum() - new.transit[:, 3].sum())
            for old, new in zip(best.steps, found, strict=True)
        )
        return replace(best, steps=tuple(found), cost=best.cost - self._weighed(saved))

    def _shorter(self, step: Step) -> FloatArray:
        """Return a shorter transit (k, 4) to a push: apply shortcuts, and search again if it stays long."""
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
        """Return a cheaper plan that ends within a goal's tolerance, or the same plan if there is none."""
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
        """Yield a step of zero length for each reachable first contact whose plan may cost less than `below`."""
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
        """Return the total cost of pushes, transits and contact changes, m."""
        ways = sum(float(step.transit[:, 3].sum()) + self._pushes.approach + self._pushes.retreat for step in steps)
        return sum(step.cost for step in steps) + self._weighed(ways) + (len(steps) - 1) * self._pushes.switch_cost

    def _all_known(self, rows: list[tuple[int, int, int]]) -> bool:
        """Return whether all assumed costs of a sequence hold: pushes, contact changes and the first transit.

        If a push costs more, most similar pushes do too. They are checked at once, because computing the cheapest
        sequence again takes five times as long as checking a push.
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
        """Compute a push and return whether its assumed cost holds."""
        m, u, v = row
        assumed = self._push[m, u, v]
        contact = self._room.contacts[m]
        cost, arcs = find_push(contact.scene, contact.packed, self.poses[u], self.poses[v])
        self._push[m, u, v] = cost + self._after(m, v)
        self._known_pushes[row] = arcs
        self.looked_at += 1
        return bool(self._push[m, u, v] <= assumed + SAME)

    def _after(self, m: int, v: int) -> float:
        """Return the cost to go after a plan that ends with a contact at a node, m; 0 if the node is no goal."""
        return float(self._cost_to_go[m, v - 1]) if 1 <= v <= self.goals else 0.0

    def _look_at_transit(self, change: Change) -> bool:
        """Search for the transit of a contact change and return whether its assumed cost holds."""
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
        reach = 1.0 + self._room.scenario.chain.reach  # m, distance from the ends within which poses are drawn
        return find_transit(around, self._room.wheels, start, goal, self._box, reach, self._state, EFFORT)

    def _transit_start(self, change: Change) -> FloatArray:
        """Return the pose (3,) of the robot's frame before it drives to a contact."""
        v, left, _ = change
        if left == FIRST:
            return self._query.robot
        first = self._room.contacts[left].packed
        return first.robot_at(self.poses[v], first.retreat)

    def _steps(self, rows: list[tuple[int, int, int]]) -> list[Step]:
        """Return the pushes of rows (contact, start, end). Consecutive rows with the same contact form one push."""
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
"""End poses to try, at the goal and beside it, as multiples of the usable tolerance."""

NEAR_TRIES = 4
"""Number of poses within the tolerance that are tried for each push, cheapest first."""


class NearGoals:
    """Poses of a load at its goals and beside them.

    Args:
        room: Robot, load and contacts.
        query: Goals, and the distances from them at which a plan may end.
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
        """Return end poses near the goals that a contact can reach, cheapest first.

        The candidates are a grid at each goal and the poses where turns and straight pushes pass nearest to it. An
        entry is (pose (3,), extra cost in m, node of the goal, lower bound of push and extra cost in m).

        Args:
            mode: The contact.
            load: (3,) pose of the load at the start of the push.
            below: Upper limit of the cost including the extra cost, m.
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
