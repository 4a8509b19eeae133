"""A push problem in OMPL's form: states, controls, propagator, validity and goal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import control as oc

from pushplan.core.collision import ROUNDING, Scene
from pushplan.core.problem import arcs_at, connect, controls_of, poses_along
from pushplan.core.search import Tree, branch
from pushplan.errors import PlanningError
from pushplan.geometry.se2 import pose_error
from pushplan.planners.problem import Box
from pushplan.planners.search.session import Session
from pushplan.plans.path import PushPath
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

OUTSIDE = 1e9
"""First coordinate, m, that marks a state as invalid."""


class Propagator:
    """State propagator that OMPL calls for every extension. It stores the results.

    One call of the core propagates, checks for collisions, computes bounds and tries to join the opposite tree. The
    checks of validity and goal only read its result.

    Args:
        session: Session of the search.
        heading_length: Distance that a turn of one radian counts as, m.
        back: Whether to propagate backwards in time from the goal.

    Attributes:
        bound: Upper limit of a whole path's cost, m. Arcs that cannot lead to such a path count as blocked.
        root: (3,) pose, the start or the goal.
        tree: Tree propagated from the root.
        other: Tree to join; only the opposite root if no search grows it.
        path: (k, 4) path that joins the trees; None if there is none.
    """

    def __init__(self, session: Session, heading_length: float, back: bool = False) -> None:
        self._session, self.bound = session, math.inf
        ends = (session.start, session.problem.goal)
        self.root, opposite = ends[back], ends[not back]
        self.tree = Tree(session.problem, self.root, heading_length, back)
        self.other = Tree(session.problem, opposite, heading_length, not back)
        self.clear()

    def take_problem(self) -> None:
        """Use the session's current problem."""
        self.tree.take(self._session.problem)

    def clear(self) -> None:
        """Clear the tree except for its root."""
        self.tree.clear(self.root)
        x, y, theta = self.root.tolist()
        self._rows = {(x, y, wrapped(theta)): 0}
        self._last: tuple[float, float, float] | None = None
        self.path: FloatArray | None = None
        self._distance = math.inf

    def propagate(self, state: Any, control: Any, duration: float, result: Any) -> None:
        """Propagate a state along the arc of a control over a duration, and write the end to `result`."""
        common, tree = self._session.common, self.tree
        place = (state.getX(), state.getY(), state.getYaw())
        parent, node = self._rows.get(place, -1), len(tree)
        common.extensions += 1
        common.iterations += 1
        controls = (control[0], control[1], control[2] * duration)
        kept, cost, to_go, x, y, theta = tree.extend(parent, place, controls, self.bound, self.other)
        if not kept:
            result.setX(OUTSIDE)
            return
        if not -math.pi <= theta < math.pi:
            theta = wrapped(theta)
        self._last = pose = (x, y, theta)
        self._distance = to_go
        if parent >= 0:
            self._rows[pose] = node
        if cost < self.bound:
            self._distance, self.path = 0.0, tree.path
        result.setX(x)
        result.setY(y)
        result.setYaw(theta)

    def free(self, state: Any) -> bool:
        """Return whether the body is collision-free at a state. At the end of the last arc, this is known."""
        x, y, theta = state.getX(), state.getY(), state.getYaw()
        if x >= OUTSIDE:
            return False
        return (x, y, theta) == self._last or self.tree.room_at(x, y, theta) >= 0.0

    def distance_to_goal(self, state: Any) -> float:
        """Return 0 if a free steering path to the other tree makes the best path so far.

        Otherwise, return the cost of the cheapest steering path to its root, free or not; infinite without one.
        """
        pose = (state.getX(), state.getY(), state.getYaw())
        if pose == self._last:
            return self._distance
        cost, to_go = self.tree.connect(self._rows.get(pose, -1), pose, self.bound, self.other)
        return 0.0 if cost < self.bound else to_go

    def note(self) -> None:
        """Give the session the tree's branches and the path to its node nearest to the goal."""
        session, nodes = self._session, self.tree.nodes
        session.common.branches.offer_nodes(nodes)
        session.note_nearest(nodes[:, :3], lambda node: branch(nodes, node))


def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi). OMPL silently drops a start or goal outside this range."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


def leave_path(definition: Any, arcs: FloatArray, planner: str) -> None:
    """Make arcs (k, 4) from the start to the goal the only solution of a problem.

    Raises:
        PlanningError: If a twist is not in the stable set.
    """
    definition.clearSolutionPaths()
    definition.addSolutionPath(path_control(information_of(definition), arcs), False, 0.0, planner)


