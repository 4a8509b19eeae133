"""Detours of the best path are free, stable and exact, and only cheaper ones are kept."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain import load_plain

from pushplan.arrays import FloatArray
from pushplan.geometry import se2
from pushplan.path import PushPath
from pushplan.planners.improve.budget import Budget
from pushplan.planners.improve.detours import POSES, detour, try_detour
from pushplan.planners.improve.polish import locate, price, shorten
from pushplan.planners.improve.session import Session
from pushplan.planners.ompl.auto import Auto
from pushplan.planners.ompl.search import search
from pushplan.planners.problem.posing import body_reach, build_problem, sampling_box
from pushplan.planners.validation.checker import find_collision
from pushplan.scenario import Scenario

NAMES = ["two-crates", "narrow-gap", "three-boxes-clutter"]


def _solved(name: str, seed: int) -> tuple[Scenario, Session]:
    """A session that has its first path, and time for more."""
    scenario = load_plain(name)
    problem = build_problem(scenario, scenario.stable_set())
    session = Session(problem, scenario.start, Budget(3600.0, first=True), seed)
    search(session, Auto, sampling_box(scenario), body_reach(scenario))
    assert session.best_arcs is not None
    session.budget = Budget(3600.0)
    return scenario, session


def _assert_valid(scenario: Scenario, path: PushPath, goal: FloatArray) -> None:
    gap = se2.relative(path.end, goal)
    np.testing.assert_allclose([gap[0], gap[1], math.remainder(gap[2], 2.0 * math.pi)], 0.0, atol=1e-9)
    assert (path.lengths > 0.0).all()
    assert (scenario.stable_set().margin(path.twists) > 0.0).all()
    assert find_collision(scenario, path.sampled(0.002)) is None


def _piece(session: Session, low: float, high: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Begin (3,), arcs (k, 4) and end (3,) of a polished piece of the best path, from one share of it to another."""
    assert session.best_arcs is not None
    arcs = shorten(session.problem, session.start, session.best_arcs, session.random, 3000)
    total, begin, end = arcs[:, 3].sum(), np.empty(3), np.empty(3)
    i, into_i = locate(session.start, arcs, low * total, begin)
    j, into_j = locate(session.start, arcs, high * total, end)
    piece = arcs[i : j + 1].copy()
    piece[-1, 3] = into_j
    piece[0, 3] -= into_i
    return begin, piece, end


@pytest.mark.parametrize("name", NAMES)
def test_a_detour_is_free_stable_and_exact_and_goes_somewhere_else(name: str) -> None:
    scenario, session = _solved(name, 3)
    away = []
    for low in (0.0, 0.2, 0.4, 0.6):
        begin, piece, end = _piece(session, low, low + 0.4)
        problem, bound = session.problem._replace(goal=end), 1.3 * piece[:, 3].sum()
        here = PushPath(begin, piece[:, :3], piece[:, 3]).sampled(0.01)
        for _ in range(20):
            way = detour(problem, begin, piece, 0.2, bound, session.random)
            if len(way):
                path = PushPath(begin, way[:, :3], way[:, 3])
                _assert_valid(scenario, path, end)
                assert path.cost < bound
                apart = path.sampled(0.01)[:, None, :] - here[None, :, :]
                away.append(np.abs(apart).max(axis=2).min(axis=1).max())
    assert len(away) > 20
    assert np.median(away) > 0.05


def test_a_way_that_has_no_room_is_none() -> None:
    scenario, session = _solved("narrow-gap", 3)
    assert session.best_arcs is not None
    shortest = float(np.hypot(*(session.problem.goal - scenario.start)[:2]))
    way = detour(session.problem, scenario.start, session.best_arcs, 0.2, shortest, session.random)
    assert way.shape == (0, 4)


@pytest.mark.parametrize("name", NAMES)
def test_detours_never_make_the_best_path_dearer_and_are_counted(name: str) -> None:
    scenario, session = _solved(name, 5)
    prices, before = [math.inf], session.iterations
    for _ in range(60):
        try_detour(session)
        assert session.best_arcs is not None
        prices.append(price(session.problem.prices, session.best_arcs))
    assert (np.diff(prices) <= 0.0).all()
    assert len(set(prices)) > 2
    assert session.iterations - before > 30 * POSES
    assert session.best_path is not None
    _assert_valid(scenario, session.best_path, session.problem.goal)


def test_without_a_path_nothing_happens() -> None:
    scenario = load_plain("two-crates")
    problem = build_problem(scenario, scenario.stable_set())
    session = Session(problem, scenario.start, Budget(3600.0), seed=1)
    assert session.best_arcs is None
    try_detour(session)
    assert session.best_arcs is None
    assert session.iterations == 0


def test_detours_do_not_let_a_search_end_sooner() -> None:
    _, session = _solved("two-crates", 1)
    session.budget = Budget(3600.0, stall=session.iterations + 100)
    session.tried(40)
    before = session.iterations
    assert not session.finished
    for _ in range(10):
        try_detour(session)
    session.excuse(session.iterations - before)
    assert session.iterations - before > 50
    assert not session.finished
