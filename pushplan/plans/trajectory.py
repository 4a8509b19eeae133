"""A timed trajectory: the body twist as a piecewise quadratic of time (constant jerk on every piece)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.util.arrays import BoolArray, FloatArray, columns_of, frozen, parameters

SAMPLE_RATE = 100.0
"""Default rate at which trajectories are sampled and executed, Hz."""

MOST_SAMPLES = 100_000
"""Largest number of samples of a trajectory: 17 minutes at the default rate. Longer trajectories (limits near zero)
have a lower sample rate to save memory; every sample is still exact."""

RESTING = 1e-6
"""Twist components below this (m/s, rad/s) count as rest."""

NUDGE = 1e-4
"""Time offset from a sample at rest at which its direction of motion is computed, s."""

_GAUSS = np.sqrt(3.0) / 6.0


def advance(columns: FloatArray, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return the motion (m, 3) in the body frame under twists c0 + c1 tau + c2 tau^2 from `begin` to `end`.

    Fourth-order Magnus expansion with two Gauss points; exact where the direction of the twist is constant.

    Args:
        columns: (3, 3, m) polynomial coefficients, lowest first: [j] multiplies tau^j.
        begin: (m,) local times, s.
        end: (m,) local times, s.
    """
    h = end - begin
    middle = 0.5 * (begin + end)
    v1, v2 = (_polynomial(columns, middle + sign * _GAUSS * h) for sign in (-1.0, 1.0))
    step = 0.5 * h * (v1 + v2)
    step[:2] += (np.sqrt(3.0) / 12.0) * h**2 * _bracket(v1, v2)
    return se2.exp(step.T)


def _polynomial(c: FloatArray, tau: FloatArray) -> FloatArray:
    """Return c0 + c1 tau + c2 tau^2 (3, m) for coefficients (3, 3, m) at times (m,)."""
    return np.asarray(c[0] + tau * (c[1] + tau * c[2]))


