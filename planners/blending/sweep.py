"""Where a timed motion comes too close to something: bisection with the compiled separation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.planners.collision.separation import Scene, separation
from pushplan.planners.timing.motion_bounds import top_rates
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray

COARSE = 0.02
"""Travel of the body's farthest point (m) between the first poses that are looked at."""

FINE = 0.002
"""Travel (m) down to which the neighbourhood of a touch is looked at."""


@compiled
def separations(scene: Scene, poses: FloatArray, enough: float) -> FloatArray:
    """Return a lower bound (m,) on the distance of the body at poses (m, 3) from everything, capped at `enough`."""
    out = np.empty(len(poses))
    for i in range(len(poses)):
        out[i] = separation(scene, poses[i, 0], poses[i, 1], poses[i, 2], enough)
    return out


def least_gap(scene: Scene) -> float:
    """Return the separation (m) that poses looked at must have: half-way from what is kept to what planners keep."""
    return 0.5 * (scene.kept + scene.clearance)


class Touches(NamedTuple):
    """Where a motion comes too close to something: times (k,), increasing, s, and separations (k,), m."""

    times: FloatArray
    gaps: FloatArray


def find_touches(scene: Scene, trajectory: Trajectory, reach: float) -> Touches:
    """Return where the body comes too close to something, nowhere if it keeps `scene.kept` throughout.

    Between two poses with separations g and h, no point of the body travelling more than d, the body stays
    (g + h - d) / 2 away from everything. Where that is not at least `scene.kept`, the time between is
    halved; every pose looked at must have a bit more, see `least_gap`. So an empty answer is a proof. Where
    something is touched, the neighbourhood is looked at every `FINE` of travel.

    Args:
        scene: What moves and what stands still.
        trajectory: The motion.
        reach: Distance from the chain frame's origin to the body's farthest point, m.
    """
    rates = top_rates(np.diff(trajectory.breaks), np.array(trajectory.coefficients), reach)
    travel = np.concatenate([[0.0], np.cumsum(rates * np.diff(trajectory.breaks))])
    s = np.linspace(0.0, travel[-1], max(2, int(np.ceil(travel[-1] / COARSE)) + 1))
    gaps = _gaps(scene, trajectory, travel, s)
    ends = np.stack([s[:-1], s[1:], gaps[:-1], gaps[1:]])
    places, found = [s], [gaps]
    while ends.shape[1]:
        low, high, g, h = ends
        free = g + h - (high - low) >= 2.0 * scene.kept
        known = (np.minimum(g, h) < least_gap(scene)) & (high - low <= FINE)
        low, high, g, h = ends[:, ~free & ~known]
        middle = 0.5 * (low + high)
        m = _gaps(scene, trajectory, travel, middle)
        places.append(middle)
        found.append(m)
        ends = np.hstack([np.stack([low, middle, g, m]), np.stack([middle, high, m, h])])
    s, gaps = np.concatenate(places), np.concatenate(found)
    close = np.flatnonzero(gaps < least_gap(scene))
    close = close[np.argsort(s[close])]
    return Touches(np.interp(s[close], travel, trajectory.breaks), gaps[close])


def _gaps(scene: Scene, trajectory: Trajectory, travel: FloatArray, s: FloatArray) -> FloatArray:
    """Separations (m,) at the body's travels (m,)."""
    poses = trajectory.poses_at(np.interp(s, travel, trajectory.breaks))
    return np.asarray(separations(scene, poses, 2.0 * (COARSE + scene.clearance)))
