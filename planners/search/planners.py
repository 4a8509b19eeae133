"""Table of planners by name, and the project's own planners: `auto`, `lattice` and `bottlenecks`."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator
from itertools import count
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import control as oc
from ompl import util as ou

from pushplan.core.problem import STRAIGHT, Problem, random
from pushplan.core.search import Lattice, branch, floor_distances
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.geometry.convex import flatten
from pushplan.planners.problem import Box
from pushplan.planners.search.bottlenecks import Extent, Ways
from pushplan.planners.search.common import Common
from pushplan.planners.search.form import PushInformation, definition_of, information_of, leave_path
from pushplan.planners.search.search import Factory
from pushplan.planners.search.session import CHUNK, Session
from pushplan.util.arrays import FloatArray
from pushplan.util.names import GONE_PLANNERS
from pushplan.util.naming import PLANNER_NAMES, attribute_named, gone_planner, name_of

_SPECK = 1e-7 * np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]])


def middle_of(problem: Problem) -> FloatArray:
    """Return the body's middle and the direction of its straight push, in the chain frame, as one pose (3,)."""
    push = problem.families[0, STRAIGHT]
    return np.append(problem.scene.body_bound[:2], math.atan2(push[1], push[0]))


MOST_CELLS = 512
"""Maximum number of floor cells along the longer side."""


def floor_of(problem: Problem, box: Box) -> tuple[FloatArray, FloatArray]:
    """Return the travel distances of the body's middle to the goal on a floor grid.

    A cell is blocked if an obstacle is nearer than a quarter of the body's width (or length, if that is less). Cells
    are small enough that no thin wall is missed.

    Args:
        problem: Push problem.
        box: (xmin, ymin, xmax, ymax) that the grid covers, m.

    Returns:
        (3,) lower left corner of the grid and side of its cells, m; distances (nx, ny), m; see `floor_distances`.
    """
    extent = Extent.of(problem)
    quarter = 0.25 * min(extent.width, extent.front - extent.back)
    longest = max(box[2] - box[0], box[3] - box[1])
    cell = max(min(quarter, longest / 72), longest / MOST_CELLS)
    nx, ny = (max(1, math.ceil((box[k + 2] - box[k]) / cell)) for k in (0, 1))
    point = problem.scene.with_body(flatten([_SPECK]), np.array([0.0, 0.0, 2.0 * _SPECK[1, 0]]))
    grid, middle = np.array([box[0], box[1], cell]), middle_of(problem)[:2]
    goal = se2.transform_points(problem.goal, middle)
    return grid, floor_distances(point, grid, nx, ny, max(quarter, 0.71 * cell), goal)


COARSEST, WIDEST = 0.03, 2.5
"""Side of the coarsest cells: a share of the box's diagonal, and at most a multiple of the body's width."""

SHRINK = 0.8
"""Factor of the cells' sides from level to level."""

FIRST_ROOM, MOST_ROOM = 1 << 15, 1 << 18
"""Maximum number of nodes on the coarsest level, doubled from level to level, and on any level.

Mazes of a hundred cells and rooms in series need about 12,000 nodes on the coarsest level. With 4,096, none was
solved.
"""

SET_UP = 400
"""Set-up cost of a round in arcs. If no path can be better, the round ends after its set-up."""

ITERATIONS = 0.125
"""Share of an iteration for each arc: it takes 1.5 us, but a tree extension or a path change 8 to 15 us."""


