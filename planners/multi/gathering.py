"""Search for plans that bring objects into a row: one by one, in groups or all together, whichever costs least.

A beam search over the objects that the plate holds (the "hand"). The plate pushes the hand until it touches another
object, which then joins the hand (a close), or to its place in the row. From there the robot drives to the next
object. So one search covers single objects and groups, and the cost decides. A push is one steering path of three
arcs, or two that meet at an intermediate pose. Its exact cost is computed when its bound reaches the head of the
queue. The beam widens while there is time.

If an object cannot be brought to the row from its place, straight pushes move it away first. If its neighbours leave
no room for the whole plate, the plate pushes a face with one of its ends only.
"""

from __future__ import annotations

import heapq
import itertools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pushplan.errors import EmptyStableSetError, PlanningError
from pushplan.geometry import se2
from pushplan.mechanics.faces import face_pairs
from pushplan.planners.infeasible.diagnosis import beyond_reach
from pushplan.planners.multi.hands import MARGIN, Floor, Hand, Hands
from pushplan.planners.multi.multi_push import MultiPushSearch, plan_cost
from pushplan.planners.multi.row_steps import Chance, Node, Steps
from pushplan.planners.multi.search import Limits
from pushplan.planners.multi.transfers import Piece, Situation, find_transfer
from pushplan.planners.outcome import Budget, Improvements, Outcome, Question, Segments, TaskSearch
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.plan import Nearest
from pushplan.plans.segment import Poses, Segment
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.scenario.goals import Goal
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, AUTO, RETREAT

WIDTHS = (1, 4, 16, 64, 256, 1024)
"""Beam widths of successive passes: nodes kept for each number of taken objects."""

AT_FIRST = 3
"""Number of widths tried with a margin before the next lower one."""

LEVELS = 3
"""Number of margins tried, each half of the one before."""


class GatheringSearch(TaskSearch):
    """Search for a plan that brings objects into a row. Stable sets are cached.

    Args:
        scenario: Scenario with a row.
        settings: Complete settings.
        hands: Hands of an earlier search, reused here.
    """

    def __init__(self, scenario: Scenario, settings: PlanSettings, hands: Hands | None = None) -> None:
        self.scenario, self.settings = scenario, settings
        self.hands = Hands(scenario, settings) if hands is None else hands

    @property
    def set_name(self) -> str:
        """Name of the stable set."""
        return str(self.settings.set_name)

    def with_obstacles(self, scenario: Scenario) -> GatheringSearch:
        """Return the search for a scenario that differs only in its obstacles."""
        return GatheringSearch(scenario, self.settings, self.hands.among(scenario))

    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """Return the best plan found; see `TaskSearch.search`."""
        scenario = self.scenario
        improvements = Improvements(observer, budget.began)
        hands, floor = self.hands, Floor(scenario, budget.seed)
        self._require_pushable()
        proof = self._proof()
        if proof is not None:
            return Outcome.without_plan(proof, hands.least_margin(()))
        beams = _Beams(Steps(hands, floor), budget, observer, improvements)
        best = beams.search(WIDTHS[:AT_FIRST])
        tried = [beams]
        while not best and hands.level + 1 < min(hands.levels, LEVELS) and not beams.over():
            hands = hands.lower()
            beams = _Beams(Steps(hands, floor), budget, observer, improvements)
            tried.append(beams)
            best = beams.search(WIDTHS[:AT_FIRST])
        if not best:
            best, beams = _with_one_moved_first(tried)
        if not (best and budget.first):
            best = beams.search(WIDTHS[AT_FIRST:]) or best
        return Outcome(
            (best,) if best else (),
            self.hands.least_margin(best[len(beams.steps.before) :]),
            beams.steps.hands.least_margin(best[len(beams.steps.before) :]),
            floor.looked_at,
            tuple(improvements.found),
            lambda segments: plan_cost(scenario, segments),
            explain=lambda: _explanation(beams, budget.time_limit),
            usual_margin=MARGIN,
            remarks=_not_gathered(best, beams),
        )

    def _proof(self) -> Diagnosis | None:
        """Return a proof that some object of the row, or every object, is out of reach; None without one."""
        scenario, row, poses = self.scenario, self.scenario.transport.row, self.scenario.poses
        away = [-scenario.transport.approach, 0.0, 0.0]
        outlines = {
            load.name: [se2.transform_points(poses[load.name], obj.outline) for obj in load.chain.objects]
            for load in scenario.loads
        }
        faces = {
            name: np.array(
                [
                    se2.compose(se2.compose(poses[name], way.entry), away)
                    for (other, _), way in self.hands.ways.items()
                    if other == name
                ]
            )
            for name in row.left
        }
        proofs = beyond_reach(scenario.alone(row.of[0]), outlines, faces, row.left)
        return next(iter(proofs.values()), None)

    def _require_pushable(self) -> None:
        """Check that every object of the row can be pushed.

        Raises:
            PlanningError: If one cannot, with the reason.
        """
        for name in self.scenario.transport.row.left:
            ways = [member for member in self.hands.ways if member[0] == name]
            if not any(self.hands.hand((member,)) for member in ways):
                why = self.hands.why.get(name, "the plate fits on none of the allowed faces")
                raise PlanningError(f"'{name}' cannot be pushed: {why}")


