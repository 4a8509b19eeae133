"""Objects that shall stand in a row: pushed together where that costs less, one by one, or all of them at once.

A beam search over what the plate holds. From where it has come up to an object, or has closed a contact with a
further one, the hand is pushed until it closes onto one more, or to its place in the row, from where the robot drives
to another object. So one search holds one by one, groups and all together, and cost decides. Pushes are words of
three arcs, or two words through a pose in between; each is priced exactly when its bound comes to the head of the
queue. The beam is widened for as long as there is time. An object that nothing brings to the row from where it stands
is moved first: pushed straight away from a face, by several pushes where that takes them, and by a plate that is set
aside on a face where what stands beside that leaves no room for the whole of it.
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
from pushplan.mechanics.faces import ways_through
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
"""Nodes that are kept for each number of objects taken, in one pass after the other."""

AT_FIRST = 3
"""So many of them are tried with one margin before a lower one."""

LEVELS = 3
"""Margins that are tried, each half of the one before."""


class GatheringSearch(TaskSearch):
    """Searches for the way to bring objects into a row; stable sets are kept.

    Args:
        scenario: With a row.
        settings: Complete.
        hands: What is known of the objects already.
    """

    def __init__(self, scenario: Scenario, settings: PlanSettings, hands: Hands | None = None) -> None:
        self.scenario, self.settings = scenario, settings
        self.hands = Hands(scenario, settings) if hands is None else hands

    @property
    def set_name(self) -> str:
        """Name of the set that is planned in."""
        return str(self.settings.set_name)

    def with_obstacles(self, scenario: Scenario) -> GatheringSearch:
        """Return it for a scenario that differs in what stands in the room."""
        return GatheringSearch(scenario, self.settings, self.hands.among(scenario))

    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """See `TaskSearch`."""
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
        """Return the proof that the robot reaches no object, or not one of the row."""
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
        """Refuse a row of which an object cannot be pushed at all.

        Raises:
            PlanningError: With the reason.
        """
        for name in self.scenario.transport.row.left:
            ways = [member for member in self.hands.ways if member[0] == name]
            if not any(self.hands.hand((member,)) for member in ways):
                why = self.hands.why.get(name, "the plate fits on none of the faces that it may choose")
                raise PlanningError(f"'{name}' cannot be pushed: {why}")


class _Beams:
    """One beam after the other, each wider.

    Args:
        steps: From where the robot holds nothing.
        budget: Of the search.
        observer: Asked whether to end at once.
        improvements: Told of better plans.
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
        """Yield beams that begin with an object that is moved first."""
        for steps in with_one_moved(self.steps, self._budget, self._observer):
            yield _Beams(steps, self._budget, self._observer, self._improvements)

    def over(self, turn: bool = False) -> bool:
        """Whether there is no more time, or no more of a turn."""
        until, most = self._turn if turn else (self._until, self._most)
        spent = self.steps.floor.looked_at >= most or time.perf_counter() >= until
        return spent or self._observer.cancelled()

    def _half(self) -> tuple[float, float]:
        """Return until when, and how many pushes and transits looked at, half of what is left lasts."""
        counted = self.steps.floor.looked_at
        return 0.5 * (time.perf_counter() + self._until), 0.5 * (counted + self._most)

    def search(self, widths: Sequence[int]) -> Segments:
        """Return the best plan of beams of some widths, none where none is better than the best so far.

        Beams that only bring one by one are the same whether there are others beside them or not, down to what they
        leave out: so `auto` has no longer plan than `never`, where both have the time for the same beams.
        """
        found: Segments = ()
        ways = {"auto": ((True, True), (False, True)), "never": ((False, True),), "always": ((True, False),)}
        for width in widths:
            truncated = False
            turns = ways[self.steps.row.gather]
            for closes, delivers in turns:
                # Without any plan, one by one has its time too: what can be done so never fails.
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
        """Tell whether every contact of a plan closes though what is closed onto may stand off."""
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
        """Return the end of the best plan of a beam that is better than those like it, and whether it was cut."""
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
        """Return nodes that chances lead to and that may be better than the best, priced by their bounds."""
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
                # No single word is free: a way around costs more than the bound by an unknown amount.
                detour = bound + 0.5 * (bound - chance.node.cost)
                again = replace(chance, by_way=True)
                heapq.heappush(queue, (max(least, detour), next(count), bound, again, None))
        return kept, bool(queue) and queue[0][0] < best


