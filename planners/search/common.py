"""Data shared by the searches of one plan: time, counts, and data that explain a failure."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import pushplan.core.improve as improve
from pushplan.core.problem import GAIN, remaining
from pushplan.geometry import se2
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray, IntArray

MOST_BRANCHES = 500
"""Maximum number of branches that are kept."""


class Branches:
    """Branches of the largest trees of a search.

    Attributes:
        ends: (q, 2, 3) poses at both ends of each branch.
        size: Number of branches of these trees.
    """

    def __init__(self) -> None:
        self.ends = np.zeros((0, 2, 3))
        self.size = 0

    def offer(self, *trees: tuple[FloatArray, IntArray]) -> None:
        """Keep the branches of trees grown together if they outnumber the previous ones.

        Args:
            trees: Poses (k, 3) of each tree's nodes, and their parents (k,), negative for roots.
        """
        size = sum(int((parents >= 0).sum()) for _, parents in trees)
        if size > self.size:
            ends = np.concatenate([_ends(poses, parents) for poses, parents in trees])
            kept = np.linspace(0, size - 1, min(size, MOST_BRANCHES)).astype(int)
            self.ends, self.size = ends[kept], size

    def offer_nodes(self, *trees: FloatArray) -> None:
        """Call `offer` with trees (k, >= 5) whose rows begin with x, y, theta, cost and parent."""
        self.offer(*((nodes[:, :3], nodes[:, 4].astype(np.int64)) for nodes in trees))


def _ends(poses: FloatArray, parents: IntArray) -> FloatArray:
    rows = np.flatnonzero(parents >= 0)
    return np.stack([poses[parents[rows]], poses[rows]], axis=1)


class NearestApproach:
    """The free path that ends nearest to the goal.

    Args:
        start: (3,) pose where paths begin.
        goal: (3,) pose.

    Attributes:
        arcs: (k, 4) twists and lengths of the path; empty at first.
        left: Lower bound on the cost from its end to the goal, m.
    """

    def __init__(self, start: FloatArray, goal: FloatArray) -> None:
        self._goal = goal
        self.arcs, self.left = np.zeros((0, 4)), remaining(start, goal)

    def nearer(self, poses: FloatArray) -> int:
        """Return the index of the pose (n, 3) nearest to the goal; -1 if none is nearer than the path's end."""
        if len(poses) == 0:
            return -1
        left = self._left(poses)
        node = int(np.argmin(left))
        return node if left[node] < self.left - GAIN else -1

    def take(self, arcs: FloatArray, end: FloatArray) -> None:
        """Keep a free path (k, 4) that ends at a nearer pose (3,)."""
        self.arcs, self.left = improve.merged(arcs), float(self._left(end[None])[0])

    def _left(self, poses: FloatArray) -> FloatArray:
        """Return the costs (n,) of straight travel and the smallest turn from poses (n, 3) to the goal, m."""
        turn = np.abs(se2.wrap_angle(self._goal[2] - poses[:, 2]))
        away = np.hypot(self._goal[0] - poses[:, 0], self._goal[1] - poses[:, 1])
        return np.asarray(away + TURN_WEIGHT * turn)


class Common:
    """Data shared by the searches of one plan, one search for each margin.

    The nearest path and the branches are reported if no search finds a path.

    Args:
        start: (3,) pose where paths begin.
        goal: (3,) pose.
        set_up: Time to build the problem, s. It counts towards the time limit.

    Attributes:
        began: `time.perf_counter` when the first search began.
        set_up: Time to build the problem, s.
        extensions: Number of arcs propagated.
        iterations: Number of arcs propagated (some count partly) and shortcuts tried.
        nearest: Free path that ends nearest to the goal, updated while no path reaches it.
        branches: Branches of the trees.
        room: Cache of data about the room (bottlenecks, distances), by search parameters.
    """

    def __init__(self, start: FloatArray, goal: FloatArray, set_up: float = 0.0) -> None:
        self.began, self.set_up = time.perf_counter(), set_up
        self.extensions = self.iterations = 0
        self.nearest, self.branches = NearestApproach(start, goal), Branches()
        self.room: dict[tuple[float, ...], Any] = {}

    @property
    def elapsed(self) -> float:
        """Wall-clock seconds since the first search began."""
        return time.perf_counter() - self.began

    @property
    def seconds(self) -> float:
        """Wall-clock seconds that count towards the time limit."""
        return self.set_up + self.elapsed
