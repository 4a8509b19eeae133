"""Blended timing of a path: the pusher does not stop where the path's twist changes.

The twist moves from one arc's to the next on smooth steps (`section`), which cuts the corners of the way a
little; the arcs' lengths are solved for anew so that the motion ends exactly where the path does. What comes
out is checked again. Where it touches something, the lengths are changed once more to keep away from it. Where
that does not help, or stability is lost, the pusher stops at the nearest corner after all, corner by corner, in
the worst case at every one: then it is the exact timing. The faster the pusher, the more of a corner is cut;
so where stops are needed, lower paces are tried, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pushplan.planners.blending.blend_search import Blend, BlendSearch
from pushplan.planners.blending.inset import inset_path
from pushplan.planners.blending.joining import corners_of
from pushplan.planners.collision.separation import Scene
from pushplan.planners.problem.problem import scenario_scene
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import SAMPLE_RATE
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet

LOWER_PACES = (0.5, 0.65, 0.8)
"""Shares of the top speeds that are tried where full speed needs stops; the lowest needs the fewest, if any."""


def blend_path(
    scenario: Scenario,
    path: PushPath,
    stable: StableSet,
    bounds: Bounds,
    rate: float = SAMPLE_RATE,
    scene: Scene | None = None,
) -> Blend:
    """Return the trajectory along a path that stops at few corners and takes no longer than the exact one.

    Args:
        scenario: What is in the way, and the margin to keep.
        path: Constant-twist arcs, free of collision and stable.
        stable: The set whose margin has to exceed `scenario.required_margin`.
        bounds: What limits the motion.
        rate: Samples per second of the trajectory.
        scene: The scenario's, where it is there already.

    Raises:
        TimingError: When an arc cannot be timed.
    """
    exact = time_path(path, bounds, rate)
    if not corners_of(path):
        return Blend(exact, frozenset())
    scene = scenario_scene(scenario) if scene is None else scene
    inset = inset_path(path, stable, scenario.required_margin, bounds)

    def paced(pace: float) -> BlendSearch:
        return BlendSearch(scenario, scene, inset.path, path.end, stable, rate, bounds._replace(pace=pace))

    full = paced(1.0)
    blend = full.blended(exact.duration, stops=0)
    if blend is None:
        blend = _soonest([*map(paced, LOWER_PACES), full], exact.duration)
    if blend is None:
        return Blend(exact, corners_of(path))
    arcs = inset.owner[blend.trajectory.arc.astype(np.int64)].astype(np.float64)
    stops = frozenset(int(inset.owner[i]) for i in blend.stops)
    return Blend(replace(blend.trajectory, arc=arcs), stops)


def _soonest(searches: list[BlendSearch], within: float) -> Blend | None:
    """The blend over soonest; None when none takes less than `within` (s)."""
    best: Blend | None = None
    for search in searches:
        best = search.blended(within if best is None else best.trajectory.duration) or best
    return best
