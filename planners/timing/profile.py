"""Jerk-limited profiles of one parameter, computed by Ruckig (Berscheid and Kroeger 2021)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from ruckig import InputParameter, Result, Ruckig, RuckigError
from ruckig import Trajectory as RuckigTrajectory

from pushplan.errors import TimingError
from pushplan.util.arrays import FloatArray, IntArray

SHORTEST_PHASE = 1e-12
"""Phases of a profile below this (s) are rounding and are left out."""


class ArcLimits(NamedTuple):
    """Bounds on the derivatives of the arc parameter: s', s'' either way, and |s'''|; numbers, or arrays of them."""

    speed: Any
    acceleration: Any
    deceleration: Any
    jerk: Any


class Profile(NamedTuple):
    """The rate s' of a parameter as one quadratic of time after the other.

    Attributes:
        durations: (q,) s.
        rates: (q, 3) coefficients of s' from the beginning of each phase on, lowest order first.
    """

    durations: FloatArray
    rates: FloatArray

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return float(self.durations.sum())


def rest_to_rest(length: float, limits: ArcLimits) -> Profile:
    """Return the time-optimal profile over `length`, starting and ending at rest.

    Raises:
        TimingError: When Ruckig finds no profile.
    """
    request = InputParameter(1)
    request.target_position = [length]
    request.max_velocity = [limits.speed]
    request.max_acceleration = [limits.acceleration]
    request.min_acceleration = [-limits.deceleration]
    request.max_jerk = [limits.jerk]
    durations, speed, rate, jerk = _phases(request, f"a profile over {length} m within {limits}")
    kept = durations > SHORTEST_PHASE
    return Profile(durations[kept], np.stack([speed, rate, 0.5 * jerk], axis=1)[kept])


def step_widths(rise: FloatArray, bend: FloatArray) -> FloatArray:
    """Return the fastest smooth steps from 0 to 1 whose first two derivatives stay within bounds.

    A step is a jump averaged over both windows of time, one after the other: its rate is a trapezoid that rises for
    `short`, stays for `long` - `short` and falls for `short`.

    Args:
        rise: (m,) inverse of the bound on the first derivative, s.
        bend: (m,) inverse of the bound on the second derivative, s^2.

    Returns:
        (m, 2) windows long and short, s.
    """
    long = np.maximum(rise, np.sqrt(bend))
    return np.stack([long, bend / np.where(long > 0.0, long, 1.0)], axis=1)


def split(profile: Profile, at: FloatArray) -> tuple[Profile, IntArray]:
    """Cut a profile where s reaches the increasing values `at`.

    Returns:
        The profile with phases that begin there, and (q,) how many of the values come before each phase.
    """
    if not len(at):
        return profile, np.zeros(len(profile.durations), dtype=np.int64)
    durations: list[float] = []
    rates: list[FloatArray] = []
    passed: list[int] = []
    s, count = 0.0, 0
    for duration, rate in zip(*profile, strict=True):
        begin, end = 0.0, s + _travel(rate, duration)
        while count < len(at) and at[count] < end:
            cut = _time_to(rate, at[count] - s, begin, duration)
            durations.append(cut - begin)
            rates.append(_shifted(rate, begin))
            passed.append(count)
            begin, count = cut, count + 1
        durations.append(duration - begin)
        rates.append(_shifted(rate, begin))
        passed.append(count)
        s = end
    kept = np.array(durations) > SHORTEST_PHASE
    return Profile(np.array(durations)[kept], np.array(rates)[kept]), np.array(passed, dtype=np.int64)[kept]


def _phases(request: InputParameter, what: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Durations (7,) of the phases, and value, rate and second derivative (7,) of the velocity where they begin."""
    found = RuckigTrajectory(1)
    try:
        status = Ruckig(1).calculate(request, found)
    except RuckigError as error:
        raise TimingError(f"Ruckig cannot make {what}: {error}") from error
    if status != Result.Working:
        raise TimingError(f"Ruckig found no way to make {what}: {status}")
    profile = found.profiles[0][0]
    return np.array(profile.t), np.array(profile.v[:7]), np.array(profile.a[:7]), np.array(profile.j)


def _travel(rate: FloatArray, time: float) -> float:
    return float(time * (rate[0] + time * (rate[1] / 2.0 + time * rate[2] / 3.0)))


def _time_to(rate: FloatArray, travel: float, low: float, high: float) -> float:
    """Time at which a phase has travelled so far: bisection, as s never runs backward."""
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _travel(rate, middle) < travel else (low, middle)
    return high


def _shifted(rate: FloatArray, time: float) -> FloatArray:
    """Coefficients of the same quadratic with its origin moved to `time`."""
    c0, c1, c2 = rate
    return np.array([c0 + time * (c1 + time * c2), c1 + 2.0 * time * c2, c2])
