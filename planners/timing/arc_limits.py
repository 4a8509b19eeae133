"""Limits of speed, acceleration and jerk on an arc of constant body twist, from the pusher and the contacts.

Along an arc of twist xi = (v, omega) with parameter s, the contact midpoint has the acceleration (s'' v, s'^2 omega
v) and the jerk (s''' v - s'^3 omega^2 v, 3 s' s'' omega v), tangential and normal. The limits of the arc parameter
are chosen so that the magnitudes of both stay within the pusher's limits for any profile.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.errors import TimingError
from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics import ContactDynamics, ForceConditions, MotionConditions
from pushplan.planners.timing.profiles import ArcLimits, step_windows, times_from_rest_to_rest
from pushplan.plans.judge import contact_dynamics, push_force
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

INERTIA_SHARE = 0.5
"""Share of the required margin that contacts keep with inertia."""


class Bounds(NamedTuple):
    """Limits of a motion.

    Attributes:
        limits: Limits of the pusher.
        contacts: Dynamics of the chain's contacts; None ignores inertia.
        margin: Lower limit of every contact's margin with inertia.
        force: Limit of the push force; None for no limit.
    """

    limits: Limits
    contacts: ContactDynamics | None = None
    margin: float = 0.0
    force: ForceConditions | None = None

    @property
    def conditions(self) -> tuple[MotionConditions, ...]:
        """Conditions that must hold with inertia."""
        return tuple(one for one in (self.contacts, self.force) if one is not None)


def motion_bounds(scenario: Scenario, stable: StableSet) -> Bounds:
    """Return the limits of a scenario's motion: pusher, force and, unless inertia is ignored, the contacts."""
    limits = scenario.chain.pusher.limits
    force = None
    if not math.isinf(limits.force):
        force = ForceConditions(push_force(scenario, stable.name), limits.force)
    if limits.contact != "dynamic":
        return Bounds(limits, force=force)
    contacts = contact_dynamics(scenario, stable.name)
    return Bounds(limits, contacts, INERTIA_SHARE * scenario.required_margin, force=force)


ROOM = 0.98
"""Share of a contact condition's reserve above the required margin that inertia can use.

The rest covers the motion between the instants at which blended motions are checked.
"""

SPLITS = 24
"""Number of top speeds tried if speed and acceleration compete for the same contact condition."""

CREEP = 10.0
"""Slowdown by the contacts above which an arc is refused, because its twist leaves no room to accelerate."""


LEAST = 1e-6
"""Smallest usable acceleration of the arc parameter, 1/s^2."""

STRAIGHT = 1e-9
"""Curvature (1/m) below which an arc is straight."""

SHARES = (np.arange(SPLITS) + 1.0) / SPLITS
"""Shares of the top speed that are tried."""


def arc_limits(twists: FloatArray, limits: Limits, top: float | FloatArray = math.inf) -> ArcLimits:
    """Return limits of s', s'' and s''' that keep arcs within the pusher's limits.

    Args:
        twists: (..., 3) body twists per unit of s.
        limits: Limits of the contact midpoint and of turning.
        top: Further limit of s' (...). A lower one leaves more room for s'' and s'''.
    """
    v, omega = np.hypot(twists[..., 0], twists[..., 1]), np.abs(twists[..., 2])
    back, ahead = limits.both("speed")
    braking, gaining = limits.both("acceleration")
    right, left = limits.both("angular_speed")
    rightward, leftward = limits.both("angular_acceleration")
    straight = np.where(twists[..., 0] < 0.0, back, ahead)
    turning, to_left = np.where(twists[..., 2] < 0.0, right, left), twists[..., 2] >= 0.0
    bend = v * omega
    # The tangential and the normal part share the jerk. A twist that is straight up to rounding has no normal part.
    # Otherwise the same path, planned again from rounded poses, would take another time.
    jerk = np.where(omega > STRAIGHT * v, limits.jerk / math.sqrt(2.0), limits.jerk)
    speed = np.minimum(top, np.minimum(ratio(straight, v), ratio(turning, omega)))
    speed = np.minimum(speed, np.sqrt(ratio(min(braking, gaining) / math.sqrt(2.0), bend)))
    speed = np.minimum(speed, np.cbrt(ratio(0.5 * jerk, omega * bend)))

    def rate(most: float, turn: FloatArray) -> FloatArray:
        tangential = np.sqrt(most**2 - (speed**2 * bend) ** 2)
        changed = np.minimum(ratio(tangential, v), ratio(turn, omega))
        bounded: FloatArray = np.minimum(changed, ratio(jerk, 3.0 * speed * bend))
        return bounded

    third = np.minimum(ratio(jerk - speed**3 * omega * bend, v), ratio(limits.angular_jerk, omega))
    up, down = np.where(to_left, leftward, rightward), np.where(to_left, rightward, leftward)
    return ArcLimits(speed, rate(gaining, up), rate(braking, down), third)


def least_times(twists: FloatArray, lengths: FloatArray, limits: Limits) -> FloatArray:
    """Return lower bounds (k,) of rest-to-rest times, s, from the limits of speed and acceleration alone."""
    slow = arc_limits(twists, limits, 0.0)
    ramp = 0.5 / slow.acceleration + 0.5 / slow.deceleration
    speed = np.minimum(arc_limits(twists, limits).speed, np.sqrt(lengths / ramp))
    return np.asarray(lengths / speed + ramp * speed)


def contact_limits(twist: FloatArray, length: float, bounds: Bounds) -> ArcLimits:
    """Return `limits_of_arcs` for one arc with a twist (3,)."""
    return limits_of_arcs(twist[None], np.array([length]), bounds)[0]


