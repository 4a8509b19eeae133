"""The propagator: one compiled call an arc, which also tries the exact connection to the goal from the arc's end.

OMPL hands states back as numbers, so what is known of a pose (its row in the tree: cost, parent, arc) is found again
by its three coordinates. An arc that touches something, or that cannot lead to a better path than the best one, ends
in a state that is out of bounds.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pushplan.planners.improve.session import Session
from pushplan.planners.ompl.grow import make_handle, ready
from pushplan.planners.problem.problem import NODE, branch, remaining

OUTSIDE = 1e9
"""First coordinate, m, that marks a state as invalid."""


class Propagator:
    """What OMPL calls for every extension, and what it remembers of them.

    Args:
        session: The search that it serves.

    Attributes:
        bound: Cost that a whole path must stay below: arcs that cannot lead to one count as blocked, m.
        nodes: (capacity, search.NODE) the tree; the first `count` rows are in use.
    """

    def __init__(self, session: Session) -> None:
        self._session, self.bound = session, math.inf
        self._word = np.zeros((3, 4))
        self.nodes = np.zeros((1024, NODE))  # doubled when full
        self.take_problem()
        self._grow, self._room_at = ready(self._handle)
        self.clear()

    def take_problem(self) -> None:
        """Hand the session's problem and the tree over to compiled code."""
        self._handle = make_handle(self._session.problem, self.nodes, self._word)

    def clear(self) -> None:
        """Forget the tree but for its root, the start."""
        start = self._session.start
        self.nodes[0] = 0.0
        self.nodes[0, :3] = start
        self.nodes[0, 4] = -1.0
        self.count = 1
        self._rows = {(float(start[0]), float(start[1]), wrapped(float(start[2]))): 0}
        self._last: tuple[float, float, float] | None = None
        self._distance = math.inf

    def propagate(self, state: Any, control: Any, duration: float, result: Any) -> None:
        """Go on from a state along the arc that the coordinates of a control stand for, for so many units of time."""
        session, node = self._session, self.count
        if node + 1 >= len(self.nodes):
            self.nodes = np.concatenate([self.nodes, np.zeros_like(self.nodes)])
            self.take_problem()
        parent = self._rows.get((state.getX(), state.getY(), state.getYaw()), -1)
        known = parent >= 0
        if not known:
            parent, node = self._enter(state), node + 1
        session.extensions += 1
        session.iterations += 1
        kept, cost, to_go, x, y, theta = self._grow(
            self._handle, node, parent, control[0], control[1], control[2] * duration, self.bound
        )
        if not kept:
            result.setX(OUTSIDE)
            return
        if not -math.pi <= theta < math.pi:
            theta = wrapped(theta)
        self._last = pose = (x, y, theta)
        self._distance = 0.0 if cost < self.bound else to_go
        if known:
            self._rows[pose] = node
            self.count = node + 1
        result.setX(x)
        result.setY(y)
        result.setYaw(theta)

    def _enter(self, state: Any) -> int:
        """Write a pose that no arc from the start led to into the first unused row, where it is not kept."""
        session, node = self._session, self.nodes[self.count]
        node[:3] = state.getX(), state.getY(), state.getYaw()
        start = session.start
        node[3] = remaining(start[0], start[1], start[2], node[:3])
        node[4] = -1.0
        return self.count

    def free(self, state: Any) -> bool:
        """Return whether the body keeps clear of everything at a state; of an arc's end that is known already."""
        x, y, theta = state.getX(), state.getY(), state.getYaw()
        if x >= OUTSIDE:
            return False
        return (x, y, theta) == self._last or self._room_at(self._handle, x, y, theta) >= 0.0

    def distance_to_goal(self, state: Any) -> float:
        """Return 0 where a free word leads to the goal and makes the best path so far, else the cheapest word's cost.

        The distance is infinite where no word leads to the goal, free or not.
        """
        pose = (state.getX(), state.getY(), state.getYaw())
        if pose == self._last:
            return self._distance
        row = self._rows.get(pose, -1)
        if row < 0:
            row = self._enter(state)
        _, cost, to_go, *_ = self._grow(self._handle, row, -1, 0.0, 0.0, 0.0, self.bound)
        return 0.0 if cost < self.bound else to_go

    def note(self) -> None:
        """Hand the branches of the tree to the session, and the way to its node nearest to the goal."""
        session, nodes = self._session, self.nodes[: self.count]
        session.branches.offer_nodes(nodes)
        session.note_nearest(nodes[:, :3], lambda node: branch(nodes, node))


def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi): OMPL silently drops a start or a goal beyond."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))
