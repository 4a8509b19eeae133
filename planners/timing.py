"""Exact timing of a path: along each arc a jerk-limited profile from rest to rest, computed by Ruckig.

Along an arc of constant body twist xi = (v, omega) with parameter s, the contact midpoint has the acceleration
(s'' v, s'^2 omega v) and the jerk (s''' v - s'^3 omega^2 v, 3 s' s'' omega v), tangential and normal. The
limits of the arc parameter are chosen so that the magnitudes of both stay within the pusher's limits
whatever the profile does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from ruckig import InputParameter, Result, Ruckig
from ruckig import Trajectory as RuckigTrajectory

from pushplan.arrays import FloatArray
from pushplan.chain import Limits
from pushplan.errors import TimingError
from pushplan.path import PushPath
from pushplan.trajectory import SAMPLE_RATE, Trajectory

SHORTEST_PHASE = 1e-12
"""Phases of a profile below this (s) are rounding and are left out."""


class ArcLimits(NamedTuple):
    """Bounds on the first three derivatives of the arc parameter."""

    speed: float
    acceleration: float
    jerk: float


def arc_limits(twist: FloatArray, limits: Limits) -> ArcLimits:
    """Return bounds on s', s'' and s''' that keep an arc within the pusher's limits.

    Args:
        twist: (3,) body twist per unit of s.
        limits: Of the contact midpoint and of the turning.
    """
    v, omega = math.hypot(twist[0], twist[1]), abs(twist[2])
    speed = min(_ratio(limits.speed, v), _ratio(limits.angular_speed, omega))
    jerk = limits.jerk
    if v * omega > 0.0:
        jerk /= math.sqrt(2.0)  # an equal share for the tangential and for the normal part
        speed = min(speed, math.sqrt(limits.acceleration / (math.sqrt(2.0) * omega * v)))
        speed = min(speed, (jerk / (2.0 * omega**2 * v)) ** (1.0 / 3.0))
    tangential = math.sqrt(limits.acceleration**2 - (speed**2 * omega * v) ** 2)
    acceleration = min(_ratio(tangential, v), _ratio(limits.angular_acceleration, omega))
    acceleration = min(acceleration, _ratio(jerk, 3.0 * speed * omega * v))
    third = min(_ratio(jerk - speed**3 * omega**2 * v, v), _ratio(limits.angular_jerk, omega))
    return ArcLimits(speed, acceleration, third)


def _ratio(limit: float, rate: float) -> float:
    return limit / rate if rate > 0.0 else math.inf


def rest_to_rest(length: float, limits: ArcLimits) -> tuple[FloatArray, FloatArray]:
    """Return the phases of the time-optimal profile over `length`, starting and ending at rest.

    Returns:
        durations (q,) in s, and (q, 3) coefficients of s' in each phase, lowest order first.

    Raises:
        TimingError: When Ruckig finds no profile.
    """
    request = InputParameter(1)
    request.target_position = [length]
    request.max_velocity = [limits.speed]
    request.max_acceleration = [limits.acceleration]
    request.max_jerk = [limits.jerk]
    found = RuckigTrajectory(1)
    status = Ruckig(1).calculate(request, found)
    if status != Result.Working:
        raise TimingError(f"Ruckig found no profile over {length} m within {limits}: {status}")
    profile = found.profiles[0][0]
    durations = np.array(profile.t)
    phases = np.stack([profile.v[:7], profile.a[:7], 0.5 * np.array(profile.j)], axis=1)
    kept = durations > SHORTEST_PHASE
    return durations[kept], phases[kept]


def time_path(path: PushPath, limits: Limits, rate: float = SAMPLE_RATE) -> Trajectory:
    """Return the trajectory that stops at every corner of the path.

    Args:
        path: Constant-twist arcs.
        limits: Of the pusher.
        rate: Samples per second of the trajectory.

    Raises:
        TimingError: When an arc cannot be timed.
    """
    durations: list[FloatArray] = [np.zeros(0)]
    coefficients: list[FloatArray] = [np.zeros((0, 3, 3))]
    arcs: list[FloatArray] = [np.zeros(0)]
    for i, (twist, length) in enumerate(zip(path.twists, path.lengths, strict=True)):
        if length > 0.0:
            phase_durations, phases = rest_to_rest(float(length), arc_limits(twist, limits))
            durations.append(phase_durations)
            coefficients.append(phases[:, :, None] * twist)
            arcs.append(np.full(len(phases), float(i)))
    breaks = np.concatenate([[0.0], np.cumsum(np.concatenate(durations))])
    return Trajectory(path.start, breaks, np.concatenate(coefficients), np.concatenate(arcs), rate)