def limits_of_arcs(twists: FloatArray, lengths: FloatArray, bounds: Bounds) -> list[ArcLimits]:
    """Return `contact_limits_of` for twists (k, 3) and lengths (k,), as numbers for each arc.

    Raises:
        TimingError: If a twist is so close to the boundary of the stable set that its arc would take `CREEP` times as
            long.
    """
    found, able = contact_limits_of(twists, lengths, bounds)
    if not able.all():
        raise _no_room(twists[np.argmin(able)], bounds)
    return [ArcLimits(*(float(bound[i]) for bound in found)) for i in range(len(twists))]


def _no_room(twist: FloatArray, bounds: Bounds) -> TimingError:
    least = min(float(one.rows(twist, bounds.margin).alpha.min()) for one in bounds.conditions)
    above = f" above a margin of {bounds.margin:.3g}" if bounds.margin > 0.0 else ""
    return TimingError(
        f"an arc along the twist {np.round(twist, 4).tolist()} leaves the contacts no room for inertia: one "
        f"condition has a reserve of only {least:.3g} N{above}; raise stability.margin, or use "
        "quasi-static contact limits"
    )


def contact_limits_of(twists: FloatArray, lengths: FloatArray, bounds: Bounds) -> tuple[ArcLimits, BoolArray]:
    """Return `arc_limits`, reduced so that inertia uses at most `ROOM` of every contact's reserve.

    The conditions are linear in (s'^2, s''), so they hold on the rectangle [0, speed^2] x [-deceleration,
    acceleration] if they hold at its corners. Among all such rectangles within the pusher's limits, the one with the
    shortest time is chosen.

    Args:
        twists: (k, 3) body twists per unit of s.
        lengths: (k,) lengths of the arcs, in s.
        bounds: Limits of the motion.

    Returns:
        The limits (k,), and (k,) whether the arc with them takes less than `CREEP` times its usual time.
    """
    free = arc_limits(twists, bounds.limits)
    if not bounds.conditions:
        return free, np.ones(len(twists), dtype=np.bool_)
    parts = zip(*(one.rows_along(twists, bounds.margin) for one in bounds.conditions), strict=True)
    rows = (np.concatenate(part, axis=1) for part in parts)
    # rows first: NumPy is slow along short axes
    alpha, beta, gamma, beta_down = (values.reshape(len(twists), -1).T[:, :, None] for values in rows)
    falling = np.where(gamma < 0.0, -gamma, 0.0)
    steady = np.sqrt(ratio(np.maximum(alpha, 0.0), falling).min(axis=0)[:, 0])
    top = np.minimum(free.speed, math.sqrt(ROOM) * steady)
    tried = arc_limits(twists[:, None], bounds.limits, SHARES * top[:, None])
    left = ROOM * alpha - falling * tried.speed**2
    tried = tried._replace(
        acceleration=np.minimum(tried.acceleration, _bearable(left, -beta)),
        deceleration=np.minimum(tried.deceleration, _bearable(left, -beta_down)),
    )
    able = np.minimum(tried.acceleration, tried.deceleration) > LEAST
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.where(able, _without_jerk(lengths[:, None], tried), np.inf)
    best = np.arange(len(lengths)), _fastest(lengths, tried, least)
    return ArcLimits(*(bound[best] for bound in tried)), least[best] <= CREEP * _without_jerk(lengths, free)


def _without_jerk(lengths: FloatArray, limits: ArcLimits) -> FloatArray:
    """Return lower bounds of the arcs' rest-to-rest times without a jerk limit, s; see `_fastest`."""
    ramps = 0.5 * limits.speed * (1.0 / limits.acceleration + 1.0 / limits.deceleration)
    return np.asarray(np.maximum(lengths / limits.speed, ramps) + ramps)


def _fastest(lengths: FloatArray, tried: ArcLimits, least: FloatArray) -> IntArray:
    """Return the index (k,) of the limits (k, n) with the shortest time for each arc, computed by Ruckig.

    An arc that is too short to reach the top speed counts as just long enough. A lower top speed, which leaves more
    room for acceleration, then wins. The lower bounds `least` (k, n) of the times save calls of Ruckig.
    """
    times, shortest = np.full(least.shape, np.inf), least.min(axis=1)
    for _ in range(2):  # the first result rules out most others
        pending = np.nonzero((least <= shortest[:, None]) & (least < np.inf) & np.isinf(times))
        each = ArcLimits(*(bound[pending] for bound in tried))
        found, cruising = times_from_rest_to_rest(lengths[pending[0]], each).T
        short = cruising == 0.0
        if short.any():
            speed, up, down, jerk = (bound[short] for bound in each)
            found[short] = sum(
                step_windows(np.stack([rate, jerk]).T / speed[:, None]).sum(axis=1) for rate in (up, down)
            )
        times[pending] = found
        shortest = times.min(axis=1)
    return np.asarray(times.argmin(axis=1))


def _bearable(left: FloatArray, cost: FloatArray) -> FloatArray:
    """Return the largest x (...) with cost x <= left for every row (r, ...)."""
    most = ratio(np.maximum(left, 0.0), np.maximum(cost, 0.0)).min(axis=0)
    return np.where((left >= 0.0).all(axis=0), most, 0.0)


def ratio(limit: float | FloatArray, rate: FloatArray) -> FloatArray:
    """Return limit / rate; infinite if the rate is 0."""
    positive = rate > 0.0
    return np.where(positive, limit / np.where(positive, rate, 1.0), np.inf)
