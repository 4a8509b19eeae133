"""Exact timing: profiles, limits of arcs from pusher and contacts, also with limits that depend on direction."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from conftest import ChainMaker
from timing.conftest import use_by_differences

from pushplan.errors import TimingError
from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.planners.clearance import Motion, excess
from pushplan.planners.timing.arc_limits import Bounds, contact_limits, least_times
from pushplan.planners.timing.exact_timing import time_path
from pushplan.planners.timing.profiles import ArcLimits, rest_to_rest
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray


def _path(rng: np.random.Generator, arcs: int) -> PushPath:
    twists = rng.normal(size=(arcs, 3)) * [1.0, 0.3, 3.0]
    twists[::3, 2] = 0.0
    twists[1::4, :2] *= 0.01
    return PushPath(rng.normal(size=3), twists / cost_rate(twists)[:, None], rng.uniform(0.05, 1.0, arcs))


@pytest.mark.parametrize("seed", range(5))
def test_speed_acceleration_and_jerk_in_the_world_stay_within_the_limits(seed: int) -> None:
    limits = Limits(0.2, 0.5, 5.0, 1.0, 2.0, 20.0)
    trajectory = time_path(_path(np.random.default_rng(seed), 6), Bounds(limits))
    assert use_by_differences(trajectory, limits, 1e-3).max() <= 1.0 + 1e-4


@pytest.mark.parametrize("seed", range(5))
def test_a_timed_path_ends_where_the_path_ends_and_stops_at_every_corner(seed: int) -> None:
    path = _path(np.random.default_rng(seed), 7)
    trajectory = time_path(path, Bounds(Limits()))
    np.testing.assert_allclose(trajectory.poses[-1], path.end, atol=1e-11)
    corners = trajectory.breaks[np.flatnonzero(np.diff(trajectory.arc)) + 1]
    assert len(corners) == 6
    assert np.abs(trajectory.twists_at(corners)).max() < 1e-9
    assert np.abs(trajectory.twists[[0, -1]]).max() < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_the_least_time_is_a_lower_bound_from_stop_to_stop(seed: int) -> None:
    """It is the exact time without a jerk limit and with straight arcs, so the bound is close."""
    rng = np.random.default_rng(seed)
    path, limits = _path(rng, 7), Limits(0.2, (-0.3, 0.5), 5.0, 1.0, 2.0, 20.0)
    least = float(least_times(path.twists, path.lengths, limits).sum())
    assert 0.7 < least / time_path(path, Bounds(limits)).duration < 1.0
    straight = PushPath(path.start, np.array([[1.0, 0.0, 0.0]]), rng.uniform(0.01, 1.0, 1))
    free = replace(limits, jerk=1e6, angular_jerk=1e6)
    least = float(least_times(straight.twists, straight.lengths, free).sum())
    assert least == pytest.approx(time_path(straight, Bounds(free)).duration, rel=1e-4)


LIMITS = ArcLimits(0.2, 0.5, 0.3, 5.0)


def test_braking_can_be_weaker_than_accelerating() -> None:
    """Length/v + (v/a + a/j) / 2 for the acceleration, and the same for braking."""
    profile = rest_to_rest(2.0, LIMITS)
    usual = 2.0 / 0.2 + (0.2 / 0.5 + 0.5 / 5.0) / 2.0 + (0.2 / 0.3 + 0.3 / 5.0) / 2.0
    assert profile.duration == pytest.approx(usual, abs=1e-9)
    assert profile.rates[:, 1].max() == pytest.approx(0.5)
    assert profile.rates[:, 1].min() == pytest.approx(-0.3)


FAST = Limits(speed=2.0, acceleration=20.0, jerk=1e3, angular_speed=20.0, angular_acceleration=90.0)


def _stable_twists(contacts: ContactDynamics, seed: int, count: int) -> FloatArray:
    """Return unit-cost twists (count, 3) along which every contact holds by some margin."""
    rng = np.random.default_rng(seed)
    twists = rng.normal(size=(4000, 3)) * [0.2, 0.2, 1.5] + [1.0, 0.0, 0.0]
    margins = contacts.margins(1e-6 * twists, np.zeros_like(twists)).min(axis=1)
    kept = twists[margins > 0.02][:count]
    assert len(kept) == count
    return np.asarray(kept / cost_rate(kept)[:, None])


@pytest.mark.parametrize("n", [1, 3])
def test_contacts_hold_at_every_corner_of_the_speed_rectangle(make_chain: ChainMaker, n: int) -> None:
    """They then hold in the whole rectangle, because their conditions are linear in s'^2 and s''."""
    contacts = ContactDynamics(make_chain.boxes(n))
    for twist in _stable_twists(contacts, n, 20):
        found = contact_limits(twist, 1.0, Bounds(FAST, contacts))
        for speed, rate in product((0.0, found.speed), (-found.deceleration, found.acceleration)):
            assert contacts.rows(twist).values(speed, rate).min() > -1e-9


