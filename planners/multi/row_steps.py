"""Steps of the search for a row and their costs: closes, deliveries and transits between nodes."""

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
    """A node of the search: the held objects and the moves that led to it.

    Attributes:
        cost: Cost of all moves up to this node, m.
        members: Held objects.
        plate: (3,) pose of the plate.
        left: Names of the row's objects that were not taken yet.
        delivered: Poses of the objects in the row.
        front: (3,) pose at which the next delivery ends; None before a place is chosen.
        place: Index of the row's place; -1 before it is chosen.
        last: Name of the last delivered object; "" before the first.
        moves: Moves since the previous node.
        before: The previous node.
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
        """The state that determines the possible next steps and their costs."""
        delivered = tuple((name, np.asarray(pose).tobytes()) for name, pose in self.delivered.items())
        return self.left, self.members, self.plate.tobytes(), delivered, self.place

    def way(self) -> tuple[Move, ...]:
        """Return all moves up to this node."""
        return (*(() if self.before is None else self.before.way()), *self.moves)


@dataclass(frozen=True, eq=False)
class Chance:
    """A possible next step with a bound of its cost. The exact cost is computed when it is needed.

    Attributes:
        node: Node at which the step begins; None for the first node.
        taken: Object that is closed onto or driven to, and its face; None if the row is complete.
        delivers: Whether the hand is first brought to the row.
        place: Index of the row's place for the delivery.
        by_way: Whether the push leads through an intermediate pose.
    """

    node: Node | None
    taken: Member | None
    delivers: bool
    place: int = -1
    by_way: bool = False


class Steps:
    """Possible steps from one node to others.

    Args:
        hands: Hands of the plate, with the margins to plan with.
        floor: Collision scenes of the room.
        before: Segments that are executed first.
        begin: Node at the end of `before`, with nothing held; None for the scenario's start.
        starts: Poses of the objects at `begin`; None for the scenario's poses.
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
        """Return the node before any move."""
        row, front, last = self.row, None, ""
        if row.placed:
            front, last = front_of_placed(self.scenario, self.hands)
        delivered = {name: self.starts[name] for name in row.placed}
        left = frozenset(row.of) - frozenset(row.placed)
        place = 0 if row.placed else -1
        return Node(0.0, (), self.scenario.plate_start, left, delivered, front, place, last, (), None)

    # --- possible next steps ---

    def first(self) -> Iterator[tuple[float, Chance]]:
        """Yield the possible first objects with lower bounds of the cost to drive to them."""
        for member in self.members:
            if member[0] in self.begin.left:
                yield (self.begin.cost + self._least_drive(self.begin.plate, member), Chance(None, member, False))

    def _least_drive(self, plate: FloatArray, member: Member) -> float:
        """Return a lower bound of the cost to drive to an object, m."""
        before = se2.compose(self.entries[member], [-self.choice.approach, 0.0, 0.0])
        way = shortest_drives(self.floor.wheels, plate[None], before[None])[0, 0] + self.choice.approach
        return self.choice.transit_weight * float(way)

    def next(self, now: Node, closes: bool, delivers: bool) -> Iterator[tuple[float, Chance]]:
        """Yield the possible steps after a node with lower bounds of the cost up to their ends."""
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
        """Yield the deliveries that bring the last hand to the row."""
        hand = self.hands.held(now.members)
        if self._stays(now):
            yield now.cost, Chance(now, None, True)
            return
        for place, goal, cost in self._end_costs(now, hand):
            if self._fills(place, goal):
                yield now.cost + cost, Chance(now, None, True, place)

    def _end_costs(self, now: Node, hand: Hand) -> Iterator[tuple[int, FloatArray, float]]:
        """Yield places for the row, the plate pose (3,) with the hand there, and a lower bound of the push's cost."""
        for place, goal, onto in self._ends(now, hand):
            short = SHORT if onto else 0.0
            at = se2.compose(goal, [-short, 0.0, 0.0])
            cost = float(self._word_costs(hand, now.plate, at[None])[0]) + short
            if math.isfinite(cost):
                yield place, goal, cost

    def _stays(self, now: Node) -> bool:
        """Return whether the row can stand anywhere and the hand holds all of it."""
        return not self.places and not now.delivered

    def _word_costs(self, hand: Hand, start: FloatArray, goals: FloatArray) -> FloatArray:
        none = np.zeros(len(goals))
        costs = word_costs(hand.packed, start[None], goals, np.zeros(1), none, math.inf)
        return np.asarray(costs[0])

    def _closed(self, hand: Hand, member: Member) -> FloatArray:
        """Return the plate pose (3,) with a hand flush against an object at its current place."""
        assert hand.across is not None
        return se2.compose(self.entries[member], se2.inverse(hand.across))

    def _ends(self, now: Node, hand: Hand) -> Iterator[tuple[int, FloatArray, str]]:
        """Yield places for the row, the plate pose (3,) with the hand there, and the object that the hand touches."""
        if hand.across is None or not self._may_end(now):
            return
        if now.front is not None and hand.closes:
            yield now.place, se2.compose(now.front, se2.inverse(hand.across)), now.last
        for k, place in enumerate(self.places if now.front is None else ()):
            yield k, se2.compose(place.front, se2.inverse(hand.across)), ""

    def _may_end(self, now: Node) -> bool:
        """Return whether a hand is next in the row, counted from the front."""
        if self.row.order == "any":
            return True
        return now.members[-1][0] == self.row.of[len(self.row.of) - len(now.delivered) - 1]

    def _follows(self, behind: str, ahead: str) -> bool:
        if self.row.order == "any":
            return True
        return self.row.of.index(ahead) == self.row.of.index(behind) + 1

    def _fills(self, place: int, goal: FloatArray) -> bool:
        """Return whether the row fits its place if the last delivery ends with the plate at a pose."""
        rear = self.places[place].rear
        return rear is None or max(se2.pose_error(rear, goal)) < AT_PLACE

    def estimate(self, now: Node) -> float:
        """Return the estimated cost of a plan through a node, m.

        Once all objects are taken, it includes the cost of the last push without obstacles. Before, it includes the
        distance from each remaining object to its nearest neighbour.
        """
        if not now.left:
            return min((bound for bound, _ in self.last(now)), default=math.inf) if now.members else now.cost
        return now.cost + self._between(now.left, now.plate)

    def _between(self, left: frozenset[str], plate: FloatArray) -> float:
        """Return the sum of distances from each remaining object to its nearest neighbour or the plate, m."""
        points = [self.starts[name][:2] for name in sorted(left)]
        others = np.array([*points, plate[:2]])
        away = np.linalg.norm(others[:-1, None] - others[None], axis=2)
        away[np.arange(len(points)), np.arange(len(points))] = np.inf
        return float(away.min(axis=1).sum())

    def least(self, bound: float, chance: Chance) -> float:
        """Return a low estimate of the cost of a plan that continues with a step, from the step's bound, m."""
        now, taken = chance.node or self.begin, chance.taken
        if taken is None or now.left == {taken[0]}:
            return bound
        hand = None if chance.node is None or chance.delivers else self.hands.hand(now.members)
        plate = self.entries[taken] if hand is None else self._closed(hand, taken)
        return bound + self._between(now.left - {taken[0]}, plate)

    # --- exact costs ---

    def priced(self, chance: Chance) -> Node | None:
        """Return the node after a step with its exact cost; None if the step is impossible."""
        now = chance.node
        if now is None:
            assert chance.taken is not None
            return self._next_taken(self.begin, chance.taken)
        if not chance.delivers:
            assert chance.taken is not None
            if self.hands.hand((*now.members, chance.taken)) is None:
                return None  # a check since then has shown that the contact may not close
        key = (now.key, chance.taken, chance.delivers, chance.place, chance.by_way)
        if key not in self._priced:
            found = self._worked_out(now, chance)
            self._priced[key] = None if found is None else (found, found.cost - now.cost)
        cached = self._priced[key]
        return None if cached is None else replace(cached[0], cost=now.cost + cached[1], before=now)

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
        """Return the poses of all objects at rest: outside the row, not taken yet, or delivered."""
        row = set(self.row.of)
        return {
            name: np.asarray(delivered.get(name, pose))
            for name, pose in self.starts.items()
            if name not in without and (name in left or name in delivered or name not in row)
        }

    def after(self, segments: Segments) -> Steps:
        """Return the steps that begin after some segments, with nothing held."""
        end = segments[-1]
        cost = self.begin.cost + plan_cost(self.scenario, segments)
        begin = replace(self.begin, cost=cost, plate=end.path.end)
        return Steps(self.hands, self.floor, (*self.before, *segments), begin, end.after)

    def least_accessible(self) -> list[str]:
        """Return the remaining objects, those with the fewest reachable faces first."""
        faces = dict.fromkeys(self.row.left, 0)
        for member in self.members:
            if member[0] in faces:
                faces[member[0]] += self._next_taken(self.begin, member) is not None
        return sorted(faces, key=lambda name: faces[name])

    def _next_taken(self, now: Node, member: Member) -> Node | None:
        """Return the node after the robot, holding nothing, has driven to an object; None if it cannot."""
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
        """Return the node after a hand is left in the row and the robot has backed off; None if impossible."""
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
        """Return the node after a row that can stand anywhere is pushed flush and left; None if impossible."""
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
        """Return the poses of members with the plate at a pose (3,)."""
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