class LatticeRounds:
    """Rounds of the lattice search.

    Args:
        session: Session of the search.
        box: (xmin, ymin, xmax, ymax) that contains all nodes, m.
    """

    def __init__(self, session: Session, box: Box) -> None:
        self._session, self._box = session, box
        share = COARSEST * math.hypot(box[2] - box[0], box[3] - box[1])
        self._coarsest = min(share, WIDEST * Extent.of(session.problem).width)
        self._lattice: Lattice | None = None
        self._rounds = self._tried = 0

    def run(self, arcs: float) -> None:
        """Run rounds until a total number of arcs was tried or a first path is found."""
        session, pathless = self._session, not self._session.solved
        while self._tried < arcs and not session.finished:
            self._search()
            if pathless and session.solved:
                return

    def _search(self) -> None:
        """Search until no path can be cheaper than the bound, and offer the best one found."""
        session = self._session
        self._rounds += 1
        number = self._rounds
        # The level is the exponent of 2 in the round's number: Luby's sequence 0, 1, 0, 2, 0, 1, 0, 3, ...
        lattice = self.planted(min((number & -number).bit_length() - 1, 7))
        # In every other round, a path can be 15 % longer than the best one, because polishing may make it the best.
        excess, over = (1.0, 1.15)[number // 2 % 2], False
        bound = excess * session.best.horizon
        while not over and not session.finished:
            before = lattice.tried
            bound, over = lattice.expand(session.random, bound, 1_000)
            tried = lattice.tried - before
            session.spent(tried, round(ITERATIONS * tried))
        self._tried += lattice.tried + SET_UP
        session.spent(0, round(ITERATIONS * SET_UP))
        if lattice.path is not None:
            session.offer(lattice.path)
        else:
            nodes = lattice.nodes
            session.note_nearest(nodes[:, :3], lambda node: branch(nodes, node))

    @property
    def nodes(self) -> FloatArray:
        """The nodes (n, 9) of the last round, a copy."""
        return np.zeros((0, 9)) if self._lattice is None else self._lattice.nodes

    def planted(self, level: int) -> Lattice:
        """Return a new search on a level."""
        session = self._session
        if self._lattice is None:
            self._lattice = self._with_distances()
        side = self._coarsest * SHRINK**level
        headings = round(28 * SHRINK ** (-0.5 * level))  # grows with the inverse square root of the side
        # Shift the cells in every round: another grid can separate two passages that share a cell in this one.
        shift = np.array([side * random(session.random), side * random(session.random), 0.0, 0.0])
        room = min(FIRST_ROOM << level, MOST_ROOM)
        # Arcs of 1.5 sides are just long enough to leave a cell.
        self._lattice.plant(np.array(self._box) - shift, side, 2.0 * math.pi / headings, 1.5 * side, room)
        return self._lattice

    def _with_distances(self) -> Lattice:
        """Return the lattice with the distances from the goal that all rounds share."""
        session, problem = self._session, self._session.problem
        middle = middle_of(problem)
        key = (*self._box, *middle, Extent.of(problem).width)
        if key not in session.common.room:
            session.common.room[key] = floor_of(problem, self._box)
        return Lattice(problem, session.start, middle, *session.common.room[key])


class AnytimePlanner(ob.Planner):  # type: ignore[misc]
    """An OMPL planner with its own search. Its solution is the best path of the search.

    Attributes:
        name: Name of the planner in OMPL.
        optimizing: Whether it runs until it is stopped; see `search`.
    """

    name: str
    optimizing = True

    def __init__(self, information: PushInformation) -> None:
        super().__init__(information, self.name)
        self._rounds: Iterator[None] | None = None

    def solve(self, stop: Any) -> Any:
        """Run rounds until `stop` returns true or the turn is over. Store the best path in OMPL's definition."""
        definition = self.getProblemDefinition()
        information = information_of(definition)
        session = information.session
        session.stop = stop
        try:
            if not stop():
                self._rounds = self._rounds or self.rounds(information)
                for _ in self._rounds:
                    if session.finished or session.turn_over:
                        break
        finally:
            session.stop = session.settled  # OMPL's condition does not outlive the call
        if session.best.arcs is None:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        leave_path(definition, session.best.arcs, self.name)
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    @abstractmethod
    def rounds(self, information: PushInformation) -> Iterator[None]:
        """Offer paths to the session and yield after each round, without end."""


GOAL_BIAS = 0.2
"""Share of OMPL's samples that are the other tree's root."""

TURN = 64
"""Number of extensions in each turn of the smaller tree."""

MOST_SEEDS = 2**31 - 2
"""Number of seeds. OMPL's seeds begin at 1."""

FIRST_TREES = 600
"""Number of extensions before the first restart of the trees. It doubles after each restart."""


class MeetingTrees:
    """Two of OMPL's RRTs, one from the start and one backwards from the goal, that grow until they meet.

    The goal region of each is the tree of the other.

    Args:
        information: Space information of the forward search.
    """

    def __init__(self, information: PushInformation) -> None:
        self._session = session = information.session
        self._sides = (
            information,
            PushInformation(session, information.box, information.heading_length, ahead=information),
        )
        self._definitions = [definition_of(side) for side in self._sides]
        self._planners: list[Any] = []
        self._left, self._lasting = 0, FIRST_TREES

    def grow(self, extensions: int) -> None:
        """Grow the trees by some extensions or until they meet. Offer the path, or note the nearest pose."""
        session = self._session
        ahead, back = (side.propagator for side in self._sides)
        ends = session.extensions + extensions
        while session.extensions < ends and not session.finished:
            if self._left <= 0:
                self._plant()
            grown = int(len(back.tree) < len(ahead.tree))
            before, propagator = session.extensions, self._sides[grown].propagator
            self._planners[grown].solve(_after(session.common, min(before + TURN, ends)))
            self._definitions[grown].clearSolutionPaths()
            self._left -= session.extensions - before
            if propagator.path is not None:
                session.offer(propagator.path)
                break
        session.common.branches.offer_nodes(ahead.tree.nodes, back.tree.nodes)
        if not session.solved:
            ahead.note()

    def _plant(self) -> None:
        """Restart the trees. OMPL's seed is drawn from the session's random state."""
        self._left, self._lasting = self._lasting, 2 * self._lasting
        ou.RNG.setSeed(1 + int(random(self._session.random) * MOST_SEEDS))
        self._planners = []
        for side, definition in zip(self._sides, self._definitions, strict=True):
            side.propagator.clear()
            planner = oc.RRT(side)
            planner.setGoalBias(GOAL_BIAS)
            planner.setProblemDefinition(definition)
            planner.setup()
            self._planners.append(planner)


def _after(common: Common, extensions: int) -> Any:
    return ob.PlannerTerminationCondition(lambda: common.extensions >= extensions)


FIRST, ROUND, MOST_ROUNDS = 256, 160, 16
"""Extensions in the first turn of the trees, factor of Luby's sequence in later turns, and its maximum.

With 1,024 in the first turn, the search for bottlenecks would begin after 40 ms instead of 5 ms.
"""

ARCS = 60.0
"""Number of lattice arcs for each extension of the trees, which takes this many times as long."""


class Auto(AnytimePlanner):
    """OMPL's RRTs and steering paths through gaps until there is a path, with rounds of lattice search."""

    name = "auto"

    def rounds(self, information: PushInformation) -> Iterator[None]:
        """Run rounds. Their shared data are kept from turn to turn."""
        session, box = information.session, information.box
        trees: MeetingTrees | None = None
        lattice, ways = LatticeRounds(session, box), None
        arcs = 0.0
        for number in count(1):
            extensions = FIRST if number == 1 or session.solved else ROUND * luby(number - 1)
            if not session.solved:
                trees = trees or MeetingTrees(information)
                trees.grow(extensions)
            arcs += ARCS * extensions
            session.refine()
            # If the trees meet at once, skip the search for bottlenecks, which can take a few milliseconds.
            if not session.solved:
                ways = ways or Ways(session)
                ways.run(extensions // 2)
            # The lattice search begins later, because its set-up takes longer.
            if session.solved or number > 2:
                lattice.run(arcs)
            yield


def luby(number: int) -> int:
    """Return a term of the sequence 1, 2, 1, 4, 1, 2, 1, 8, ...: the largest power of 2 that divides a number."""
    return min(number & -number, MOST_ROUNDS)


class LatticeSearch(AnytimePlanner):
    """Rounds of best-first search over cells of poses (a lattice), without OMPL's trees."""

    name = "lattice"

    def rounds(self, information: PushInformation) -> Iterator[None]:
        """Run rounds of the lattice search."""
        session = information.session
        lattice = LatticeRounds(session, information.box)
        for number in count(1):
            lattice.run(number * ARCS * FIRST)
            session.common.branches.offer_nodes(lattice.nodes)
            session.refine()
            yield


class Bottlenecks(AnytimePlanner):
    """Steering paths through narrow gaps only. If they do not reach the goal, it finds no path."""

    name = "bottlenecks"

    def rounds(self, information: PushInformation) -> Iterator[None]:
        """Try steering paths, then shorten the path found."""
        session = information.session
        ways = Ways(session)
        while True:
            ways.run(FIRST)
            session.refine()
            session.spent(0, CHUNK)
            yield


PLANNERS = {
    "auto": "pushplan.planners.search.planners:Auto",
    "rrt": "ompl.control:RRT",
    "est": "ompl.control:EST",
    "kpiece": "ompl.control:KPIECE1",
    "lattice": "pushplan.planners.search.planners:LatticeSearch",
    "bottlenecks": "pushplan.planners.search.planners:Bottlenecks",
}
"""Import path of each planner in `names.PLANNERS`."""


def planner_named(planner: str | Factory) -> tuple[str, Factory]:
    """Return a planner's name and its factory.

    Args:
        planner: Name, `module:attribute`, or a factory that builds an `ompl.base.Planner` from a space information.

    Raises:
        PlanningError: If there is no such planner, or it is not callable.
    """
    found = (
        attribute_named(PLANNERS.get(planner, planner), PLANNER_NAMES.group) if isinstance(planner, str) else planner
    )
    if found is None:
        if planner in GONE_PLANNERS:
            raise PlanningError(gone_planner(planner))
        raise PlanningError(
            f"there is no planner {planner!r}; allowed: {', '.join(PLANNERS)}, planners of installed packages, and "
            "module:attribute"
        )
    if not callable(found):
        raise PlanningError(
            f"the planner {planner!r} is a {type(found).__name__}; allowed: a callable that builds an "
            "ompl.base.Planner from a space information"
        )
    return planner if isinstance(planner, str) else name_of(planner), found
