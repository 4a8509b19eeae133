"""Poses at which several straight pushes meet: with one bend, and on a grid around obstacles.

Straight pushes keep the heading of the load. On a grid of positions with one heading, each contact pushes the load
from cell to cell in its own direction, and contacts change where the robot has room. The cheapest sequence of pushes
is a shortest path on this grid (Dijkstra 1959), for which transits have their shortest length without obstacles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pushplan.core.collision import ROUNDING, separations
from pushplan.core.pushes import PackedMode, approaches_are_free
from pushplan.geometry import se2
from pushplan.planners.multi.room import PushRoom, Query
from pushplan.planners.problem import sampling_box
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

CROSSED = 100_000
"""Pairs of pushes whose crossings are computed in one batch: about 10 ms and 20 MB."""

STEP, NODES = 0.25, 36_000
"""Distance of grid lines, as a share of the narrowest object's width, and approximate maximum number of nodes."""

ROUTES = 3
"""Number of routes for each heading."""

AVOIDED, AROUND = 1.0, 0.3
"""Additional cost (m) of a contact change near the ones of an earlier route, and how near (m)."""

SAME = 1e-9
"""Tolerance within which two numbers of poses are equal, m and rad."""

DECIMALS = 9
"""Decimals to which grid lines (m) and headings (rad) are compared."""

SQUARE = 0.02
"""Largest deviation of a push direction from the grid's axes, rad."""


