"""Searches over finer and finer lattices, guided by distances over the room's floor."""

from __future__ import annotations

import math

import numpy as np

from pushplan.core.problem import STRAIGHT, Problem, random
from pushplan.core.search import Lattice, branch, floor_distances
from pushplan.geometry import se2
from pushplan.planners.collision.scene import flatten
from pushplan.planners.improve.session import Session
from pushplan.planners.problem.problem import Box
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
    point = scene.with_body(flatten([_SPECK]), np.array([0.0, 0.0, 2.0 * _SPECK[1, 0]]))
    grid = np.array([box[0], box[1], cell])
    there = se2.transform_points(pose, middle[:2])
    return floor_distances(point, grid, nx, ny, least, there), grid


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
        self._lattice: Lattice | None = None
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
        excess, over = (1.0, 1.15)[number // 2 % 2], False
        bound = excess * session.best.horizon
        while not over and not session.finished:
            before = lattice.tried
            bound, over = lattice.expand(session.random, bound, 1_000)
            tried = lattice.tried - before
            session.spent(tried, round(ITERATIONS * tried))
        self._tried[back] += lattice.tried + SET_UP
        session.spent(0, round(ITERATIONS * SET_UP))
        nodes, path = lattice.nodes, lattice.path
        session.branches.offer_nodes(nodes)
        if path is not None:
            session.offer(path)
        elif not back:
            session.note_nearest(nodes[:, :3], lambda node: branch(nodes, node))

    def planted(self, level: int, back: int) -> Lattice:
        """Return a search that has not begun, from the start or back from the goal, on a level."""
        session = self._session
        if self._lattice is None:
            self._lattice = self._with_distances()
        side = self._diagonal * 0.03 * SHRINK**level
        headings = round(28 * SHRINK ** (-0.5 * level))  # these grow only as the root of one by the side
        # Cells begin elsewhere in every round: two passages that one grid cannot tell apart another one can.
        shift = np.array([side * random(session.random), side * random(session.random), 0.0, 0.0])
        room = min(FIRST_ROOM << level, MOST_ROOM)
        # Arcs of 1.5 sides are just long enough to leave a cell.
        self._lattice.plant(
            bool(back), np.array(self._box) - shift, side, 2.0 * math.pi / headings, 1.5 * side, room
        )
        return self._lattice

    def _with_distances(self) -> Lattice:
        """Return what all rounds share: how far places are from the start and from the goal."""
        session, problem = self._session, self._session.problem
        ends = session.start, problem.goal
        (to_start, grid), (to_goal, _) = (distances_to(pose, problem, self._box) for pose in ends)
        return Lattice(problem, session.start, middle_of(problem), grid, to_start, to_goal)
