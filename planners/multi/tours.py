"""Quick estimates of the cost to bring several bodies to their goals in sequence.

Each body is delivered by a single push. The push avoids fixed obstacles and, one at a time, each other body at its
current place or at its goal. Transits between pushes are the shortest ones without obstacles. The recursion of Held
and Karp (1962) gives the cheapest tour from every end of a push through every set of bodies. The estimate is no
bound, because several pushes can cost less than a single one.
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
"""Maximum number of bodies in a tour. Each further body can double the time; 8 take 0.013 s, 12 take 0.03 s."""

FEW = 8
"""Number of nearest bodies in a tour if there are more than `MOST`. It is then recomputed for each step."""

HARD = 3.0
"""Assumed maximum excess of a body's cost over that of its cheapest push alone, m."""


class Rooms:
    """Scenes of the robot among the bodies that never move, with or without one other body.

    Args:
        pieces: All bodies.
        now: Current situation.
        moved: Indices of the bodies that move; the others stay.
    """

    def __init__(self, pieces: tuple[Piece, ...], now: Situation, moved: Iterable[int]) -> None:
        self.moved, self._pieces = tuple(moved), pieces
        rest = (k for k in range(len(pieces)) if k not in self.moved)
        self._standing = [obstacle for k in rest for obstacle in pieces[k].obstacles(now.poses[k])]
        self._known: dict[tuple[object, ...], Scene] = {}

    def robot(self, piece: int, other: int | None, pose: FloatArray | None = None) -> Scene:
        """Return the scene for pushing a body, with another body at a pose (3,) if given; twins share scenes."""
        room = self._pieces[piece].search.room(0)
        key = (id(room.shortest), other, None if pose is None else pose.tobytes())  # twins share `shortest`
        if key not in self._known:
            there = () if other is None or pose is None else self._pieces[other].obstacles(pose)
            standing = (*room.scenario.obstacles, *self._standing, *there)
            self._known[key] = room.robot.with_obstacles(*standing_in(replace(room.scenario, obstacles=standing)))
        return self._known[key]


@dataclass(frozen=True, eq=False)
class Ends:
    """Robot poses before and after the pushes of a body to its goals, and the costs of these pushes.

    Attributes:
        entries: (m, 3) poses of the robot's frame before the approach, by contact.
        exits: (k, 3) distinct poses of the plate after the retreat.
        costs: (n, 2, m, k) least costs of the pushes from entries to exits, including approach and retreat, m. The
            first index names the only other body, the second whether it is at its goal (0) or not yet moved (1).
            Entries for the body itself have no other body.
    """

    entries: FloatArray
    exits: FloatArray
    costs: FloatArray

    @classmethod
    def of(cls, pieces: tuple[Piece, ...], now: Situation, piece: int, rooms: Rooms) -> Ends:
        """Return the ends of a body's pushes.

        Args:
            pieces: All bodies.
            now: Current situation.
            piece: Index of the body.
            rooms: Scenes for the pushes.
        """
        own, pose = pieces[piece], now.poses[piece]
        goals = np.array([goal.pose_chain for goal in own.goals])
        room = own.search.room(0)
        modes = [contact.packed for contact in room.contacts]
        contacts = [(contact.scene, contact.packed) for contact in room.contacts]
        entries = np.array([mode.robot_at(pose, mode.approach) for mode in modes])
        exits = plates_after(room, goals)
        places = np.column_stack([exits[:, :2], np.cos(exits[:, 2]), np.sin(exits[:, 2])]).round(6) + 0.0
        _, firsts, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
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
        least = np.full((len(modes), len(firsts), *costs.shape[:2]), math.inf)
        contact = np.repeat(np.arange(len(modes)), len(goals))
        by_push = np.minimum(costs + ends, most).transpose(2, 3, 0, 1).reshape(len(contact), *costs.shape[:2])
        np.minimum.at(least, (contact, place.reshape(-1)), by_push)
        return cls(entries, exits[firsts], least.transpose(2, 3, 0, 1))


class Tours:
    """Cheapest tours through the remaining bodies.

    Args:
        pieces: All bodies.
        now: Current situation.
        ends: Ends of the remaining bodies' pushes, by index.
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
        """Return the tours from a situation."""
        away = np.hypot(*(now.poses - now.plate)[:, :2].T)
        nearest = sorted(sorted(now.left), key=lambda piece: float(away[piece]))
        nearest = nearest if len(nearest) <= MOST else nearest[:FEW]
        rooms = Rooms(pieces, now, nearest)
        return cls(pieces, now, {piece: Ends.of(pieces, now, piece, rooms) for piece in nearest})

    def lead_on_from(self, now: Situation) -> bool:
        """Return whether the tours also hold for a situation: no remaining body has moved."""
        if not self._whole:
            return now.left == self._left and np.array_equal(now.plate, self._plate)
        left = sorted(now.left)
        return now.left <= self._left and np.array_equal(now.poses[left], self._poses[left])

    def begun(self, plate: FloatArray, left: Iterable[int]) -> dict[int, float]:
        """Return the cost of the cheapest tour that begins with each of some bodies, from a plate pose (3,), m."""
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
        """Return the costs (k,) of tours through some bodies from plate poses (k, 3) at the ends of pushes, m."""
        among = sum(self._bit[piece] for piece in left if piece in self._bit)
        off = np.hypot(*np.moveaxis(plates[:, None, :2] - self._exits[:, :2], -1, 0))
        turned = np.abs(se2.wrap_angle(plates[:, None, 2] - self._exits[:, 2]))
        return np.asarray(self._cost_to_go[among, np.argmin(off + turned, axis=1)])

    def _drives(self, plates: FloatArray, piece: int) -> FloatArray:
        """Return the costs (k, m) of transits from plate poses (k, 3) to the entries of a body, m."""
        room = self._pieces[piece].search.room(0)
        starts = se2.compose(plates, se2.inverse(room.scenario.chain.pusher.plate_pose))
        weight = room.scenario.transport.transit_weight
        return weight * shortest_drives(room.wheels, starts, self._ends[piece].entries)
