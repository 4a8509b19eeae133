"""Search for the order in which several objects go to their goals, and for objects that must make room first.

The search first follows the cheapest tour (`tours`). If this leaves some bodies, it delivers all bodies greedily
again: deepest goals first, layer by layer, and bodies that the last attempt left before all others. Then it puts
obstructing bodies aside as long as this delivers more, those on goals also to other places.

If some bodies are still left, a depth-first search follows. It brings a body to its goal only if every other
remaining body still has a plan (or waits for another body to leave its goal). If no body can be brought, an
obstructing one moves aside and goes to its goal later. As few bodies as possible are moved. The effort for each
transfer grows until there is an order. Beam searches then look for cheaper orders.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.planners.multi.search import Limits
from pushplan.planners.multi.tours import MOST, Tours
from pushplan.planners.multi.transfers import (
    Piece,
    Situation,
    Transfer,
    depths,
    find_transfer,
    nudged_goals,
    posed,
    situation_after,
)
from pushplan.planners.outcome import Budget
from pushplan.plans.settings import Observer
from pushplan.scenario.goals import Goal
from pushplan.scenario.parts import Workspace
from pushplan.util.arrays import FloatArray

STAGES = (
    (0, 0, False),
    (0, 1, False),
    (3, 1, False),
    (0, 0, True),
    (0, 1, True),
    (15, 1, False),
    (3, 1, True),
    (15, 1, True),
    (3, 2, True),
    (15, 2, True),
    (15, 3, True),
    (63, 3, True),
    (255, 6, True),
)
"""Stages of the depth-first search, tried in turn: (batches of poses for one transfer, maximum number of relocations,
whether to begin at the start instead of at the end of the tours).

