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

from pushplan.core.collision import Scene
from pushplan.core.driving import shortest_drives
from pushplan.core.pushes import push_costs
from pushplan.core.sequences import cheapest_tours
from pushplan.geometry import se2
from pushplan.planners.multi.transfers import Piece, Situation, plates_after
from pushplan.planners.problem import standing_in
from pushplan.util.arrays import FloatArray

MOST = 12
"""Bodies in a tour. Each one more takes up to twice the time; 12 take 0.03 s, 8 0.013 s."""

FEW = 8
"""So many, the nearest ones, are in it where there are more than that: it is made anew then for each step."""

HARD = 3.0
"""A body can always be brought to a goal for so much more than its cheapest push alone costs, it is assumed, m."""


class Rooms:
    """The robot in the room with what is never moved, and with one other body in it, too.

    Args:
        pieces: All bodies.
        now: Where everything is.
        moved: Indices of the bodies that are moved; the rest stand.
    """

    def __init__(self, pieces: tuple[Piece, ...], now: Situation, moved: Iterable[int]) -> None:
        self.moved, self._pieces = tuple(moved), pieces
        rest = (k for k in range(len(pieces)) if k not in self.moved)
        self._standing = [obstacle for k in rest for obstacle in pieces[k].obstacles(now.poses[k])]
        self._known: dict[tuple[object, ...], Scene] = {}

    def robot(self, piece: int, other: int | None, pose: FloatArray | None = None) -> Scene:
        """Return the room of a body, another one standing at a pose (3,); bodies that are alike share it."""
        room = self._pieces[piece].search.room(0)
        key = (id(room.shortest), other, None if pose is None else pose.tobytes())  # which rooms of twins share
        if key not in self._known:
            there = () if other is None or pose is None else self._pieces[other].obstacles(pose)
            standing = (*room.scenario.obstacles, *self._standing, *there)
            self._known[key] = room.robot.with_obstacles(*standing_in(replace(room.scenario, obstacles=standing)))
        return self._known[key]


@dataclass(frozen=True, eq=False)
class Ends:
    """Where the robot is before and after a body is pushed to a goal, and what that costs.

    Attributes:
        entries: (m, 3) poses of its frame before the approach, by contact.
        exits: (k, 3) poses of the plate after the retreat, each once.
        costs: (n, 2, m, k) least costs of the pushes between them, with approach and retreat, m: each of the n bodies
            that are moved alone being at its goal, or not brought away yet; none of them where it is this one.
    """

    entries: FloatArray
    exits: FloatArray
    costs: FloatArray

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
        room = own.search.room(0)
        modes = [contact.packed for contact in room.contacts]
        contacts = [(contact.scene, contact.packed) for contact in room.contacts]
        entries = np.array([mode.robot_at(pose, mode.approach) for mode in modes])
        exits = plates_after(room, goals)
        places = np.column_stack([exits[:, :2], np.cos(exits[:, 2]), np.sin(exits[:, 2])]).round(6) + 0.0
        _, kept, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
        every = np.ones((len(modes), len(goals)), dtype=np.bool_)
        pushes, alone = (
            room.scenario.transport,
            push_costs([rooms.robot(piece, None)], contacts, pose, goals, every)[0],
        )
        ends = pushes.transit_weight * (pushes.approach + pushes.retreat)
        most = HARD + min(float(alone.min()) + ends, float(np.hypot(*(goals - pose)[:, :2].T).min()) + HARD)
        among = {
            (at, waits): rooms.robot(piece, k, there[0])
            for at, k in enumerate(rooms.moved)
            for waits, there in enumerate((pieces[k].only_place, [now.poses[k]]))
            if k != piece and there
        }
        costs = np.broadcast_to(alone, (len(rooms.moved), 2, *alone.shape)).copy()
        costs[tuple(np.array([*among], dtype=int).reshape(-1, 2).T)] = push_costs(
            list(among.values()), contacts, pose, goals, alone + ends < most
        )
        least = np.full((len(modes), len(kept), *costs.shape[:2]), math.inf)
        contact = np.repeat(np.arange(len(modes)), len(goals))
        by_push = np.minimum(costs + ends, most).transpose(2, 3, 0, 1).reshape(len(contact), *costs.shape[:2])
        np.minimum.at(least, (contact, place.reshape(-1)), by_push)
        return cls(entries, exits[kept], least.transpose(2, 3, 0, 1))


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
        last = np.cumsum([len(end.exits) for end in ends.values()])
        self._own = {piece: slice(end - len(ends[piece].exits), end) for piece, end in zip(ends, last, strict=True)}
        ways = [self._drives(self._exits, piece) for piece in ends]
        self._cost_to_go = cheapest_tours(ways, [end.costs for end in ends.values()])

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
        among, found = sum(self._bit[piece] for piece in left), {}
        waits = np.array([bit & among > 0 for bit in self._bit.values()], dtype=int)
        for piece in sorted(left):
            first = self._drives(plate[None], piece)[0]
            push = self._ends[piece].costs[np.arange(len(waits)), waits].max(axis=0)
            rest = self._cost_to_go[among ^ self._bit[piece], self._own[piece]]
            found[piece] = float((first[:, None] + push + rest).min())
        return found

    def after(self, left: Iterable[int], plates: FloatArray) -> FloatArray:
        """Return what tours cost through some bodies from ends of pushes, the plate's poses (k, 3): (k,), m."""
        among = sum(self._bit[piece] for piece in left if piece in self._bit)
        off = np.hypot(*np.moveaxis(plates[:, None, :2] - self._exits[:, :2], -1, 0))
        turned = np.abs(se2.wrap_angle(plates[:, None, 2] - self._exits[:, 2]))
        return np.asarray(self._cost_to_go[among, np.argmin(off + turned, axis=1)])

    def _drives(self, plates: FloatArray, piece: int) -> FloatArray:
        """What the ways from poses (k, 3) of the plate to the entries of a body cost, (k, m), m."""
        room = self._pieces[piece].search.room(0)
        starts = se2.compose(plates, se2.inverse(room.scenario.chain.pusher.plate_pose))
        weight = room.scenario.transport.transit_weight
        return weight * shortest_drives(room.wheels, starts, self._ends[piece].entries)
