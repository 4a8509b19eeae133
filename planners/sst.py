"""Stable Sparse RRT (Li, Littlefield and Bekris 2016) as an OMPL planner with a compiled core.

Rounds as in their SST*: each begins anew with witnesses closer together and more extensions, so that costs fall
towards the optimum of the sampled arcs; paths are polished, and every further one has to be cheaper.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from pushplan.arrays import FloatArray
from pushplan.geometry import se2
from pushplan.planners.search import NODE, remaining, trace
from pushplan.planners.session import Session
from pushplan.planners.sst_kernel import ACTIVE, NODES, TO_GO, UNUSED, SparseTree, grow_sparse

SELECTION_SHARE, PRUNING_SHARE = 0.08, 0.04
"""Radii of the first round, as shares of the sampling box's diagonal: around a random pose, and between witnesses."""

SHRINK = 0.85
"""Factor of both radii from round to round."""

FIRST_ROUND = 4_000
"""Extensions of the first round."""

GROWTH = 1.4
"""Factor of the extensions from round to round."""

CHUNK = 128
"""Extensions between two looks at the clock."""

Box = tuple[float, float, float, float]


def search(session: Session, box: Box, heading_length: float) -> None:
    """Run SST until the session is finished."""
    ou.setLogLevel(ou.LOG_NONE)
    information, definition = _pose(session, box)
    planner = StableSparseRRT(information, session, box, heading_length)
    planner.setProblemDefinition(definition)
    planner.setup()
    planner.solve(ob.PlannerTerminationCondition(lambda: session.finished))


class StableSparseRRT(ob.Planner):  # type: ignore[misc]
    """The planner, as OMPL sees it: its solutions are paths of the poses between the arcs."""

    def __init__(self, information: Any, session: Session, box: Box, heading_length: float) -> None:
        super().__init__(information, "SST")
        self._session, self._box, self._heading_length = session, box, heading_length
        self._information = information

    def solve(self, stop: Any) -> Any:
        """Run rounds until `stop` says so; add the best path to the problem definition."""
        session = self._session
        diagonal = math.hypot(self._box[2] - self._box[0], self._box[3] - self._box[1])
        shrunk, extensions = 1.0, float(FIRST_ROUND)
        while not stop():
            radii = [self._heading_length, *(shrunk * diagonal * s for s in (SELECTION_SHARE, PRUNING_SHARE))]
            self._round(int(extensions), np.array(radii), stop)
            session.refine()
            shrunk, extensions = SHRINK * shrunk, GROWTH * extensions
        if session.best_arcs is None:
            return ob.PlannerStatus(ob.PlannerStatus.TIMEOUT)
        self.getProblemDefinition().addSolutionPath(self._solution(session.best_arcs))
        return ob.PlannerStatus(ob.PlannerStatus.EXACT_SOLUTION)

    def _round(self, extensions: int, radii: FloatArray, stop: Any) -> None:
        """Grow one tree, offering every path found to the session."""
        session = self._session
        tree = _planted(session, np.array(self._box), radii)
        path = np.empty((len(tree.nodes) + 3, 4))
        while extensions > 0 and not stop():
            if tree.counts[0] + CHUNK > len(tree.nodes):
                tree = _doubled(tree)
                path = np.empty((len(tree.nodes) + 3, 4))
            done, arcs = grow_sparse(session.problem, tree, session.bound, CHUNK, path)
            session.spent(done)
            extensions -= done
            if arcs:
                session.offer(path[:arcs])
        _note(session, tree)

    def _solution(self, arcs: FloatArray) -> Any:
        pose, path = self._session.start, og.PathGeometric(self._information)
        path.append(_state(self._information, pose))
        for arc in arcs:
            pose = se2.compose(pose, se2.exp(arc[:3] * arc[3]))
            path.append(_state(self._information, pose))
        return path


def _planted(session: Session, box: FloatArray, radii: FloatArray) -> SparseTree:
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
    nearest = session.nearer(nodes[rows, :3])
    if nearest >= 0:
        path = np.empty((len(rows), 4))
        session.approach(path[: trace(tree.nodes, int(rows[nearest]), np.zeros((3, 4)), path)])


def _doubled(tree: SparseTree) -> SparseTree:
    """Return the tree with twice the room."""
    nodes, witnesses = (np.concatenate([a, np.zeros_like(a)]) for a in (tree.nodes, tree.witnesses))
    roles, unused = (np.concatenate([a, np.zeros_like(a)]) for a in (tree.roles, tree.unused))
    return tree._replace(nodes=nodes, roles=roles, witnesses=witnesses, unused=unused)


def _pose(session: Session, box: Box) -> tuple[Any, Any]:
    """Return OMPL's space information and problem definition."""
    space = ob.SE2StateSpace()
    bounds = ob.RealVectorBounds(2)
    for i in range(2):
        bounds.setLow(i, box[i])
        bounds.setHigh(i, box[i + 2])
    space.setBounds(bounds)
    information = ob.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: True)
    information.setup()
    definition = ob.ProblemDefinition(information)
    ends = (_state(information, pose) for pose in (session.start, session.problem.goal))
    definition.setStartAndGoalStates(*ends)
    return information, definition


def _state(information: Any, pose: FloatArray) -> Any:
    state = information.allocState()
    state.setX(float(pose[0]))
    state.setY(float(pose[1]))
    state.setYaw(float(se2.wrap_angle(pose[2])))
    return state