def path_control(information: PushInformation, arcs: FloatArray) -> Any:
    """Return arcs (k, 4) from the start as OMPL's path of states, controls and durations."""
    problem, path = information.session.problem, oc.PathControl(information)
    controls = controls_of(problem, arcs)
    if not np.isfinite(controls).all():
        raise PlanningError("a twist of the path is on no segment of the stable set")
    poses, _ = poses_along(problem.scene, information.session.start, arcs)
    control = information.allocControl()
    for pose, (u0, u1, u2, units) in zip(poses[:-1], controls.tolist(), strict=True):
        control[0], control[1], control[2] = u0, u1, u2
        path.append(state_at(information, pose), control, units)
    path.append(state_at(information, poses[-1]))
    return path


def arcs_to_goal(definition: Any) -> FloatArray:
    """Return the arcs (k, 4) of a problem's exact solution, plus the steering path from its end to the goal.

    Raises:
        PlanningError: If there is none, or it is not free, or it does not end in the goal region.
    """
    session = information_of(definition).session
    if not definition.hasExactSolution():
        raise PlanningError("the problem has no exact solution")
    arcs = controlled_arcs(session, definition.getSolutionPath())
    poses, free = poses_along(_proven(session.problem.scene), session.start, arcs)
    if free < len(arcs):
        raise PlanningError(f"the planner returned a path, but its arc {free + 1} of {len(arcs)} is not free")
    end = poses[-1]
    if max(pose_error(end, session.problem.goal)) <= 1e-9:  # at the goal: no steering path is needed
        return arcs
    word = free_word(session, end, session.problem.goal)
    if word is None:
        raise PlanningError("the planner returned a path, but no free steering path leads from its end to the goal")
    return np.concatenate([arcs, word])


def _proven(scene: Scene) -> Scene:
    """Return the scene with the clearance that a search proves for every pose of its arcs.

    A search checks poses with more clearance than it proves between them. After neighbouring arcs of one motion are
    merged, other poses are checked.
    """
    return scene.with_distances(scene.kept - ROUNDING, scene.kept - CLEARANCE_ROOM)


def push_path(definition: Any) -> PushPath:
    """Return the path that solves a problem; see `arcs_to_goal`."""
    arcs = arcs_to_goal(definition)
    return PushPath.of_arcs(information_of(definition).session.start, arcs)


def controlled_arcs(session: Session, path: Any) -> FloatArray:
    """Return the arcs (k, 4) of the controls of OMPL's path."""
    if not isinstance(path, oc.PathControl):
        raise PlanningError(
            f"the planner returned a {type(path).__name__}; allowed: a path with controls (PathControl)"
        )
    units = path.getControlDurations()
    controls = [[u[0], u[1], u[2], unit] for u, unit in zip(path.getControls(), units, strict=True)]
    return arcs_at(session.problem, np.array(controls).reshape(-1, 4))


class PushInformation(oc.SpaceInformation):  # type: ignore[misc]
    """OMPL's space information of a push problem, with data for the project's own planners.

    Attributes:
        session: Session of the search.
        box: (xmin, ymin, xmax, ymax) to sample from, m.
        heading_length: Distance that a turn of one radian counts as, m.
        propagator: Propagator of its arcs.
    """

    def __init__(
        self, session: Session, box: Box, heading_length: float, ahead: PushInformation | None = None
    ) -> None:
        """Build a search from the start or, with `ahead`, its counterpart back from the goal."""
        if ahead is None:
            space = _poses_in(box, heading_length)
            controls = oc.RealVectorControlSpace(space, 3)
            controls.setBounds(bounds([(0.0, 1.0)] * 3))
        else:
            space, controls = ahead.getStateSpace(), ahead.getControlSpace()
        super().__init__(space, controls)
        self.session, self.box, self.heading_length = session, box, heading_length
        self.propagator = Propagator(session, heading_length, back=ahead is not None)
        self.setStatePropagator(self.propagator.propagate)
        self.setStateValidityChecker(self.propagator.free)
        self.setMotionValidator(FreeWords(self, session))
        self.setPropagationStepSize(1.0)
        self.setMinMaxControlDuration(1, 1)
        self.setup()
        if ahead is not None:
            self.propagator.other, ahead.propagator.other = ahead.propagator.tree, self.propagator.tree

    def admit(self, twist: FloatArray) -> None:
        """Add a stable twist (3,) to the controls as a segment of its own. It can lie between the segments."""
        problem = self.session.problem
        segments = np.vstack([problem.segments, np.tile(twist, 2)])
        self.session.problem = problem.with_segments(segments)
        self.propagator.take_problem()


