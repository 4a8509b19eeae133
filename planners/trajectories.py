"""From a planned path to the trajectory that its scenario asks for."""

from __future__ import annotations

from dataclasses import replace

from pushplan.planners.blending.blending import blend_path
from pushplan.planners.collision.separation import Scene
from pushplan.planners.timing.arc_limits import motion_bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet


def make_trajectory(
    scenario: Scenario,
    path: PushPath,
    stable: StableSet,
    rate: float = SAMPLE_RATE,
    scene: Scene | None = None,
) -> Trajectory:
    """Return a path timed within the limits of the pusher and, if asked for, of the contacts.

    Args:
        scenario: Chooses by `trajectory` whether the pusher stops at every corner (`exact`) or at as few as
            possible (`blended`), and by `limits.contact` whether inertia may make a contact slip.
        path: Constant-twist arcs, free of collision and stable.
        stable: The set that the path was planned in.
        rate: Samples per second of the trajectory.
        scene: The scenario's, where it is there already.

    Raises:
        TimingError: When an arc cannot be timed within the limits.
    """
    bounds = motion_bounds(scenario, stable)
    if scenario.trajectory == "blended":
        timed = blend_path(scenario, path, stable, bounds, rate, scene).trajectory
    else:
        timed = time_path(path, bounds, rate)
    return replace(timed, base=scenario.chain.pusher.base_pose)
