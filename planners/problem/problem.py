"""How a push problem is made from a scenario and a stable set."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.core.collision import SLACK, Scene, separation
from pushplan.core.problem import Problem
from pushplan.planners.collision.scene import build_scene
from pushplan.planners.problem.controls import MARGIN_FLOOR, MERIDIANS, control_segments, steering_families
from pushplan.planners.problem.objective import make_objective
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

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
        """Return the problem.

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
    """Return the problem of a scenario alone; see `Posing`."""
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
    return scene.with_gap(min(gaps), clearance)


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