def test_a_twist_without_a_margin_is_refused_with_advice(make_chain: ChainMaker) -> None:
    """On the boundary of the stable set any acceleration would cause slip."""
    contacts = ContactDynamics(make_chain.boxes(1))
    inside, outside = np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 20.0])
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        held = contacts.quasi_static(middle[None]).rows.min() > 0.0
        inside, outside = (middle, outside) if held else (inside, middle)
    with pytest.raises(TimingError, match=r"no room for inertia.*raise stability\.margin"):
        contact_limits(inside / cost_rate(inside), 1.0, Bounds(Limits(), contacts))


SIDES = Limits(
    speed=(-0.1, 0.4), acceleration=(-0.2, 0.6), angular_speed=(-0.15, 0.5), angular_acceleration=(-0.8, 2.0)
)
MIRRORED = replace(SIDES, angular_speed=(-0.5, 0.15), angular_acceleration=(-2.0, 0.8))
TWISTS = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 2.0], [1.0, 0.1, -2.0], [1.0, -0.1, 1.0]])


def _straight_and_turns(twists: np.ndarray) -> PushPath:
    return PushPath(np.zeros(3), twists / cost_rate(twists)[:, None], np.full(len(twists), 0.7))


def test_an_exact_motion_uses_each_side_of_its_limits_and_no_more() -> None:
    for twist in TWISTS:
        trajectory = time_path(_straight_and_turns(twist[None]), Bounds(SIDES))
        assert excess(trajectory, SIDES) == ""
    left = time_path(_straight_and_turns(TWISTS[1:2]), Bounds(SIDES))
    assert excess(left, MIRRORED).startswith("the motion exceeds the pusher's angular speed: 0.5 after")


def test_jumps_and_turns_of_the_velocity_count_as_acceleration() -> None:
    limits = Limits(speed=2.0, acceleration=0.9, angular_speed=2.0, angular_acceleration=0.9)

    def moving(*twists: list[float]) -> Trajectory:
        coefficients = np.zeros((len(twists), 3, 3))
        coefficients[:, 0] = twists
        return Trajectory(np.zeros(3), np.arange(len(twists) + 1.0), coefficients, np.zeros(len(twists)))

    assert excess(moving([0.8, 0.0, 1.0]), limits) == ""
    assert excess(moving([1.0, 0.0, 1.0]), limits).startswith("the motion exceeds the pusher's acceleration: 1 ")
    assert "acceleration" in excess(moving([0.1, 0.0, 0.0], [0.11, 0.0, 0.0]), limits)
    assert "angular acceleration" in excess(moving([0.1, 0.0, 0.1], [0.1, 0.0, 0.11]), limits)


def test_samples_along_one_twist_repeat_the_checked_ones() -> None:
    trajectory = time_path(_path(np.random.default_rng(1), 6), Bounds(Limits()), 200.0)
    kept = trajectory.changes_at(trajectory.t)
    assert kept.mean() < 0.9
    same = np.cumsum(kept) - 1
    for values in (trajectory.twists_at, trajectory.rates_at):
        np.testing.assert_array_equal(values(trajectory.t[kept])[same], values(trajectory.t))
    few, all_of_them = Motion.sampled(trajectory, 0.5), Motion.through(trajectory.poses, 0.5)
    assert len(few.poses) < len(all_of_them.poses)
    s = np.linspace(0.0, all_of_them.travel[-1], 999)
    np.testing.assert_allclose(few.at(s), all_of_them.at(s), atol=1e-11)