def _segments_of(steps: Steps, end: Node) -> Segments:
    """Return the moves that lead to the end of a plan as its segments, not timed."""
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
    """Return a plan that first moves one object out of where it cannot be brought to the row from, and its beams."""
    for beams in tried[:: max(1, len(tried) - 1)]:
        for other in beams.with_one_moved():
            found = other.search(WIDTHS[:2])
            if found:
                return found, other
            if beams.over():
                break
    return (), tried[0]


def _same(one: Node) -> tuple[object, ...]:
    """Return what makes two nodes the same, whatever came before."""
    return one.left, one.members, tuple(np.round(one.plate, 6)), frozenset(one.delivered), one.place


def _not_gathered(segments: Segments, beams: _Beams) -> tuple[str, ...]:
    """Return why a plan of a row that may be gathered brings one by one; nothing where it does not."""
    row, hands = beams.steps.row, beams.steps.hands
    together = any(one.load is not None and len(one.load.names) > 1 for one in segments)
    if row.gather != AUTO or not segments or together or len(row.left) < 2:
        return ()
    what, why = "of the plans that were found, one by one costs least", [*hands.unsure]
    if not hands.holds_several:
        what, why = "no two of the objects can be pushed together", [*why, *hands.why.values()]
    return (f"not gathered: {what}" + (f" ({why[0]})" if why else ""),)


def _explanation(beams: _Beams, limit: float) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
    """Return why no plan was found: how far the search came, and how widely what it held then turns."""
    row, farthest = beams.steps.row, beams.farthest
    names = ", ".join(f"'{name}'" for name in row.of)
    hand = None
    if farthest is None:
        what = "the robot can drive up to none of the objects that it may push first"
    else:
        held = ", ".join(f"'{name}'" for name, _ in farthest.members)
        what = f"the search came as far as holding {held}"
        what += f", with {len(farthest.left)} left to take" if farthest.left else ", and not to the row"
        hand = beams.steps.hands.hand(farthest.members)
    told = [Diagnosis("order", what, False)]
    told += [Diagnosis("closing", text, False) for text in beams.steps.hands.unsure]
    radius = math.inf if hand is None else _radius(hand)
    area = beams.steps.scenario.workspace
    if hand is not None and area is not None and math.isfinite(radius):
        x, y = area.xmax - area.xmin, area.ymax - area.ymin
        if radius > 0.25 * min(x, y):
            wide = f"it turns with a radius of {radius:.2f} m at the least, in a room of {x:.3g} x {y:.3g} m"
            told.append(Diagnosis("wide turns", wide, False, {"radius": radius}))
    reasons = "; ".join(one.text for one in told)
    reason = f"no way was found within the time limit of {limit:g} s to bring {names} into a row: {reasons}"
    return reason, tuple(told), None


def _radius(hand: Hand) -> float:
    """Return the smallest radius (m) at which the middle of the plate turns with a hand."""
    twists = hand.packed.families.reshape(-1, 3)
    turns = twists[twists[:, 2] != 0.0]
    return float((np.hypot(turns[:, 0], turns[:, 1]) / np.abs(turns[:, 2])).min(initial=math.inf))


AWAY = (0.3, 0.6, 1.0)
"""How far an object is pushed that has to be moved first, m."""

TRIES = 6
"""So many places are tried for it, those first that cost least."""

ELSEWHERE = 0.2
"""Places farther than this from those tried, m, are others."""

EFFORT = 3
"""Batches of poses that the search for a place may take."""


def with_one_moved(steps: Steps, budget: Budget, observer: Observer) -> Iterator[Steps]:
    """Yield the steps once an object was moved: the least accessible ones first.

    Args:
        steps: From where everything is.
        budget: Of the search.
        observer: Asked whether to end at once.
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
    """Return the problem of an object whose faces the plate may also take with one of its ends at theirs."""
    plate = float(np.ptp(alone.chain.pusher.outline[:, 1]))
    over = {0.5 * (plate - way.length) for way in ways_through(alone.chain.objects[0].outline)}
    aside = sorted(round(one, 9) for one in over if one > 0.0)
    offsets = dict.fromkeys((*alone.transport.offsets, *(sign * one for one in aside for sign in (1.0, -1.0))))
    return alone.with_task(offsets=tuple(offsets))


def _places(piece: Piece, pose: FloatArray) -> tuple[Goal, ...]:
    """Return where straight pushes lead from a pose (3,), nearest first."""
    stated, places = piece.search.scenario.goal, piece.pushed_straight(pose, AWAY)
    return tuple(replace(stated, pose=place, of=None, pose_chain=place) for place in places)
