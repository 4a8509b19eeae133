"""Objects that shall stand in a row: pushed together where that costs less, one by one, or all of them at once.

A beam search over what the plate holds. From where it has come up to an object, or has closed a contact with one more,
the hand is pushed until it closes onto a further object, or to its place in the row, from where the robot drives to
another object. So one search holds one by one, groups and all together, and cost decides. Pushes are words of three
arcs, or two words through a pose in between; each is priced exactly when its bound comes to the head of the queue.
The beam is widened for as long as there is time.
"""

from __future__ import annotations

import heapq
import itertools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pushplan.core.driving import shortest_drive
from pushplan.core.pushes import word_costs
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.multi.hands import SHORT, Floor, Hand, Hands, Pushed
from pushplan.planners.multi.multi_push import plan_cost
from pushplan.planners.outcome import Improvements, Outcome, Segments
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Diagnosis, Nearest, Poses, Segment
from pushplan.plans.row_load import Member
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, RETREAT, TRANSIT

WIDTHS = (4, 16, 64, 256, 1024)
"""Situations that are kept for each number of objects taken, in one pass after the other."""

BESIDE_A_WALL = 1e-3
"""What a row's front keeps from a wall beside the clearance, m."""

ALONG_A_WALL = 0.25
"""Distance between places along a wall that are offered to a row, m, and so many of them at most."""
MOST_ALONG = 16

AT_PLACE = 1e-6
"""A row that is made up of other lengths than its stated place is for misses it by more, m."""

