"""Collisions and lost contacts along a motion, and conditions on arc lengths that avoid collisions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import pushplan.core.contacts as contacts
from pushplan.core.collision import Scene, separations
from pushplan.geometry import se2
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sets.force_limited_set import ForceLimitedSet
from pushplan.sets.known_load_sets import EcofSet
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, columns_of, distinct

COARSE = 0.02
"""Travel of the body's farthest point (m) between the first poses that are checked."""

FINE = 0.002
"""Travel (m) between the poses that are checked near a collision."""


def least_gap(scene: Scene) -> float:
    """Return the separation (m) that checked poses must have: halfway between `kept` and `clearance`."""
    return 0.5 * (scene.kept + scene.clearance)


class Touches(NamedTuple):
    """Instants at which a motion is too close to something: increasing times (k,), s; separations (k,), m."""

    times: FloatArray
    gaps: FloatArray


NOTHING_TOUCHED = Touches(np.zeros(0), np.zeros(0))


def find_touches(scene: Scene, trajectory: Trajectory, reach: float) -> Touches:
    """Return when the body is too close to something; empty if it keeps `scene.kept` throughout.

    Take two poses with separations g and h, between which no point of the body travels more than d. Between them, the
    body stays (g + h - d) / 2 away from everything. If this is less than `scene.kept`, the interval is halved. Every
    checked pose must have a bit more (`least_gap`). So an empty result is a proof. Near a collision, poses are
    checked every `FINE` of travel.

    Args:
        scene: Collision scene.
        trajectory: The motion.
        reach: Distance from the chain frame's origin to the body's farthest point, m.
    """
    rates = _top_rates(trajectory, reach)
    travel = np.concatenate([[0.0], np.cumsum(rates * np.diff(trajectory.breaks))])
    s = np.linspace(0.0, travel[-1], max(2, int(np.ceil(travel[-1] / COARSE)) + 1))
    gaps = _gaps(scene, trajectory, travel, s)
    ends = np.stack([s[:-1], s[1:], gaps[:-1], gaps[1:]])
    places, found = [s], [gaps]
    while ends.shape[1]:
        low, high, g, h = ends
        free = g + h - (high - low) >= 2.0 * scene.kept
        resolved = (np.minimum(g, h) < least_gap(scene)) & (high - low <= FINE)
        low, high, g, h = ends[:, ~free & ~resolved]
        middle = 0.5 * (low + high)
        m = _gaps(scene, trajectory, travel, middle)
        places.append(middle)
        found.append(m)
        ends = np.hstack([np.stack([low, middle, g, m]), np.stack([middle, high, m, h])])
    s, gaps = np.concatenate(places), np.concatenate(found)
    close = np.flatnonzero(gaps < least_gap(scene))
    close = close[np.argsort(s[close])]
    return Touches(np.interp(s[close], travel, trajectory.breaks), gaps[close])


def _top_rates(trajectory: Trajectory, reach: float) -> FloatArray:
    """Return upper bounds (q,) of the speed of any point within `reach` (m) of the origin, by piece, m/s.

    A quadratic lies in the hull of its Bernstein coefficients.
    """
    duration, (c0, c1, c2) = np.diff(trajectory.breaks)[:, None], np.moveaxis(trajectory.coefficients, 1, 0)
    hull = np.stack([c0, c0 + 0.5 * duration * c1, c0 + duration * (c1 + duration * c2)])
    return np.asarray(np.hypot(hull[..., 0], hull[..., 1]).max(axis=0) + reach * np.abs(hull[..., 2]).max(axis=0))


def sampled(trajectory: Trajectory) -> Trajectory:
    """Return the motion through a trajectory's samples, with a constant twist between neighbours."""
    t, poses = trajectory.t, trajectory.poses
    coefficients = np.zeros((len(t) - 1, 3, 3))
    coefficients[:, 0] = se2.log(se2.relative(poses[:-1], poses[1:])) / np.diff(t)[:, None]
    return Trajectory(trajectory.start, t, coefficients, np.zeros(len(t) - 1), trajectory.rate)


def _gaps(scene: Scene, trajectory: Trajectory, travel: FloatArray, s: FloatArray) -> FloatArray:
    """Return the separations (m,) at the body's travels (m,)."""
    poses = trajectory.poses_at(np.interp(s, travel, trajectory.breaks))
    return separations(scene, poses, 2.0 * (COARSE + scene.clearance))


APART = 0.2
"""Time (s) below which neighbouring collisions count as one. The worst of them is avoided."""

ROOM = 2.0
"""Target of a nudge beyond the clearance, as a multiple of the possible loss between checked poses."""

STEP = 1e-5
"""Step of the separation's finite differences: in m, and in rad times the body's reach."""


class LengthRows(NamedTuple):
    """Linear conditions on the lengths x (k,) of a path's arcs: matrix (c, k) x >= values (c,)."""

    matrix: FloatArray
    values: FloatArray

    def joined(self, other: LengthRows) -> LengthRows:
        """Return the conditions of both."""
        return LengthRows(np.vstack([self.matrix, other.matrix]), np.append(self.values, other.values))


def no_rows(count: int) -> LengthRows:
    """Return an empty set of conditions on `count` lengths."""
    return LengthRows(np.zeros((0, count)), np.zeros(0))


