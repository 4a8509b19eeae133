"""Profiles of one parameter: Ruckig's answers, cut where arcs end."""

import numpy as np
import pytest

from pushplan.errors import TimingError
from pushplan.planners.timing.arc_limits import ArcLimits
from pushplan.planners.timing.exact_timing import Profile, rest_to_rest, split

LIMITS = ArcLimits(0.2, 0.5, 0.3, 5.0)


def _speed_and_travel(profile: Profile, time: float) -> tuple[float, float]:
    travel = 0.0
    for duration, rate in zip(*profile, strict=True):
        tau = min(time, duration)
        travel += float(rate @ (tau ** np.arange(1, 4) / np.arange(1, 4)))
        time -= tau
        if time <= 0.0:
            return float(rate @ tau ** np.arange(3)), travel
    raise AssertionError("the time lies after the end")


def test_braking_may_be_weaker_than_accelerating() -> None:
    """Length/v + (v/a + a/j) / 2 for the way up and likewise down."""
    profile = rest_to_rest(2.0, LIMITS)
    usual = 2.0 / 0.2 + (0.2 / 0.5 + 0.5 / 5.0) / 2.0 + (0.2 / 0.3 + 0.3 / 5.0) / 2.0
    assert profile.duration == pytest.approx(usual, abs=1e-9)
    assert profile.rates[:, 1].max() == pytest.approx(0.5)
    assert profile.rates[:, 1].min() == pytest.approx(-0.3)


@pytest.mark.parametrize("length", [1e-5, 1e-3, 0.05, 1.0])
def test_a_cut_profile_is_the_same_motion_and_begins_phases_where_it_is_told(length: float) -> None:
    whole = rest_to_rest(length, LIMITS)
    at = length * np.array([0.1, 0.100001, 0.5, 0.99])
    cut, passed = split(whole, at)
    assert cut.duration == pytest.approx(whole.duration, rel=1e-12)
    for time in np.linspace(0.0, whole.duration * (1.0 - 1e-9), 50):
        assert _speed_and_travel(cut, time) == pytest.approx(
            _speed_and_travel(whole, time), rel=1e-9, abs=1e-15
        )
    begins = np.concatenate([[0.0], np.cumsum(cut.durations)])
    for i, place in enumerate(at):
        first = int(np.flatnonzero(passed == i + 1)[0])
        assert _speed_and_travel(whole, begins[first])[1] == pytest.approx(place, rel=1e-9)
    assert (np.diff(passed) >= 0).all()


@pytest.mark.parametrize("limits", [LIMITS._replace(deceleration=0.0), LIMITS._replace(speed=float("nan"))])
def test_limits_that_allow_nothing_are_refused(limits: ArcLimits) -> None:
    with pytest.raises(TimingError, match="Ruckig"):
        rest_to_rest(1.0, limits)
