"""The project's own planner, auto: an OMPL planner whose inner loops are compiled."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from functools import cache
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from numba import typeof, types
from numba.experimental import structref

from ompl import base as ob
from pushplan.compiled import compiled, no_refcount
from pushplan.compiled.private import COMPILES, entry_point
from pushplan.planners.collision.separation import separation
from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.ompl.form import PushInformation, information_of, leave_path
from pushplan.planners.problem.problem import TRIES, Box, Problem, extend
from pushplan.planners.problem.steering import MAX_WORDS, connect
from pushplan.planners.search.bidirectional import grow_both
from pushplan.planners.search.forest import NODE, Forest, plant
from pushplan.planners.search.lattice_rounds import LatticeRounds
from pushplan.util.arrays import FloatArray


class AnytimePlanner(ob.Planner):  # type: ignore[misc]
    """A planner with a compiled core, as OMPL sees it: its solution is the best path of the search.

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


@structref.register
class _HandleType(types.StructRef):
    """Numba's type of a handle."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Return the fields, their types freed from particular values."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)  # type: ignore[no-untyped-call]


class Handle(structref.StructRefProxy):
    """A problem and a tree inside compiled code; made by `make_handle`."""

    problem: Problem
    nodes: FloatArray
    word: FloatArray


structref.define_proxy(Handle, _HandleType, ["problem", "nodes", "word"])  # type: ignore[no-untyped-call]


class _HandleInPython(NamedTuple):
    """Stands in for `Handle` where nothing is compiled."""

    problem: Problem
    nodes: FloatArray
    word: FloatArray


@compiled
def make_handle(problem: Problem, nodes: FloatArray, word: FloatArray) -> Handle:
    """Return a reference for `grow`.

    Args:
        problem: What to plan.
        nodes: (capacity, NODE) the tree.
        word: (3, 4) where connections are written, as twists and lengths.
    """
    return Handle(problem, nodes, word)  # type: ignore[no-untyped-call]


if not COMPILES:  # for debuggers and coverage; there numba's reference would call itself for ever
    make_handle = _HandleInPython  # type: ignore[assignment]


@compiled
def grow(
    handle: Handle, count: int, parent: int, u0: float, u1: float, u2: float, bound: float
) -> tuple[bool, float, float, float, float, float]:
    """Grow the tree by one arc and try the exact connection from its end to the goal, in one compiled call.

    Args:
        handle: The problem; the tree, whose row `count` is filled, unless `parent` is negative: then it is already;
            and where the connection goes.
        count: See `search.extend`.
        parent: See `search.extend`; negative to connect from the row alone, by any word.
        u0: The first of the controls, see `search.extend`.
        u1: The second one.
        u2: The third one.
        bound: Cost that a whole path must stay below.

    Returns:
        (kept, cost, promise, x, y, theta): whether there is a new node that may be on a path below the bound; the
        cost of the whole path through it, infinite when the connection is blocked; the cost of the cheapest word from
        it, blocked or not; and its pose.
    """
    return _grow(handle.problem, handle.nodes, handle.word, count, parent, (u0, u1, u2), bound)


@compiled
def room_at(handle: Handle, x: float, y: float, theta: float) -> float:
    """Return how far (m) the body is from everything at a pose, beyond the clearance; negative where it is too near.

    Distances above twice the clearance are not told apart.
    """
    scene = handle.problem.scene
    return separation(scene, x, y, theta, 2.0 * scene.clearance) - scene.clearance


@no_refcount
def _grow(
    problem: Problem,
    nodes: FloatArray,
    word: FloatArray,
    count: int,
    parent: int,
    controls: tuple[float, float, float],
    bound: float,
) -> tuple[bool, float, float, float, float, float]:
    """Do what `grow` promises."""
    if parent >= 0 and not extend(problem, nodes, count, parent, controls, bound):
        return False, np.inf, np.inf, 0.0, 0.0, 0.0
    node = nodes[count]
    so_far = node[3]
    tries = MAX_WORDS if parent < 0 else TRIES
    limit = bound - so_far
    cost, promise = connect(problem.scene, problem.families, node[:3], problem.goal, limit, tries, word)
    kept = so_far + promise < bound or promise == np.inf
    return kept, so_far + cost, promise, node[0], node[1], node[2]


Grow = Callable[
    [Handle, int, int, float, float, float, float], tuple[bool, float, float, float, float, float]
]
RoomAt = Callable[[Handle, float, float, float], float]


def ready(handle: Handle) -> tuple[Grow, RoomAt]:
    """Return `grow` and `room_at` for references like this one, without numba's look-up of types at every call."""
    if not COMPILES:
        return grow, room_at
    return _ready(typeof(handle))  # type: ignore[no-untyped-call]


@cache
def _ready(kind: Any) -> tuple[Grow, RoomAt]:
    """Return both functions for a type of reference."""
    whole, real = types.int64, types.float64
    return (
        entry_point(grow, (kind, whole, whole, real, real, real, real)),
        entry_point(room_at, (kind, real, real, real)),
    )


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
        forest = _forest(session, box, heading_length)
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


def _forest(session: Session, box: Box, heading_length: float) -> Forest:
    start_tree, goal_tree = np.zeros((2, (ROUND << DOUBLINGS) + CHUNK, NODE))
    return Forest(
        start_tree=start_tree,
        goal_tree=goal_tree,
        counts=np.ones(2, dtype=np.int64),
        box=np.array(box, dtype=np.float64),
        heading_length=heading_length,
        reach=0.15 * math.hypot(box[2] - box[0], box[3] - box[1]),
        state=session.random,
    )


def _round(session: Session, forest: Forest, excess: float, extensions: int) -> int:
    """Grow fresh trees until they join or have used up their extensions; return what counts as used."""
    plant(forest, session.start, session.problem.goal)
    path = np.empty((3 * (len(forest.start_tree) + len(forest.goal_tree)) + 3, 4))
    used, arcs = 0, 0
    while used < extensions and not arcs and not session.finished:
        done, arcs = grow_both(session.problem, forest, excess * session.best.horizon, CHUNK, path)
        used += done
        session.spent(done)
    start_tree, goal_tree = forest.start_tree[: forest.counts[0]], forest.goal_tree[: forest.counts[1]]
    session.branches.offer_nodes(start_tree, goal_tree)
    if arcs:
        session.offer(path[:arcs])
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
