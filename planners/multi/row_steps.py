"""What may come next while a row is made, and what it costs: closes, deliveries and transits between nodes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pushplan.core.driving import shortest_drives
from pushplan.core.pushes import word_costs
from pushplan.geometry import se2
from pushplan.planners.multi.hands import SHORT, Floor, Hand, Hands, Move, Pushed
from pushplan.planners.multi.multi_push import plan_cost
from pushplan.planners.multi.row_places import AT_PLACE, RowPlace, front_of_placed, row_places
from pushplan.planners.outcome import Segments
from pushplan.plans.load import Member
from pushplan.plans.segment import Poses
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, CLOSE, PUSH, RETREAT, TRANSIT


@dataclass(frozen=True, eq=False)
class Node:
    """A node of the search: what the plate holds, and how it came about.

    Attributes:
        cost: Of all moves until here, m.
        members: What is held.
        plate: (3,) pose.
        left: Names of the row's objects that were not taken yet.
        delivered: Poses of those in the row.
        front: (3,) where the next one that is delivered ends; None before a place was chosen.
        place: Index of the row's place; -1 likewise.
        last: Name of the object that was delivered last, "" before.
        moves: Since the node before.
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
    before: Node | None

    @cached_property
    def key(self) -> tuple[object, ...]:
        """On what it depends what comes next, and what that costs."""
        delivered = tuple((name, np.asarray(pose).tobytes()) for name, pose in self.delivered.items())
        return self.left, self.members, self.plate.tobytes(), delivered, self.place

    def way(self) -> tuple[Move, ...]:
        """Return all moves until here."""
        return (*(() if self.before is None else self.before.way()), *self.moves)


@dataclass(frozen=True, eq=False)
class Chance:
    """A step that may be taken next: what it is assumed to cost, priced exactly when it is its turn.

    Attributes:
        node: From which.
        taken: The object that is closed onto or driven to, and its face; None where the row is complete.
        delivers: The hand is brought to the row at first.
        place: Index of the row's place, where it is delivered to.
        by_way: The push leads through a pose in between.
    """

    node: Node | None
    taken: Member | None
    delivers: bool
    place: int = -1
    by_way: bool = False


