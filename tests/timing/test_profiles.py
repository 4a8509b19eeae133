"""Every step of every trajectory is a result of Ruckig, checked at Ruckig's own call."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import ruckig
from conftest import there
from hypothesis import given, settings
from hypothesis import strategies as st
from kinds import MULTI, ROW

import pushplan
from pushplan.errors import TimingError
from pushplan.mechanics.chain import Limits
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.blending import time_segments
from pushplan.planners.timing.exact_timing import Pieces
from pushplan.planners.timing.parts import Section, joined, make_part, passing_speeds, step_bounds
from pushplan.planners.timing.profiles import ArcLimits, rest_to_rest, step_windows
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import scenario_from_text
from pushplan.util.arrays import FloatArray

RUCKIG = ruckig.Ruckig


class Asked:
    """Stand-in for `ruckig.Ruckig` that records inputs and outputs, and stretches the durations."""

    requests: list[tuple[list[float], list[float]]]
    answers: list[ruckig.Trajectory]
    slower: float

    def __init__(self, degrees: int) -> None:
        self._solver = RUCKIG(degrees)

    def calculate(self, request: Any, found: Any) -> Any:
        step = request.control_interface == ruckig.ControlInterface.Velocity
        names = ("max_acceleration", "max_jerk") if step else ("max_velocity", "max_acceleration", "max_jerk")
        given = {name: getattr(request, name) for name in (*names, "min_acceleration")}
        if step:
            self.requests.append((given["max_acceleration"], given["max_jerk"]))
        for power, name in enumerate(names, 1):
            setattr(request, name, [value / self.slower**power for value in given[name]])
        if given["min_acceleration"] is not None:
            request.min_acceleration = [value / self.slower**2 for value in given["min_acceleration"]]
        status = self._solver.calculate(request, found)
        if step:
            again = ruckig.Trajectory(1)
            self._solver.calculate(request, again)
            self.answers.append(again)
        for name, value in given.items():
            setattr(request, name, value)
        return status


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> type[Asked]:
    Asked.requests, Asked.answers, Asked.slower = [], [], 1.0
    monkeypatch.setattr(ruckig, "Ruckig", Asked)
    return Asked


def _changing(trajectory: Trajectory) -> FloatArray:
    """Return the durations (s,) of the successive changes of the twist."""
    changes = np.any(trajectory.coefficients[:, 1:] != 0.0, axis=(1, 2))
    ends = np.flatnonzero(np.diff(changes, prepend=False, append=False)).reshape(-1, 2)
    return np.array([trajectory.breaks[end] - trajectory.breaks[begin] for begin, end in ends])


ROOMY = Limits(angular_acceleration=20.0, angular_jerk=200.0)
"""Limits with which only the pusher's linear limits determine the steps between the twists below."""

CORNERED = PushPath(
    np.zeros(3), np.array([[1.0, 0.0, 0.0], [0.98, 0.0, 0.2], [1.0, 0.0, 0.0]]), np.array([1.0, 0.9, 1.1])
)


def _cornered() -> Section:
    """Return a section with distant steps, none of which is widened at first."""
    section = make_part(CORNERED, np.arange(3), Bounds(ROOMY), np.full(3, 0.2))
    assert isinstance(section, Section)
    return section


def test_single_steps_use_the_limits_of_the_pusher(asked: type[Asked]) -> None:
    section = _cornered()
    section.pieces(CORNERED.lengths)
    size = np.hypot(*np.diff(section.levels[:, :2], axis=0).T)
    room = ROOMY.both("acceleration")[1] - np.hypot(*section.levels[:, :2].T) * np.abs(section.levels[:, 2])
    want = np.minimum(room[1:], room[:-1]) / size, ROOMY.jerk / size
    np.testing.assert_allclose(np.array(asked.requests)[:, :, 0].T, want, rtol=1e-15)


def test_steps_take_twice_as_long_if_ruckig_says_so(asked: type[Asked]) -> None:
    """The starts, corners and ends of blended pushes; and all steps of stop-to-stop pushes, transits and closings."""
    once = _changing(joined(CORNERED, [_cornered()], CORNERED.lengths, 100.0))
    plans = [pushplan.plan(scenario_from_text(text), seed=1, first=True, time_limit=600.0) for text in (MULTI, ROW)]
    assert {"transit", "approach", "push", "close", "retreat"} <= {s.kind for plan in plans for s in plan.segments}
    scenarios = [replace(plan.scenario, trajectory="exact") for plan in plans]
    exact = [time_segments(scenario, plan.segments) for scenario, plan in zip(scenarios, plans, strict=True)]
    asked.slower = 2.0
    np.testing.assert_allclose(_changing(joined(CORNERED, [_cornered()], CORNERED.lengths, 100.0)), 2.0 * once)
    for scenario, plan, before in zip(scenarios, plans, exact, strict=True):
        for segment, of_before in zip(time_segments(scenario, plan.segments), before, strict=True):
            assert there(segment.trajectory).duration == pytest.approx(2.0 * there(of_before.trajectory).duration)


