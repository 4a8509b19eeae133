"""The costs to choose: objectives agree with what they stand for, and each planner's path is best by its own."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from plain import ARC_PRICE, load_plain

from pushplan.core.improve import objective_value
from pushplan.core.problem import Objective, arc_value, rest_to_rest_time
from pushplan.planners.planner import plan
from pushplan.planners.problem import build_problem
from pushplan.planners.timing.arc_limits import ArcLimits, arc_limits
from pushplan.planners.timing.exact_timing import rest_to_rest
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray

ITERATIONS = 10_000


def ranked(cost: str, weight: float = 1.0, trajectory: str = "exact") -> Scenario:
    scenario = load_plain("two-crates")
    settings = replace(scenario.planner, cost=cost, weight=weight, seed=6)
    return replace(scenario, planner=settings, trajectory=trajectory)


@cache
def planned(cost: str, weight: float = 1.0, trajectory: str = "exact") -> Plan:
    result = plan(ranked(cost, weight, trajectory), time_limit=60.0, iterations=ITERATIONS)
    assert result.solved, result.reason
    return result


def prices_of(scenario: Scenario) -> Objective:
    return build_problem(scenario, stable_set(scenario.chain)).objective


def path_price(objective: Objective, path: PushPath) -> float:
    return float(objective_value(objective, np.column_stack([path.twists, path.lengths])))


def rate(objective: Objective, twist: FloatArray, length: float = 1.0) -> float:
    return float(arc_value(objective, twist[0], twist[1], twist[2], length))


def mean_margin(scenario: Scenario, path: PushPath) -> float:
    return float(stable_set(scenario.chain).margin(path.twists) @ path.lengths / path.cost)


def test_the_rest_to_rest_time_is_ruckigs() -> None:
    """Lengths from a micrometre to metres: every phase of the profile may be missing."""
    rng = np.random.default_rng(2)
    for _ in range(300):
        length, speed, acceleration, jerk = 10.0 ** rng.uniform([-6, -1.5, -1.5, -1], [1, 0.5, 0.5, 2])
        profile = rest_to_rest(length, ArcLimits(speed, acceleration, acceleration, jerk))
        found = rest_to_rest_time(length, speed, acceleration, jerk)
        assert found == pytest.approx(profile.duration, rel=1e-9)


def test_the_price_of_time_is_the_duration_of_the_exact_trajectory() -> None:
    result, objective = planned("time"), prices_of(ranked("time"))
    assert result.path is not None
    assert result.trajectory is not None
    for_arcs = objective.per_arc * len(result.path.lengths)
    assert path_price(objective, result.path) - for_arcs == pytest.approx(
        result.trajectory.duration, rel=0.02
    )


def test_ranking_by_time_is_faster_and_by_travel_shorter() -> None:
    fast, short = planned("time"), planned("travel")
    assert fast.trajectory is not None
    assert short.trajectory is not None
    assert fast.path is not None
    assert short.path is not None
    assert fast.trajectory.duration < 0.98 * short.trajectory.duration
    assert short.path.cost < fast.path.cost


def test_ranking_by_margin_is_safer_the_more_the_higher_its_weight() -> None:
    paths = [planned("travel").path, planned("margin", 1.0).path, planned("margin", 20.0).path]
    scenario = ranked("margin")
    means = [mean_margin(scenario, path) for path in paths if path is not None]
    assert len(means) == 3
    assert means[0] < means[1] < means[2]


def test_prices_of_the_margin_follow_from_the_margin() -> None:
    scenario = ranked("margin", 3.0)
    stable = stable_set(scenario.chain)
    problem = build_problem(scenario, stable)
    rng = np.random.default_rng(4)
    rows = problem.segments[rng.integers(len(problem.segments), size=200)]
    share = rng.uniform(size=(200, 1))
    twists = (1.0 - share) * rows[:, :3] + share * rows[:, 3:]
    best = stable.peaks[1].max()
    found = np.array([rate(problem.objective, twist) for twist in twists]) - 4.0 * ARC_PRICE
    expected = 1.0 + 3.0 * (1.0 - stable.margin(twists) / best)
    assert np.abs(found - expected).max() < 0.3  # the table is coarse where the margin has a kink
    assert np.abs(found - expected).mean() < 0.03
    assert found.min() >= problem.objective.lowest
    assert found.max() <= 4.0 + 0.3


@pytest.mark.parametrize("trajectory", ["exact", "blended"])
def test_the_lowest_price_is_a_bound(trajectory: str) -> None:
    """The search prunes by it: no arc may be cheaper."""
    scenario = ranked("time", trajectory=trajectory)
    problem = build_problem(scenario, stable_set(scenario.chain))
    limits = scenario.chain.pusher.limits
    rng = np.random.default_rng(8)
    for row in problem.segments[rng.integers(len(problem.segments), size=100)]:
        for twist in (row[:3], row[3:]):
            unit = twist / (np.hypot(*twist[:2]) + 0.1 * abs(twist[2]))
            length = 10.0 ** rng.uniform(-3, 0.5)
            assert rate(problem.objective, unit, length) >= problem.objective.lowest * length
            assert arc_limits(unit, limits).speed <= 1.0 / problem.objective.lowest * (1.0 + 1e-2)


@pytest.mark.parametrize("name", ["one-box", "two-crates", "asymmetric"])
def test_the_soonest_of_both_is_taken_so_time_is_never_slower_than_travel(name: str) -> None:
    """Paths are ranked by travel first, in half of the iterations, and what is best then is driven as well."""
    scenario = load_scenario(name)
    fast = plan(scenario, seed=1, time_limit=120.0, iterations=8000)
    short = plan(scenario, seed=1, time_limit=120.0, iterations=4000, cost="travel")
    assert (fast.objective, short.objective) == ("time", "travel")
    assert fast.trajectory is not None
    assert short.trajectory is not None
    assert fast.trajectory.duration <= short.trajectory.duration + 1e-9


@pytest.mark.parametrize("cost", ["travel", "time", "margin"])
def test_an_arc_is_paid_for_whatever_the_cost(cost: str) -> None:
    """Per arc: metres of travel, the time that these take at top speed, or what they cost at the dearest twist."""
    scenario = ranked(cost, 3.0)
    dear = replace(scenario, planner=replace(scenario.planner, arc_price=ARC_PRICE + 0.05))
    twist = np.array([1.0, 0.0, 0.0])
    more = rate(prices_of(dear), twist) - rate(prices_of(scenario), twist)
    factor = {"travel": 1.0, "time": 1.0 / scenario.chain.pusher.limits.both("speed")[1], "margin": 4.0}[cost]
    assert more == pytest.approx(0.05 * factor)
