"""The fastest trajectory along a path with a stop after every arc."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import pushplan.core.timing as timing
from pushplan.mechanics.chain import LimitName, Limits
from pushplan.planners.timing.arc_limits import ROOM, Bounds, limits_of_arcs
from pushplan.planners.timing.profiles import rest_to_rest
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.util.arrays import FloatArray, IntArray


class Pieces(NamedTuple):
    """A twist as a sequence of quadratics in time.

    Attributes:
        durations: (q,) durations of the pieces, s.
        coefficients: (q, 3, 3) coefficients of the twist in the time since the beginning of each piece, lowest order
            first.
        level: (q,) index of the level of each piece, after the last completed step.
    """

    durations: FloatArray
    coefficients: FloatArray
    level: IntArray

    @classmethod
    def through(cls, levels: FloatArray, centers: FloatArray, widths: FloatArray) -> Pieces:
        """Return the twist through levels (m + 1, 3) by m smooth steps; see `core.timing.step_sum`."""
        return cls(*timing.step_sum(levels, centers, widths))

    @property
    def motion(self) -> FloatArray:
        """(3,) end pose relative to the beginning."""
        return np.asarray(timing.poses_after(np.zeros(3), self.coefficients, self.durations)[-1])


ORDERS = np.array([[1.0], [2.0], [3.0], [2.0]])
"""Powers of the speed with which the shares grow: speed, acceleration, jerk, contact conditions."""


class Use(NamedTuple):
    """Used shares of the limits, by piece of a motion.

    Attributes:
        shares: (4, q) used shares of the limits of speed, acceleration, jerk and contacts. Up to 1, a limit is kept.
        slowing: (q,) factor by which the twists must change more slowly so that the contacts hold.
    """

    shares: FloatArray
    slowing: FloatArray


def bounds_use(pieces: Pieces, bounds: Bounds) -> Use:
    """Return the used shares of the limits for each piece.

    The first three shares bound the whole piece. The last one is computed at its beginning and its middle. It is the
    share of the contacts' reserve above the required margin (times `arc_limits.ROOM`) that inertia uses.
    """
    pusher = limit_use(pieces, bounds.limits)
    held, slowing = np.zeros(len(pusher)), np.ones(len(pusher))
    for one in bounds.conditions:
        twists, rates, piece = _instants(pieces)
        floor, inertia = one.quasi_static(twists), one.rows_of_inertia(twists, twists, rates)
        steady = one.rows_of_inertia(twists, twists, np.zeros_like(rates))
        own = timing.contact_use(floor, inertia, steady, piece, len(pusher), bounds.margin, ROOM)
        held, slowing = np.maximum(held, own[0]), np.maximum(slowing, own[1])
    return Use(np.vstack([pusher.T, held]), slowing)


def _instants(pieces: Pieces) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return twists and rates (k, 3) at the beginning and middle of moving pieces, and the pieces' indices (k,)."""
    t, piece = np.outer(pieces.durations, [0.0, 0.5]).reshape(-1, 1), np.repeat(np.arange(len(pieces.durations)), 2)
    c0, c1, c2 = pieces.coefficients[piece].transpose(1, 0, 2)
    twists, rates = c0 + t * (c1 + t * c2), c1 + 2.0 * t * c2
    moving = twists.any(axis=1)
    return twists[moving], rates[moving], piece[moving]


def limit_use(pieces: Pieces, limits: Limits) -> FloatArray:
    """Return upper bounds (q, 3) of each piece's used shares of the limits of speed, acceleration and jerk.

    Each is the larger of the linear and the angular share.
    """
    names: tuple[LimitName, ...] = ("speed", "acceleration", "angular_speed", "angular_acceleration")
    sides = np.array([limits.both(name) for name in names])
    return timing.limit_use(*pieces[:2], sides, limits.jerk, limits.angular_jerk)


def time_path(path: PushPath, bounds: Bounds, rate: float = SAMPLE_RATE) -> Trajectory:
    """Return the trajectory that stops wherever the path's twist changes.

    Args:
        path: Constant-twist arcs.
        bounds: Limits of the motion.
        rate: Samples per second of the trajectory.

    Raises:
        TimingError: If an arc cannot be timed.
    """
    durations: list[FloatArray] = [np.zeros(0)]
    coefficients: list[FloatArray] = [np.zeros((0, 3, 3))]
    arcs: list[FloatArray] = [np.zeros(0)]
    for k, limits in enumerate(limits_of_arcs(path.twists, path.lengths, bounds)):
        profile = rest_to_rest(float(path.lengths[k]), limits)
        durations.append(profile.durations)
        coefficients.append(profile.along(path.twists[k]))
        arcs.append(np.full(len(profile.durations), float(k)))
    breaks = np.concatenate([[0.0], np.cumsum(np.concatenate(durations))])
    return Trajectory(path.start, breaks, np.concatenate(coefficients), np.concatenate(arcs), rate)