class _Beams:
    """Successive beam searches, each wider than the one before.

    Args:
        steps: Possible steps, beginning with nothing held.
        budget: Budget of the search.
        observer: Can cancel the search.
        improvements: Collects better plans.
    """

    def __init__(self, steps: Steps, budget: Budget, observer: Observer, improvements: Improvements) -> None:
        self.steps, self._budget, self._until = steps, budget, budget.until
        self._observer, self._improvements = observer, improvements
        self._most = budget.iterations or math.inf
        self._turn = self._until, self._most
        self.best = math.inf
        self._one_by_one = math.inf
        self.farthest: Node | None = None

    def with_one_moved(self) -> Iterator[_Beams]:
        """Yield beams for plans that first move one object out of its place."""
        for steps in with_one_moved(self.steps, self._budget, self._observer):
            yield _Beams(steps, self._budget, self._observer, self._improvements)

    def over(self, turn: bool = False) -> bool:
        """Return whether the budget (with `turn`, of the current pass) is used up or the search is cancelled."""
        until, most = self._turn if turn else (self._until, self._most)
        spent = self.steps.floor.looked_at >= most or time.perf_counter() >= until
        return spent or self._observer.cancelled()

    def _half(self) -> tuple[float, float]:
        """Return the time and the count of pushes and transits at which half of the remaining budget is used."""
        counted = self.steps.floor.looked_at
        return 0.5 * (time.perf_counter() + self._until), 0.5 * (counted + self._most)

    def search(self, widths: Sequence[int]) -> Segments:
        """Return the best plan of beams with these widths; empty if none beats the best so far.

        Beams that only deliver one by one do not depend on the other beams. So a plan with `auto` never costs more
        than one with `never` if both have time for the same beams.
        """
        found: Segments = ()
        ways = {"auto": ((True, True), (False, True)), "never": ((False, True),), "always": ((True, False),)}
        for width in widths:
            truncated = False
            turns = ways[self.steps.row.gather]
            for closes, delivers in turns:
                # Without a plan, reserve time for delivery one by one, so that gathering cannot make a solvable row
                # fail.
                waits = not found and math.isinf(self.best) and (closes, delivers) != turns[-1]
                self._turn = self._half() if waits else (self._until, self._most)
                end, cut = self._beam(width, closes, delivers)
                while end is not None and not self._surely_closes(end):
                    end, cut = self._beam(width, closes, delivers)
                truncated = truncated or cut
                if end is not None and not closes:
                    self._one_by_one = end.cost
                if end is not None and end.cost < self.best:
                    found = self._taken(end)
                if self.over() or (found and self._budget.first):
                    return found
            if not truncated:
                break
        return found

    def _surely_closes(self, end: Node) -> bool:
        """Return whether every contact of a plan closes despite pose errors of the objects that it closes onto."""
        one: Node | None = end
        while one is not None:
            if len(one.members) > 1 and not self.steps.hands.surely_closes(one.members):
                return False
            one = one.before
        return True

    def _taken(self, end: Node) -> Segments:
        self.best = end.cost
        segments = _segments_of(self.steps, end)
        self._improvements.add(plan_cost(self.steps.scenario, segments), self.steps.floor.looked_at, segments)
        return segments

    def _beam(self, width: int, closes: bool, delivers: bool) -> tuple[Node | None, bool]:
        """Return the last node of a beam's plan, None if it is no improvement, and whether the beam was truncated."""
        begin, best = self.steps.begin, self.best if closes else self._one_by_one
        chances = list(self.steps.first())
        truncated = False
        for _ in range(len(begin.left)):
            kept, cut = self._chosen(chances, width, best)
            truncated = truncated or cut
            if all(one.cost >= self.best for one in kept):
                return None, truncated
            chances = []
            for one in kept:
                if self.farthest is None or len(one.left) < len(self.farthest.left):
                    self.farthest = one
            if not kept[0].left:
                break
            for one in kept:
                chances += self.steps.next(one, closes, delivers)
        ends = [chance for one in kept for chance in self.steps.last(one)]
        done, _ = self._chosen(ends, 1, best)
        return (done[0] if done else None), truncated

    def _chosen(self, chances: list[tuple[float, Chance]], width: int, best: float) -> tuple[list[Node], bool]:
        """Return at most `width` nodes that may beat the best cost, lowest bound first, and whether some were cut."""
        count = itertools.count()
        queue: list[tuple[float, int, float, Chance, Node | None]] = [
            (least, next(count), bound, chance, None)
            for bound, chance in chances
            if (least := self.steps.least(bound, chance)) < best
        ]
        heapq.heapify(queue)
        kept: list[Node] = []
        seen: set[tuple[object, ...]] = set()
        while queue and len(kept) < width and not self.over(turn=True):
            least, _, bound, chance, priced = heapq.heappop(queue)
            if least >= best:
                break
            if priced is not None:
                key = _same(priced)
                if key not in seen:
                    seen.add(key)
                    kept.append(priced)
                continue
            found = self.steps.priced(chance)
            if found is not None:
                rest = self.steps.estimate(found)
                heapq.heappush(queue, (max(least, rest), next(count), bound, chance, found))
            elif chance.node is not None and not chance.by_way:
                # No single steering path is free. A detour costs more than the bound by an unknown amount.
                detour = bound + 0.5 * (bound - chance.node.cost)
                again = replace(chance, by_way=True)
                heapq.heappush(queue, (max(least, detour), next(count), bound, again, None))
        return kept, bool(queue) and queue[0][0] < best


