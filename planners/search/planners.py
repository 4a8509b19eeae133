"""The planners by their names, and the project's own: the anytime search over trees and a lattice, and SST."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

import numpy as np
from ompl import base as ob

from pushplan.core.problem import STRAIGHT, Problem, random
from pushplan.core.search import Forest, Lattice, SparseTree, branch, floor_distances
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.geometry.convex import flatten
from pushplan.planners.problem import Box
from pushplan.planners.search.bottlenecks import Extent, Ways
from pushplan.planners.search.form import PushInformation, information_of, leave_path
from pushplan.planners.search.search import Factory
from pushplan.planners.search.session import CHUNK, Session
from pushplan.util.arrays import FloatArray
from pushplan.util.naming import PLANNER_NAMES, attribute_named, name_of

_SPECK = 1e-7 * np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]])


def middle_of(problem: Problem) -> FloatArray:
    """Return the body's middle in the chain frame, and the direction of its straight push there (3,)."""
    push = problem.families[0, STRAIGHT]
    return np.append(problem.scene.body_bound[:2], math.atan2(push[1], push[0]))


MOST_CELLS = 512
"""So many cells of the floor there are along its longer side, at most."""


def floor_of(problem: Problem, start: FloatArray, box: Box) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how far the body's middle is from where it is at the start and at the goal.

    A middle that is nearer to anything than a half of the half width is blocked whatever the heading (or than that of
    the length, if that is less); cells of half of that width do not let thin walls through.

    Args:
        problem: What to plan.
        start: (3,) pose of the chain frame.
        box: (xmin, ymin, xmax, ymax) that the grid covers, m.

    Returns:
        The lower left corner of the grid and the side of its cells (3,), m; and the distances (nx, ny) from the start
        and from the goal, m; see `floor_distances`.
    """
    extent = Extent.of(problem)
    quarter = 0.25 * min(extent.width, extent.front - extent.back)
    longest = max(box[2] - box[0], box[3] - box[1])
    cell = max(min(quarter, longest / 72), longest / MOST_CELLS)
    nx, ny = (max(1, math.ceil((box[k + 2] - box[k]) / cell)) for k in (0, 1))
    point = problem.scene.with_body(flatten([_SPECK]), np.array([0.0, 0.0, 2.0 * _SPECK[1, 0]]))
    grid, middle = np.array([box[0], box[1], cell]), middle_of(problem)[:2]
    places = [se2.transform_points(pose, middle) for pose in (start, problem.goal)]
    to_start, to_goal = floor_distances(point, grid, nx, ny, max(quarter, 0.71 * cell), *places)
    return grid, to_start, to_goal


COARSEST, WIDEST = 0.03, 2.5
"""Side of the coarsest cells: a share of the diagonal of what they cover, but not wider than so many bodies."""

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
        share = COARSEST * math.hypot(box[2] - box[0], box[3] - box[1])
        self._coarsest = min(share, WIDEST * Extent.of(session.problem).width)
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
        session.common.branches.offer_nodes(nodes)
        if path is not None:
            session.offer(path)
        elif not back:
            session.note_nearest(nodes[:, :3], lambda node: branch(nodes, node))

    def planted(self, level: int, back: int) -> Lattice:
        """Return a search that has not begun, from the start or back from the goal, on a level."""
        session = self._session
        if self._lattice is None:
            self._lattice = self._with_distances()
        side = self._coarsest * SHRINK**level
        headings = round(28 * SHRINK ** (-0.5 * level))  # these grow only as the root of one by the side
        # Cells begin elsewhere in every round: two passages that one grid cannot tell apart another one can.
        shift = np.array([side * random(session.random), side * random(session.random), 0.0, 0.0])
        room = min(FIRST_ROOM << level, MOST_ROOM)
        # Arcs of 1.5 sides are just long enough to leave a cell.
        self._lattice.plant(bool(back), np.array(self._box) - shift, side, 2.0 * math.pi / headings, 1.5 * side, room)
        return self._lattice

    def _with_distances(self) -> Lattice:
        """Return what all rounds share: how far places are from the start and from the goal."""
        session, problem = self._session, self._session.problem
        middle = middle_of(problem)
        asked = (*self._box, *middle, Extent.of(problem).width)
        if asked not in session.common.room:
            session.common.room[asked] = floor_of(problem, session.start, self._box)
        return Lattice(problem, session.start, middle, *session.common.room[asked])


class AnytimePlanner(ob.Planner):  # type: ignore[misc]
    """A planner with a search of its own, as OMPL sees it: its solution is the best path of the search.

    Attributes:
        name: What OMPL calls it.
        optimizing: It goes on until it is told to stop; see `search`.
    """

    name: str
    optimizing = True

    def __init__(self, information: PushInformation) -> None:
        super().__init__(information, self.name)
        self._rounds: Iterator[None] | None = None

    def solve(self, stop: Any) -> Any:
        """Go on with rounds until `stop` says so or the turn is over; leave the best path where OMPL looks for it."""
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
        """Offer paths to the session; yield after each round, without an end."""


ROUND, DOUBLINGS = 256, 4
"""Extensions of a round of trees, and how often they are doubled at most.

