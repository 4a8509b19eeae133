"""Paths that are shortened still lead to the goal through the stable set, and end where a convex optimiser ends."""

import math
from typing import Any

import numpy as np
import pytest
import scipy.optimize
from plain import load_plain

from pushplan.core.improve import objective_value, shorten, vary
from pushplan.core.problem import Problem
from pushplan.geometry import se2
from pushplan.planners.clearance import find_collision
from pushplan.planners.problem import build_problem, travel_objective
from pushplan.planners.search.session import Budget, Session
from pushplan.plans.path import PushPath
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray

NAMES = ["free-space", "carts", "narrow-gap"]


def _posed(name: str) -> tuple[Scenario, Problem]:
    scenario = load_plain(name).with_margin(0.02 if name == "carts" else 0.0)
    return scenario, build_problem(scenario, stable_set(scenario.chain, scenario.stability.set))


def _first_path(scenario: Scenario, problem: Problem, seed: int) -> FloatArray:
    from pushplan.planners.problem import body_reach, sampling_box
    from pushplan.planners.search.planners import Auto
    from pushplan.planners.search.search import Search

    session = Session(problem, scenario.start, Budget(60.0, first=True), seed)
    if not session.finished:
        Search(session, Auto, sampling_box(scenario), body_reach(scenario)).run()
    assert session.best.arcs is not None
    return session.best.arcs


def _random(seed: int) -> np.ndarray:
    return np.array([seed], dtype=np.uint64)


@pytest.mark.parametrize("name", NAMES)
def test_changed_paths_reach_the_goal_free_stable_and_never_dearer(name: str) -> None:
    scenario, problem = _posed(name)
    path, state = _first_path(scenario, problem, 3), _random(5)
    before, kept = objective_value(problem.objective, path), 0
    for _ in range(1000):
        new = vary(problem, scenario.start, path, state)
        now = objective_value(problem.objective, new)
        assert now <= before
        kept += now < before
        path, before = new, now
    assert kept > 10
    done = PushPath(scenario.start, path[:, :3], path[:, 3])
    gap = se2.relative(done.end, problem.goal)
    np.testing.assert_allclose([gap[0], gap[1], math.remainder(gap[2], 2.0 * math.pi)], 0.0, atol=1e-9)
    assert (path[:, 3] > 0.0).all()
    assert (stable_set(scenario.chain, scenario.stability.set).margin(path[:, :3]) > 0.0).all()
    assert find_collision(scenario, done.sampled(0.002)) is None


@pytest.mark.parametrize("name", NAMES)
def test_arcs_that_are_not_needed_are_left_out_and_the_path_stays_exact_free_and_stable(name: str) -> None:
    """Every arc of a path is cut in three; where arcs are dear, changes take the cuts out again."""
    scenario, problem = _posed(name)
    problem = problem.with_objective(travel_objective(0.05))
    path, state = _first_path(scenario, problem, 3), _random(5)
    cut = np.repeat(path, 3, axis=0) * [1.0, 1.0, 1.0, 1.0 / 3.0]
    now = cut
    left_out = 0
    for _ in range(3000):
        new = vary(problem, scenario.start, now, state)
        assert len(new) >= len(now) - 1
        if len(new) < len(now):
            left_out += 1
            assert objective_value(problem.objective, new) < objective_value(problem.objective, now)
            done = PushPath(scenario.start, new[:, :3], new[:, 3])
            gap = se2.relative(done.end, problem.goal)
            np.testing.assert_allclose([*gap[:2], math.remainder(gap[2], 2.0 * math.pi)], 0.0, atol=1e-9)
            assert (new[:, 3] >= 0.0).all()
            stable = stable_set(scenario.chain, scenario.stability.set)
            assert stable.margin(new[:, :3]).min() > scenario.required_margin
            assert find_collision(scenario, done.sampled(0.002)) is None
        now = new
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
    """Price after an independent optimiser (SLSQP) has moved the lengths and twists of a path's arcs."""
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
    """Segment (fractional) and share on it of a twist, by brute force."""
    shares = np.linspace(0.0, 1.0, 2001)
    along = (1.0 - shares)[:, None, None] * segments[:, :3] + shares[:, None, None] * segments[:, 3:]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    b, i = np.unravel_index(np.argmax(along @ (twist / np.linalg.norm(twist))), along.shape[:2])
    return float(i), float(shares[b])