def _segments_of(steps: Steps, end: Node) -> Segments:
    """Return the moves up to a plan's last node as segments without timing."""
    found: list[Segment] = [*steps.before]
    now: Poses = steps.starts
    for move in end.way():
        load = steps.hands.load(move.members) if move.members else None
        hand = steps.hands.hand(move.members) if move.members else None
        if load is None or hand is None or move.kind in (APPROACH, RETREAT):
            found.append(Segment(move.kind, move.path, now, now, load))
        elif move.onto:
            found.append(Segment.close(load, move.path, now, hand.margin, move.onto))
        else:
            found.append(Segment.push(load, move.path, now, hand.margin))
        now = found[-1].after
    return tuple(found)


def _with_one_moved_first(tried: Sequence[_Beams]) -> tuple[Segments, _Beams]:
    """Return a plan that first moves an object out of a place that blocks its delivery, and its beams."""
    for beams in tried[:: max(1, len(tried) - 1)]:
        for other in beams.with_one_moved():
            found = other.search(WIDTHS[:2])
            if found:
                return found, other
            if beams.over():
                break
    return (), tried[0]


def _same(one: Node) -> tuple[object, ...]:
    """Return a key that is equal for nodes in the same state, whatever moves led to them."""
    return one.left, one.members, tuple(np.round(one.plate, 6)), frozenset(one.delivered), one.place


def _not_gathered(segments: Segments, beams: _Beams) -> tuple[str, ...]:
    """Return why a plan with `gather: auto` delivers one by one; empty if it gathers."""
    row, hands = beams.steps.row, beams.steps.hands
    together = any(one.load is not None and len(one.load.names) > 1 for one in segments)
    if row.gather != AUTO or not segments or together or len(row.left) < 2:
        return ()
    what, why = "one by one is the cheapest plan found", [*hands.unsure]
    if not hands.holds_several:
        what, why = "no two of the objects can be pushed together", [*why, *hands.why.values()]
    return (f"not gathered: {what}" + (f" ({why[0]})" if why else ""),)


