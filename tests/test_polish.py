"""Costs and shortening: costs have their stated meaning, and paths reach the result of a convex optimiser."""

import math
import runpy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.optimize
from conftest import there
from plans_of import load_plain

import pushplan
from pushplan.core.improve import objective_value, shorten, vary
from pushplan.core.problem import Objective, Problem
from pushplan.geometry import se2
from pushplan.planner import plan
from pushplan.planners.clearance import find_collision
from pushplan.planners.problem import build_problem, sampling_box, travel_objective
from pushplan.planners.search.planners import Auto
from pushplan.planners.search.search import Search
from pushplan.planners.search.session import Session, StopRule
from pushplan.planners.timing.arc_limits import arc_limits, contact_limits, motion_bounds
from pushplan.planners.timing.profiles import rest_to_rest
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.plan import Plan
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray

NAMES = ["free-space", "carts", "narrow-gap"]


def _posed(name: str) -> tuple[Scenario, Problem]:
    scenario = load_plain(name).with_margin(0.02 if name == "carts" else 0.0)
    return scenario, build_problem(scenario, stable_set(scenario.chain, scenario.stability.set))


def _first_path(scenario: Scenario, problem: Problem, seed: int) -> FloatArray:
    session = Session(problem, scenario.start, StopRule(60.0, first=True), seed)
    if not session.finished:
        Search(session, Auto, sampling_box(scenario), scenario.chain.reach).run()
    return there(session.best.arcs)


def _random(seed: int) -> np.ndarray:
    return np.array([seed], dtype=np.uint64)


def assert_exact_stable_and_free(scenario: Scenario, problem: Problem, path: FloatArray) -> None:
    done = PushPath(scenario.start, path[:, :3], path[:, 3])
    assert max(se2.pose_error(done.end, problem.goal)) < 1e-9
    assert (path[:, 3] >= 0.0).all()
    stable = stable_set(scenario.chain, scenario.stability.set)
    assert stable.margin(path[:, :3]).min() > scenario.required_margin
    assert find_collision(scenario, done.sampled(0.002)) is None


@pytest.mark.parametrize("name", NAMES)
def test_shortened_paths_cost_no_more_have_fewer_arcs_and_stay_free_and_stable(name: str) -> None:
    """Every arc of a path is cut in three; if arcs have a cost, shortening merges them again."""
    scenario, problem = _posed(name)
    problem = problem.with_objective(travel_objective(0.05))
    path, state = _first_path(scenario, problem, 3), _random(5)
    cut = np.repeat(path, 3, axis=0) * [1.0, 1.0, 1.0, 1.0 / 3.0]
    now, price, left_out, cheaper = cut, objective_value(problem.objective, cut), 0, 0
    for _ in range(1500):
        before, now = len(now), vary(problem, scenario.start, now, state)
        was, price = price, objective_value(problem.objective, now)
        assert len(now) >= before - 1
        assert price <= was
        cheaper += price < was
        if len(now) < before:
            left_out += 1
            assert price < was
            assert_exact_stable_and_free(scenario, problem, now)
    assert_exact_stable_and_free(scenario, problem, now)
    assert cheaper > left_out + 10
    assert left_out > len(path)
    assert len(now) < len(cut) - len(path)


def test_shortening_finds_the_optimum_of_the_free_space() -> None:
    scenario, problem = _posed("free-space")
    costs = [
        shorten(problem, scenario.start, _first_path(scenario, problem, seed), _random(seed), 40_000)
        for seed in (1, 2, 3)
    ]
    values = [objective_value(problem.objective, path) for path in costs]
    assert max(values) < 1.003 * min(values)
    assert min(values) <= 1.002 * _optimum(problem, scenario.start, costs[int(np.argmin(values))])


def _optimum(problem: Problem, start: FloatArray, path: FloatArray) -> float:
    """Return the cost after an independent optimiser (SLSQP) has changed the lengths and twists of a path's arcs."""
    segments = problem.segments
    at = [_place(segments, twist) for twist in path[:, :3]]

    def arcs(z: FloatArray) -> FloatArray:
        i, b, lengths = np.split(z, 3)
        low = np.clip(i.astype(int), 0, len(segments) - 2)
        part = (i - low)[:, None]
        ends = (1.0 - part) * segments[low] + part * segments[low + 1]
        twists = (1.0 - b)[:, None] * ends[:, :3] + b[:, None] * ends[:, 3:]
        twists /= (np.hypot(twists[:, 0], twists[:, 1]) + 0.1 * np.abs(twists[:, 2]))[:, None]
        return np.column_stack([twists, lengths])

    def missing(z: FloatArray) -> FloatArray:
        pose = start
        for arc in arcs(z):
            pose = se2.compose(pose, se2.exp(arc[:3] * arc[3]))
        gap = pose - problem.goal
        return np.array([gap[0], gap[1], math.remainder(gap[2], 2.0 * math.pi)])

    first = np.concatenate([[a for a, _ in at], [b for _, b in at], path[:, 3]])
    n = len(path)
    bounds = [(0.0, len(segments) - 1.0)] * n + [(0.0, 1.0)] * n + [(0.0, 5.0)] * n
    closed: Any = {"type": "eq", "fun": missing}
    found: Any = scipy.optimize.minimize(  # type: ignore[call-overload]
        lambda z: float(z[2 * n :].sum()), first, method="SLSQP", bounds=bounds, constraints=[closed]
    )
    assert np.abs(missing(found.x)).max() < 1e-6
    return float(found.fun) + n * problem.objective.per_arc


