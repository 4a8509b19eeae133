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

from pushplan.arrays import FloatArray
from pushplan.errors import TimingError
from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics import ContactDynamics, DynamicRows
from pushplan.planners.profile import ArcLimits, rest_to_rest

ROOM = 0.9
"""Share of every contact condition's quasi-static value that inertia may use up; the rest is for safety."""

SPLITS = 24
"""Top speeds tried when speed and acceleration compete for the same contact condition."""

CREEP = 10.0
"""An arc that the contacts slow down by more than this factor is refused: its twist leaves no room to accelerate."""


LEAST = 1e-6
"""Smallest acceleration of the arc parameter (1/s^2) with which anything is driven."""


class Bounds(NamedTuple):
    """What limits a motion.

    Attributes:
        limits: Of the pusher.
        contacts: The chain whose contacts must hold; None leaves inertia out.
        pace: Share of an arc's top speed with which it is passed at most.
    """

    limits: Limits
    contacts: ContactDynamics | None
    pace: float = 1.0


def arc_limits(twist: FloatArray, limits: Limits, top: float = math.inf) -> ArcLimits:
    """Return bounds on s', s'' and s''' that keep an arc within the pusher's limits.

    Args:
        twist: (3,) body twist per unit of s.
        limits: Of the contact midpoint and of the turning.
        top: Bound on s' from elsewhere; a lower one leaves more for s'' and s'''.
    """
    v, omega = math.hypot(twist[0], twist[1]), abs(twist[2])
    speed = min(top, _ratio(limits.speed, v), _ratio(limits.angular_speed, omega))
    jerk = limits.jerk
    if v * omega > 0.0:
        jerk /= math.sqrt(2.0)  # an equal share for the tangential and for the normal part
        speed = min(speed, math.sqrt(limits.acceleration / (math.sqrt(2.0) * omega * v)))
        speed = min(speed, (jerk / (2.0 * omega**2 * v)) ** (1.0 / 3.0))
    tangential = math.sqrt(limits.acceleration**2 - (speed**2 * omega * v) ** 2)
    acceleration = min(_ratio(tangential, v), _ratio(limits.angular_acceleration, omega))
    acceleration = min(acceleration, _ratio(jerk, 3.0 * speed * omega * v))
    third = min(_ratio(jerk - speed**3 * omega**2 * v, v), _ratio(limits.angular_jerk, omega))
    return ArcLimits(speed, acceleration, acceleration, third)


def contact_limits(twist: FloatArray, length: float, bounds: Bounds) -> ArcLimits:
    """Return `arc_limits`, cut down so that inertia uses at most `ROOM` of every contact condition.

    The conditions are linear in (s'^2, s''), so they hold on the rectangle [0, speed^2] x [-deceleration,
    acceleration] if they hold at its corners. Of all such rectangles within the pusher's limits, the one is
    taken that makes the arc shortest in time.

    Args:
        twist: (3,) body twist per unit of s.
        length: Of the arc, in s.
        bounds: What limits the motion.

    Raises:
        TimingError: When the twist is so close to the boundary of the stable set that the arc would take
            `CREEP` times as long.
    """
    free = arc_limits(twist, bounds.limits)
    if bounds.contacts is None:
        return free
    rows = bounds.contacts.rows(twist)
    top = min(free.speed, math.sqrt(ROOM) * rows.steady_speed)
    tried = [_beside_inertia(arc_limits(twist, bounds.limits, share * top), rows) for share in _shares()]
    able = [found for found in tried if min(found.acceleration, found.deceleration) > LEAST]
    times = [rest_to_rest(length, found).duration for found in able]
    usual = rest_to_rest(length, free).duration
    if not times or min(times) > CREEP * usual:
        least = float(rows.alpha.min())
        raise TimingError(
            f"an arc along the twist {np.round(twist, 4).tolist()} leaves the contacts no room for inertia: one "
            f"condition holds by {least:.3g} N only; raise stability.margin, or use quasi-static contact limits"
        )
    return able[int(np.argmin(times))]


def _shares() -> FloatArray:
    return (np.arange(SPLITS) + 1.0) / SPLITS


def _beside_inertia(found: ArcLimits, rows: DynamicRows) -> ArcLimits:
    """Cut the accelerations down to what the contacts bear at every speed up to the bound."""
    left = ROOM * rows.alpha + np.minimum(rows.gamma, 0.0) * found.speed**2
    return found._replace(
        acceleration=min(found.acceleration, _bearable(left, -rows.beta)),
        deceleration=min(found.deceleration, _bearable(left, rows.beta)),
    )


def _bearable(left: FloatArray, cost: FloatArray) -> float:
    """Largest x with cost x <= left for every row."""
    paying = cost > 0.0
    return float(np.min(left[paying] / cost[paying], initial=np.inf)) if (left >= 0.0).all() else 0.0


def _ratio(limit: float, rate: float) -> float:
    return limit / rate if rate > 0.0 else math.inf