AHEAD = np.array([[1.0, 0.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Move:
    """A segment of a plan, as the search has it.

    Attributes:
        kind: One of `names.SEGMENT_KINDS`.
        members: What is held; none in a transit.
        start: (3,) pose of the plate.
        arcs: (k, 4) twists and lengths.
        onto: What a close ends at.
    """

    kind: str
    members: tuple[Member, ...]
    start: FloatArray
    arcs: FloatArray
    onto: str = ""

    @classmethod
    def straight(
        cls, kind: str, members: tuple[Member, ...], start: FloatArray, length: float, onto: str = ""
    ) -> Move:
        """Return a straight move ahead, or back where the length is negative."""
        arcs = np.append(np.sign(length) * AHEAD, [[abs(length)]], axis=1)
        return cls(kind, members, start, arcs, onto)

    @property
    def path(self) -> PushPath:
        """Of the plate."""
        kept = self.arcs[self.arcs[:, 3] > 1e-12]
        return PushPath(self.start, kept[:, :3], kept[:, 3])


@dataclass(frozen=True, eq=False)
class Situation:
    """The plate holds something, and how it came about.

    Attributes:
        cost: Of all moves until here, m.
        members: What is held.
        plate: (3,) pose.
        left: Names of the row's objects that were not taken yet.
        delivered: Poses of those in the row.
        front: (3,) where the next one that is delivered ends; None before a place was chosen.
        place: Index of the row's place; -1 likewise.
        last: Name of the object that was delivered last, "" before.
        moves: Since the situation before.
        before: That one.
    """

    cost: float
    members: tuple[Member, ...]
    plate: FloatArray
    left: frozenset[str]
    delivered: Poses
    front: FloatArray | None
    place: int
    last: str
    moves: tuple[Move, ...]
    before: Situation | None

    def way(self) -> tuple[Move, ...]:
        """Return all moves until here."""
        return (*(() if self.before is None else self.before.way()), *self.moves)


@dataclass(frozen=True, eq=False)
class Place:
    """A place for the row: (3,) pose of its front, +x along the push; and of its rear where that is stated."""

    front: FloatArray
    rear: FloatArray | None


@dataclass(frozen=True, eq=False)
class Chance:
    """A step that may be taken next: what it is assumed to cost, priced exactly when it is its turn.

    Attributes:
        situation: From which.
        taken: The object that is closed onto or driven to, and its face; None where the row is complete.
        delivers: The hand is brought to the row at first.
        place: Index of the row's place, where it is delivered to.
        by_way: The push leads through a pose in between.
    """

    situation: Situation | None
    taken: Member | None
    delivers: bool
    place: int = -1
    by_way: bool = False


class GatheringSearch:
    """Searches for the way to bring objects into a row; stable sets are kept.

    Args:
        scenario: With a `row`.
        settings: Complete.
        hands: What is known of the objects already.
    """

    def __init__(self, scenario: Scenario, settings: PlanSettings, hands: Hands | None = None) -> None:
        self.scenario, self.settings = scenario, settings
        self.hands = Hands(scenario, settings) if hands is None else hands

    def with_obstacles(self, scenario: Scenario) -> GatheringSearch:
        """Return it for a scenario that differs in what stands in the room."""
        return GatheringSearch(scenario, self.settings, self.hands.among(scenario))

    def search(self, settings: PlanSettings, began: float) -> Outcome:
        """Return the best plan that was found.

        Args:
            settings: Complete.
            began: `time.perf_counter` from which the time limit counts.

        Raises:
            PlanningError: When nothing can push one of the objects, or the row fits nowhere.
        """
        scenario, limit = self.scenario, settings.time_limit
        assert limit is not None
        assert settings.seed is not None
        until = began + limit
        improvements = Improvements(settings.observer, began)
        hands, floor = self.hands, Floor(scenario, settings.seed)
        self._require_pushable()
        best: Segments = ()
        while True:
            beams = _Beams(hands, floor, settings, until, improvements)
            best = beams.search()
            if best or hands.level + 1 >= hands.levels or beams.over():
                break
            hands = hands.lower()
        return Outcome(
            (best,) if best else (),
            self.hands.least_margin(best),
            hands.least_margin(best),
            floor.looked_at,
            tuple(improvements.found),
            lambda segments: plan_cost(scenario, segments),
            explain=lambda: _explanation(beams, limit),
        )

    def _require_pushable(self) -> None:
        """Refuse a row of which an object cannot be pushed at all.

        Raises:
            PlanningError: With the reason.
        """
        assert self.scenario.row is not None
        for name in self.scenario.row.of:
            ways = [member for member in self.hands.ways if member[0] == name]
            if not any(self.hands.hand((member,)) for member in ways):
                why = self.hands.why.get(name, "the plate fits on none of the faces that it may choose")
                raise PlanningError(f"'{name}' cannot be pushed: {why}")


class _Beams:
    """One beam after the other, each wider.

    Args:
        hands: What the plate may hold, with the margins to plan with.
        floor: What stands in the room.
        settings: Complete.
        until: `time.perf_counter` at which it is over.
        improvements: Told of better plans.
    """

    def __init__(
        self, hands: Hands, floor: Floor, settings: PlanSettings, until: float, improvements: Improvements
    ) -> None:
        scenario = hands.scenario
        assert scenario.row is not None
        assert scenario.pushes is not None
        self.hands, self.floor, self.row, self.choice = hands, floor, scenario.row, scenario.pushes
        self.scenario, self._settings, self._until = scenario, settings, until
        self._improvements = improvements
        self.starts = scenario.poses
        self.members = [member for member in hands.ways if hands.hand((member,)) is not None]
        self.entries = {
            member: se2.compose(self.starts[member[0]], hands.ways[member].entry) for member in self.members
        }
        self.places = _places(scenario, hands)
        self.best = math.inf
        self.farthest: Situation | None = None

    def over(self) -> bool:
        """Whether there is no more time."""
        return time.perf_counter() >= self._until or self._settings.observer.cancelled()

    def search(self) -> Segments:
        """Return the best plan, none where none was found."""
        found: Segments = ()
        ways = {"auto": ((True, True), (False, True)), "never": ((False, True),), "always": ((True, False),)}
        for width in WIDTHS:
            truncated = False
            for closes, delivers in ways[self.row.gather]:
                moves, cut = self._beam(width, closes, delivers)
                truncated = truncated or cut
                if moves:
                    found = self._taken(moves)
                if self.over() or (found and self._settings.first):
                    return found
            if not truncated:
                break
        return found

    def _taken(self, moves: tuple[Move, ...]) -> Segments:
        segments = self._segments(moves)
        self._improvements.add(plan_cost(self.scenario, segments), self.floor.looked_at, segments)
        return segments

    def _beam(self, width: int, closes: bool, delivers: bool) -> tuple[tuple[Move, ...], bool]:
        """Return the moves of the best plan of a beam that is better than the best so far, and whether it was cut."""
        chances = [(0.0, Chance(None, member, False)) for member in self.members]
        truncated = False
        for _ in range(len(self.row.of)):
            kept, cut = self._chosen(chances, width)
            truncated = truncated or cut
            if not kept:
                return (), truncated
            chances = []
            for one in kept:
                if self.farthest is None or len(one.left) < len(self.farthest.left):
                    self.farthest = one
            if not kept[0].left:
                break
            for one in kept:
                chances += self._next(one, closes, delivers)
        ends = [chance for one in kept for chance in self._last(one)]
        done, _ = self._chosen(ends, 1)
        if not done:
            return (), truncated
        self.best = done[0].cost
        return done[0].way(), truncated

    def _chosen(
        self, chances: list[tuple[float, Chance]], width: int
    ) -> tuple[list[Situation], bool]:
        """Return the best situations that chances lead to, priced in the order of their bounds."""
        count = itertools.count()
        queue: list[tuple[float, int, Chance, Situation | None]] = [
            (bound, next(count), chance, None) for bound, chance in chances if bound < self.best
        ]
        heapq.heapify(queue)
        kept: list[Situation] = []
        seen: set[tuple[object, ...]] = set()
        while queue and len(kept) < width and not self.over():
            bound, _, chance, priced = heapq.heappop(queue)
            if bound >= self.best:
                break
            if priced is not None:
                key = _same(priced)
                if key not in seen:
                    seen.add(key)
                    kept.append(priced)
                continue
            found = self._priced(chance)
            if found is not None:
                rest = found.cost + self._rest(found)
                heapq.heappush(queue, (max(bound, rest), next(count), chance, found))
            elif chance.situation is not None and not chance.by_way:
                # No single word is free: a way around costs more than the bound by an unknown amount.
                detour = bound + 0.5 * (bound - chance.situation.cost)
                heapq.heappush(queue, (detour, next(count), replace(chance, by_way=True), None))
        return kept, bool(queue)

    # --- what may come next ---

    def _next(self, now: Situation, closes: bool, delivers: bool) -> Iterator[tuple[float, Chance]]:
        """Yield what may come after a situation, with bounds of the cost until the end."""
        hand = self.hands.hand(now.members)
        assert hand is not None
        if closes:
            yield from self._closings(now, hand)
        if delivers:
            yield from self._deliveries(now, hand)

    def _closings(self, now: Situation, hand: Hand) -> Iterator[tuple[float, Chance]]:
        members = [m for m in self.members if m[0] in now.left and self._follows(now.members[-1][0], m[0])]
        if hand.across is None or not hand.closes or not members:
            return
        goals = np.array([se2.compose(self._closed(hand, m), [-SHORT, 0.0, 0.0]) for m in members])
        costs = self._word_costs(hand, now.plate, goals)
        for member, cost in zip(members, costs, strict=True):
            if math.isfinite(cost) and self.hands.hand((*now.members, member)) is not None:
                yield now.cost + float(cost) + SHORT, Chance(now, member, False)

    def _deliveries(self, now: Situation, hand: Hand) -> Iterator[tuple[float, Chance]]:
        members = [m for m in self.members if m[0] in now.left]
        for place, goal, onto in self._ends(now, hand):
            short = SHORT if onto else 0.0
            at = se2.compose(goal, [-short, 0.0, 0.0])
            cost = float(self._word_costs(hand, now.plate, at[None])[0]) + short
            if not math.isfinite(cost):
                continue
            back = se2.compose(goal, [-self.choice.retreat, 0.0, 0.0])
            weight, straight = self.choice.transit_weight, self.choice.retreat + self.choice.approach
            for member in members:
                before = se2.compose(self.entries[member], [-self.choice.approach, 0.0, 0.0])
                way = shortest_drive(self.floor.wheels, back, before) + straight
                yield now.cost + cost + weight * way, Chance(now, member, True, place)

    def _last(self, now: Situation) -> Iterator[tuple[float, Chance]]:
        """Yield how a hand that has all that is left may be brought to the row."""
        hand = self.hands.hand(now.members)
        assert hand is not None
        if self._stays(now):
            yield now.cost, Chance(now, None, True)
            return
        for place, goal, onto in self._ends(now, hand):
            short = SHORT if onto else 0.0
            at = se2.compose(goal, [-short, 0.0, 0.0])
            cost = float(self._word_costs(hand, now.plate, at[None])[0]) + short
            if math.isfinite(cost) and self._fills(place, goal):
                yield now.cost + cost, Chance(now, None, True, place)

    def _stays(self, now: Situation) -> bool:
        """Tell whether the row may stand anywhere, and all of it is in hand."""
        return not self.places and not now.delivered

    def _word_costs(self, hand: Hand, start: FloatArray, goals: FloatArray) -> FloatArray:
        none = np.zeros(len(goals))
        return word_costs(hand.packed, start[None], goals, np.zeros(1), none, math.inf)[0]

    def _closed(self, hand: Hand, member: Member) -> FloatArray:
        """Return the plate's pose (3,) with a hand flush at an object where that stands."""
        assert hand.across is not None
        return se2.compose(self.entries[member], se2.inverse(hand.across))

    def _ends(self, now: Situation, hand: Hand) -> Iterator[tuple[int, FloatArray, str]]:
        """Yield places for the row, where the plate is with the hand there (3,), and what it comes to touch."""
        if hand.across is None or not self._may_end(now):
            return
        if now.front is not None and hand.closes:
            yield now.place, se2.compose(now.front, se2.inverse(hand.across)), now.last
        for k, place in enumerate(self.places if now.front is None else ()):
            yield k, se2.compose(place.front, se2.inverse(hand.across)), ""

    def _may_end(self, now: Situation) -> bool:
        """Tell whether a hand comes next in the row, counted from its front."""
        if self.row.order == "any":
            return True
        return now.members[-1][0] == self.row.of[len(self.row.of) - len(now.delivered) - 1]

    def _follows(self, behind: str, ahead: str) -> bool:
        if self.row.order == "any":
            return True
        return self.row.of.index(ahead) == self.row.of.index(behind) + 1

    def _fills(self, place: int, goal: FloatArray) -> bool:
        """Tell whether a row whose last part ends with the plate at a pose is as long as its place."""
        rear = self.places[place].rear
        return rear is None or max(se2.pose_error(rear, goal)) < AT_PLACE

    def _rest(self, now: Situation) -> float:
        """Return an estimate of what is to come: how far it is to the nearest one from each that is left, m."""
        points = [self.starts[name][:2] for name in sorted(now.left)]
        if not points:
            return 0.0
        others = np.array([*points, now.plate[:2]])
        away = np.linalg.norm(others[:-1, None] - others[None], axis=2)
        away[np.arange(len(points)), np.arange(len(points))] = np.inf
        return float(away.min(axis=1).sum())

    # --- what it costs ---

    def _priced(self, chance: Chance) -> Situation | None:
        """Return the situation that a chance leads to, None where it is not possible."""
        now = chance.situation
        if now is None:
            assert chance.taken is not None
            return self._begun(chance.taken)
        hand = self.hands.hand(now.members)
        assert hand is not None
        if not chance.delivers:
            assert chance.taken is not None
            return self._closing(now, hand, chance.taken, chance.by_way)
        if self._stays(now):
            return self._left_there(now, hand)
        delivered = self._delivery(now, hand, chance.place, chance.by_way)
        if delivered is None or chance.taken is None:
            return delivered
        return self._next_taken(delivered, chance.taken)

    def _standing(self, left: frozenset[str], delivered: Poses, *without: str) -> dict[str, FloatArray]:
        """Return all that rests: what is no part of the row, or not taken yet, and what was delivered."""
        assert self.scenario.row is not None
        row = set(self.row.of)
        return {
            name: np.asarray(delivered[name] if name in delivered else pose)
            for name, pose in self.starts.items()
            if name not in without and (name in left or name in delivered or name not in row)
        }

    def _begun(self, member: Member) -> Situation | None:
        """Return the situation in which the robot has come up to the first object."""
        left = frozenset(self.row.of)
        empty = Situation(0.0, (), self.scenario.plate_start, left, {}, None, -1, "", (), None)
        return self._next_taken(empty, member)

    def _next_taken(self, now: Situation, member: Member) -> Situation | None:
        """Return the situation in which the robot, which holds nothing, has driven to an object."""
        hand, name = self.hands.hand((member,)), member[0]
        assert hand is not None
        at, pose = self.entries[member], self.starts[name]
        others = self._standing(now.left, now.delivered, name)
        if not self.floor.approach(hand, at, others, member, self.hands.ways[member].entry):
            return None
        before = se2.compose(at, [-self.choice.approach, 0.0, 0.0])
        arcs = self.floor.transit(now.plate, before, others, name, pose)
        if arcs is None:
            return None
        moves = [Move(TRANSIT, (), now.plate, arcs)] if len(arcs) else []
        moves.append(Move.straight(APPROACH, (member,), before, self.choice.approach))
        way = sum(move.path.cost for move in moves)
        cost = now.cost + self.choice.transit_weight * way
        return replace(
            now,
            cost=cost,
            members=(member,),
            plate=at,
            left=now.left - {name},
            moves=(*now.moves, *moves),
        )

    def _closing(self, now: Situation, hand: Hand, member: Member, by_way: bool) -> Situation | None:
        end = self._closed(hand, member)
        short = se2.compose(end, [-SHORT, 0.0, 0.0])
        standing = self._standing(now.left, now.delivered)
        if not self.floor.closes(hand, short, SHORT, self._standing(now.left, now.delivered, member[0])):
            return None
        push = self._pushed(hand, now.plate, short, standing, by_way)
        if not math.isfinite(push.cost):
            return None
        moves = (
            Move("push", now.members, now.plate, push.arcs),
            Move.straight("close", now.members, short, SHORT, member[0]),
        )
        return replace(
            now,
            cost=now.cost + push.cost + SHORT,
            members=(*now.members, member),
            plate=end,
            left=now.left - {member[0]},
            moves=moves,
            before=now,
        )

    def _delivery(self, now: Situation, hand: Hand, place: int, by_way: bool) -> Situation | None:
        """Return the situation in which a hand was left in the row, and the robot has backed off."""
        found = next((goal, onto) for k, goal, onto in self._ends(now, hand) if k == place)
        goal, onto = found
        short = SHORT if onto else 0.0
        at = se2.compose(goal, [-short, 0.0, 0.0])
        standing = self._standing(now.left, now.delivered)
        if onto and not self.floor.closes(
            hand, at, short, self._standing(now.left, now.delivered, *now.delivered)
        ):
            return None
        push = self._pushed(hand, now.plate, at, standing, by_way)
        if not math.isfinite(push.cost):
            return None
        moves = [Move("push", now.members, now.plate, push.arcs)]
        if onto:
            moves.append(Move.straight("close", now.members, at, short, onto))
        return self._backed_off(now, hand, goal, moves, push.cost + short, place)

    def _left_there(self, now: Situation, hand: Hand) -> Situation | None:
        """Return the situation in which a row that may stand anywhere was pushed flush and left."""
        settle = hand.packed.settling * hand.packed.settle
        end = se2.compose(now.plate, settle)
        arcs = np.append(hand.packed.settling, hand.packed.settle)[None]
        if not self.floor.settles(hand, now.plate, self._standing(now.left, now.delivered)):
            return None
        moves = [Move("push", now.members, now.plate, arcs)]
        return self._backed_off(now, hand, end, moves, hand.packed.settle, -1)

    def _backed_off(
        self, now: Situation, hand: Hand, goal: FloatArray, moves: list[Move], cost: float, place: int
    ) -> Situation | None:
        if not self.floor.retreats(hand, goal, self._standing(now.left, now.delivered)):
            return None
        retreat = self.choice.retreat
        moves.append(Move.straight(RETREAT, now.members, goal, -retreat))
        delivered = {**now.delivered, **self._poses_in(now.members, goal)}
        return Situation(
            now.cost + cost + self.choice.transit_weight * retreat,
            (),
            se2.compose(goal, [-retreat, 0.0, 0.0]),
            now.left,
            delivered,
            goal,
            place,
            now.members[0][0],
            tuple(moves),
            now,
        )

    def _poses_in(self, members: tuple[Member, ...], plate: FloatArray) -> dict[str, FloatArray]:
        """Return where members are with the plate at a pose (3,)."""
        found, at = {}, plate
        for member in members:
            way = self.hands.ways[member]
            found[member[0]] = se2.compose(at, se2.inverse(way.entry))
            if way.across is not None:
                at = se2.compose(at, way.across)
        return found

    def _pushed(
        self, hand: Hand, start: FloatArray, goal: FloatArray, standing: Poses, by_way: bool
    ) -> Pushed:
        way = self.floor.push_by_way_of if by_way else self.floor.push
        return way(hand, start, goal, standing)

    # --- as a plan ---

    def _segments(self, moves: tuple[Move, ...]) -> Segments:
        """Return moves as the segments of a plan, not timed."""
        found: list[Segment] = []
        now: Poses = self.scenario.poses
        for move in moves:
            load = self.hands.load(move.members) if move.members else None
            hand = self.hands.hand(move.members) if move.members else None
            if load is None or hand is None or move.kind in (APPROACH, RETREAT):
                found.append(Segment(move.kind, move.path, now, now, load))
            elif move.onto:
                found.append(Segment.close(load, move.path, now, hand.margin, move.onto))
            else:
                found.append(Segment.push(load, move.path, now, hand.margin))
            now = found[-1].after
        return tuple(found)


def _same(one: Situation) -> tuple[object, ...]:
    """Return what makes two situations the same, whatever came before."""
    return one.left, one.members, tuple(np.round(one.plate, 6)), frozenset(one.delivered), one.place


def _places(scenario: Scenario, hands: Hands) -> tuple[Place, ...]:
    """Return the places that the row may have; none where it may stand anywhere."""
    row = scenario.row
    assert row is not None
    if row.pose is not None:
        return tuple(
            Place(se2.compose(row.pose, [length, 0.0, 0.0]), np.asarray(row.pose))
            for length in sorted(_lengths(row.of, hands))
        )
    if row.wall is None:
        return ()
    area = scenario.workspace
    assert area is not None
    kept = scenario.clearance + BESIDE_A_WALL
    sides = {
        "xmin": ([area.xmin + kept, area.ymin], [area.xmin + kept, area.ymax], math.pi),
        "xmax": ([area.xmax - kept, area.ymin], [area.xmax - kept, area.ymax], 0.0),
        "ymin": ([area.xmin, area.ymin + kept], [area.xmax, area.ymin + kept], -0.5 * math.pi),
        "ymax": ([area.xmin, area.ymax - kept], [area.xmax, area.ymax - kept], 0.5 * math.pi),
    }
    found = []
    for name, (begin, end, heading) in sides.items():
        if row.wall in (name, "any"):
            length = float(np.linalg.norm(np.subtract(end, begin)))
            count = max(1, min(MOST_ALONG, int(length / ALONG_A_WALL)))
            for share in (np.arange(count) + 0.5) / count:
                found.append(Place(np.append(np.add(begin, share * np.subtract(end, begin)), heading), None))
    return tuple(found)


def _lengths(names: tuple[str, ...], hands: Hands) -> set[float]:
    """Return how long a row of all the objects may be, each pushed through a face straight in front of another."""
    found = {0.0}
    for name in names:
        own = set()
        for (other, _), way in hands.ways.items():
            if other == name and way.across is not None and abs(way.across[1]) < AT_PLACE:
                own.add(round(float(way.across[0]), 9))
        found = {round(sofar + length, 9) for sofar in found for length in own}
    return found


def _explanation(beams: _Beams, limit: float) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
    """Return why no plan was found: how far the search came, and how widely what it held then turns."""
    row, farthest = beams.row, beams.farthest
    names = ", ".join(f"'{name}'" for name in row.of)
    hand = None
    if farthest is None:
        what = "the robot can drive up to none of the objects that it may push first"
    else:
        held = ", ".join(f"'{name}'" for name, _ in farthest.members)
        what = f"the search came as far as holding {held}"
        what += f", with {len(farthest.left)} left to take" if farthest.left else ", and not to the row"
        hand = beams.hands.hand(farthest.members)
    told = [Diagnosis("order", what, False)]
    radius = math.inf if hand is None else _radius(hand)
    area = beams.scenario.workspace
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