def _place(segments: FloatArray, twist: FloatArray) -> tuple[float, float]:
    """Return segment (fractional) and share of a twist on it, by brute force."""
    shares = np.linspace(0.0, 1.0, 2001)
    along = (1.0 - shares)[:, None, None] * segments[:, :3] + shares[:, None, None] * segments[:, 3:]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    b, i = np.unravel_index(np.argmax(along @ (twist / np.linalg.norm(twist))), along.shape[:2])
    return float(i), float(shares[b])


ITERATIONS = 3_000


def ranked(cost: str, weight: float = 1.0, trajectory: str = "exact") -> Scenario:
    scenario = load_plain("two-crates").with_planner(cost=cost, weight=weight, seed=1)
    return replace(scenario, trajectory=trajectory)


@cache
def planned(cost: str, weight: float = 1.0, trajectory: str = "exact") -> Plan:
    result = plan(ranked(cost, weight, trajectory), time_limit=60.0, iterations=ITERATIONS)
    assert result.solved, result.reason
    return result


def rate(objective: Objective, twist: FloatArray, length: float = 1.0) -> float:
    return objective_value(objective, np.append(twist, length)[None])


def test_the_time_of_a_single_arc_is_that_of_ruckig() -> None:
    scenario = ranked("time")
    stable = stable_set(scenario.chain)
    problem, bounds = build_problem(scenario, stable), motion_bounds(scenario, stable)
    twists = problem.segments[:, :3] / cost_rate(problem.segments[:, :3])[:, None]
    for twist in twists[:: len(twists) // 5]:
        limits = contact_limits(twist, 0.3, bounds)
        slower = min(limits.acceleration, limits.deceleration)
        for length in (0.02, 0.1, 0.5, 2.0):
            profile = rest_to_rest(length, limits._replace(acceleration=slower, deceleration=slower))
            found = rate(problem.objective, twist, length) - problem.objective.per_arc
            assert found == pytest.approx(profile.duration, rel=0.05)


def test_the_estimated_time_is_the_duration_of_the_exact_trajectory() -> None:
    scenario, result = ranked("time"), planned("time")
    objective, path = build_problem(scenario, stable_set(scenario.chain)).objective, there(result.path)
    price = objective_value(objective, np.column_stack([path.twists, path.lengths]))
    for_arcs = objective.per_arc * len(path.lengths)
    assert price - for_arcs == pytest.approx(there(result.trajectory).duration, rel=0.02)


def test_ranking_by_margin_is_safer_the_more_the_higher_its_weight() -> None:
    found = [planned("travel"), planned("margin", 1.0), planned("margin", 20.0)]
    stable, paths = stable_set(ranked("margin").chain), [plan.path for plan in found if plan.path is not None]
    means = [float(stable.margin(path.twists) @ path.lengths / path.cost) for path in paths]
    assert len(means) == 3
    assert means[0] < means[1] < means[2]


@pytest.mark.parametrize("trajectory", ["exact", "blended"])
def test_the_lowest_cost_rate_is_a_bound(trajectory: str) -> None:
    """The search prunes with it: no arc can be cheaper."""
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
def test_ranking_by_time_is_never_slower_than_ranking_by_travel(name: str) -> None:
    """Paths are ranked by travel in the first half of the iterations, and their best is timed as well."""
    scenario = load_scenario(name)
    fast = plan(scenario, seed=1, time_limit=120.0, iterations=8000)
    short = plan(scenario, seed=1, time_limit=120.0, iterations=4000, cost="travel")
    assert (fast.objective, short.objective) == ("time", "travel")
    assert there(fast.trajectory).duration <= there(short.trajectory).duration + 1e-9


SERIES = runpy.run_path(str(Path(__file__).parents[1] / "benchmarks" / "series.py"))


@pytest.mark.parametrize("scenario", list(SERIES["scenes"]()), ids=lambda scenario: scenario.name)
def test_rooms_in_series_are_solved(scenario: Scenario) -> None:
    found = pushplan.plan(scenario, first=True, seed=1, iterations=100_000, time_limit=600.0)
    assert found.solved, found.reason
