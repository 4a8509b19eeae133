"""Push problems from a scenario and a stable set, and the objectives that rank paths."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pushplan.core.collision import SLACK, Scene, Shapes, separations
from pushplan.core.problem import (
    MARGIN,
    PASSING,
    REST_TO_REST,
    TRAVEL,
    Objective,
    Problem,
    connect,
    poses_along,
    reach,
)
from pushplan.geometry.convex import convex_pieces
from pushplan.geometry.se2 import compose, relative
from pushplan.mechanics.sphere import angles_of, twists_at
from pushplan.planners.controls import MARGIN_FLOOR, MERIDIANS, control_segments, steering_families
from pushplan.planners.scene import build_scene, standing_shapes
from pushplan.planners.timing.arc_limits import Bounds, arc_limits, contact_limits_of, motion_bounds
from pushplan.planners.timing.profiles import ArcLimits, step_windows, times_from_rest_to_rest
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import BoolArray, FloatArray

GRIDS = {"margin": 129, "time": 33}
"""Number of longitudes and of latitudes in the table; fewer if an entry takes longer to compute."""

SHORT = 0.1
"""Share of the ramps' length from which the approximate time of an arc is accurate to 4 %."""


def travel_objective(per_arc: float) -> Objective:
    """Return the objective of travel: length plus `per_arc` (m) for each arc."""
    return Objective(TRAVEL, per_arc, 1.0, 1.0, np.array([0.0, 1.0, 0.0, 1.0]), np.zeros((2, 2, 3)))


def make_objective(scenario: Scenario, stable: StableSet, segments: FloatArray) -> Objective:
    """Return the objective of a scenario.

    Args:
        scenario: Scenario with `planner.cost`, `planner.weight` and the timing of the path.
        stable: Stable set of the plan.
        segments: (k, 6) controls, which the table covers.
    """
    cost = scenario.planner.cost
    if cost == "travel":
        return travel_objective(scenario.planner.arc_price)
    length = scenario.chain.characteristic_length
    box, twists = _grid(segments, length, GRIDS[cost])
    table = np.zeros((*twists.shape[:2], 3))
    if cost == "margin":
        margins = stable.margin(twists.reshape(-1, 3)).reshape(twists.shape[:2])
        table[..., 0] = 1.0 + scenario.planner.weight * (1.0 - margins / margins.max())
        per_arc = scenario.planner.arc_price * (1.0 + scenario.planner.weight)
        return Objective(MARGIN, per_arc, float(table[..., 0].min()), length, box, table)
    bounds = motion_bounds(scenario, stable)
    blended = scenario.trajectory == "blended"
    table[:] = _timing(twists.reshape(-1, 3), bounds, lone=not blended).reshape(table.shape)
    per_arc = scenario.planner.arc_price / scenario.chain.pusher.limits.both("speed")[1]
    return Objective(
        PASSING if blended else REST_TO_REST, per_arc, 1.0 / float(table[..., 0].max()), length, box, table
    )


