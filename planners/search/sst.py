"""Stable sparse RRT (SST): OMPL's has no constructor in Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pushplan.compiled import inlined, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.planners.collision.separation import step, sweep_is_free
from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.ompl.auto import AnytimePlanner
from pushplan.planners.ompl.form import PushInformation
from pushplan.planners.problem.problem import (
    NODE,
    TRIES,
    Box,
    Problem,
    apart,
    branch,
    choose_twist,
    enter,
    random,
    remaining,
    trace,
)
from pushplan.planners.problem.steering import connect
from pushplan.util.arrays import FloatArray, IntArray, RandomState

TO_GO = NODE
"""Column of a node, after those of `search`, with a lower bound on the cost from there to the goal."""

CHILDREN, ACTIVE = 0, 1
"""Columns of a node's roles: number of its children; whether it stands for a witness."""

NODES, WITNESSES, UNUSED = 0, 1, 2
"""What is counted: rows of nodes ever used, witnesses, rows that are unused again."""


class SparseTree(NamedTuple):
    """The tree and what grows it.

    Attributes:
        nodes: (capacity, NODE + 1) see `search.NODE` and `TO_GO`; the first row is the root.
        roles: (capacity, 2) see `CHILDREN` and `ACTIVE`.
        witnesses: (capacity, 4) pose, and the row of the node that stands for it.
        unused: (capacity,) stack of rows that were pruned.
        counts: (3,) see `NODES`, `WITNESSES` and `UNUSED`.
        box: (4,) xmin, ymin, xmax, ymax that positions are drawn from.
        radii: (3,) metres that a radian counts as; how far from a random pose the best node is looked for; how far
            apart witnesses are.
        state: (1,) of the random generator.
    """

    nodes: FloatArray
    roles: IntArray
    witnesses: FloatArray
    unused: IntArray
    counts: IntArray
    box: FloatArray
    radii: FloatArray
    state: RandomState


@inlined
def _selected(tree: SparseTree, bound: float) -> int:
    """Row of the cheapest node near a random pose, or of the nearest node; -1 if none can lead below the bound."""
    x = tree.box[0] + (tree.box[2] - tree.box[0]) * random(tree.state)
    y = tree.box[1] + (tree.box[3] - tree.box[1]) * random(tree.state)
    theta = 2.0 * math.pi * random(tree.state)
    nearest, best, distance, cost = -1, -1, np.inf, np.inf
    for i in range(tree.counts[NODES]):
        node = tree.nodes[i]
        # Inactive nodes only carry branches: what they stand for is reached cheaper by others.
        if tree.roles[i, ACTIVE] == 1 and node[3] + node[TO_GO] < bound:
            d = apart(node, x, y, theta, tree.radii[0])
            if d < distance:
                nearest, distance = i, d
            if d < tree.radii[1] and node[3] < cost:
                best, cost = i, node[3]
    return best if best >= 0 else nearest


@inlined
def _witness(tree: SparseTree, x: float, y: float, theta: float) -> int:
    """Index of the nearest witness close to a pose, -1 if there is none."""
    nearest, distance = -1, tree.radii[2]
    for i in range(tree.counts[WITNESSES]):
        d = apart(tree.witnesses[i], x, y, theta, tree.radii[0])
        if d < distance:
            nearest, distance = i, d
    return nearest


@inlined
def _row(tree: SparseTree) -> int:
    """Take a row for a new node."""
    if tree.counts[UNUSED] > 0:
        tree.counts[UNUSED] -= 1
        return int(tree.unused[tree.counts[UNUSED]])
    tree.counts[NODES] += 1
    return int(tree.counts[NODES]) - 1


@inlined
def _retire(tree: SparseTree, row: int) -> None:
    """Let a node stand for nothing any more, and prune the branch that ends there."""
    tree.roles[row, ACTIVE] = 0
    # The root (row 0) stays: everything hangs from it.
    while row > 0 and tree.roles[row, ACTIVE] == 0 and tree.roles[row, CHILDREN] == 0:
        parent = int(tree.nodes[row, 4])
        tree.roles[parent, CHILDREN] -= 1
        tree.unused[tree.counts[UNUSED]] = row
        tree.counts[UNUSED] += 1
        row = parent


@inlined
def _represent(tree: SparseTree, witness: int, row: int) -> None:
    """Let a new node stand for a witness, -1 for a new one at its own pose, instead of the node that did."""
    tree.roles[row, ACTIVE] = 1
    if witness < 0:
        witness = int(tree.counts[WITNESSES])
        tree.counts[WITNESSES] += 1
        for k in range(3):
            tree.witnesses[witness, k] = tree.nodes[row, k]
    else:
        _retire(tree, int(tree.witnesses[witness, 3]))
    tree.witnesses[witness, 3] = row


