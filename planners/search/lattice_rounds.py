"""Searches over finer and finer lattices, guided by distances over the room's floor."""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled, no_refcount
from pushplan.geometry import se2
from pushplan.planners.collision.scene import flatten
from pushplan.planners.collision.separation import Scene, separation
from pushplan.planners.improve.session import Session
from pushplan.planners.problem.problem import NODE, Box, Problem, branch, random
from pushplan.planners.problem.steering import STRAIGHT
from pushplan.planners.search.lattice_kernel import (
    NODES,
    PARTNER,
    TRIED,
    Lattice,
    expand_best,
    path_of,
    plant,
)
from pushplan.util.arrays import FloatArray

_SPECK = 1e-7 * np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]])


def middle_of(problem: Problem) -> FloatArray:
    """Return the body's middle in the chain frame, and the direction of its straight push there (3,)."""
    push = problem.families[0, STRAIGHT]
    return np.append(problem.scene.body_bound[:2], math.atan2(push[1], push[0]))


def distances_to(pose: FloatArray, problem: Problem, box: Box) -> tuple[FloatArray, FloatArray]:
    """Return distances (nx, ny) of the body's middle from where a pose has it, m, infinite where there is no way.

    Args:
        pose: (3,) of the chain frame.
        problem: What to plan.
        box: (xmin, ymin, xmax, ymax) that the grid covers.

    Returns:
        The distances; and the lower left corner of the grid and the side of its cells (3,), m.
    """
    scene = problem.scene
    cell = max(box[2] - box[0], box[3] - box[1]) / 72
    nx, ny = (max(1, round((box[k + 2] - box[k]) / cell)) for k in (0, 1))
    middle = middle_of(problem)
    across = scene.body.corners[:, :2] @ np.array([-math.sin(middle[2]), math.cos(middle[2])])
    least = 0.25 * float(np.ptp(across))  # nearer than half of the half width, blocked whatever the heading
    point = scene._replace(body=flatten([_SPECK]), body_bound=np.array([0.0, 0.0, 2.0 * _SPECK[1, 0]]))
    grid = np.array([box[0], box[1], cell])
    there = se2.transform_points(pose, middle[:2])
    return distances(point, grid, nx, ny, least, there), grid


@compiled
def distances(
    point: Scene, grid: FloatArray, nx: int, ny: int, least: float, there: FloatArray
) -> FloatArray:
    """Return the lengths (nx, ny) of ways to a place (2,) through cells that keep `least` from everything, m."""
    cell = grid[2]
    free = np.empty((nx, ny), dtype=np.bool_)
    for i in range(nx):
        for j in range(ny):
            x, y = grid[0] + (i + 0.5) * cell, grid[1] + (j + 0.5) * cell
            # Half a diagonal is added, so that a cell counts as free when any place in it is.
            free[i, j] = separation(point, x, y, 0.0, least) + 0.71 * cell >= least
    away = np.full((nx, ny), np.inf)
    i0 = min(nx - 1, max(0, int((there[0] - grid[0]) / cell)))
    j0 = min(ny - 1, max(0, int((there[1] - grid[1]) / cell)))
    away[i0, j0] = 0.0
    quiet = 0
    for sweep in range(60):
        changed = False
        for a in range(nx):
            i = a if sweep % 2 == 0 else nx - 1 - a
            for b in range(ny):
                j = b if sweep // 2 % 2 == 0 else ny - 1 - b
                if free[i, j] and _is_nearer(away, i, j, cell):
                    changed = True
        quiet = 0 if changed else quiet + 1
        # Sweeps go in four orders in turn; when none of them changed anything, distances are final.
        if quiet == 4:
            break
    return away


@no_refcount
def _is_nearer(away: FloatArray, i: int, j: int, cell: float) -> bool:
    """Lower a cell's distance to what its neighbours allow; return whether that changed it."""
    nx, ny = away.shape
    best = away[i, j]
    for di in range(-1, 2):
        for dj in range(-1, 2):
            a, b = i + di, j + dj
            if 0 <= a < nx and 0 <= b < ny:
                # Octile distances: steps to the side cost a cell, diagonal ones sqrt(2) cells.
                best = min(best, away[a, b] + cell * (1.0 if di * dj == 0 else math.sqrt(2.0)))
    changed = bool(best < away[i, j])
    away[i, j] = best
    return changed


SHRINK = 0.8
"""Factor of the cells' sides from level to level."""

FIRST_ROOM, MOST_ROOM = 1 << 15, 1 << 18
"""Nodes of a search on the coarsest level, twice as many on the next one and so on, and on any level, at most.

Mazes of a hundred cells and rooms in series take some 12,000 nodes on the coarsest level; with 4,096 none was solved.
"""