The limits are batches, not seconds, so that one seed gives the same order on any machine.
"""

SOON, SOON_MOST = 3, 200
"""Number of stages tried at once for up to `MOST` bodies, and the limit of transfers."""

QUICK = ((0, 0), (3, 0), (0, 1), (0, 2), (0, 3), (0, 4))
"""Quick rounds of greedy deliveries: (batches of poses for one transfer, level of its margins)."""

GREEDY = (*QUICK, (15, 0), (15, 1), (15, 2))
"""All rounds of greedy deliveries. The last ones spend more effort on bodies that the quick rounds leave."""

ROUNDS = 6
"""Number of greedy attempts. Each begins with the bodies that the last one left."""

FREED, AGAIN = 24, 3
"""Maximum number of bodies put aside to deliver more, and of attempts with other places and more effort."""

PLACES = 4
"""Number of places tried for an obstructing body."""

NEAR = 0.8
"""A body nearer than this (m) to another, or to its goal, may be in its way."""

AWAY = np.concatenate([np.arange(0.1, 1.05, 0.1), np.arange(1.25, 3.1, 0.25)])
"""Lengths of straight pushes that put a body aside, m."""

SCATTERED = 60
"""Number of random places around a body where it can be put aside."""

MOST_PLACES = 24
"""Number of candidate places that are kept, nearest first."""

ROOM = 0.05
"""Distance of a place from other bodies and from goals, in addition to the clearance, m."""

BEAMS = ((2, 1), (4, 1), (8, 1), (16, 2), (32, 2), (64, 3), (128, 4), (2, 16))
"""Successive beams: (situations kept after each transfer, batches of poses to improve a transfer)."""

EFFORT = 2
"""Batches of poses to improve a transfer while other places are tried for obstructing bodies."""

SPARE = 1.0
"""Gap (m, divided by the batches) below which beams do not try to improve a transfer."""

GAIN = 1e-6
"""Smallest saving that counts, m."""


@dataclass(frozen=True, eq=False)
class PartialPlan:
    """Transfers that bring some or all pieces to goals.

    Attributes:
        whole: Estimated cost including the remaining pieces, from tours, m.
        cost: Cost of the transfers, m.
        steps: The transfers.
        here: Situation after the transfers.
    """

    whole: float
    cost: float
    steps: tuple[Transfer, ...]
    here: Situation


class Order:
    """The search for an order.

    Args:
        pieces: All bodies that can be pushed.
        budget: Budget of the search.
        observer: Can cancel the search.

    Attributes:
        looked_at: Number of transfers searched for.
    """

    def __init__(self, pieces: tuple[Piece, ...], budget: Budget, observer: Observer) -> None:
        self._pieces, self._seed, self._until = pieces, budget.seed, budget.until
        self._cancelled, self._most = observer.cancelled, budget.iterations or math.inf
        self._patience = self._level = 0
        self._depths = [0] * len(pieces)
        self._known: dict[tuple[object, ...], Transfer | None] = {}
        self._tours: Tours | None = None
        self._turn = math.inf
        self.looked_at = 0

    @cached_property
    def _random(self) -> np.random.Generator:
        return np.random.default_rng(self._seed)  # loads numpy.random, which most plans do not need

    def find(self, now: Situation) -> PartialPlan:
        """Return the plan that delivers most of the remaining pieces, as far as the budget allows.

        Deliveries along tours come first. If they leave some of a few pieces, a short search for an order follows.
        Then all pieces are delivered again: deepest goals and nearest pieces first, with obstructing pieces put
        aside. So no plan delivers fewer pieces than a loop over single pieces.

        A long search for an order and deliveries with other seeds use the remaining time.
        """
        self._patience = 0
        begun = PartialPlan(0.0, 0.0, (), now), self._led(now)
        if begun[1].here.left:
            self._depths = depths(self._pieces)
        best, soon = begun[1], STAGES[:SOON] if len(now.left) <= MOST else ()
        if best.here.left and soon:
            self._turn = self.looked_at + SOON_MOST
            best = min(best, self._in_order(begun, soon), key=_worth)
            self._turn = math.inf
        if best.here.left and not self._over():
            best = min(best, self._by_layers(begun[0]), key=_worth)
        if best.here.left and not self._over():
            best = min(best, self._delivered(begun[1]), key=_worth)
        if best.here.left and not self._over():
            best = self._freed(best)
        for _ in range(AGAIN):
            if best.here.left and not self._over():
                best = self._freed(best, again=True)
        if (
            best.here.left and not self._over()
        ):  # from the first stage on, for the limit may have cut the short search
            best = min(best, self._in_order(begun, STAGES), key=_worth)
        while not self._over() and any(not self._reason(best.here, piece)[0] for piece in best.here.left):
            self._seed, self._known = self._seed + 1, {}
            best = min(best, self._freed(self._by_layers(begun[0])), key=_worth)
        return best

    def _in_order(
        self, begun: tuple[PartialPlan, PartialPlan], stages: Sequence[tuple[int, int, bool]]
    ) -> PartialPlan:
        """Return a plan for all pieces from one of the stages, or else the better of the two given plans."""
        for self._patience, relocations, again in stages:
            first = begun[0] if again else begun[1]
            rest = self._go_on(first.here, relocations)
            if rest is not None:
                return self._extended_by(first, rest)
            if self._over():
                break
        return min(begun, key=_worth)

    def _led(self, now: Situation) -> PartialPlan:
        """Return transfers along the cheapest tours until no further plan is found."""
        return self._beam(now, 1, 0, math.inf)[0]

    def _extended_by(self, plan: PartialPlan, steps: Iterable[Transfer]) -> PartialPlan:
        """Return a plan with more transfers."""
        for step in steps:
            cost = plan.cost + step.cost
            plan = PartialPlan(cost, cost, (*plan.steps, step), situation_after(self._pieces, step, plan.here))
        return plan

    def _delivered(
        self, plan: PartialPlan, rounds: Sequence[tuple[int, int]] = GREEDY, only: frozenset[int] | None = None
    ) -> PartialPlan:
        """Return a plan with further deliveries, nearest pieces first, until nothing more can be delivered.

        A piece that cannot be delivered is tried again after all others. With `only`, other pieces stay.
        """
        for self._patience, self._level in rounds:
            found = True
            while found and plan.here.left and not self._over():
                found, waiting = False, set(plan.here.left if only is None else plan.here.left & only)
                while waiting and not self._over():
                    piece = next(k for k in self._nearest_first(plan.here) if k in waiting)
                    waiting.remove(piece)
                    step = self._delivery(plan.here, piece)
                    if step is not None:
                        found, plan = True, self._extended_by(plan, (step,))
        self._patience, self._level = 0, 0
        return plan

    def _by_layers(self, begin: PartialPlan) -> PartialPlan:
        """Return the best of several plans that deliver the deepest goals first, layer by layer.

        Each plan begins with the pieces that the one before left.
        """
        best, first = begin, frozenset[int]()
        for _ in range(ROUNDS):
            plan = self._delivered(begin, QUICK, only=first) if first else begin
            for depth in range(max(self._depths), -1, -1):
                layer = frozenset(k for k, own in enumerate(self._depths) if own == depth)
                plan = self._delivered(plan, QUICK, only=layer)
            plan = self._delivered(plan)
            best = min(best, plan, key=_worth)
            if not plan.here.left or self._over():
                break
            first |= plan.here.left
        return best

    def _freed(self, plan: PartialPlan, again: bool = False) -> PartialPlan:
        """Return a plan that puts bodies aside, one at a time, as long as this delivers more.

        Args:
            plan: Plan to extend.
            again: Whether only bodies on goals move, to random places, and more effort is spent on deliveries.
        """
        for _ in range(FREED):
            more = next(self._with_one_aside(plan, again), None)
            if more is None or not more.here.left:
                return more or plan
            plan = more
        return plan

    def _with_one_aside(self, plan: PartialPlan, again: bool) -> Iterator[PartialPlan]:
        """Yield plans that put one body aside and then deliver more; see `_freed`."""
        rounds = GREEDY if again else QUICK
        for piece in dict.fromkeys(self._on_goals(plan.here)) if again else self._in_the_way(plan.here):
            places = self._parking(plan.here, piece)
            if again:
                places = self._few(places)
            if self._over():
                return
            step = self._search(plan.here, piece, places, delivers=False) if places else None
            if step is not None:
                # Remaining pieces come first, because the piece put aside could shut them in again.
                more = self._delivered(self._extended_by(plan, (step,)), rounds, plan.here.left)
                if len(more.here.left) <= len(plan.here.left):
                    more = self._delivered(more, rounds)
                if len(more.here.left) < len(plan.here.left):
                    yield more

    def _by_tours(self, now: Situation) -> list[tuple[float, int]]:
        """Return (tour cost, first piece) for each remaining piece, cheapest first; infinite for far pieces."""
        begun = self._tours_from(now).begun(now.plate, now.left)
        return sorted((begun.get(piece, math.inf), piece) for piece in now.left)

    def cost_to_go(self, now: Situation, piece: int) -> Callable[[FloatArray], FloatArray]:
        """Return a function from plate poses (k, 3) after a delivery to the cost (k,) of the remaining ones, m."""
        tours, left = self._tours_from(now), now.left - {piece}
        return lambda plates: tours.after(left, plates)

    def _tours_from(self, now: Situation) -> Tours:
        if self._tours is None or not self._tours.lead_on_from(now):
            self._tours = Tours.of(self._pieces, now)
        return self._tours

    def cheaper(self, now: Situation, best: tuple[Transfer, ...]) -> tuple[Transfer, ...]:
        """Return cheaper transfers in another order or to other goals, or the given ones if none are found.

        A beam search keeps the best situations for each number of deliveries. After a beam that was not truncated,
        the search only improves transfers in a few orders. If the plan puts bodies aside, other places for them are
        tried instead.
        """
        if not all(step.delivers for step in best):
            return self._elsewhere(now, best)
        cut = True
        for width, effort in BEAMS:
            if not self._over() and (cut or (width, effort) == BEAMS[-1]):
                found, cut = self._beam(now, width, effort, sum(step.cost for step in best) - GAIN)
                best = best if found.here.left else found.steps
        return best

    def _elsewhere(self, now: Situation, best: tuple[Transfer, ...]) -> tuple[Transfer, ...]:
        """Return the same transfers with the cheapest random places for obstructing bodies."""
        cost = sum(step.cost for step in best)
        while not self._over():
            steps, here = [], now
            for one in best:
                places = () if one.delivers else self._parking(here, one.piece)
                step = self._delivery(here, one.piece, EFFORT) if one.delivers else None
                if places:
                    step = self._search(here, one.piece, self._few(places), delivers=False)
                if step is None:
                    break
                steps.append(step)
                here = situation_after(self._pieces, step, here)
            spent = sum(step.cost for step in steps)
            if len(steps) == len(best) and spent < cost - GAIN:
                best, cost = tuple(steps), spent
        return best

    def _beam(self, now: Situation, width: int, effort: int, below: float) -> tuple[PartialPlan, bool]:
        """Return the cheapest of the plans with most deliveries, and whether the beam was truncated.

        After each delivery, the situations with the cheapest tours are kept.

        Args:
            now: Current situation.
            width: Number of situations to keep.
            effort: As in `_delivery`.
            below: Upper limit of the cost, m.
        """
        kept, cut = [PartialPlan(0.0, 0.0, (), now)], False
        while kept[0].here.left and not self._over():
            plans = self._extended(kept, width, effort, below)
            if not plans:
                break
            cut = cut or len(plans) > width
            kept = plans[:width]
        return kept[0], cut

    def _extended(self, kept: list[PartialPlan], width: int, effort: int, below: float) -> list[PartialPlan]:
        """Return plans with one more transfer, lowest estimated total cost first.

        The search stops when the tour costs leave no other plan among the first `width`.
        """
        plans: list[PartialPlan] = []
        begun = [
            (one.cost + cost, k, piece) for k, one in enumerate(kept) for cost, piece in self._by_tours(one.here)
        ]
        for least, k, piece in sorted(begun):
            enough = below if len(plans) < width else min(below, plans[width - 1].whole)
            if least >= enough or self._over():
                break
            one = kept[k]
            step = self._delivery(one.here, piece, effort)
            if step is not None and one.cost + step.with_cost_to_go < below:
                after = situation_after(self._pieces, step, one.here)
                plans.append(
                    PartialPlan(one.cost + step.with_cost_to_go, one.cost + step.cost, (*one.steps, step), after)
                )
                plans.sort(key=lambda one: one.whole)
        return plans

    def _over(self) -> bool:
        spent = self.looked_at >= min(self._most, self._turn)
        return spent or time.perf_counter() >= self._until or self._cancelled()

    def _go_on(self, now: Situation, relocations: int) -> tuple[Transfer, ...] | None:
        if not now.left:
            return ()
        for piece in self._nearest_first(now):
            step = self._delivery(now, piece)
            if self._over():
                return None
            if step is None:
                continue
            after = situation_after(self._pieces, step, now)
            if all(self._is_open(after, k) for k in after.left):
                rest = self._go_on(after, relocations)
                if rest is not None:
                    return (step, *rest)
        return self._make_way(now, relocations) if relocations else None

    def _nearest_first(self, now: Situation) -> list[int]:
        """Return the remaining pieces: deepest goals first, then the lowest cost of transit and push."""

        def way(piece: int) -> tuple[int, float]:
            own = self._pieces[piece]
            weight, start = own.search.scenario.transport.transit_weight, now.poses[piece]
            push = min(math.hypot(*(goal.pose_chain - start)[:2]) for goal in own.goals)
            return -self._depths[piece], weight * math.hypot(*(start - now.plate)[:2]) + push

        return sorted(sorted(now.left), key=way)

    def _delivery(
        self, now: Situation, piece: int, effort: int | None = None, patience: int | None = None
    ) -> Transfer | None:
        """Return the transfer of a piece to one of its goals; None if none was found.

        Args:
            now: Current situation.
            piece: Index of the piece.
            effort: Batches of poses to improve a first plan whose cost, cost to go included, exceeds its lower bound
                by `SPARE` / effort. None: return the first plan and ignore the cost to go.
            patience: Maximum batches of poses for the first plan; None: the limit of the current stage.
        """
        patience = self._patience if patience is None else patience
        if patience:  # a quick plan usually exists and is cached
            quick = self._delivery(now, piece, effort, 0)
            if quick is not None:
                return quick
        key = (effort, patience, self._level, piece, now.left, now.plate.tobytes(), now.poses.tobytes())
        if key not in self._known:
            first = self._delivery(now, piece, 0, patience) if effort else None
            if first is not None and first.beyond_bound < SPARE / (effort or 1):
                return first
            goals, cost_to_go = self._pieces[piece].goals, None if effort is None else self.cost_to_go(now, piece)
            if patience and not effort:  # no quick plan reaches the goals themselves
                goals += nudged_goals(self._pieces, now, piece)
            self._known[key] = self._search(
                now, piece, goals, cost_to_go=cost_to_go, effort=effort or 0, patience=patience
            )
        return self._known[key]

    def _search(
        self,
        now: Situation,
        piece: int,
        goals: tuple[Goal, ...],
        delivers: bool = True,
        cost_to_go: Callable[[FloatArray], FloatArray] | None = None,
        effort: int = 0,
        patience: int | None = None,
    ) -> Transfer | None:
        self.looked_at += 1
        most = max(self._patience if patience is None else patience, effort)
        limits = Limits(self._until, first=not effort, iterations=most, stop=self._cancelled)
        level = min(self._level, self._pieces[piece].search.levels - 1)
        return find_transfer(self._pieces, now, piece, limits, self._seed, goals, delivers, cost_to_go, level)

    def _is_open(self, now: Situation, piece: int) -> bool:
        """Return whether a piece has a plan or only waits for remaining pieces to leave its goals."""
        waits = all(self._on_goal(now, piece, goal) & now.left for goal in range(len(self._pieces[piece].goals)))
        return waits or self._delivery(now, piece) is not None

    def _on_goal(self, now: Situation, piece: int, goal: int) -> frozenset[int]:
        """Return the pieces that stand on a goal of another piece."""
        own = self._pieces[piece]
        area = own.goal_areas[goal].buffer(own.search.scenario.clearance)
        others = (k for k in range(len(self._pieces)) if k != piece)
        return frozenset(k for k in others if self._pieces[k].area(now.poses[k]).intersects(area))

    def _make_way(self, now: Situation, relocations: int) -> tuple[Transfer, ...] | None:
        """Return transfers that move an obstructing piece aside and then continue; None if there are none."""
        for piece in self._in_the_way(now):
            places = self._parking(now, piece)
            for _ in range(PLACES):
                step = self._search(now, piece, places, delivers=False) if places else None
                if step is None or self._over():
                    break
                after = situation_after(self._pieces, step, now)
                if relocations > 1 or any(self._delivery(after, k) is not None for k in after.left):
                    rest = self._go_on(after, relocations - 1)
                    if rest is not None:
                        return (step, *rest)
                reached = step.end
                places = tuple(p for p in places if np.hypot(*(p.pose_chain - reached)[:2]) > 0.2)
        return None

    def _in_the_way(self, now: Situation) -> Iterator[int]:
        """Yield pieces that may obstruct: on goals, near remaining ones, the remaining ones, then all others."""
        near = [k for piece in sorted(now.left) for k in self._near(now, piece)]
        away = np.hypot(*(now.poses - now.plate)[:, :2].T)
        yield from dict.fromkeys(
            [*self._on_goals(now), *near, *sorted(now.left), *np.argsort(away, kind="stable").tolist()]
        )

    def _on_goals(self, now: Situation) -> list[int]:
        """Return the pieces on goals of remaining ones."""
        left = [(piece, goal) for piece in sorted(now.left) for goal in range(len(self._pieces[piece].goals))]
        return [k for piece, goal in left for k in sorted(self._on_goal(now, piece, goal))]

    def _near(self, now: Situation, piece: int) -> list[int]:
        """Return the pieces near a piece or its goals, nearest first."""
        spots = np.array([now.poses[piece], *(goal.pose_chain for goal in self._pieces[piece].goals)])[:, :2]
        away = [float(np.linalg.norm(spots - pose[:2], axis=1).min()) for pose in now.poses]
        return [int(k) for k in np.argsort(away) if k != piece and away[k] < NEAR]

    def why_not(self, now: Situation, piece: int) -> str:
        """Return why a remaining piece is not delivered, as far as it is known."""
        reason, faces = self._reason(now, piece)
        unknown = "no pushes to its goal were found among the other objects"
        return reason or "; ".join(filter(None, (unknown, faces)))

    def _reason(self, now: Situation, piece: int) -> tuple[str, str]:
        """Return the reason at the start or the goals that prevents a delivery, or else the faces in reach."""
        own = self._pieces[piece]
        takers = [self._on_goal(now, piece, goal) - {piece} for goal in range(len(own.goals))]
        if all(takers):
            names = ", ".join(f"'{self._pieces[k].name}'" for k in sorted(frozenset().union(*takers)))
            return f"its goal is taken by {names}", ""
        return own.search.with_obstacles(posed(self._pieces, now, piece, own.goals)).why_not()

    def _parking(self, now: Situation, piece: int) -> tuple[Goal, ...]:
        """Return places for a piece away from all goals, nearest first: along straight pushes and around it."""
        own, pose = self._pieces[piece], now.poses[piece]
        taken = self._taken(now, piece)
        tolerance = own.search.scenario.goal.tolerance
        places = [p for p in (*own.pushed_straight(pose, AWAY), *self._scattered(pose)) if _is_free(own, p, taken)]
        nearest = sorted(places, key=lambda p: math.hypot(*(p - pose)[:2]))[:MOST_PLACES]
        return tuple(Goal.of_chain(p, tolerance) for p in nearest)

    def _few(self, places: tuple[Goal, ...]) -> tuple[Goal, ...]:
        """Return some random places."""
        few = self._random.choice(len(places), min(PLACES, len(places)), replace=False)
        return tuple(places[k] for k in few)

    def _taken(self, now: Situation, piece: int) -> BaseGeometry:
        """Return the area of the other pieces and of the remaining pieces' goals, with a buffer."""
        pieces = self._pieces
        distance = pieces[piece].search.scenario.clearance + ROOM
        areas = [other.area(now.poses[k]) for k, other in enumerate(pieces) if k != piece]
        areas += [area for k in now.left if k != piece for area in pieces[k].goal_areas]
        return shapely.union_all(areas).buffer(distance)

    def _scattered(self, pose: FloatArray) -> Iterator[FloatArray]:
        for _ in range(SCATTERED):
            away, way = self._random.uniform(AWAY[0], AWAY[-1]), self._random.uniform(-np.pi, np.pi)
            turn = self._random.uniform(-np.pi, np.pi)
            yield pose + np.array([away * math.cos(way), away * math.sin(way), turn])


def _worth(plan: PartialPlan) -> tuple[int, float]:
    """Return the sort key of a plan: number of remaining pieces, then cost."""
    return len(plan.here.left), plan.cost


def _is_free(piece: Piece, pose: FloatArray, taken: BaseGeometry) -> bool:
    area = piece.area(pose)
    return _is_inside(area, piece.search.scenario.workspace) and not taken.intersects(area)


def _is_inside(area: BaseGeometry, workspace: Workspace | None) -> bool:
    if workspace is None:
        return True
    x0, y0, x1, y1 = area.bounds
    return bool(
        workspace.xmin + ROOM < x0
        and x1 < workspace.xmax - ROOM
        and workspace.ymin + ROOM < y0
        and y1 < workspace.ymax - ROOM
    )