def _bracket(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the linear part (2, m) of the Lie bracket [a, b] of planar twists (3, m); its angular part is 0."""
    return np.stack([b[2] * a[1] - a[2] * b[1], a[2] * b[0] - b[2] * a[0]])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The commanded motion of the pusher.

    Attributes:
        start: (3,) pose of the chain frame in the world at time 0.
        breaks: (q + 1,) times of the ends of the pieces, s; the first is 0.
        coefficients: (q, 3, 3) coefficients: the twist on piece i is sum_j coefficients[i, j] (t - breaks[i])^j.
        arc: (q,) index of the path's arc of each piece (a blend belongs to the arc that it leaves).
        rate: Rate of the samples `t`, `poses`, `twists`, `base_poses` and `base_twists`, Hz; see also `sample_rate`.
        base: (3,) pose of the robot's base in the chain frame, the frame that path followers steer.
    """

    start: FloatArray
    breaks: FloatArray
    coefficients: FloatArray
    arc: FloatArray
    rate: float = SAMPLE_RATE
    base: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __repr__(self) -> str:
        """Return one line."""
        return f"<Trajectory: {self.duration:.2f} s from ({', '.join(f'{x:.3f}' for x in self.start)})>"

    def __post_init__(self) -> None:
        pieces = len(self.coefficients)
        object.__setattr__(self, "start", frozen(self.start, (3,), "start of the trajectory"))
        object.__setattr__(self, "breaks", frozen(self.breaks, (pieces + 1,), "breaks of the trajectory"))
        object.__setattr__(self, "coefficients", frozen(self.coefficients, (None, 3, 3), "coefficients"))
        object.__setattr__(self, "arc", frozen(self.arc, (pieces,), "arc of the trajectory"))
        object.__setattr__(self, "base", frozen(self.base, (3,), "base of the trajectory"))
        if not self.rate > 0.0:
            raise PushplanError(f"rate is {self.rate} Hz; it must be > 0")
        if self.breaks[0] != 0.0 or (np.diff(self.breaks) <= 0.0).any():
            raise PushplanError("breaks of the trajectory must start at 0 and increase")

    @cached_property
    def columns(self) -> FloatArray:
        """(3, 3, q) coefficients by order, then by component of the twist."""
        return np.ascontiguousarray(self.coefficients.transpose(1, 2, 0))

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.breaks[-1])

    @property
    def sample_rate(self) -> float:
        """Rate of the samples `t`, Hz: `rate`, or less to stay within `MOST_SAMPLES`."""
        return min(self.rate, MOST_SAMPLES / self.duration) if self.duration > 0.0 else self.rate

    @cached_property
    def t(self) -> FloatArray:
        """(m,) sample times at `sample_rate`, s, including the end."""
        steps = np.arange(int(np.floor(self.duration * self.sample_rate)) + 1) / self.sample_rate
        times = steps if steps[-1] == self.duration else np.append(steps, self.duration)
        return frozen(times, (None,), "sample times")

    @cached_property
    def poses(self) -> FloatArray:
        """(m, 3) poses of the chain frame in the world at `t`; angles are continuous, not wrapped."""
        return frozen(self.poses_at(self.t), (None, 3), "poses")

    @cached_property
    def twists(self) -> FloatArray:
        """(m, 3) body twists in the chain frame at `t`."""
        return frozen(self.twists_at(self.t), (None, 3), "twists")

    @cached_property
    def base_poses(self) -> FloatArray:
        """(m, 3) poses of the robot's base in the world at `t`; angles are continuous, not wrapped."""
        return frozen(self.base_poses_at(self.t), (None, 3), "poses of the base")

    @cached_property
    def base_twists(self) -> FloatArray:
        """(m, 3) body twists of the robot's base, in its own frame, at `t`; with wheels, vy is 0 at the axle."""
        return frozen(self.base_twists_at(self.t), (None, 3), "twists of the base")

    @cached_property
    def break_poses(self) -> FloatArray:
        """(q + 1, 3) poses of the chain frame in the world at `breaks`."""
        durations = np.diff(self.breaks)
        steps = advance(self.columns, np.zeros(len(durations)), durations)
        return frozen(se2.chained(self.start, steps), (None, 3), "break poses")

    @cached_property
    def directions(self) -> FloatArray:
        """(m, 3) twists at `t`; at rest, the next twist (at the end: the last)."""
        return self.directions_at(self.t)

    def directions_at(self, t: FloatArray) -> FloatArray:
        """Return the twists (m, 3) at times (m,); at rest, the next twist (at the end: the last)."""
        twists = self.twists_at(t)
        resting = (np.abs(columns_of(twists)) < RESTING).all(axis=0)
        still = t[resting]
        twists[resting] = self.twists_at(still + np.where(still + NUDGE < self.duration, NUDGE, -NUDGE))
        return twists

    def piece_at(self, t: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        """Return the index of the piece at each time (m,)."""
        piece = np.searchsorted(self.breaks, np.asarray(t, dtype=np.float64), side="right") - 1
        return np.clip(piece, 0, len(self.coefficients) - 1)

    def twists_at(self, t: ArrayLike) -> FloatArray:
        """Return the commanded twists (m, 3) at times (m,), clipped to the trajectory."""
        t = np.clip(np.asarray(t, dtype=np.float64), 0.0, self.duration)
        if len(self.coefficients) == 0:
            return np.zeros((*t.shape, 3))
        piece = self.piece_at(t)
        return np.ascontiguousarray(_polynomial(self.columns.take(piece, axis=2), t - self.breaks[piece]).T)

    def rates_at(self, t: ArrayLike) -> FloatArray:
        """Return the time derivatives (m, 3) of the commanded twists at times (m,), clipped to the trajectory."""
        t = np.clip(np.asarray(t, dtype=np.float64), 0.0, self.duration)
        if len(self.coefficients) == 0:
            return np.zeros((*t.shape, 3))
        piece = self.piece_at(t)
        _, c1, c2 = self.columns.take(piece, axis=2)
        return np.ascontiguousarray((c1 + 2.0 * (t - self.breaks[piece]) * c2).T)

    def changes_at(self, t: FloatArray) -> BoolArray:
        """Return for ordered times (m,) whether twist or rate can differ from those at a neighbouring time."""
        piece, changing = self.piece_at(t), np.any(self.columns[1:] != 0.0, axis=(0, 1))
        fresh = (np.diff(piece, prepend=-1) > 0) | changing[piece]
        return np.asarray(fresh | np.append(fresh[1:], True))

    def base_poses_at(self, t: ArrayLike) -> FloatArray:
        """Return the poses (m, 3) of the robot's base in the world at times (m,), clipped to the trajectory."""
        return se2.compose(self.poses_at(t), self.base)

    def base_twists_at(self, t: ArrayLike) -> FloatArray:
        """Return the body twists (m, 3) of the robot's base at times (m,), clipped to the trajectory."""
        return se2.twist_of(self.base, self.twists_at(t))

    def of_frame(self, frame: FloatArray) -> Trajectory:
        """Return the motion of another frame of the same body.

        Args:
            frame: (3,) pose of the other frame in this trajectory's frame.
        """
        if not np.any(frame):
            return self
        return Trajectory(
            se2.compose(self.start, frame),
            self.breaks,
            se2.twist_of(frame, self.coefficients),
            self.arc,
            self.rate,
            se2.relative(frame, self.base),
        )

    def sample(self, rate: float) -> Trajectory:
        """Return the same motion with `t`, `poses`, `twists`, `base_poses` and `base_twists` at another rate, Hz.

        Raises:
            PushplanError: If the rate is not above 0.
        """
        return replace(self, rate=rate)

    def poses_at(self, t: ArrayLike) -> FloatArray:
        """Return the poses (m, 3) in the world at times (m,), clipped to the trajectory.

        Raises:
            PushplanError: If a time is not a number.
        """
        t = np.clip(parameters(t, "times"), 0.0, self.duration)
        if len(self.coefficients) == 0:
            return np.broadcast_to(self.start, (*t.shape, 3)).copy()
        piece = self.piece_at(t)
        tau = t - self.breaks[piece]
        return se2.compose(
            self.break_poses[piece], advance(self.columns.take(piece, axis=2), np.zeros_like(tau), tau)
        )