SET_UP = 400
"""A round takes as long as so many arcs before it begins; where no path can be better, it is over then."""

ITERATIONS = 0.125
"""Each counts as this share of an iteration: it takes 1.5 us, a tree's extension or a change of a path 8 to 15 us."""


class LatticeRounds:
    """The rounds of one search, from the start and back from the goal.

    Args:
        session: The search that they serve.
        box: (xmin, ymin, xmax, ymax) that the nodes stay in, m.
    """

    def __init__(self, session: Session, box: Box) -> None:
        self._session, self._box = session, box
        self._diagonal = math.hypot(box[2] - box[0], box[3] - box[1])
        self._tables: Tables | None = None
        self._rounds, self._tried = [0, 0], [0, 0]

    def run(self, arcs: float) -> None:
        """Run rounds until so many arcs have been tried in all, or a first path is found."""
        session, pathless = self._session, not self._session.solved
        while sum(self._tried) < arcs and not session.finished:
            back = int(self._tried[1] < self._tried[0])
            self._search(back)
            if pathless and session.solved:
                return

    def _search(self, back: int) -> None:
        """Search until nothing promises a path cheaper than the bound; offer the best one found."""
        session = self._session
        self._rounds[back] += 1
        number = self._rounds[back]
        # The level is how often 2 divides the round's number: Luby's sequence 0, 1, 0, 2, 0, 1, 0, 3, ...
        lattice = self.planted(min((number & -number).bit_length() - 1, 7), back)
        # In every other round a path may be 15 % longer than the best one: polishing may yet make it the best.
        excess, word, over = (1.0, 1.15)[number // 2 % 2], np.zeros((3, 4)), False
        bound = excess * session.best.horizon
        while not over and not session.finished:
            before = int(lattice.counts[TRIED])
            bound, over = expand_best(session.problem, lattice, bound, 1_000, word)
            tried = int(lattice.counts[TRIED]) - before
            session.spent(tried, round(ITERATIONS * tried))
        self._tried[back] += int(lattice.counts[TRIED]) + SET_UP
        session.spent(0, round(ITERATIONS * SET_UP))
        nodes = lattice.nodes[: lattice.counts[NODES]]
        session.branches.offer_nodes(nodes)
        if lattice.counts[PARTNER] >= 0:
            path = np.empty((len(nodes) + 3, 4))
            session.offer(path[: path_of(lattice, word, path)])
        elif not back:
            session.note_nearest(nodes[:, :3], lambda node: branch(nodes, node))

    def planted(self, level: int, back: int) -> Lattice:
        """Return a search that has not begun, from the start or back from the goal, on a level."""
        session = self._session
        if self._tables is None:
            self._tables = Tables(session, self._box)
        tables = self._tables
        side = self._diagonal * 0.03 * SHRINK**level
        headings = round(28 * SHRINK ** (-0.5 * level))  # these grow only as the root of one by the side
        # Cells begin elsewhere in every round: two passages that one grid cannot tell apart another one can.
        shift = np.array([side * random(session.random), side * random(session.random), 0.0, 0.0])
        room = min(FIRST_ROOM << level, MOST_ROOM)
        tables.make_room(room)
        # Twice as many slots as nodes, so that chains of taken slots stay short.
        tables.keys[: 2 * room] = 0
        ends = session.start, session.problem.goal
        lattice = Lattice(
            nodes=tables.nodes[:room],
            keys=tables.keys[: 2 * room],
            costs=tables.costs[: 2 * room],
            queue=tables.queue[:room],
            counts=np.zeros(4, dtype=np.int64),
            box=np.array(self._box) - shift,
            # Arcs of 1.5 sides are just long enough to leave a cell.
            sizes=np.array([side, 2.0 * math.pi / headings, 1.5 * side, 1.0 - 2.0 * back]),
            target=ends[1 - back],
            away=tables.away[1 - back],
            grid=tables.grid,
            middle=middle_of(session.problem),
            state=session.random,
        )
        plant(lattice, ends[back])
        return lattice


class Tables:
    """What all rounds of a search share: room for nodes, and how far places are from the start and from the goal."""

    def __init__(self, session: Session, box: Box) -> None:
        self.nodes = np.empty((0, NODE))
        self.away: list[FloatArray] = []
        for pose in (session.start, session.problem.goal):
            away, self.grid = distances_to(pose, session.problem, box)
            self.away.append(away)

    def make_room(self, room: int) -> None:
        """Have room for so many nodes; what was there is gone where there was less."""
        if len(self.nodes) < room:
            self.nodes, self.queue = np.empty((room, NODE)), np.empty((room, 2))
            self.keys, self.costs = np.empty(2 * room, dtype=np.int64), np.empty(2 * room)
