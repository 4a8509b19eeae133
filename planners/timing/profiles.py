"""Jerk-limited profiles from Ruckig. All trajectories of the package are built from them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import ruckig

from pushplan.errors import TimingError
from pushplan.util.arrays import FloatArray


class ArcLimits(NamedTuple):
    """Limits of the arc parameter's derivatives s', s'' (both signs) and |s'''|; numbers or arrays."""

    speed: Any
    acceleration: Any
    deceleration: Any
    jerk: Any


SHORTEST_PHASE = 1e-12
"""Duration (s) below which a phase counts as a rounding error and is left out."""


HALVED = np.array([1.0, 1.0, 0.5])
"""The coefficient of t^2 is half of the second derivative."""


class Profile(NamedTuple):
    """The rate s' of a parameter as a sequence of quadratics in time.

    Attributes:
        durations: (q,) durations of the phases, s.
        rates: (q, 3) coefficients of s' in the time since the beginning of each phase, lowest order first.
    """

    durations: FloatArray
    rates: FloatArray

    @property
    def duration(self) -> float:
        """Total duration, s."""
        return float(self.durations.sum())

    def along(self, twist: FloatArray) -> FloatArray:
        """Return the coefficients (q, 3, 3) of the body twist, given the twist (3,) per unit of the parameter."""
        return np.asarray(self.rates[:, :, None] * twist)


def rest_to_rest(length: float, limits: ArcLimits) -> Profile:
    """Return the time-optimal profile over `length`, starting and ending at rest.

    Raises:
        TimingError: If Ruckig finds no profile.
    """
    (found,) = _over_lengths([length], [limits])
    profile = found.profiles[0][0]
    phases = np.array([profile.t, profile.v[:7], profile.a[:7], profile.j]).T
    phases = phases[phases[:, 0] > SHORTEST_PHASE]
    return Profile(phases[:, 0], phases[:, 1:] * HALVED)


def times_from_rest_to_rest(lengths: FloatArray, limits: ArcLimits) -> FloatArray:
    """Return the durations of `rest_to_rest` profiles over lengths (k,) within limits (k,).

    Returns:
        (k, 2) total time and time at full speed, s. The latter is 0 if the length is too short to reach full speed.

    Raises:
        TimingError: If Ruckig finds no profile.
    """
    each = zip(*(bound.tolist() for bound in limits), strict=True)
    times = [(found.duration, found.profiles[0][0].t[3]) for found in _over_lengths(lengths.tolist(), each)]
    return np.array(times).reshape(-1, 2)


def _over_lengths(lengths: Iterable[float], limits: Iterable[Iterable[float]]) -> Iterator[ruckig.Trajectory]:
    """Yield Ruckig's trajectories. Each is valid only until the next one is requested."""
    request, found, solver = ruckig.InputParameter(1), ruckig.Trajectory(1), ruckig.Ruckig(1)
    for length, (speed, acceleration, deceleration, jerk) in zip(lengths, limits, strict=True):
        request.target_position = [length]
        request.max_velocity = [speed]
        request.max_acceleration, request.min_acceleration = [acceleration], [-deceleration]
        request.max_jerk = [jerk]
        _calculate(solver, request, found)
        yield found


def step_windows(bounds: FloatArray) -> FloatArray:
    """Return the fastest smooth steps from 0 to 1 within bounds, by Ruckig's velocity interface.

    The rate of a step is a trapezoid. It rises for `short`, is constant for `long` - `short` and falls for `short`.
    So a step is a jump averaged over the long window and then over the short one.

    Args:
        bounds: (m, 2) limits of the first and second derivative of each step, 1/s and 1/s^2. If the first limit is
            infinite, there is no step.

    Returns:
        (m, 2) long and short windows, s; zero if there is no step.

    Raises:
        TimingError: If Ruckig finds no step.
    """
    request, found, solver = ruckig.InputParameter(1), ruckig.Trajectory(1), ruckig.Ruckig(1)
    request.control_interface = ruckig.ControlInterface.Velocity
    request.target_velocity = [1.0]
    windows = []
    for rate, jerk in bounds.tolist():
        rising = steady = 0.0
        if rate < np.inf:
            request.max_acceleration, request.max_jerk = [rate], [jerk]
            _calculate(solver, request, found)
            rising, steady = found.profiles[0][0].t[:2]
        windows.append((rising + steady, rising))
    return np.array(windows).reshape(-1, 2)


def _calculate(solver: ruckig.Ruckig, request: ruckig.InputParameter, found: ruckig.Trajectory) -> None:
    try:
        status = solver.calculate(request, found)
    except ruckig.RuckigError as error:
        raise TimingError(f"Ruckig cannot compute a profile: {str(error).strip()}") from error
    if status != ruckig.Result.Working:
        raise TimingError(f"Ruckig found no profile: {status}; request: {request.to_string()}")