@settings(max_examples=10)
@given(st.integers(0, 10**6))
def test_a_blended_twist_is_the_sum_of_ruckig_s_steps(seed: int) -> None:
    """Steps overlap, and some are widened; compared with Ruckig's own evaluation at random times."""
    rng = np.random.default_rng(seed)
    twists = rng.normal(size=(6, 3)) * [0.3, 0.1, 1.5] + [1.0, 0.0, 0.0]
    path = PushPath(np.zeros(3), twists / cost_rate(twists)[:, None], rng.exponential(0.15, 6) + 0.01)
    bounds = Bounds(Limits())
    with pytest.MonkeyPatch.context() as patch:
        Asked.requests, Asked.answers, Asked.slower = [], [], 1.0
        patch.setattr(ruckig, "Ruckig", Asked)
        sums: list[tuple[FloatArray, ...]] = []
        made = Pieces.through

        def kept(*given: FloatArray) -> Pieces:
            sums.append(given)
            return made(*given)

        patch.setattr(Pieces, "through", kept)
        speeds = passing_speeds(path.twists, path.lengths, bounds)
        part = make_part(path, np.arange(6), bounds, speeds).eased(path.lengths).slowed(path.lengths)[0]
        trajectory = joined(path, [part], path.lengths, 100.0)
    by_windows = {(sum(t[:2]), t[0]): one for one in Asked.answers for t in [one.profiles[0][0].t]}
    times = rng.uniform(0.0, trajectory.duration, 300)
    levels, centers, windows = sums[-1]
    expected = np.tile(levels[0], (len(times), 1))
    for change, center, (long, short) in zip(np.diff(levels, axis=0), centers, windows, strict=True):
        into = np.maximum(times - center + (long + short) / 2.0, 0.0)
        reached = [by_windows[long, short].at_time(moment)[1][0] for moment in into]
        expected += np.outer(reached, change)
    np.testing.assert_allclose(trajectory.twists_at(times), expected, atol=1e-12)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_step_is_a_trapezoid_of_its_rate(rate: float, jerk: float) -> None:
    """It takes the time of the largest rate if that is reached, otherwise that of the jerk alone."""
    bounds = 10.0 ** np.array([[rate, jerk]])
    long = max(1.0 / bounds[0, 0], np.sqrt(1.0 / bounds[0, 1]))
    np.testing.assert_allclose(step_windows(bounds), [[long, 1.0 / bounds[0, 1] / long]], rtol=1e-12)


def test_there_is_no_step_between_equal_twists() -> None:
    level = np.array([[0.2, 0.0, 0.1]] * 2)
    np.testing.assert_array_equal(step_windows(step_bounds(level, Limits())), np.zeros((1, 2)))


def test_errors_of_ruckig_become_timing_errors() -> None:
    with pytest.raises(TimingError, match="maximum acceleration limit"):
        step_windows(np.array([[-1.0, 1.0]]))
    with pytest.raises(TimingError, match="Ruckig cannot compute a profile: "):
        rest_to_rest(1.0, ArcLimits(-0.2, 0.5, 0.5, 5.0))


def test_steps_use_the_limits_of_their_direction() -> None:
    """From rest the speed grows, to rest it falls; between, either bound can count, less the centripetal part."""
    limits = Limits(acceleration=(-0.3, 0.7), angular_acceleration=(-1.0, 3.0), jerk=8.0, angular_jerk=50.0)
    levels = np.array(
        [[0.0, 0, 0], [0.2, 0, 0], [0.5, 0, 0], [0.5, 0, 0.1], [0.5, 0, -0.1], [0, 0, -0.1], [0.0, 0, 0]]
    )
    rates, jerks = step_bounds(levels, limits).T
    wanted = [0.7 / 0.2, 0.3 / 0.3, 3.0 / 0.1, 1.0 / 0.2, (0.3 - 0.05) / 0.5, 3.0 / 0.1]
    np.testing.assert_allclose(rates, wanted)
    np.testing.assert_allclose(jerks, [8.0 / 0.2, 8.0 / 0.3, 50.0 / 0.1, 50.0 / 0.2, 8.0 / 0.5, 50.0 / 0.1])
