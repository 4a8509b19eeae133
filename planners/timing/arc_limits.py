"""How fast an arc of constant body twist may be driven: limits of the pusher and of the contacts.

Along an arc of twist xi = (v, omega) with parameter s, the contact midpoint has the acceleration
(s'' v, s'^2 omega v) and the jerk (s''' v - s'^3 omega^2 v, 3 s' s'' omega v), tangential and normal. The
limits of the arc parameter are chosen so that the magnitudes of both stay within the pusher's limits
whatever the profile does.
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
"""Share of the margin asked for that contacts keep with inertia."""


class Bounds(NamedTuple):
    """What limits a motion.

    Attributes:
        limits: Of the pusher.
        contacts: The chain whose contacts must hold; None leaves inertia out.
        margin: Every contact keeps more than this with inertia.
        force: What the plate pushes with at most; None where nothing limits it.
    """

    limits: Limits
    contacts: ContactDynamics | None = None
    margin: float = 0.0
    force: ForceConditions | None = None

    @property
    def conditions(self) -> tuple[MotionConditions, ...]:
        """What inertia must not break."""
        return tuple(one for one in (self.contacts, self.force) if one is not None)


def motion_bounds(scenario: Scenario, stable: StableSet) -> Bounds:
    """Return what limits the motion of a scenario: pusher, force and, unless inertia is left out, the contacts."""
    limits = scenario.chain.pusher.limits
    force = None
    if not math.isinf(limits.force):
        force = ForceConditions(push_force(scenario, stable.name), limits.force)
    if limits.contact != "dynamic":
        return Bounds(limits, force=force)
    contacts = contact_dynamics(scenario, stable.name)
    return Bounds(limits, contacts, INERTIA_SHARE * scenario.required_margin, force=force)


ROOM = 0.98
"""Share of what a contact condition has to spare above the margin to keep that inertia may use up.

