"""The project's own planner, auto: an OMPL planner whose inner loops are in the core."""

from __future__ import annotations

import math
from abc import abstractmethod
from itertools import count
from typing import Any

import numpy as np

from ompl import base as ob
from pushplan.core.search import Forest
from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.ompl.form import PushInformation, information_of, leave_path
from pushplan.planners.problem.problem import Box
from pushplan.planners.search.lattice_rounds import LatticeRounds
from pushplan.util.arrays import FloatArray


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

    def solve(self, stop: Any) -> Any:
        """Improve the best path until `stop` says so; leave it in the problem definition."""
        definition = self.getProblemDefinition()
        information = information_of(definition)
        session = information.session
        session.stop = stop
        try:
            if not stop():
                self.improve(information)
        finally:
            session.stop = session.settled  # OMPL's condition does not outlive the call
        if session.best.arcs is None:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        leave_path(definition, session.best.arcs, self.name)
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    @abstractmethod
    def improve(self, information: PushInformation) -> None:
        """Offer paths to the session until it is finished."""


ROUND, DOUBLINGS = 256, 4
"""Extensions of a round of trees, and how often they are doubled at most.

Short rounds suffice where trees join within milliseconds, through rooms in series they have to grow longer.
"""


class Auto(AnytimePlanner):
    """Rounds of trees and of best-first search."""

    name = "auto"

    def improve(self, information: PushInformation) -> None:
        """Run rounds until the search is over."""
        session, box, heading_length = information.session, information.box, information.heading_length
        forest = _forest(box, heading_length)
        lattice = LatticeRounds(session, box)
        extensions = 0
        for number in count(1):
            # A path that polishing will shorten may be longer than the best one: by 100 % or 30 %, in turn.
            extensions += _round(session, forest, (1.3, 2.0)[number % 2], _length(number, session.solved))
            session.refine()
            # The search over cells takes longer to set up; then it has 40 arcs for each extension of the trees, which
            # takes eight times as long as an arc.
            if session.solved or number > 5:
                lattice.run(40.0 * extensions)
            if session.finished:
                return


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
    session.branches.offer_nodes(start_tree, forest.goal_tree)
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
