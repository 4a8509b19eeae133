"""Whether a trajectory keeps the pusher's limits, by differences of its poses: no code shared with the timing."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.chain import LimitName, Limits
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray

STEP = 4e-3
"""Time between two poses looked at, s."""

TOLERANCE = 0.01
"""Share of a limit that differences may seem to exceed it by; speeds change within a step, too."""


def excess(trajectory: Trajectory, limits: Limits) -> str:
    """Return which limit of speed or acceleration a trajectory exceeds, and when; empty if it keeps them all."""
    count = int(np.ceil(trajectory.duration / STEP)) + 1
    if count < 3:
        return ""
    t = np.linspace(0.0, trajectory.duration, count)
    h = t[1]
    poses = trajectory.poses_at(t)  # angles run on
    rates = np.diff(poses, axis=0) / h
    changes = np.diff(rates, axis=0) / h
    heading = poses[:-1, 2]
    ahead = np.cos(heading) * rates[:, 0] + np.sin(heading) * rates[:, 1]
    speed = np.hypot(rates[:, 0], rates[:, 1])
    gain = np.diff(speed)
    found: dict[LimitName, FloatArray] = {
        "speed": np.where(ahead < 0.0, -speed, speed),
        "acceleration": np.copysign(np.hypot(changes[:, 0], changes[:, 1]), gain),
        "angular_speed": rates[:, 2],
        "angular_acceleration": changes[:, 2],
    }
    steady = np.abs(gain) < TOLERANCE * h * np.abs(found["acceleration"])  # rounding tells no sign
    found["acceleration"][steady] = np.abs(found["acceleration"][steady])
    for name, values in found.items():
        words = _beyond(values, limits.both(name), t)
        if words:
            return f"the motion exceeds the pusher's {name.replace('_', ' ')}: {words}"
    return ""


def _beyond(values: FloatArray, both: tuple[float, float], t: FloatArray) -> str:
    share = np.maximum(-values / both[0], values / both[1])
    worst = int(np.argmax(share))
    if share[worst] <= 1.0 + TOLERANCE:
        return ""
    return f"{values[worst]:.4g} after {t[worst]:.2f} s, allowed are {-both[0]:.4g} to {both[1]:.4g}"
