"""Blended trajectories: they end on the goal, keep limits, margin and clearance, and save time."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from conftest import ChainMaker
from plans_of import push_of, timed
from timing.conftest import Planned, use_by_differences

from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Limits
from pushplan.planners.clearance import find_collision
from pushplan.planners.controls import control_segments, segment_ends
from pushplan.planners.timing.arc_limits import Bounds, arc_limits, motion_bounds
from pushplan.planners.timing.blending import FEW, Blend, blend_path
from pushplan.planners.timing.exact_timing import time_path
from pushplan.planners.timing.parts import corners_of
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import example_names
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.sim.kinematic import execute


def _set(scenario: Scenario) -> StableSet:
    return stable_set(scenario.chain, scenario.stability.set)


def _blend(scenario: Scenario, path: PushPath) -> Blend:
    return blend_path(scenario, path, _set(scenario), Bounds(scenario.chain.pusher.limits))


def _check(scenario: Scenario, path: PushPath, stable: StableSet, blend: Blend) -> None:
    trajectory, limits = blend.trajectory, scenario.chain.pusher.limits
    assert use_by_differences(trajectory, limits).max() <= 1.0 + 1e-4
    np.testing.assert_allclose(trajectory.poses[-1], path.end, atol=1e-9)
    pusher = replace(stable.chain.pusher, limits=replace(limits, contact="quasi-static"))
    pushed = push_of(replace(stable.chain, pusher=pusher), trajectory)
    execution = execute(pushed.scenario, pushed.segments, "ecof")
    assert execution.loss is None
    assert execution.margins.min() > scenario.required_margin
    assert max(execution.goal_error) < 3e-8  # the error of integration with other steps
    assert find_collision(scenario, trajectory.poses_at(np.arange(0.0, trajectory.duration, 2e-3))) is None
    stopped = trajectory.breaks[np.abs(trajectory.twists_at(trajectory.breaks)).max(axis=1) < 1e-9]
    assert len(stopped) == 2 + len(blend.stops)


@pytest.mark.parametrize("name", example_names())
def test_packaged_scenarios_take_nearly_the_time_without_stops(planned: Planned, name: str) -> None:
    scenario, path = planned(name)
    limits, stable = scenario.chain.pusher.limits, _set(scenario)
    blend = _blend(scenario, path)
    _check(scenario, path, stable, blend)
    exact = time_path(path, Bounds(limits))
    flow = sum(s / arc_limits(t, limits).speed for t, s in zip(path.twists, path.lengths, strict=True))
    per_stop = (exact.duration - flow) / (len(corners_of(path)) + 1.0)
    assert blend.trajectory.duration < flow + (2.0 + len(blend.stops)) * per_stop + 0.03 * flow
    assert len(blend.stops) <= 0.3 * len(corners_of(path))


def _free(
    make_chain: ChainMaker, template: Scenario, *arcs: tuple[float, float, float, float]
) -> tuple[Scenario, PushPath]:
    """Return a scenario without obstacles for two boxes, and a path with some twists and lengths."""
    chain = make_chain.boxes(2, size=(0.1, 0.2))
    values = np.array(arcs)
    twists = values[:, :3] / cost_rate(values[:, :3])[:, None]
    path = PushPath(np.array([0.2, -0.1, 0.4]), twists, values[:, 3])
    scenario = template.push_of(replace(template.load, chain=chain, start=path.start), template.goal)
    return replace(scenario, obstacles=(), workspace=None), path


TURNS = [(1.0, 0.0, 0.0, 0.4), (1.0, -0.1, 0.8, 0.3), (1.0, 0.1, -0.8, 0.3), (1.0, 0.0, 0.0, 0.3)]


def test_a_blend_interpolates_the_twists_of_two_arcs_linearly(make_chain: ChainMaker, planned: Planned) -> None:
    """The arcs are so long that their steps do not overlap: the phase-synchronised blend of two twists."""
    scenario, path = _free(make_chain, planned("one-box")[0], *TURNS)
    blend = _blend(scenario, path)
    assert not blend.stops
    twists = blend.trajectory.twists_at(np.linspace(0.0, blend.trajectory.duration, 3000))
    levels = [t * arc_limits(t, Limits()).speed for t in path.twists]
    levels = [np.zeros(3), *levels, np.zeros(3)]
    away = np.full(len(twists), np.inf)
    for a, b in pairwise(levels):
        share = np.clip((twists - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        away = np.minimum(away, np.linalg.norm(twists - a - share[:, None] * (b - a), axis=1))
    assert away.max() < 1e-9


def test_needles_at_cut_corners_change_the_path_or_force_a_stop(make_chain: ChainMaker, planned: Planned) -> None:
    """The blend would hit the needles, and the exact motion passes them by half a millimetre."""
    scenario, path = _free(make_chain, planned("one-box")[0], *TURNS, *TURNS[2:0:-1], *TURNS)
    pusher = replace(scenario.chain.pusher, limits=Limits(speed=0.4, angular_speed=2.0))
    scenario = scenario.with_load(chain=replace(scenario.chain, pusher=pusher))
    stable, limits = _set(scenario), scenario.chain.pusher.limits
    plain = _blend(scenario, path).trajectory
    exact = time_path(path, Bounds(limits))
    only_blended = shapely.difference(_swept(plain), shapely.buffer(_swept(exact), 7e-4))
    places = [part.representative_point() for part in shapely.get_parts(only_blended) if part.area > 1e-7]
    assert len(places) >= 2
    stops = []
    for some in [*([place] for place in places), places]:
        blocked = replace(
            scenario, obstacles=tuple(CircleObstacle(np.array([place.x, place.y]), 1e-4) for place in some)
        )
        assert find_collision(blocked, plain.poses) is not None
        assert find_collision(blocked, exact.poses) is None
        blend = _blend(blocked, path)
        _check(blocked, path, stable, blend)
        assert blend.trajectory.duration < exact.duration
        stops.append(len(blend.stops))
    assert min(stops) == 0


def _swept(trajectory: Trajectory) -> shapely.Geometry:
    """Return the area that pusher and boxes sweep over."""
    body = np.array([[-0.03, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.03, 0.1]])
    poses = trajectory.poses_at(np.arange(0.0, trajectory.duration, 5e-3))
    return shapely.union_all([shapely.Polygon(transform_points(pose, body)) for pose in poses])


@pytest.mark.parametrize("word", ["exact", "blended"])
def test_the_setting_selects_the_timing(planned: Planned, word: str) -> None:
    scenario, path = planned("two-crates")
    found = timed(replace(scenario, trajectory=word), path, "ecof", 50.0)
    exact = time_path(path, Bounds(scenario.chain.pusher.limits), 50.0)
    assert found.rate == 50.0
    assert np.sign(exact.duration - found.duration) == (word == "blended")


def test_hundreds_of_corners_get_stops_several_at_a_time(make_chain: ChainMaker, planned: Planned) -> None:
    scenario = _free(make_chain, planned("one-box")[0], *TURNS)[0].with_margin(0.02)
    stable, rng = _set(scenario), np.random.default_rng(1)
    ends = segment_ends(control_segments(stable, scenario.chain.pusher.drive, 0.021))
    twists = ends[rng.integers(0, len(ends), 2 * FEW)]
    path = PushPath(scenario.start, twists / cost_rate(twists)[:, None], rng.uniform(0.01, 0.1, len(twists)))
    blend = blend_path(scenario, path, stable, motion_bounds(scenario, stable))
    np.testing.assert_allclose(blend.trajectory.poses[-1], path.end, atol=1e-9)
    assert 0 < len(blend.stops) < 0.2 * len(twists)
