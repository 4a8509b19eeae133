"""A push problem as arrays for compiled code, and how it is made from a scenario and a stable set."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import any_integer, compiled, inlined, no_refcount
from pushplan.planners.collision.scene import build_scene
from pushplan.planners.collision.separation import Scene, separation, step, sweep_is_free
from pushplan.planners.problem.controls import MARGIN_FLOOR, MERIDIANS, control_segments, steering_families
from pushplan.planners.problem.objective import Objective, make_objective
from pushplan.planners.problem.rows import put
from pushplan.plans.path import TURN_WEIGHT
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, RandomState
from pushplan.util.names import CLEARANCE_ROOM

NODE = 9
"""Columns of a node: x, y, theta, cost from the start, parent, arc that led here (vx, vy, omega, length)."""

LETTER_SHARE = 0.3
"""Share of the sampled controls that are the twists of a steering family : turns and straight pushes."""

END_SHARE = 0.25
"""Share of the other controls that lie on either end of their segment, the boundary of the stable set."""


TRIES = any_integer(2)
"""Words that are swept, at most, in the attempt to connect a new node."""


class Problem(NamedTuple):
    """What the compiled search needs to know.

    Attributes:
        scene: The body and what it must not touch.
        segments: (k, 6) stable twists between two end twists: every positive combination of them is stable.
        families: (f, 3, 3) left, straight and right twists for exact connections.
        goal: (3,) pose of the chain frame in the world.
        longest: Longest arc sampled, m of cost.
        objective: What makes one path better than another.
    """

    scene: Scene
    segments: FloatArray
    families: FloatArray
    goal: FloatArray
    longest: float
    objective: Objective


@inlined
def between(segment: FloatArray, b: float) -> tuple[float, float, float]:
    """Combine a segment's ends (6,) as (1 - b, b): a twist scaled to a cost rate of 1."""
    vx = (1.0 - b) * segment[0] + b * segment[3]
    vy = (1.0 - b) * segment[1] + b * segment[4]
    omega = (1.0 - b) * segment[2] + b * segment[5]
    rate = math.hypot(vx, vy) + TURN_WEIGHT * abs(omega)
    return vx / rate, vy / rate, omega / rate