@inlined
def _extended(problem: Problem, tree: SparseTree, parent: int, bound: float) -> int:
    """Grow the tree by a random arc if it ends cheaper than its witness's node; return the row, or -1."""
    x, y, theta, cost = (
        tree.nodes[parent, 0],
        tree.nodes[parent, 1],
        tree.nodes[parent, 2],
        tree.nodes[parent, 3],
    )
    u0, u1, length = random(tree.state), random(tree.state), random(tree.state) * problem.longest
    vx, vy, omega = choose_twist(problem, u0, u1)
    nx, ny, nt = step(x, y, theta, vx, vy, omega, length)
    to_go = remaining(nx, ny, nt, problem.goal)
    if length <= 0.0 or cost + length + to_go >= bound:
        return -1
    witness = _witness(tree, nx, ny, nt)
    # Asked before the sweep, which costs most of an extension.
    if witness >= 0 and tree.nodes[int(tree.witnesses[witness, 3]), 3] <= cost + length:
        return -1
    if not sweep_is_free(problem.scene, x, y, theta, vx, vy, omega, length):
        return -1
    row = _row(tree)
    node = tree.nodes[row]
    enter(node, (nx, ny, nt), cost + length, parent, (vx, vy, omega, length))
    node[TO_GO] = to_go
    tree.roles[row, CHILDREN] = 0
    tree.roles[parent, CHILDREN] += 1
    _represent(tree, witness, row)
    return row


@no_refcount
def grow_sparse(
    problem: Problem, tree: SparseTree, bound: float, iterations: int, path: FloatArray
) -> tuple[int, int]:
    """Grow the tree until a path below the bound is found.

    Args:
        problem: What to plan.
        tree: The tree; it has room for `iterations` more nodes.
        bound: Cost that a path must stay below.
        iterations: Extensions to try, at most.
        path: (capacity, 4) filled with the path's twists and lengths.

    Returns:
        (done, arcs): extensions tried; arcs of the path found, 0 if none.
    """
    word = scratch(3, 4)
    for done in range(1, iterations + 1):
        parent = _selected(tree, bound)
        if parent < 0:
            return done, 0
        row = _extended(problem, tree, parent, bound)
        if row < 0:
            continue
        pose, limit = tree.nodes[row, :3], bound - tree.nodes[row, 3]
        cost, _ = connect(problem.scene, problem.families, pose, problem.goal, limit, TRIES, word)
        if cost < limit:
            return done, trace(tree.nodes, row, word, path)
    return iterations, 0


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
        radii = np.array([self._heading_length, *(self._shrunk * self._diagonal * share for share in shares)])
        tree, left = planted(session, self._box, radii), int(self._extensions)
        path = np.empty((len(tree.nodes) + 3, 4))
        while left > 0 and not stop():
            if tree.counts[0] + CHUNK > len(tree.nodes):
                tree = doubled(tree)
                path = np.empty((len(tree.nodes) + 3, 4))
            done, arcs = grow_sparse(session.problem, tree, session.best.bound, CHUNK, path)
            session.spent(done)
            left -= done
            self.extensions += done
            if arcs:
                session.offer(path[:arcs])
        _note(session, tree)
        self._shrunk, self._extensions = 0.85 * self._shrunk, 1.4 * self._extensions


def planted(session: Session, box: FloatArray, radii: FloatArray) -> SparseTree:
    """Return a tree of the start alone, which is the first witness too."""
    nodes, roles = np.zeros((4 * CHUNK, NODE + 1)), np.zeros((4 * CHUNK, 2), dtype=np.int64)
    witnesses, unused = np.zeros((4 * CHUNK, 4)), np.zeros(4 * CHUNK, dtype=np.int64)
    nodes[0, :3] = witnesses[0, :3] = session.start
    nodes[0, 4] = -1.0
    x, y, theta = session.start
    nodes[0, TO_GO] = remaining(x, y, theta, session.problem.goal)
    roles[0, ACTIVE] = 1
    counts = np.array([1, 1, 0])
    return SparseTree(nodes, roles, witnesses, unused, counts, box, radii, session.random)


def _note(session: Session, tree: SparseTree) -> None:
    """Hand the tree's branches to the session, and the way to its node nearest to the goal."""
    nodes = tree.nodes[: tree.counts[NODES]]
    parents = nodes[:, 4].astype(np.int64)
    parents[tree.unused[: tree.counts[UNUSED]]] = -1
    session.branches.offer((nodes[:, :3], parents))
    rows = np.append(0, np.flatnonzero(parents >= 0))
    session.note_nearest(nodes[rows, :3], lambda node: branch(tree.nodes, int(rows[node])))


def doubled(tree: SparseTree) -> SparseTree:
    """Return the tree with twice the room."""
    nodes, witnesses = (np.concatenate([a, np.zeros_like(a)]) for a in (tree.nodes, tree.witnesses))
    roles, unused = (np.concatenate([a, np.zeros_like(a)]) for a in (tree.roles, tree.unused))
    return tree._replace(nodes=nodes, roles=roles, witnesses=witnesses, unused=unused)


class StableSparseRRT(AnytimePlanner):
    """Rounds of sparse trees."""

    name = "SST"

    def improve(self, information: PushInformation) -> None:
        """Run rounds until the search is over."""
        session = information.session
        rounds = SparseRounds(session, information.box, information.heading_length)
        while not session.finished:
            rounds.run_next(session.stop)
            session.refine()
