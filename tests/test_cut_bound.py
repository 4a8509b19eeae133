"""Bounds by cuts: no better path beats them, cuts are crossed in order, chains are free where they are said to be."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import there

from pushplan.bench.random_problems import generate
from pushplan.bench.schema import ProblemParameters
from pushplan.core.problem import find_words
from pushplan.geometry import se2
from pushplan.planner import plan
from pushplan.planners.controls import steering_families
from pushplan.planners.infeasible.bounds import lower_bound, time_bound
from pushplan.planners.infeasible.cut_bound import _highest, _Parts, cut_bound
from pushplan.planners.infeasible.turn_bound import TRAVEL
from pushplan.planners.infeasible.ways import find_cuts
from pushplan.planners.problem import Posing
from pushplan.plans.path import PushPath
from pushplan.scenario.file import example_names, load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

NAMES = [name for name in example_names() if name != "free-space"]


def of_travel(scenario: Scenario) -> Scenario:
    return scenario.with_planner(cost="travel", arc_price=0.0).with_margin(0.01)


def paths(scenario: Scenario) -> tuple[PushPath, PushPath]:
    """A path that is found soon, and one that is found later."""
    soon = plan(scenario, seed=3, time_limit=60.0, iterations=20_000, first=True)
    later = plan(scenario, seed=1, time_limit=60.0, iterations=8_000)
    return there(soon.path), there(later.path)


def segments_of(scenario: Scenario) -> FloatArray:
    return Posing().controls(scenario, scenario.stable_set()).segments


def in_clutter(seed: int) -> Scenario:
    """One or two objects among some obstacles, with a way past them."""
    parameters = ProblemParameters(objects=(1, 2), obstacles=(6, 10))
    return of_travel(scenario_from_text(generate(parameters, seed), "random"))


def costates_in_circle(rng: np.random.Generator, count: int) -> FloatArray:
    angles, lengths = rng.uniform(0.0, 2.0 * math.pi, count), rng.uniform(0.7, 0.999, count)
    return np.asarray(lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]))


@pytest.mark.parametrize("which", [*NAMES, *range(3)])
def test_no_better_path_beats_what_any_costates_prove(which: str | int) -> None:
    scenario = in_clutter(which) if isinstance(which, int) else of_travel(load_scenario(which))
    rng, (known, better), segments = np.random.default_rng(3), paths(scenario), segments_of(scenario)
    cuts = find_cuts(scenario, known, known.cost)
    assert better.cost < known.cost
    parts = _Parts(scenario, segments, cuts, known.cost, TRAVEL)
    ahead = known.end[None, :2] - known.start[None, :2]
    toward = np.tile(0.99 * ahead / np.linalg.norm(ahead), (len(cuts) + 1, 1))
    for _ in range(6):
        for costates in (toward, costates_in_circle(rng, len(toward)), 0.5 * toward):
            assert parts.value(costates)[0] <= better.cost + 1e-9
            parts.leave_out(costates)
    assert cut_bound(scenario, segments, known, known.cost, 0.0) <= better.cost


@pytest.mark.parametrize("name", NAMES)
def test_paths_cross_the_cuts_in_order(name: str) -> None:
    scenario = of_travel(load_scenario(name))
    _, path = paths(scenario)
    cuts = find_cuts(scenario, path, path.cost)
    assert cuts
    poses, last = path.sampled(1e-3), -1
    for cut in cuts:
        first = int(np.argmax(poses[:, :2] @ cut.normal >= cut.level))
        assert first > last
        last = first


@pytest.mark.parametrize("name", ["hook", "feet", "two-crates", "carts"])
def test_chains_are_said_to_be_free_wherever_they_are(name: str) -> None:
    """And at most where they cut into something by no more than they move within a bin."""
    scenario, rng = of_travel(load_scenario(name)), np.random.default_rng(1)
    known, _ = paths(scenario)
    parts = _Parts(scenario, segments_of(scenario), find_cuts(scenario, known, known.cost), known.cost, TRAVEL)
    stands = shapely.union_all([shapely.buffer(o.core, o.radius) for o in scenario.obstacles])
    tried = []
    for _ in range(400):
        k = int(rng.integers(len(parts.cuts)))
        sections = parts.cuts[k].sections
        offset, heading = rng.uniform(sections.min(), sections.max()), rng.uniform(0.0, 2.0 * math.pi)
        if not ((sections[:, 0] < offset) & (offset < sections[:, 1])).any():
            continue
        pose = np.append(parts.cuts[k].at(np.array([offset]))[0], heading)
        chain = [shapely.Polygon(se2.transform_points(pose, body.outline)) for body in scenario.chain.bodies]
        corners, area = shapely.get_coordinates(chain), there(scenario.workspace)
        inside = (corners > [area.xmin, area.ymin]).all() and (corners < [area.xmax, area.ymax]).all()
        is_free = inside and min(shapely.distance(chain, stands)) > scenario.clearance
        beside = np.argsort(np.abs(se2.wrap_angle(parts.edges - heading)))[:2]
        said = ((parts.free[k][beside, :, 0] < offset) & (offset < parts.free[k][beside, :, 1])).any(axis=1)
        assert said.all() or not is_free
        tried.append((is_free, bool(said.all())))
    free, said = np.array(tried).T
    assert free.any()
    assert not said.all()
    assert (free == said).mean() > 0.85


@pytest.mark.parametrize(
    ("name", "cost", "gain"),
    [("hook", "travel", 1.015), ("feet", "travel", 1.04), ("one-box", "travel", 1.005), ("hook", "time", 1.01)],
)
def test_cuts_prove_more_than_turns_and_ways_around_alone(name: str, cost: str, gain: float) -> None:
    scenario = load_scenario(name).with_planner(cost=cost, arc_price=0.0)
    found = plan(scenario, seed=1, time_limit=60.0, iterations=20_000)
    segments, known = segments_of(scenario.with_margin(found.segments[0].margin)), there(found.path).cost
    bound, known = (time_bound, there(found.duration)) if cost == "time" else (lower_bound, known)
    assert gain * bound(scenario, segments) < there(found.lower_bound) < known


CAR = np.array([[1.0, 0.0, -2.0, 1.0, 0.0, 2.0]])
"""Dubins' car: all that it does is straight ahead, or turns with 0.5 m."""


def test_no_word_of_a_car_beats_what_costates_prove() -> None:
    """And those that are found nearly reach it where no loop is needed."""
    scenario, rng, shares = load_scenario("free-space"), np.random.default_rng(2), []
    for pose in rng.uniform([-3.0, -3.0, -3.0], [3.0, 3.0, 3.0], (20, 3)):
        posed = scenario.with_goal(replace(scenario.goal, pose_chain=pose))
        word = float(find_words(steering_families(CAR)[0], posed.start, pose)[:, 0].min())
        parts = _Parts(posed, CAR, [], 2.0 * word, TRAVEL)
        for costates in costates_in_circle(rng, 20):
            assert parts.value(costates[None])[0] <= word + 1e-9
        shares.append(_highest(parts, 0.99 * pose[None, :2] / np.linalg.norm(pose[:2]), 0.0)[0] / word)
    assert max(shares) <= 1.0 + 1e-9
    assert np.quantile(shares, 0.8) > 0.97
