"""How fast a plan is driven: the segments of a plan with their trajectories, whatever its kind."""

from __future__ import annotations

from dataclasses import replace

from pushplan.core.collision import Scene
from pushplan.geometry.se2 import relative
from pushplan.planners.outcome import Segments
from pushplan.planners.timing.arc_limits import Bounds, motion_bounds
from pushplan.planners.timing.blending import blend_path
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.scenario.model import Scenario


def time_segments(
    scenario: Scenario,
    segments: Segments,
    rate: float = SAMPLE_RATE,
    stable_set: str | None = None,
    scene: Scene | None = None,
) -> Segments:
    """Return segments with their trajectories, within the limits of the pusher and, if asked for, of the contacts.

    Args:
        scenario: Chooses by `trajectory` whether the pusher stops at every corner of a push (`exact`) or at as few as
            possible (`blended`), and by `limits.contact` whether inertia may make a contact slip.
        segments: Of a plan: free of collision and stable.
        rate: Samples per second of the trajectories.
        stable_set: That they were planned in; None stands for the scenario's.
        scene: Of a single push, where it is there already.

    Raises:
        TimingError: When an arc cannot be timed within the limits.
    """
    return tuple(_timed(scenario, segment, rate, stable_set, scene) for segment in segments)


def _timed(scenario: Scenario, segment: Segment, rate: float, stable_set: str | None, scene: Scene | None) -> Segment:
    pusher = scenario.pusher
    if not segment.pushes or segment.load is None:
        alone = time_path(segment.path, Bounds(pusher.limits), rate)
        return replace(segment, trajectory=replace(alone, base=relative(pusher.plate_pose, pusher.base_pose)))
    problem, stable = segment.problem(scenario), segment.load.stable_set(stable_set)
    bounds = motion_bounds(problem, stable)
    if scenario.trajectory == "blended":
        timed: Trajectory = blend_path(problem, segment.contact_path, stable, bounds, rate, scene).trajectory
    else:
        timed = time_path(segment.contact_path, bounds, rate)
    own = segment.load.chain.pusher
    least = float(stable.margin(segment.contact_path.twists).min())
    return replace(segment, trajectory=replace(timed, base=own.base_pose).of_frame(own.plate_pose), min_margin=least)