def _grid(segments: FloatArray, length: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the range of angles (4,) of all controls, and a grid of twists (n, n, 3) with a cost rate of 1."""
    longitude, latitude = angles_of(segments.reshape(-1, 3), length)
    pad = 1e-3
    box = np.array([longitude.min() - pad, longitude.max() + pad, latitude.min() - pad, latitude.max() + pad])
    longitudes, latitudes = (np.linspace(low, high, count) for low, high in box.reshape(2, 2))
    twists = twists_at(longitudes[:, None], latitudes, length)
    return box, twists / cost_rate(twists)[..., None]


def _timing(twists: FloatArray, bounds: Bounds, lone: bool) -> FloatArray:
    """Return top speed, time to it from rest, and exponent of the length (k, 3) for arcs along twists (k, 3).

    The time of an arc too short for its top speed is a power of its length, if it is driven alone. The exponent makes
    this equal to Ruckig's duration at `SHORT` times the shortest length that reaches full speed.
    """
    length = np.full(len(twists), 0.3)  # m, of a typical arc
    found, able = contact_limits_of(twists, length, bounds)
    free = arc_limits(twists, bounds.limits)
    # If the contacts leave no room for inertia, use a hundredth of the pusher's limits.
    speed = np.where(able, found.speed, 0.01 * free.speed)
    rate = np.where(able, np.minimum(found.acceleration, found.deceleration), 0.01 * free.acceleration)
    rise = step_windows(np.stack([rate / speed, found.jerk / speed], axis=1)).sum(axis=1)
    power = np.ones(len(twists))
    if lone:
        times = times_from_rest_to_rest(SHORT * speed * rise, ArcLimits(speed, rate, rate, found.jerk))[:, 0]
        power = np.log(times / (2.0 * rise)) / np.log(SHORT)
    return np.stack([speed, rise, power], axis=1)


LONGEST = 0.225
"""Maximum length of a sampled arc, as a share of the room's diagonal. With 0.3, OMPL's RRTs meet later."""

Box = tuple[float, float, float, float]


class Controls(NamedTuple):
    """Controls of the pusher for a margin: `segments` (k, 6) and `families` (f, 3, 3) of a `Problem`."""

    segments: FloatArray
    families: FloatArray


class Posing:
    """Factory of the problems of one chain in one room. Scene and controls are cached.

    Args:
        scene: An existing `open_scene`; None builds one.
        controls: Existing controls, by margin.
        meridians: Number of meridians of the stable set for the controls.
    """

    def __init__(
        self, scene: Scene | None = None, controls: dict[float, Controls] | None = None, meridians: int = MERIDIANS
    ) -> None:
        self._scene, self._meridians = scene, meridians
        self._controls = {} if controls is None else controls

    def __call__(self, scenario: Scenario, stable: StableSet, until: float = math.inf) -> Problem:
        """Return the problem of a scenario.

        Args:
            scenario: Scenario with a number as margin.
            stable: Stable set to plan in.
            until: Value of `time.perf_counter` by which the problem must be built.

        Raises:
            EmptyStableSetError: If no twist is stable for the pusher's drive.
            OutOfTimeError: If building it takes too long.
        """
        scene, controls = self.scene(scenario, until), self.controls(scenario, stable)
        xmin, ymin, xmax, ymax = sampling_box(scenario)
        return Problem(
            scene_between(scene, scenario.clearance, scenario.start, scenario.goal.pose_chain),
            *controls,
            np.array(scenario.goal.pose_chain, dtype=np.float64),
            LONGEST * math.hypot(xmax - xmin, ymax - ymin),
            make_objective(scenario, stable, controls.segments),
        )

    def scene(self, scenario: Scenario, until: float = math.inf) -> Scene:
        """Return the `open_scene` of the room."""
        if self._scene is None:
            self._scene = open_scene(scenario, until)
        return self._scene

    def controls(self, scenario: Scenario, stable: StableSet) -> Controls:
        """Return the pusher's controls for the scenario's margin; cached.

        Raises:
            EmptyStableSetError: If no twist is stable for the pusher's drive.
        """
        margin = scenario.required_margin
        if margin not in self._controls:
            drive = scenario.chain.pusher.drive
            segments = control_segments(stable, drive, margin + MARGIN_FLOOR, self._meridians)
            self._controls[margin] = Controls(segments, steering_families(segments))
        return self._controls[margin]

    def in_room(self, scene: Scene) -> Posing:
        """Return the factory for another room, with shared controls."""
        return Posing(scene, self._controls, self._meridians)


def build_problem(scenario: Scenario, stable: StableSet) -> Problem:
    """Return the problem of a single scenario; see `Posing`."""
    return Posing()(scenario, stable)


def scenario_scene(scenario: Scenario) -> Scene:
    """Return the collision scene of a scenario, with the distances that can be kept from start to goal."""
    scene = open_scene(scenario)
    return scene_between(scene, scenario.clearance, scenario.start, scenario.goal.pose_chain)


def open_scene(scenario: Scenario, until: float = math.inf) -> Scene:
    """Return the collision scene of a scenario, with `SLACK` added to its clearance.

    Raises:
        OutOfTimeError: If it is not built by `until`, in terms of `time.perf_counter`.
    """
    polygons, discs = obstacles_of(scenario)
    return build_scene(scenario.chain, polygons, discs, walls_of(scenario), scenario.clearance + SLACK, until=until)


def obstacles_of(scenario: Scenario) -> tuple[list[FloatArray], FloatArray]:
    """Return the outlines (k, 2) of polygonal obstacles, and (x, y, radius) (c, 3) of round ones, m."""
    circles = [(*o.center, o.radius) for o in scenario.obstacles if isinstance(o, CircleObstacle)]
    polygons = [o.outline for o in scenario.obstacles if not isinstance(o, CircleObstacle)]
    return polygons, np.array(circles, dtype=np.float64).reshape(-1, 3)


def standing_in(scenario: Scenario) -> tuple[Shapes, FloatArray, FloatArray, FloatArray]:
    """Return the obstacles and walls of a scenario as arguments of `Scene.with_obstacles`."""
    polygons, discs = obstacles_of(scenario)
    return *standing_shapes(list(convex_pieces(polygons)), discs), np.array(walls_of(scenario))


def scene_between(scene: Scene, clearance: float, start: FloatArray, goal: FloatArray) -> Scene:
    """Return an `open_scene` with the distances that can be kept from a start to a goal (3,).

    Checked poses keep the clearance plus `SLACK`, or the distance of start and goal if that is less. Poses between
    them keep the clearance, reduced by at most `CLEARANCE_ROOM` if start and goal are too near to prove it.
    """
    gaps = separations(scene, np.array([start, goal]), clearance + SLACK)
    return scene.with_gap(float(gaps.min()), clearance)


def walls_of(scenario: Scenario) -> Box:
    """Return (xmin, ymin, xmax, ymax) of the workspace; infinite if there is none."""
    area = scenario.workspace
    if area is None:
        return (-math.inf, -math.inf, math.inf, math.inf)
    return (area.xmin, area.ymin, area.xmax, area.ymax)


def sampling_box(scenario: Scenario) -> Box:
    """Return (xmin, ymin, xmax, ymax) for sampling: the workspace, or a box around everything with room to turn."""
    if scenario.workspace is not None:
        return walls_of(scenario)
    ends = np.array([scenario.start[:2], scenario.goal.pose_chain[:2]])
    corners = np.concatenate([ends, *(obstacle.box for obstacle in scenario.obstacles)])
    room = 4.0 * scenario.chain.reach + 0.25 * float(np.ptp(corners, axis=0).max())
    low, high = corners.min(axis=0) - room, corners.max(axis=0) + room
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def rejoin(
    scene: Scene,
    families: FloatArray,
    clearance: float,
    stable: Callable[[FloatArray], BoolArray],
    path: PushPath,
    start: FloatArray,
    goal: FloatArray,
) -> FloatArray | None:
    """Return the arcs (k, 4) of the cheapest steering path onto an earlier path and its rest; None if none is free.

    The rest is moved rigidly so that it ends at the goal, which can differ from the path's end.

    Args:
        scene: An `open_scene`.
        families: (f, 3, 3) left, straight and right twists.
        clearance: Clearance, m.
        stable: Returns which twists (k, 3) have the required margin.
        path: The earlier path.
        start: (3,) start pose of the chain frame in the world.
        goal: (3,) goal pose of the chain frame in the world.
    """
    s = np.unique(np.append(np.linspace(0.0, path.cost, 24), np.cumsum(path.lengths)))
    onto = compose(goal, relative(path.end, path.poses_at(s)))
    words = reach(scene, families, start[None], onto, clearance)[0]
    between = scene_between(scene, clearance, start, goal)
    for k in np.argsort(words + path.cost - s)[:4]:  # check only a few for collisions, cheapest first
        if words[k] == math.inf:
            break
        rest = _rest(path, float(s[k]))
        if len(rest) and not (stable(rest[:, :3]).all() and poses_along(between, onto[k], rest)[1] == len(rest)):
            continue
        _, _, word = connect(between, families, start, onto[k])
        if word is not None:
            return np.concatenate([word, rest])
    return None


def _rest(path: PushPath, s: float) -> FloatArray:
    """Return the remaining arcs (k, 4) of a path after a cost `s`."""
    ends = np.cumsum(path.lengths)
    left = np.minimum(path.lengths, ends - s)
    ahead = left > 1e-9
    return np.column_stack([path.twists, left])[ahead]