The rest is for what lies between the places at which blended motions are looked at.
"""

SPLITS = 24
"""Top speeds tried when speed and acceleration compete for the same contact condition."""

CREEP = 10.0
"""An arc that the contacts slow down by more than this factor is refused: its twist leaves no room to accelerate."""


LEAST = 1e-6
"""Smallest acceleration of the arc parameter (1/s^2) with which anything is driven."""

STRAIGHT = 1e-9
"""Curvature (1/m) below which an arc is straight."""

SHARES = (np.arange(SPLITS) + 1.0) / SPLITS
"""Shares of the top speed that are tried."""


def arc_limits(twists: FloatArray, limits: Limits, top: float | FloatArray = math.inf) -> ArcLimits:
    """Return bounds on s', s'' and s''' that keep arcs within the pusher's limits.

    Args:
        twists: (..., 3) body twists per unit of s.
        limits: Of the contact midpoint and of the turning.
        top: Bound on s' from elsewhere (...); a lower one leaves more for s'' and s'''.
    """
    v, omega = np.hypot(twists[..., 0], twists[..., 1]), np.abs(twists[..., 2])
    back, ahead = limits.both("speed")
    braking, gaining = limits.both("acceleration")
    right, left = limits.both("angular_speed")
    rightward, leftward = limits.both("angular_acceleration")
    straight = np.where(twists[..., 0] < 0.0, back, ahead)
    turning, to_left = np.where(twists[..., 2] < 0.0, right, left), twists[..., 2] >= 0.0
    bend = v * omega
    # The tangential and the normal part share the jerk; that of a twist that is straight but for rounding is zero:
    # else the same path, planned again from rounded poses, would be driven in another time.
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
    """Return what arcs (k, 3), (k,) take from rest to rest at least, s: speed and acceleration alone limit them."""
    slow = arc_limits(twists, limits, 0.0)
    ramp = 0.5 / slow.acceleration + 0.5 / slow.deceleration
    speed = np.minimum(arc_limits(twists, limits).speed, np.sqrt(lengths / ramp))
    return np.asarray(lengths / speed + ramp * speed)


def contact_limits(twist: FloatArray, length: float, bounds: Bounds) -> ArcLimits:
    """Return `limits_of_arcs` of one arc, twist (3,)."""
    return limits_of_arcs(twist[None], np.array([length]), bounds)[0]


def limits_of_arcs(twists: FloatArray, lengths: FloatArray, bounds: Bounds) -> list[ArcLimits]:
    """Return `contact_limits_of` of arcs with twists (k, 3) and lengths (k,), as numbers for each.

    Raises:
        TimingError: If a twist is so close to the boundary of the stable set that its arc would take `CREEP`
            times as long.
    """
    found, able = contact_limits_of(twists, lengths, bounds)
    if not able.all():
        raise _no_room(twists[np.argmin(able)], bounds)
    return [ArcLimits(*(float(bound[i]) for bound in found)) for i in range(len(twists))]


def _no_room(twist: FloatArray, bounds: Bounds) -> TimingError:
    least = min(float(one.rows(twist, bounds.margin).alpha.min()) for one in bounds.conditions)
    kept = f" above a margin of {bounds.margin:.3g}" if bounds.margin > 0.0 else ""
    return TimingError(
        f"an arc along the twist {np.round(twist, 4).tolist()} leaves the contacts no room for inertia: one "
        f"condition holds by {least:.3g} N only{kept}; raise stability.margin, or use quasi-static contact limits"
    )


def contact_limits_of(twists: FloatArray, lengths: FloatArray, bounds: Bounds) -> tuple[ArcLimits, BoolArray]:
    """Return `arc_limits`, cut down so that inertia uses at most `ROOM` of what every contact has to spare.

    The conditions are linear in (s'^2, s''), so they hold on the rectangle [0, speed^2] x [-deceleration,
    acceleration] if they hold at its corners. Of all such rectangles within the pusher's limits, the one is
    taken that makes the arc shortest in time.

    Args:
        twists: (k, 3) body twists per unit of s.
        lengths: (k,) of the arcs, in s.
        bounds: What limits the motion.

    Returns:
        The limits (k,), and (k,) whether the arc is driven in less than `CREEP` times its usual time with them.
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
    """Return a bound on what arcs take from rest to rest, s: nothing limits the jerk. See also `_fastest`."""
    ramps = 0.5 * limits.speed * (1.0 / limits.acceleration + 1.0 / limits.deceleration)
    return np.asarray(np.maximum(lengths / limits.speed, ramps) + ramps)


def _fastest(lengths: FloatArray, tried: ArcLimits, least: FloatArray) -> IntArray:
    """Return which limits (k, n) drive each arc (k,) in the shortest time, by Ruckig's answers.

    Where the speed is not reached, the arc counts as long enough for it: a lower speed, which leaves more for
    acceleration, is reached there. Ruckig is asked for those only that `least` (k, n), bounds on their times, leaves.
    """
    times, known = np.full(least.shape, np.inf), least.min(axis=1)
    for _ in range(2):  # the first answer leaves few others
        asked = np.nonzero((least <= known[:, None]) & (least < np.inf) & np.isinf(times))
        each = ArcLimits(*(bound[asked] for bound in tried))
        found, cruising = times_from_rest_to_rest(lengths[asked[0]], each).T
        short = cruising == 0.0
        if short.any():
            speed, up, down, jerk = (bound[short] for bound in each)
            found[short] = sum(
                step_windows(np.stack([rate, jerk]).T / speed[:, None]).sum(axis=1) for rate in (up, down)
            )
        times[asked] = found
        known = times.min(axis=1)
    return np.asarray(times.argmin(axis=1))


def _bearable(left: FloatArray, cost: FloatArray) -> FloatArray:
    """Largest x (...) with cost x <= left for every row (r, ...)."""
    most = ratio(np.maximum(left, 0.0), np.maximum(cost, 0.0)).min(axis=0)
    return np.where((left >= 0.0).all(axis=0), most, 0.0)


def ratio(limit: float | FloatArray, rate: FloatArray) -> FloatArray:
    """Return limit / rate, infinite where the rate is 0."""
    positive = rate > 0.0
    return np.where(positive, limit / np.where(positive, rate, 1.0), np.inf)