def crossings(start: FloatArray, goals: FloatArray, modes: list[PackedMode]) -> Iterator[FloatArray]:
    """Yield poses (k, 3) where a straight push from the start, or after a tight turn there, meets one to a goal."""
    directions = np.array([se2.rotate(mode.contact[2], mode.settling[:2]) for mode in modes])  # in the load's frame
    pairs, turned = [(start, goal) for goal in goals], []
    for mode in modes:
        for goal in goals:
            after = [*_turned_to(start, float(goal[2]), mode, 1.0)]
            before = [*_turned_to(goal, float(start[2]), mode, -1.0)]
            pairs += [*((pose, goal) for pose in after), *((start, pose) for pose in before)]
            turned += [*after, *before]
    yield np.array(turned).reshape(-1, 3)
    for some in np.array_split(np.array(pairs), -(-len(pairs) * len(modes) ** 2 // CROSSED)):
        yield _straight_crossings(some[:, 0], some[:, 1], directions)


def _straight_crossings(starts: FloatArray, ends: FloatArray, directions: FloatArray) -> FloatArray:
    """Return poses (k, 3) where straight pushes in directions (m, 2) from n starts meet those to n ends."""
    same = np.abs(se2.wrap_angle(ends[:, 2] - starts[:, 2])) <= SAME  # straight pushes keep the heading
    starts, away = starts[same], se2.relative(starts[same], ends[same])[:, None, None]
    first, last = directions[:, None], directions
    across = _cross(first, last)
    across = np.where(np.abs(across) < 1e-6, np.inf, across)  # parallel lines do not meet
    ahead, rest = _cross(away, last) / across, _cross(first, away) / across
    n, i, j = np.nonzero((ahead > 0.0) & (rest > 0.0))
    steps = ahead[n, i, j, None] * directions[i]
    return se2.compose(starts[n], np.column_stack([steps, np.zeros(len(n))]))


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


def _turned_to(pose: FloatArray, heading: float, mode: PackedMode, sense: float) -> Iterator[FloatArray]:
    """Yield the poses where the tightest turns, forward or backward, bring a load to a heading."""
    for letter in (0, 2):
        twist = mode.families[0, letter]
        if twist[2] == 0.0:
            continue
        angle = float((sense * np.sign(twist[2]) * (heading - pose[2])) % (2.0 * np.pi))
        if SAME < angle < math.pi + SAME:
            yield _moved(pose, mode, twist, sense * angle / abs(twist[2]))


def _moved(pose: FloatArray, mode: PackedMode, twist: FloatArray, length: float) -> FloatArray:
    """Return the load pose (3,) after motion along a twist in the contact's frame over a length."""
    contact = se2.compose(se2.compose(pose, mode.contact), se2.exp(twist * length))
    return se2.compose(contact, se2.inverse(mode.contact))


def _ends(pose: FloatArray, heading: float, modes: list[PackedMode], sense: float) -> FloatArray:
    """Return the pose, or the poses (k, 3) after a tight turn to a heading (sense -1: before a turn from it)."""
    if abs(float(se2.wrap_angle(heading - pose[2]))) <= SAME:
        return pose[None]
    return np.array([one for mode in modes for one in _turned_to(pose, heading, mode, sense)]).reshape(-1, 3)


def routes(room: PushRoom, query: Query, changes: FloatArray) -> Iterator[FloatArray]:
    """Yield the poses (k, 3) between the pushes of routes on a grid, heading by heading, smallest turn first.

    Args:
        room: Robot, load and contacts.
        query: Start and goals.
        changes: (m, m) lower bounds of the cost of contact changes, m.
    """
    modes, known = [contact.packed for contact in room.contacts], np.concatenate([query.load[None], query.goals])
    turns = np.unique(se2.wrap_angle(known[:, 2] - query.load[2]).round(DECIMALS))
    for heading in (query.load[2] + turns[np.argsort(np.abs(turns))]).tolist():
        begins = _ends(query.load, heading, modes, 1.0)
        ends = np.concatenate([_ends(goal, heading, modes, -1.0) for goal in query.goals])
        if len(begins) and len(ends):
            ways = [*Grid(room, heading, np.concatenate([begins, ends]), changes).routes(len(begins))]
            poses = np.concatenate([known[:0], *ways])
            new = (np.abs(poses[:, None] - known).max(axis=2) > SAME).all(axis=1)
            if new.any():
                yield poses[new]


def _lines(room: PushRoom, axis: float, through: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the coordinates of grid lines along an axis (rad) and across it: equally spaced, and through poses."""
    xmin, ymin, xmax, ymax = sampling_box(room.scenario)
    corners = se2.rotate(-axis, np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    step = STEP * min(float(np.ptp(obj.outline, axis=0).min()) for obj in room.scenario.chain.objects)
    most = int(math.sqrt(NODES / len(room.contacts)))
    inner = se2.rotate(-axis, through[:, :2])
    first, second = (
        np.unique(np.append(np.linspace(low[k], high[k], count), inner[:, k]).round(DECIMALS))
        for k in (0, 1)
        for count in [min(math.ceil((high[k] - low[k]) / step) + 1, most)]
    )
    return first, second


class Grid:
    """Positions of the load with one heading, and the straight pushes and contact changes between them.

    A node is a cell with a contact; its number is that of the contact times the number of cells, plus the cell's.

    Args:
        room: Robot, load and contacts.
        heading: Heading of the load, rad.
        through: Poses (k, 3) that are cells of the grid.
        changes: (m, m) lower bounds of the cost of contact changes, m.
    """

    def __init__(self, room: PushRoom, heading: float, through: FloatArray, changes: FloatArray) -> None:
        modes = [contact.packed for contact in room.contacts]
        angles = np.array([mode.contact[2] + math.atan2(mode.settling[1], mode.settling[0]) for mode in modes])
        axis, angles = heading + float(angles[0]), angles - angles[0]
        quarters = np.round(angles / (0.5 * np.pi)).astype(int)
        self._lines = _lines(room, axis, through)
        places = np.stack(np.meshgrid(*self._lines, indexing="ij"), axis=-1).reshape(-1, 2)
        self._poses = np.column_stack([se2.rotate(axis, places), np.full(len(places), heading)])
        inner = se2.rotate(-axis, through[:, :2]).round(DECIMALS)
        row, column = (np.searchsorted(lines, inner[:, k]) for k, lines in enumerate(self._lines))
        self._through = row * len(self._lines[1]) + column
        free, least = [], room.scenario.clearance
        for contact in room.contacts:
            at = se2.compose(self._poses, contact.packed.contact)
            free.append(separations(contact.scene, at, least) >= least - ROUNDING)
        self._begins, self._ends = (
            np.array(free) & [approaches_are_free(room.robot, mode, self._poses, back) for mode in modes]
            for back in (False, True)
        )
        square = np.flatnonzero(np.abs(angles - 0.5 * np.pi * quarters) <= SQUARE)
        pushes = [self._pushed(k, int(quarters[k]) % 4, free[k]) for k in square.tolist()]
        self._pushes = np.concatenate([pairs for pairs, _ in pushes], axis=1)
        self._costs = np.concatenate([lengths for _, lengths in pushes])
        left, taken, cell = np.nonzero(
            self._ends[:, None] & self._begins & ~np.eye(len(modes), dtype=bool)[..., None]
        )
        self._changes, self._prices = np.array([left, taken]) * len(places) + cell, changes[left, taken]

    def _pushed(self, contact: int, quarter: int, free: BoolArray) -> tuple[IntArray, FloatArray]:
        """Return the nodes (2, k) before and after straight pushes to the next cell, and their lengths (k,), m."""
        along, cells = quarter % 2, np.arange(len(free)).reshape(*map(len, self._lines))
        across = np.moveaxis(cells, along, 0)
        pairs = np.stack([across[:-1], across[1:]][:: 1 if quarter < 2 else -1])
        lengths = np.broadcast_to(np.diff(self._lines[along])[:, None], across[1:].shape)
        kept = free[pairs].all(axis=0)
        return contact * len(free) + pairs[:, kept], lengths[kept]

    def routes(self, begins: int) -> Iterator[FloatArray]:
        """Yield the poses (k, 3) between the pushes of some routes from the first `begins` cells to the others."""
        count, contacts = len(self._poses), np.arange(len(self._begins))[:, None]
        first, last = (
            nodes[free.ravel()[nodes]]
            for free, cells in ((self._begins, self._through[:begins]), (self._ends, self._through[begins:]))
            for nodes in [(contacts * count + cells).ravel()]
        )
        if not (len(first) and len(last)):
            return
        from scipy.sparse import coo_array  # takes 0.3 s to load and is needed only where direct pushes are blocked
        from scipy.sparse.csgraph import dijkstra

        used = np.zeros(count)
        for _ in range(ROUTES):
            costs = np.concatenate([self._costs, self._prices + AVOIDED * used[self._changes[0] % count]])
            edges = np.concatenate([self._pushes, self._changes], axis=1)
            graph = coo_array((costs, edges), 2 * (contacts.size * count,)).tocsr()
            cost, before, _ = dijkstra(graph, indices=first, min_only=True, return_predecessors=True)
            node = last[np.argmin(cost[last])]
            if not np.isfinite(cost[node]):
                return
            cells = [node % count]
            while before[node] >= 0:
                if before[node] % count == node % count:
                    cells.append(node % count)
                node = before[node]
            poses = self._poses[[*dict.fromkeys([*cells, node % count])]]
            yield poses
            away = self._poses[:, None, :2] - poses[:, :2]
            used += (np.hypot(away[..., 0], away[..., 1]) < AROUND).any(axis=1)