class Steps:
    """The steps that lead from a node to others.

    Args:
        hands: What the plate may hold, with the margins to plan with.
        floor: What stands in the room.
        before: What is done first.
        begin: Where that ends, the robot holding nothing; None for nothing, or what is placed in the row.
        starts: Where the objects are then; None for where the scenario has them.
    """

    def __init__(
        self,
        hands: Hands,
        floor: Floor,
        before: Segments = (),
        begin: Node | None = None,
        starts: Poses | None = None,
    ) -> None:
        scenario = hands.scenario
        self.scenario, self.row, self.choice = scenario, scenario.transport.row, scenario.transport
        self.hands, self.floor, self.before = hands, floor, before
        self.starts = scenario.poses if starts is None else starts
        self.begin = self._first() if begin is None else begin
        self.members = [member for member in hands.ways if hands.hand((member,)) is not None]
        self.entries = {
            member: se2.compose(self.starts[member[0]], hands.ways[member].entry) for member in self.members
        }
        front = self.begin.front
        self.places = row_places(scenario, hands) if front is None else (RowPlace(front, None),)
        self._priced: dict[tuple[object, ...], tuple[Node, float] | None] = {}

    def _first(self) -> Node:
        """Return the node in which nothing was done yet."""
        row, front, last = self.row, None, ""
        if row.placed:
            front, last = front_of_placed(self.scenario, self.hands)
        delivered = {name: self.starts[name] for name in row.placed}
        left = frozenset(row.of) - frozenset(row.placed)
        place = 0 if row.placed else -1
        return Node(0.0, (), self.scenario.plate_start, left, delivered, front, place, last, (), None)

    # --- what may come next ---

    def first(self) -> Iterator[tuple[float, Chance]]:
        """Yield which objects may be driven to at first, with bounds of what that costs."""
        for member in self.members:
            if member[0] in self.begin.left:
                yield (self.begin.cost + self._least_drive(self.begin.plate, member), Chance(None, member, False))

    def _least_drive(self, plate: FloatArray, member: Member) -> float:
        """Return what the robot's way to an object costs at least, m."""
        before = se2.compose(self.entries[member], [-self.choice.approach, 0.0, 0.0])
        way = shortest_drives(self.floor.wheels, plate[None], before[None])[0, 0] + self.choice.approach
        return self.choice.transit_weight * float(way)

    def next(self, now: Node, closes: bool, delivers: bool) -> Iterator[tuple[float, Chance]]:
        """Yield what may come after a node, with bounds of the cost until the end."""
        hand = self.hands.held(now.members)
        if closes:
            yield from self._closings(now, hand)
        if delivers:
            yield from self._deliveries(now, hand)

    def _closings(self, now: Node, hand: Hand) -> Iterator[tuple[float, Chance]]:
        members = [m for m in self.members if m[0] in now.left and self._follows(now.members[-1][0], m[0])]
        if hand.across is None or not hand.closes or not members:
            return
        goals = np.array([se2.compose(self._closed(hand, m), [-SHORT, 0.0, 0.0]) for m in members])
        costs = self._word_costs(hand, now.plate, goals)
        for member, cost in zip(members, costs, strict=True):
            if math.isfinite(cost):
                yield now.cost + float(cost) + SHORT, Chance(now, member, False)

    def _deliveries(self, now: Node, hand: Hand) -> Iterator[tuple[float, Chance]]:
        members = [m for m in self.members if m[0] in now.left]
        for place, goal, cost in self._end_costs(now, hand):
            back = se2.compose(goal, [-self.choice.retreat, 0.0, 0.0])
            sofar = now.cost + cost + self.choice.transit_weight * self.choice.retreat
            for member in members:
                yield sofar + self._least_drive(back, member), Chance(now, member, True, place)

    def last(self, now: Node) -> Iterator[tuple[float, Chance]]:
        """Yield how a hand that has all that is left may be brought to the row."""
        hand = self.hands.held(now.members)
        if self._stays(now):
            yield now.cost, Chance(now, None, True)
            return
        for place, goal, cost in self._end_costs(now, hand):
            if self._fills(place, goal):
                yield now.cost + cost, Chance(now, None, True, place)

    def _end_costs(self, now: Node, hand: Hand) -> Iterator[tuple[int, FloatArray, float]]:
        """Yield places for the row, where the plate is with the hand there (3,), and what the push costs at least."""
        for place, goal, onto in self._ends(now, hand):
            short = SHORT if onto else 0.0
            at = se2.compose(goal, [-short, 0.0, 0.0])
            cost = float(self._word_costs(hand, now.plate, at[None])[0]) + short
            if math.isfinite(cost):
                yield place, goal, cost

    def _stays(self, now: Node) -> bool:
        """Tell whether the row may stand anywhere, and all of it is in hand."""
        return not self.places and not now.delivered

    def _word_costs(self, hand: Hand, start: FloatArray, goals: FloatArray) -> FloatArray:
        none = np.zeros(len(goals))
        costs = word_costs(hand.packed, start[None], goals, np.zeros(1), none, math.inf)
        return np.asarray(costs[0])

    def _closed(self, hand: Hand, member: Member) -> FloatArray:
        """Return the plate's pose (3,) with a hand flush at an object where that stands."""
        assert hand.across is not None
        return se2.compose(self.entries[member], se2.inverse(hand.across))

    def _ends(self, now: Node, hand: Hand) -> Iterator[tuple[int, FloatArray, str]]:
        """Yield places for the row, where the plate is with the hand there (3,), and what it comes to touch."""
        if hand.across is None or not self._may_end(now):
            return
        if now.front is not None and hand.closes:
            yield now.place, se2.compose(now.front, se2.inverse(hand.across)), now.last
        for k, place in enumerate(self.places if now.front is None else ()):
            yield k, se2.compose(place.front, se2.inverse(hand.across)), ""

    def _may_end(self, now: Node) -> bool:
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

    def estimate(self, now: Node) -> float:
        """Return what a plan costs about that goes on from a node, m.

        Once all is taken, what the last push costs where nothing is in the way; before, at least how far it is to the
        nearest other one from each object that is left.
        """
        if not now.left:
            return min((bound for bound, _ in self.last(now)), default=math.inf) if now.members else now.cost
        return now.cost + self._between(now.left, now.plate)

    def _between(self, left: frozenset[str], plate: FloatArray) -> float:
        """Return how far it is from each object that is left to the nearest other one, or to the plate, in all, m."""
        points = [self.starts[name][:2] for name in sorted(left)]
        others = np.array([*points, plate[:2]])
        away = np.linalg.norm(others[:-1, None] - others[None], axis=2)
        away[np.arange(len(points)), np.arange(len(points))] = np.inf
        return float(away.min(axis=1).sum())

    def least(self, bound: float, chance: Chance) -> float:
        """Return the least estimate of a plan that goes on with a chance whose bound is known, m."""
        now, taken = chance.node or self.begin, chance.taken
        if taken is None or now.left == {taken[0]}:
            return bound
        hand = None if chance.node is None or chance.delivers else self.hands.hand(now.members)
        plate = self.entries[taken] if hand is None else self._closed(hand, taken)
        return bound + self._between(now.left - {taken[0]}, plate)

    # --- what it costs ---

    def priced(self, chance: Chance) -> Node | None:
        """Return the node that a chance leads to, None where it is not possible."""
        now = chance.node
        if now is None:
            assert chance.taken is not None
            return self._next_taken(self.begin, chance.taken)
        if not chance.delivers:
            assert chance.taken is not None
            if self.hands.hand((*now.members, chance.taken)) is None:
                return None  # it may have turned out meanwhile that the contact does not surely close
        key = (now.key, chance.taken, chance.delivers, chance.place, chance.by_way)
        if key not in self._priced:
            found = self._worked_out(now, chance)
            self._priced[key] = None if found is None else (found, found.cost - now.cost)
        kept = self._priced[key]
        return None if kept is None else replace(kept[0], cost=now.cost + kept[1], before=now)

    def _worked_out(self, now: Node, chance: Chance) -> Node | None:
        hand = self.hands.held(now.members)
        if not chance.delivers:
            assert chance.taken is not None
            return self._closing(now, hand, chance.taken, chance.by_way)
        if self._stays(now):
            return self._left_there(now, hand)
        if chance.taken is None:
            return self._delivery(now, hand, chance.place, chance.by_way)
        delivered = self.priced(replace(chance, taken=None))
        return None if delivered is None else self._next_taken(delivered, chance.taken)

    def _standing(self, left: frozenset[str], delivered: Poses, *without: str) -> dict[str, FloatArray]:
        """Return all that rests: what is no part of the row, or not taken yet, and what was delivered."""
        row = set(self.row.of)
        return {
            name: np.asarray(delivered.get(name, pose))
            for name, pose in self.starts.items()
            if name not in without and (name in left or name in delivered or name not in row)
        }

    def after(self, segments: Segments) -> Steps:
        """Return the steps from where some segments lead, the robot holding nothing then."""
        end = segments[-1]
        cost = self.begin.cost + plan_cost(self.scenario, segments)
        begin = replace(self.begin, cost=cost, plate=end.path.end)
        return Steps(self.hands, self.floor, (*self.before, *segments), begin, end.after)

    def least_accessible(self) -> list[str]:
        """Return the objects that are left, those with the fewest faces that the robot comes up to at once first."""
        faces = dict.fromkeys(self.row.left, 0)
        for member in self.members:
            if member[0] in faces:
                faces[member[0]] += self._next_taken(self.begin, member) is not None
        return sorted(faces, key=lambda name: faces[name])

    def _next_taken(self, now: Node, member: Member) -> Node | None:
        """Return the node in which the robot, which holds nothing, has driven to an object."""
        hand, name = self.hands.held((member,)), member[0]
        at, pose = self.entries[member], self.starts[name]
        others = self._standing(now.left, now.delivered, name)
        if not self.floor.approach(hand, at, others, name, self.hands.ways[member].entry):
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
            now, cost=cost, members=(member,), plate=at, left=now.left - {name}, moves=(*now.moves, *moves)
        )

    def _closing(self, now: Node, hand: Hand, member: Member, by_way: bool) -> Node | None:
        end = self._closed(hand, member)
        short = se2.compose(end, [-SHORT, 0.0, 0.0])
        standing = self._standing(now.left, now.delivered)
        if not self.floor.closes(hand, short, SHORT, self._standing(now.left, now.delivered, member[0])):
            return None
        push = self._pushed(hand, now.plate, short, standing, by_way)
        if not math.isfinite(push.cost):
            return None
        moves = (
            Move(PUSH, now.members, now.plate, push.arcs),
            Move.straight(CLOSE, now.members, short, SHORT, member[0]),
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

    def _delivery(self, now: Node, hand: Hand, place: int, by_way: bool) -> Node | None:
        """Return the node in which a hand was left in the row, and the robot has backed off."""
        goal, onto = next((goal, onto) for k, goal, onto in self._ends(now, hand) if k == place)
        short = SHORT if onto else 0.0
        at = se2.compose(goal, [-short, 0.0, 0.0])
        standing = self._standing(now.left, now.delivered)
        if onto and not self.floor.closes(hand, at, short, self._standing(now.left, now.delivered, *now.delivered)):
            return None
        push = self._pushed(hand, now.plate, at, standing, by_way)
        if not math.isfinite(push.cost):
            return None
        moves = [Move(PUSH, now.members, now.plate, push.arcs)]
        if onto:
            moves.append(Move.straight(CLOSE, now.members, at, short, onto))
        return self._backed_off(now, hand, goal, moves, push.cost + short, place)

    def _left_there(self, now: Node, hand: Hand) -> Node | None:
        """Return the node in which a row that may stand anywhere was pushed flush and left."""
        settle = hand.packed.settling * hand.packed.settle
        end = se2.compose(now.plate, settle)
        arcs = np.append(hand.packed.settling, hand.packed.settle)[None]
        if not self.floor.settles(hand, now.plate, self._standing(now.left, now.delivered)):
            return None
        moves = [Move(PUSH, now.members, now.plate, arcs)]
        return self._backed_off(now, hand, end, moves, hand.packed.settle, -1)

    def _backed_off(
        self, now: Node, hand: Hand, goal: FloatArray, moves: list[Move], cost: float, place: int
    ) -> Node | None:
        if not self.floor.retreats(hand, goal, self._standing(now.left, now.delivered)):
            return None
        retreat = self.choice.retreat
        moves.append(Move.straight(RETREAT, now.members, goal, -retreat))
        delivered = {**now.delivered, **self._poses_in(now.members, goal)}
        return Node(
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

    def _pushed(self, hand: Hand, start: FloatArray, goal: FloatArray, standing: Poses, by_way: bool) -> Pushed:
        way = self.floor.push_by_way_of if by_way else self.floor.push
        return way(hand, start, goal, standing)