def _explanation(beams: _Beams, limit: float) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
    """Return the reasons for failure: the progress of the search and the turning radius of the last hand."""
    row, farthest = beams.steps.row, beams.farthest
    names = ", ".join(f"'{name}'" for name in row.of)
    hand = None
    if farthest is None:
        what = "the robot cannot drive up to any object that could be pushed first"
    else:
        held = ", ".join(f"'{name}'" for name, _ in farthest.members)
        what = f"the search got as far as holding {held}"
        what += f", with {len(farthest.left)} left to take" if farthest.left else ", but not to the row"
        hand = beams.steps.hands.hand(farthest.members)
    diagnoses = [Diagnosis("order", what, False)]
    diagnoses += [Diagnosis("closing", text, False) for text in beams.steps.hands.unsure]
    radius = math.inf if hand is None else _radius(hand)
    area = beams.steps.scenario.workspace
    if hand is not None and area is not None and math.isfinite(radius):
        x, y = area.xmax - area.xmin, area.ymax - area.ymin
        if radius > 0.25 * min(x, y):
            wide = f"its smallest turning radius is {radius:.2f} m, in a room of {x:.3g} x {y:.3g} m"
            diagnoses.append(Diagnosis("wide turns", wide, False, {"radius": radius}))
    reasons = "; ".join(one.text for one in diagnoses)
    reason = f"no plan found within the time limit of {limit:g} s that brings {names} into a row: {reasons}"
    return reason, tuple(diagnoses), None


def _radius(hand: Hand) -> float:
    """Return the smallest turning radius (m) of the plate's middle with a hand."""
    twists = hand.packed.families.reshape(-1, 3)
    turns = twists[twists[:, 2] != 0.0]
    return float((np.hypot(turns[:, 0], turns[:, 1]) / np.abs(turns[:, 2])).min(initial=math.inf))


AWAY = (0.3, 0.6, 1.0)
"""Distances over which an object is pushed out of its place first, m."""

TRIES = 6
"""Number of places tried for that object, cheapest first."""

ELSEWHERE = 0.2
"""Minimum distance of a new place from those already tried, m."""

EFFORT = 3
"""Maximum number of pose batches in the search for a place."""


def with_one_moved(steps: Steps, budget: Budget, observer: Observer) -> Iterator[Steps]:
    """Yield the steps after one object was moved, beginning with the least accessible object.

    Args:
        steps: Steps from the current situation.
        budget: Budget of the search.
        observer: Can cancel the search.
    """
    scenario = steps.scenario
    names = tuple(load.name for load in scenario.loads)
    poses = np.array([load.start for load in scenario.loads])
    now = Situation(steps.begin.plate, poses, frozenset())
    limits = Limits(budget.until, first=True, iterations=EFFORT, stop=observer.cancelled)
    resting = tuple(Piece(name, MultiPushSearch(scenario.alone(name), ()), ()) for name in names)
    for name in steps.least_accessible():
        k = names.index(name)
        try:
            moved = Piece(name, MultiPushSearch.of(_set_aside(scenario.alone(name)), steps.hands.settings), ())
            goals = _places(moved, poses[k])
        except EmptyStableSetError:
            continue
        pieces = (*resting[:k], moved, *resting[k + 1 :])
        for _ in range(TRIES):
            found = find_transfer(pieces, now, k, limits, budget.seed, goals, delivers=False) if goals else None
            if found is None:
                break
            steps.floor.looked_at += found.looked_at
            yield steps.after(found.segments(scenario.poses))
            end = found.end[:2]
            goals = tuple(goal for goal in goals if np.hypot(*(goal.pose_chain[:2] - end)) > ELSEWHERE)


def _set_aside(alone: Scenario) -> Scenario:
    """Return the problem of one object, with added offsets that align an end of the plate with an end of a face."""
    plate = float(np.ptp(alone.chain.pusher.outline[:, 1]))
    over = {0.5 * (plate - way.length) for way in face_pairs(alone.chain.objects[0].outline)}
    aside = sorted(round(one, 9) for one in over if one > 0.0)
    offsets = dict.fromkeys((*alone.transport.offsets, *(sign * one for one in aside for sign in (1.0, -1.0))))
    return alone.with_task(offsets=tuple(offsets))


def _places(piece: Piece, pose: FloatArray) -> tuple[Goal, ...]:
    """Return the goals that straight pushes reach from a pose (3,), nearest first."""
    stated, places = piece.search.scenario.goal, piece.pushed_straight(pose, AWAY)
    return tuple(replace(stated, pose=place, of=None, pose_chain=place) for place in places)