def effects_on(pose: FloatArray, path: PushPath) -> FloatArray:
    """Return the body twists (3, k) of a later pose (3,) per unit of each arc's length."""
    knots = se2.relative(pose, path.knots[1:])
    v, omega = se2.rotate(knots[:, 2], path.twists[:, :2]), path.twists[:, 2]
    return np.stack([v[:, 0] + omega * knots[:, 1], v[:, 1] - omega * knots[:, 0], omega])


def nudges(
    scene: Scene, path: PushPath, trajectory: Trajectory, lengths: FloatArray, touches: Touches, reach: float
) -> LengthRows:
    """Return conditions on the lengths that move the motion away from its collisions.

    Args:
        scene: Collision scene.
        path: The path that was blended.
        trajectory: The blended motion.
        lengths: (k,) lengths of its arcs.
        touches: Its collisions.
        reach: Reach of the body, m.
    """
    rows = no_rows(len(lengths))
    for group in np.split(np.arange(len(touches.times)), np.flatnonzero(np.diff(touches.times) > APART) + 1):
        worst = group[np.argmin(touches.gaps[group])]
        time = touches.times[worst]
        pose = trajectory.poses_at([time])[0]
        before = np.arange(len(lengths)) < trajectory.arc[trajectory.piece_at([time])[0]]
        row = np.where(before, _gradient(scene, pose, reach) @ effects_on(pose, path), 0.0)
        missing = scene.clearance + ROOM * (scene.clearance - scene.kept) - touches.gaps[worst]
        rows = rows.joined(LengthRows(row[None], np.array([row @ lengths + missing])))
    return rows


def _gradient(scene: Scene, pose: FloatArray, reach: float) -> FloatArray:
    """Return the gradient (3,) of the separation for body twists at a pose (3,)."""
    steps = STEP * np.array([1.0, 1.0, 1.0 / reach])
    poses = [se2.compose(pose, se2.exp(sign * step)) for step in np.diag(steps) for sign in (1.0, -1.0)]
    ahead, behind = separations(scene, np.array(poses), 1.0).reshape(3, 2).T
    return np.asarray((ahead - behind) / (2.0 * steps))


RESTING = 1e-9
"""Twist components (m/s, rad/s) up to which the pusher is at rest."""


def unstable_times(scenario: Scenario, stable: StableSet, trajectory: Trajectory, bounds: Bounds) -> FloatArray:
    """Return the times (k,) at which the trajectory does not keep the scenario's margins, worst first, s.

    The samples, the breaks and the middles between breaks are checked. Along one twist, only the ends are checked,
    and rest is not checked. No push begins between two twists, so there the force must only suffice for sliding.
    """
    stable = stable.inside if isinstance(stable, ForceLimitedSet) else stable
    breaks = trajectory.breaks
    times = distinct(np.concatenate([trajectory.t, breaks, 0.5 * (breaks[:-1] + breaks[1:])]))
    times = times[trajectory.changes_at(times)]
    twists = trajectory.twists_at(times)
    moving = np.abs(columns_of(twists)).max(axis=0) > RESTING
    times, twists = times[moving], twists[moving]
    dynamics, floor = bounds.contacts, None
    if dynamics is not None and isinstance(stable, EcofSet) and stable.chain is dynamics.chain:
        floor = dynamics.floor_wrenches(twists)  # the wrenches that the set uses
        margins = columns_of(contacts.contact_margins_of(stable.packed, floor)).min(axis=0)
    else:
        margins = stable.margin(twists)
    spare = margins - scenario.required_margin
    if dynamics is not None:
        with_inertia = dynamics.margins(twists, trajectory.rates_at(times), floor)
        spare = np.minimum(spare, columns_of(with_inertia).min(axis=0) - bounds.margin)
    if bounds.force is not None:
        force = bounds.force.force.moving(twists, trajectory.rates_at(times))
        spare = np.minimum(spare, 1.0 - force / bounds.force.limit)
    worst = np.argsort(spare, kind="stable")
    return np.asarray(times[worst][spare[worst] <= 0.0])


def off_chords(trajectory: Trajectory, reach: float) -> float:
    """Return an upper bound (m) of a body's deviation from constant twists between the samples of its motion.

    The part of dV/dt along the twist V changes only the timing, not the path. The rest deflects a point by at most
    h^2 / 8 times the acceleration that it causes, where h is the time between samples.

    Args:
        trajectory: The motion.
        reach: Distance from the chain frame's origin to the body's farthest point, m.
    """
    durations, scale = np.diff(trajectory.breaks)[:, None], np.array([1.0, 1.0, reach])
    c0, c1, c2 = (trajectory.coefficients[:, k] * scale for k in range(3))
    twists = np.concatenate([c0, c0 + durations * (c1 + durations * c2)])
    rates = np.concatenate([c1, c1 + 2.0 * durations * c2])
    along = (rates * twists).sum(axis=1) / np.maximum((twists * twists).sum(axis=1), RESTING**2)
    rest = rates - along[:, None] * twists
    most = np.hypot(rest[:, 0], rest[:, 1]) + np.abs(rest[:, 2])
    return float(most.max(initial=0.0)) / (8.0 * trajectory.sample_rate**2)