def _poses_in(box: Box, heading_length: float) -> Any:
    """Return OMPL's pose space, with 40 cells along the diagonal in which EST and KPIECE1 count nodes."""
    space = ob.SE2StateSpace()
    space.setBounds(bounds([(box[0], box[2]), (box[1], box[3])]))
    space.setSubspaceWeight(1, heading_length)
    side = math.hypot(box[2] - box[0], box[3] - box[1]) / 40
    plane = space.getSubspace(0)
    cells = ob.RealVectorOrthogonalProjectionEvaluator(plane, [side, side], [0, 1])
    space.registerDefaultProjection(ob.SubspaceProjectionEvaluator(space, 0, cells))
    return space


class FreeWords(ob.MotionValidator):  # type: ignore[misc]
    """Motion validator: two states are joined if a free steering path of stable arcs connects them."""

    def __init__(self, information: Any, session: Session) -> None:
        super().__init__(information)
        self._session = session

    def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802 OMPL's name
        """Return whether a free steering path connects two states."""
        return free_word(self._session, pose_of(first), pose_of(second)) is not None


class WordGoal(ob.GoalSampleableRegion):  # type: ignore[misc]
    """Goal region: poses that a free steering path joins exactly to the opposite tree. Its sample is that root."""

    def __init__(self, information: PushInformation) -> None:
        super().__init__(information)
        self.setThreshold(1e-12)  # OMPL requires a distance below the threshold
        self._distance = information.propagator.distance_to_goal
        x, y, theta = information.propagator.other.nodes[0, :3].tolist()
        self._goal = (x, y, wrapped(theta))

    def sampleGoal(self, state: Any) -> None:  # noqa: N802 OMPL's name
        """Set a state to the other tree's root."""
        x, y, yaw = self._goal
        state.setX(x)
        state.setY(y)
        state.setYaw(yaw)

    def maxSampleCount(self) -> int:  # noqa: N802 OMPL's name
        """Return the number of distinct samples."""
        return 1

    def distanceGoal(self, state: Any) -> float:  # noqa: N802 OMPL's name
        """Return 0 inside the region, else the cost of the cheapest steering path to the other root, m."""
        return self._distance(state)


def pose_problem(session: Session, box: Box, heading_length: float) -> tuple[PushInformation, Any]:
    """Return OMPL's space information and problem definition of a search.

    Args:
        session: The search.
        box: (xmin, ymin, xmax, ymax) that OMPL draws its samples from, m.
        heading_length: Distance that a turn of one radian counts as, m.
    """
    information = PushInformation(session, box, heading_length)
    return information, definition_of(information)


def definition_of(information: PushInformation) -> Any:
    """Return the problem definition from the propagator's root to the tree that it joins."""
    definition = ob.ProblemDefinition(information)
    definition.addStartState(state_at(information, information.propagator.root))
    definition.setGoal(WordGoal(information))
    return definition


def free_word(session: Session, begin: FloatArray, end: FloatArray) -> FloatArray | None:
    """Return the arcs (3, 4) of the cheapest free steering path between two poses (3,); None without one."""
    problem = session.problem
    _, _, arcs = connect(problem.scene, problem.families, begin, end)
    return arcs


def information_of(definition: Any) -> PushInformation:
    """Return the space information of a push problem's definition.

    Raises:
        PlanningError: If it belongs to another problem.
    """
    information = definition.getSpaceInformation()
    if not isinstance(information, PushInformation):
        raise PlanningError("the problem definition is not of a push; allowed: one from pushplan.ompl.pose")
    return information


def bounds(ranges: Sequence[tuple[float, float]]) -> Any:
    """Return OMPL's bounds from the lowest and highest value of each coordinate."""
    made = ob.RealVectorBounds(len(ranges))
    for i, (low, high) in enumerate(ranges):
        made.setLow(i, low)
        made.setHigh(i, high)
    return made


def state_at(information: Any, pose: FloatArray) -> Any:
    """Return an SE(2) state at a pose (3,), with its angle wrapped."""
    state = information.allocState()
    state.setX(float(pose[0]))
    state.setY(float(pose[1]))
    state.setYaw(wrapped(float(pose[2])))
    return state


def pose_of(state: Any) -> FloatArray:
    """Return the pose (3,) of a state."""
    return np.array([state.getX(), state.getY(), state.getYaw()])
