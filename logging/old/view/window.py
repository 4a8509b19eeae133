"""The rectangle of the floor that a picture of a run has to show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.logging.old.view.scene import PATH_SPACING, ghosts, obstacle_outline
from pushplan.mechanics.chain import Chain
from pushplan.plans.path import PushPath
from pushplan.plans.result import PlanResult
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

RIM = 0.03
"""Free rim around everything, as a share of the longer side."""

SMOOTHED_RATE = 10.0
"""Poses per second of a timed path in pictures."""


class Way(NamedTuple):
    """Points (k, 2) of a part of a path in the world, and whether the robot drives it alone."""

    points: FloatArray
    alone: bool


class Window(NamedTuple):
    """Sides of a rectangle in the world, m."""

    xmin: float
    ymin: float
    xmax: float
    ymax: float


def shown_path(plan: PlanResult | None) -> PushPath | None:
    """Return the planned path; without one, that which comes nearest to the goal, if there is any."""
    return None if plan is None else plan.path or plan.approximate_path


def path_points(plan: PlanResult | None) -> FloatArray:
    """Return points (k, 2) of the path to show in the world, none where there is no path."""
    path = shown_path(plan)
    return np.zeros((0, 2)) if path is None else path.sampled(PATH_SPACING)[:, :2]


def shown_ways(plan: PlanResult | None) -> list[Way]:
    """Return the parts of the path to show, one after the other; a single push is one part."""
    if plan is not None and plan.segments:
        paths = [(segment.robot_path, not segment.pushes) for segment in plan.segments]
        return [Way(path.sampled(PATH_SPACING)[:, :2], alone) for path, alone in paths]
    points = path_points(plan)
    return [Way(points, False)] if len(points) > 1 else []


def smoothed_times(trajectory: Trajectory) -> FloatArray:
    """Return the times (m,) at which a timed path is drawn, its end included, s."""
    return np.append(np.arange(0.0, trajectory.duration, 1.0 / SMOOTHED_RATE), trajectory.duration)


def window(scenario: Scenario, plan: PlanResult | None) -> Window:
    """Return the rectangle around workspace, obstacles, start, goal and everything that the chain passes."""
    chain = scenario.chain
    way = path_points(plan)
    points = [outline for outlines in ghosts(scenario).values() for outline in outlines]
    points += [obstacle_outline(obstacle) for obstacle in scenario.obstacles]
    reach = _reach(chain, plan)
    points += [way - reach, way + reach]
    if scenario.workspace is not None:
        points.append(scenario.workspace.outline)
    every = np.concatenate(points)
    low, high = every.min(axis=0), every.max(axis=0)
    rim = RIM * float((high - low).max())
    (xmin, ymin), (xmax, ymax) = low - rim, high + rim
    return Window(float(xmin), float(ymin), float(xmax), float(ymax))


def _reach(chain: Chain, plan: PlanResult | None) -> float:
    """Return how far anything that moves along the path is from it, about, m."""
    if plan is None or not any(segment.objects for segment in plan.segments):
        return chain.reach
    sizes = [float(np.hypot(*np.ptp(obj.outline, axis=0))) for obj in chain.objects]
    return max(float(np.linalg.norm(body.outline, axis=1).max()) for body in chain.carried) + max(sizes)
