"""The bound by turns: no stable path beats it, and where nothing is in the way the best ones nearly reach it."""

import math

import numpy as np
import pytest
from plain import load_plain

from pushplan.core.problem import find_words
from pushplan.geometry import se2
from pushplan.planners.controls import control_segments, steering_families
from pushplan.planners.infeasible.turn_bound import turn_bound
from pushplan.planners.planner import plan
from pushplan.plans.path import TURN_WEIGHT, PushPath
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

ORIGIN = np.zeros(3)
CAR = np.array([[1.0, 0.0, -2.0, 1.0, 0.0, 2.0]])
"""Dubins' car with a turning radius of 0.5 m at the chain frame's origin."""


def set_of(name: str) -> tuple[Scenario, StableSet]:
    scenario = load_plain(name)
    return scenario, scenario.stable_set()


def random_path(segments: FloatArray, rng: np.random.Generator) -> PushPath:
    """A few arcs of twists on segments, most of them at their ends, from a random pose."""
    count = int(rng.integers(1, 6))
    rows = segments[rng.integers(0, len(segments), count)]
    share = np.clip(rng.uniform(-0.5, 1.5, (count, 1)), 0.0, 1.0)
    twists = (1.0 - share) * rows[:, :3] + share * rows[:, 3:]
    twists /= (np.hypot(twists[:, 0], twists[:, 1]) + TURN_WEIGHT * np.abs(twists[:, 2]))[:, None]
    return PushPath(rng.uniform(-3.0, 3.0, 3), twists, rng.uniform(0.01, 2.0, count))


@pytest.mark.parametrize("name", ["one-box", "asymmetric", "carts", "trapezoids"])
def test_no_path_of_stable_twists_beats_the_bound(name: str) -> None:
    """Paths of finer meridians than those that the bound knows: it holds between them, too."""
    scenario, stable = set_of(name)
    known, finer = (control_segments(stable, scenario.chain.pusher.drive, 0.05, k) for k in (512, 4099))
    rng = np.random.default_rng(7)
    for _ in range(40):
        path = random_path(finer, rng)
        assert turn_bound(path.start, path.end, known) <= path.cost + 1e-9


def test_no_word_of_a_car_beats_the_bound_and_some_reach_it() -> None:
    """Dubins' car: the cheapest word is the best path, or near it, as turns cost something, too."""
    rng, family = np.random.default_rng(3), steering_families(CAR)[0]
    shares = []
    for goal in rng.uniform([-3.0, -3.0, -math.pi], [3.0, 3.0, math.pi], (100, 3)):
        best = float(find_words(family, ORIGIN, goal)[:, 0].min())
        shares.append(turn_bound(ORIGIN, goal, CAR) / best)
    assert max(shares) <= 1.0 + 1e-9
    assert np.quantile(shares, 0.5) > 0.97


def test_a_turn_that_a_car_has_to_make_counts_with_its_way() -> None:
    """A quarter turn to the left along the tightest arc is the best path to its end."""
    path = PushPath(ORIGIN, np.array([[1.0, 0.0, 2.0]]) / 1.2, np.array([0.25 * math.pi * 1.2]))
    assert turn_bound(path.start, path.end, CAR) == pytest.approx(path.cost, rel=5e-3)


def test_a_rigid_motion_changes_nothing() -> None:
    rng = np.random.default_rng(11)
    _, stable = set_of("asymmetric")
    segments = control_segments(stable, load_plain("asymmetric").chain.pusher.drive, 0.05)
    for _ in range(10):
        start, goal, motion = rng.uniform(-3.0, 3.0, (3, 3))
        moved = turn_bound(se2.compose(motion, start), se2.compose(motion, goal), segments)
        # the bins of the heading lie elsewhere then
        assert moved == pytest.approx(turn_bound(start, goal, segments), rel=2e-3)


@pytest.mark.parametrize("name", ["free-space", "narrow-gap", "carts"])
def test_what_is_ranked_by_time_states_a_gap_in_time_and_by_margin_none(name: str) -> None:
    scenario, _ = set_of(name)
    by = {
        cost: plan(scenario, cost=cost, time_limit=300.0, iterations=300, seed=1)
        for cost in ("time", "margin")
    }
    assert by["margin"].gap is None
    timed = by["time"]
    assert timed.duration is not None
    assert timed.lower_bound is not None
    assert 0.5 * timed.duration < timed.lower_bound < timed.duration
    assert timed.gap == timed.duration / timed.lower_bound - 1.0
