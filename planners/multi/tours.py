"""What bringing several bodies to their goals costs, one after the other: about, and soon.

Each is brought there by a single push, round what never moves and round each other body alone, where that stands or
at its goal; the robot drives the shortest way from one to the next, whatever is in the way. The cheapest tour from
every end of a push through every set of bodies is known at once, by the recursion of Held and Karp (1962). That is no
bound: several pushes can cost less than a single one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from pushplan.core.driving import shortest_drives
from pushplan.core.pushes import push_costs
from pushplan.geometry import se2
from pushplan.planners.multi.room import PushRoom
from pushplan.planners.multi.transfers import Piece, Situation, plates_after
from pushplan.scenario.parts import PolygonObstacle
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

MOST = 12
"""Bodies in a tour. Each one more takes twice the time; 12 take 0.2 s, 8 0.03 s."""

FEW = 8
"""So many, the nearest ones, are in it where there are more than that: it is made anew then for each step."""

HARD = 3.0
"""A body can always be brought to a goal for so much more than its cheapest push alone costs, it is assumed, m."""


class Rooms:
    """The room with what is never moved, and with one other body in it, too.

    Args:
        pieces: All bodies.
        now: Where everything is.
        moved: Indices of the bodies that are moved; the rest stand.
    """

    def __init__(self, pieces: tuple[Piece, ...], now: Situation, moved: Iterable[int]) -> None:
        self.moved, self._pieces = tuple(moved), pieces
        rest = (k for k in range(len(pieces)) if k not in self.moved)
        self._standing = [outline for k in rest for outline in pieces[k].outlines(now.poses[k])]
        self._known: dict[tuple[object, ...], PushRoom] = {}

    def with_body(self, piece: int, other: int | None, pose: FloatArray | None = None) -> PushRoom:
        """Return the room of a body, another one standing at a pose (3,); bodies that are alike share it."""
        room = self._pieces[piece].search.room(0)
        kind = tuple(id(contact.packed) for contact in room.contacts)
        key = (kind, other, None if pose is None else pose.tobytes())
        if key not in self._known:
            there = [] if other is None or pose is None else self._pieces[other].outlines(pose)
            standing = tuple(PolygonObstacle(outline) for outline in (*self._standing, *there))
            scenario = replace(room.scenario, obstacles=(*room.scenario.obstacles, *standing))
            self._known[key] = room.with_obstacles(scenario) if standing else room
        return self._known[key]


@dataclass(frozen=True, eq=False)
class Ends:
    """Where the plate is before and after a body is pushed to a goal, and what that costs.

    Attributes:
        entries: (m, 3) poses before the approach, by contact.
        exits: (k, 3) poses after the retreat, each once.
        costs: (m, k) of the pushes between them, with approach and retreat, none of the bodies in the way, m.
        waiting: Least costs (m, k) while another body has not been brought away, by its index.
        brought: Likewise once it is at its goal.
    """

    entries: FloatArray
    exits: FloatArray
    costs: FloatArray
    waiting: dict[int, FloatArray]
    brought: dict[int, FloatArray]

    @classmethod
    def of(cls, pieces: tuple[Piece, ...], now: Situation, piece: int, rooms: Rooms) -> Ends:
        """Return them for a body.

        Args:
            pieces: All of them.
            now: Where everything is.
            piece: The body's index.
            rooms: What it is pushed in.
        """
        own, pose = pieces[piece], now.poses[piece]
        goals = np.array([goal.pose_chain for goal in own.goals])
        room = rooms.with_body(piece, None)
        modes = [contact.packed for contact in room.contacts]
        plate = room.scenario.chain.pusher.plate_pose
        entries = np.array([se2.compose(mode.robot_at(pose, mode.approach), plate) for mode in modes])
        exits = plates_after(room, goals)
        places = np.column_stack([exits[:, :2], np.cos(exits[:, 2]), np.sin(exits[:, 2])]).round(6) + 0.0
        _, kept, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
        free = _push_costs(room, pose, goals)
        most = HARD + min(float(free.min()), float(np.hypot(*(goals - pose)[:, :2].T).min()) + HARD)

        def least(costs: FloatArray) -> FloatArray:
            found = np.full((len(modes), len(kept)), math.inf)
            contacts = np.repeat(np.arange(len(modes)), len(goals))
            np.minimum.at(found, (contacts, place.reshape(-1)), np.minimum(costs, most).reshape(-1))
            return found

        def among(other: int, pose_other: FloatArray) -> FloatArray:
            return least(_push_costs(rooms.with_body(piece, other, pose_other), pose, goals, free < most))

        others = [k for k in rooms.moved if k != piece]
        waiting = {k: among(k, now.poses[k]) for k in others}
        brought = {k: among(k, goal) for k in others for goal in pieces[k].only_place}
        return cls(entries, exits[kept], least(free), waiting, brought)


def _push_costs(room: PushRoom, pose: FloatArray, goals: FloatArray, asked: BoolArray | None = None) -> FloatArray:
    """Return what single pushes by each contact from a pose to goals (g, 3) cost, with approach and retreat, m.

    Infinite where there is none, or where it is not `asked` (m, g) for.
    """
    pushes = room.scenario.pushes
    assert pushes is not None
    asked = np.ones((len(room.contacts), len(goals)), dtype=np.bool_) if asked is None else asked
    contacts = [(contact.scene, contact.packed) for contact in room.contacts]
    costs = push_costs(room.robot, contacts, pose, goals, asked)
    return costs + pushes.transit_weight * (pushes.approach + pushes.retreat)


class Tours:
    """The cheapest tours through bodies that are left.

    Args:
        pieces: All of them.
        now: Where everything is.
        ends: Of the bodies that are left, by index.
    """

    def __init__(self, pieces: tuple[Piece, ...], now: Situation, ends: dict[int, Ends]) -> None:
        self._pieces, self._poses, self._ends, self._plate = pieces, now.poses, ends, now.plate
        self._left, self._whole = now.left, now.left == frozenset(ends)
        self._bit = {piece: 1 << k for k, piece in enumerate(ends)}
        self._exits = np.concatenate([end.exits for end in ends.values()])
        self._cost_to_go = self._solved()

    @classmethod
    def of(cls, pieces: tuple[Piece, ...], now: Situation) -> Tours:
        """Return those from where everything is."""
        away = np.hypot(*(now.poses - now.plate)[:, :2].T)
        nearest = sorted(sorted(now.left), key=lambda piece: float(away[piece]))
        nearest = nearest if len(nearest) <= MOST else nearest[:FEW]
        rooms = Rooms(pieces, now, nearest)
        return cls(pieces, now, {piece: Ends.of(pieces, now, piece, rooms) for piece in nearest})

    def lead_on_from(self, now: Situation) -> bool:
        """Tell whether they are those of a situation, too: of what is left nothing was moved."""
        if not self._whole:
            return now.left == self._left and np.array_equal(now.plate, self._plate)
        left = sorted(now.left)
        return now.left <= self._left and np.array_equal(now.poses[left], self._poses[left])

    def begun(self, plate: FloatArray, left: Iterable[int]) -> dict[int, float]:
        """Return what a tour costs that begins with each of some bodies, the plate being at a pose (3,), m."""
        left = frozenset(left) & frozenset(self._ends)
        among = np.array([sum(self._bit[piece] for piece in left)])
        found = {}
        for piece in sorted(left):
            first = self._drives(plate[None], piece)[0]
            rest = self.after(left - {piece}, self._ends[piece].exits)
            found[piece] = float((first[:, None] + self._costs(piece, among)[0] + rest).min())
        return found

    def after(self, left: Iterable[int], plates: FloatArray) -> FloatArray:
        """Return what tours cost through some bodies from ends of pushes, the plate's poses (k, 3): (k,), m."""
        among = sum(self._bit[piece] for piece in left if piece in self._bit)
        off = np.hypot(*np.moveaxis(plates[:, None, :2] - self._exits[:, :2], -1, 0))
        turned = np.abs(se2.wrap_angle(plates[:, None, 2] - self._exits[:, 2]))
        return np.asarray(self._cost_to_go[among, np.argmin(off + turned, axis=1)])

    def _drives(self, plates: FloatArray, piece: int) -> FloatArray:
        """What the ways from poses (k, 3) to the entries of a body cost, (k, m), m."""
        room = self._pieces[piece].search.room(0)
        assert room.scenario.pushes is not None
        inner = se2.inverse(room.scenario.chain.pusher.plate_pose)
        starts, goals = (se2.compose(poses, inner) for poses in (plates, self._ends[piece].entries))
        return room.scenario.pushes.transit_weight * shortest_drives(room.wheels, starts, goals)

    def _costs(self, piece: int, sets: IntArray) -> FloatArray:
        """Return what the pushes of a body cost while sets of bodies (s,), by bits, are left: (s, m, k), m."""
        ends = self._ends[piece]
        costs = np.repeat(ends.costs[None], len(sets), axis=0)
        for other, bit in self._bit.items():
            if other != piece:
                waits = (sets & bit > 0)[:, None, None]
                there = np.where(waits, ends.waiting[other], ends.brought.get(other, ends.costs))
                np.maximum(costs, there, out=costs)
        return costs

    def _solved(self) -> FloatArray:
        """Return what the cheapest tours cost through each set of bodies (by bits) from each end of a push, m."""
        cost_to_go = np.full((1 << len(self._ends), len(self._exits)), math.inf)
        cost_to_go[0] = 0.0
        sets = np.arange(len(cost_to_go))
        sizes = np.array([int(one).bit_count() for one in sets])
        ways = {piece: self._drives(self._exits, piece) for piece in self._ends}
        begins = np.cumsum([0, *(len(ends.exits) for ends in self._ends.values())])
        for size in range(1, len(self._ends) + 1):
            for begin, (piece, bit) in zip(begins[:-1], self._bit.items(), strict=True):
                with_it = sets[(sizes == size) & (sets & bit > 0)]
                own = slice(begin, begin + len(self._ends[piece].exits))
                rest = cost_to_go[with_it ^ bit, own]
                push = (self._costs(piece, with_it) + rest[:, None]).min(axis=2)
                found = (ways[piece] + push[:, None]).min(axis=2)
                cost_to_go[with_it] = np.minimum(cost_to_go[with_it], found)
        return cost_to_go