@inlined
def choose_twist(problem: Problem, u0: float, u1: float) -> tuple[float, float, float]:
    """Map two numbers in [0, 1] onto the stable set: a twist scaled to a cost rate of 1."""
    families, segments = problem.families, problem.segments
    if u0 < LETTER_SHARE:
        i = min(int(u0 / LETTER_SHARE * 3 * families.shape[0]), 3 * families.shape[0] - 1)
        twist = families[i // 3, i % 3]
        # Zeros stand for a twist that the family does not have.
        if twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0:
            return twist[0], twist[1], twist[2]
        u0 = LETTER_SHARE + (1.0 - LETTER_SHARE) * u1
    u0 = (u0 - LETTER_SHARE) / (1.0 - LETTER_SHARE)
    i = min(int(u0 * segments.shape[0]), segments.shape[0] - 1)
    # Clipped: the numbers beyond lie on the ends, so that the boundary of the stable set is drawn at all.
    b = min(1.0, max(0.0, (u1 - END_SHARE) / (1.0 - 2.0 * END_SHARE)))
    return between(segments[i], b)


@inlined
def apart(row: FloatArray, x: float, y: float, theta: float, heading_length: float) -> float:
    """Distance of a row's pose from a pose, m: straight travel and the smallest turn at so many metres a radian."""
    turn = abs((row[2] - theta + math.pi) % (2.0 * math.pi) - math.pi)
    return float(math.hypot(row[0] - x, row[1] - y) + heading_length * turn)


@no_refcount
def remaining(x: float, y: float, theta: float, goal: FloatArray) -> float:
    """Lower bound on the cost from a pose to the goal: straight travel plus the smallest turn."""
    return apart(goal, x, y, theta, TURN_WEIGHT)


@inlined
def enter(
    node: FloatArray,
    pose: tuple[float, float, float],
    cost: float,
    parent: int,
    arc: tuple[float, float, float, float],
) -> None:
    """Fill the row of a node: its pose, cost from the start, parent, and the arc that led there; see `NODE`."""
    node[0], node[1], node[2] = pose
    node[3], node[4] = cost, parent
    node[5], node[6], node[7], node[8] = arc


@inlined
def extend(
    problem: Problem,
    nodes: FloatArray,
    count: int,
    parent: int,
    controls: tuple[float, float, float],
    bound: float,
) -> bool:
    """Grow the tree by one arc.

    Args:
        problem: What to plan.
        nodes: (capacity, NODE) the tree; row `count` is filled on success.
        count: Nodes so far, below the capacity.
        parent: Row to grow from.
        controls: Three numbers in [0, 1]: which segment of the stable set, where on it, length of the arc.
        bound: Cost that a path through the new node must stay below.

    Returns:
        Whether the arc is free and worth keeping.
    """
    x, y, theta, cost = nodes[parent, 0], nodes[parent, 1], nodes[parent, 2], nodes[parent, 3]
    vx, vy, omega = choose_twist(problem, controls[0], controls[1])
    length = controls[2] * problem.longest
    nx, ny, nt = step(x, y, theta, vx, vy, omega, length)
    if length <= 0.0 or cost + length + remaining(nx, ny, nt, problem.goal) >= bound:
        return False
    if not sweep_is_free(problem.scene, x, y, theta, vx, vy, omega, length):
        return False
    enter(nodes[count], (nx, ny, nt), cost + length, parent, (vx, vy, omega, length))
    return True


@no_refcount
def trace(nodes: FloatArray, node: int, last: FloatArray, path: FloatArray) -> int:
    """Write the arcs from the root to a node and then `last` (3, 4) into `path`; return how many."""
    depth = 0
    i = node
    while nodes[i, 4] >= 0.0:
        depth += 1
        i = int(nodes[i, 4])
    i = node
    for k in range(depth - 1, -1, -1):
        put(path[k], nodes[i, 5:9])
        i = int(nodes[i, 4])
    for k in range(3):
        if last[k, 3] > 0.0:
            put(path[depth], last[k])
            depth += 1
    return depth


def branch(nodes: FloatArray, node: int) -> FloatArray:
    """Return the arcs (k, 4) from the root of a tree to a node."""
    path = np.empty((len(nodes) + 3, 4))
    return path[: trace(nodes, node, np.zeros((3, 4)), path)]


@no_refcount
def random(state: RandomState) -> float:
    """Draw a number in [0, 1) from the generator's state (1,) uint64 (splitmix64, Steele et al. 2014)."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) * (1.0 / 9007199254740992.0)


SLACK = 2e-4
"""Distance beyond the clearance, m, that the poses looked at have, so that those between can be proven to keep it."""

ROUNDING = 1e-9
"""Start and goal may fail by rounding to have the distance they have, m."""

Box = tuple[float, float, float, float]


class Controls(NamedTuple):
    """What the pusher can do with a margin: `segments` (k, 6) and `families` (f, 3, 3) of a `Problem`."""

    segments: FloatArray
    families: FloatArray


class Posing:
    """Makes the problems of one chain in one room; scene and controls are made once.

    Args:
        scene: An `open_scene` that is there already.
        controls: By margin, likewise.
        meridians: Of the stable set that controls are taken from.
    """

    def __init__(
        self,
        scene: Scene | None = None,
        controls: dict[float, Controls] | None = None,
        meridians: int = MERIDIANS,
    ) -> None:
        self._scene, self._meridians = scene, meridians
        self._controls = {} if controls is None else controls

    def __call__(self, scenario: Scenario, stable: StableSet, until: float = math.inf) -> Problem:
        """Return the compiled problem.

        Args:
            scenario: Its margin is a number.
            stable: The set to plan in.
            until: `time.perf_counter` at which it must be there.

        Raises:
            EmptyStableSetError: When no twist is stable for the pusher's drive.
            OutOfTimeError: When it takes too long.
        """
        scene, controls = self.scene(scenario, until), self.controls(scenario, stable)
        xmin, ymin, xmax, ymax = sampling_box(scenario)
        return Problem(
            scene_between(scene, scenario.clearance, scenario.start, scenario.goal.pose_chain),
            *controls,
            np.array(scenario.goal.pose_chain, dtype=np.float64),
            0.3 * math.hypot(xmax - xmin, ymax - ymin),
            make_objective(scenario, stable, controls.segments),
        )

    def scene(self, scenario: Scenario, until: float = math.inf) -> Scene:
        """Return the `open_scene` of the room."""
        if self._scene is None:
            self._scene = open_scene(scenario, until)
        return self._scene

    def controls(self, scenario: Scenario, stable: StableSet) -> Controls:
        """Return what the pusher can do with the scenario's margin.

        Raises:
            EmptyStableSetError: When no twist is stable for the pusher's drive.
        """
        margin = scenario.required_margin
        if margin not in self._controls:
            drive = scenario.chain.pusher.drive
            segments = control_segments(stable, drive, margin + MARGIN_FLOOR, self._meridians)
            self._controls[margin] = Controls(segments, steering_families(segments))
        return self._controls[margin]

    def in_room(self, scene: Scene) -> Posing:
        """Return it for another room: the controls are shared."""
        return Posing(scene, self._controls, self._meridians)


def build_problem(scenario: Scenario, stable: StableSet) -> Problem:
    """Return the compiled problem of a scenario alone; see `Posing`."""
    return Posing()(scenario, stable)


def scenario_scene(scenario: Scenario) -> Scene:
    """Return what moves and what stands still in a scenario, with the distances kept between start and goal."""
    scene = open_scene(scenario)
    return scene_between(scene, scenario.clearance, scenario.start, scenario.goal.pose_chain)


def open_scene(scenario: Scenario, until: float = math.inf) -> Scene:
    """Return what moves and what stands still; its clearance has `SLACK` more than the scenario's.

    Raises:
        OutOfTimeError: When it is not there at `until`, by `time.perf_counter`.
    """
    circles = [(*o.center, o.radius) for o in scenario.obstacles if isinstance(o, CircleObstacle)]
    polygons = [o.outline for o in scenario.obstacles if not isinstance(o, CircleObstacle)]
    return build_scene(
        scenario.chain, polygons, circles, _walls(scenario), scenario.clearance + SLACK, until=until
    )


def scene_between(scene: Scene, clearance: float, start: FloatArray, goal: FloatArray) -> Scene:
    """Return an `open_scene` with the distances that can be kept from a start to a goal (3,).

    The poses looked at have `SLACK` more than the clearance, or what start and goal have if that is less;
    those between have the clearance, less `CLEARANCE_ROOM` at most where start and goal leave no room to prove it.
    """
    gaps = [separation(scene, pose[0], pose[1], pose[2], clearance + SLACK) for pose in (start, goal)]
    looked_at, kept = kept_distances(min(gaps), clearance)
    return scene._replace(clearance=looked_at, kept=kept)


@no_refcount
def kept_distances(gap: float, clearance: float) -> tuple[float, float]:
    """Return what the poses looked at keep, and those between, where start and goal have the distance `gap`, m."""
    looked_at = max(gap, clearance) - ROUNDING
    # A sweep proves what lies between poses from what is seen at them: with no room between the two distances it
    # would need infinitely many.
    return looked_at, min(clearance, looked_at - CLEARANCE_ROOM)


@compiled
def scene_with_gap(scene: Scene, gap: float, clearance: float) -> Scene:
    """Return what `scene_between` does, in compiled code, where start and goal have the distance `gap`, m."""
    looked_at, kept = kept_distances(gap, clearance)
    return Scene(
        scene.body, scene.body_bound, scene.obstacles, scene.circles, scene.tree, scene.walls, looked_at, kept
    )


def _walls(scenario: Scenario) -> Box:
    area = scenario.workspace
    if area is None:
        return (-math.inf, -math.inf, math.inf, math.inf)
    return (area.xmin, area.ymin, area.xmax, area.ymax)


def sampling_box(scenario: Scenario) -> Box:
    """Return (xmin, ymin, xmax, ymax) to sample from: the workspace, or around everything with room to turn."""
    if scenario.workspace is not None:
        return _walls(scenario)
    points = [np.array([scenario.start[:2], scenario.goal.pose_chain[:2]])]
    for obstacle in scenario.obstacles:
        if isinstance(obstacle, CircleObstacle):
            points.append(obstacle.center + obstacle.radius * np.array([[-1.0, -1.0], [1.0, 1.0]]))
        else:
            points.append(obstacle.outline)
    corners = np.concatenate(points)
    room = 4.0 * body_reach(scenario) + 0.25 * float(np.ptp(corners, axis=0).max())
    low, high = corners.min(axis=0) - room, corners.max(axis=0) + room
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def body_reach(scenario: Scenario) -> float:
    """Return the distance from the chain frame's origin to the farthest point of all that moves, m."""
    return scenario.chain.reach