Short rounds suffice where trees join within milliseconds, through rooms in series they have to grow longer.
"""


class Auto(AnytimePlanner):
    """Rounds of trees and of best-first search; while there is no path, of ways through bottlenecks, too."""

    name = "auto"

    def rounds(self, information: PushInformation) -> Iterator[None]:
        """Run rounds; what they share is kept from turn to turn."""
        session, box, heading_length = information.session, information.box, information.heading_length
        forest = _forest(box, heading_length)
        lattice, ways = LatticeRounds(session, box), None
        extensions = 0
        for number in count(1):
            # A path that polishing will shorten may be longer than the best one: by 100 % or 30 %, in turn.
            extensions += _round(session, forest, (1.3, 2.0)[number % 2], _length(number, session.solved))
            session.refine()
            # Rooms in which trees join at once are not looked at for bottlenecks: that takes up to some milliseconds.
            # Trees between bottlenecks are for rooms that whole trees cannot cross soon; they delay paths elsewhere.
            if not session.solved:
                ways = ways or Ways(session, _forest(box, heading_length))
                ways.run(_length(number, False) // 2, trees=number > 5)
            # The search over cells takes longer to set up; then it has 40 arcs for each extension of the trees, which
            # takes eight times as long as an arc.
            if session.solved or number > 5:
                lattice.run(40.0 * extensions)
            yield


def _length(number: int, solved: bool) -> int:
    """Return how many extensions a round has: as many as ever once there is a path, else by Luby's sequence."""
    return ROUND if solved else ROUND << min((number & -number).bit_length() - 1, DOUBLINGS)


def _forest(box: Box, heading_length: float) -> Forest:
    return Forest(np.array(box), heading_length, reach=0.15 * math.hypot(box[2] - box[0], box[3] - box[1]))


def _round(session: Session, forest: Forest, excess: float, extensions: int) -> int:
    """Grow fresh trees until they join or have used up their extensions; return what counts as used."""
    forest.plant(session.start, session.problem.goal)
    used, path = 0, None
    while used < extensions and path is None and not session.finished:
        bound = excess * session.best.horizon
        done, path = forest.grow(session.problem, session.random, bound, CHUNK)
        used += done
        session.spent(done)
    start_tree = forest.start_tree
    session.common.branches.offer_nodes(start_tree, forest.goal_tree)
    if path is not None:
        session.offer(path)
    else:
        session.note_nearest(start_tree[:, :3], lambda node: _way_to(start_tree, node))
    return extensions


def _way_to(tree: FloatArray, node: int) -> FloatArray:
    """Arcs (k, 4) from the root of the tree from the start to a node."""
    words: list[FloatArray] = []
    while tree[node, 4] >= 0.0:
        words.append(tree[node, 5:].reshape(3, 4))
        node = int(tree[node, 4])
    arcs = np.concatenate(words[::-1]) if words else np.zeros((0, 4))
    return arcs[arcs[:, 3] > 0.0]


class SparseRounds:
    """The rounds of one search: each is a tree of its own.

    Args:
        session: The search that they serve.
        box: (xmin, ymin, xmax, ymax) to sample from, m.
        heading_length: Metres that a radian counts as.

    Attributes:
        extensions: Arcs tried so far.
    """

    def __init__(self, session: Session, box: Box, heading_length: float) -> None:
        self._session, self._box, self._heading_length = session, np.array(box), heading_length
        self._diagonal = math.hypot(box[2] - box[0], box[3] - box[1])
        self._shrunk, self._extensions, self.extensions = 1.0, 4_000.0, 0

    def run_next(self, stop: Callable[[], bool]) -> None:
        """Grow one tree, offering every path found to the session."""
        session = self._session
        shares = (0.08, 0.04)  # of the diagonal: around a random pose, and between witnesses
        radii = [self._shrunk * self._diagonal * share for share in shares]
        tree = SparseTree(session.start, session.problem.goal, self._box, self._heading_length, *radii)
        left = int(self._extensions)
        while left > 0 and not stop():
            done, path = tree.grow(session.problem, session.random, session.best.bound, CHUNK)
            session.spent(done)
            left -= done
            self.extensions += done
            if path is not None:
                session.offer(path)
        _note(session, tree)
        self._shrunk, self._extensions = 0.85 * self._shrunk, 1.4 * self._extensions


def _note(session: Session, tree: SparseTree) -> None:
    """Hand the tree's branches to the session, and the way to its node nearest to the goal."""
    nodes = tree.nodes
    parents = nodes[:, 4].astype(np.int64)
    parents[tree.unused] = -1
    session.common.branches.offer((nodes[:, :3], parents))
    rows = np.append(0, np.flatnonzero(parents >= 0))
    session.note_nearest(nodes[rows, :3], lambda node: branch(nodes, int(rows[node])))


class StableSparseRRT(AnytimePlanner):
    """Rounds of sparse trees."""

    name = "SST"

    def rounds(self, information: PushInformation) -> Iterator[None]:
        """Grow one tree after the other."""
        session = information.session
        rounds = SparseRounds(session, information.box, information.heading_length)
        while True:
            rounds.run_next(session.stop)
            session.refine()
            yield


PLANNERS = {
    "auto": "pushplan.planners.search.planners:Auto",
    "rrt": "ompl.control:RRT",
    "est": "ompl.control:EST",
    "kpiece": "ompl.control:KPIECE1",
    "sst": "pushplan.planners.search.planners:StableSparseRRT",
}
"""Where each of `names.PLANNERS` is."""


def planner_named(planner: str | Factory) -> tuple[str, Factory]:
    """Return a planner's name and what makes it.

    Args:
        planner: A name, `module:attribute`, or what makes an `ompl.base.Planner` from a space information.

    Raises:
        PlanningError: When nothing is called so, or it cannot be called.
    """
    found = (
        attribute_named(PLANNERS.get(planner, planner), PLANNER_NAMES.group) if isinstance(planner, str) else planner
    )
    if found is None:
        raise PlanningError(
            f"no planner is called {planner!r}; there are {', '.join(PLANNERS)}, those of installed packages, and "
            "any other as module:attribute"
        )
    if not callable(found):
        raise PlanningError(
            f"the planner {planner!r} is a {type(found).__name__}; allowed: what makes an ompl.base.Planner from a "
            "space information"
        )
    return planner if isinstance(planner, str) else name_of(planner), found
