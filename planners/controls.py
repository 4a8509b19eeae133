"""The controls of a planner: the stable set cut down to what the pusher's drive can do.

Both come as arrays of stable twists: segments, of which every positive combination of the two ends is
stable (meridians of the twist sphere, or pieces of the drive's own family), and steering families for exact
connections.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.chain import Drive
from pushplan.errors import EmptyStableSetError
from pushplan.path import cost_rate
from pushplan.sphere import twists_at
from pushplan.stable_set import StableSet

MARGIN_FLOOR = 1e-6
"""Planned twists keep at least this margin, so that rounding cannot put them on the boundary."""

FAMILIES = 4
"""Steering families with different straight directions."""

TURNS = 1024
"""Turning rates at which a drive's family is scanned for changes between stable and not."""


def control_segments(stable: StableSet, drive: Drive, margin: float) -> FloatArray:
    """Return the segments (k, 6) of stable twists that the drive can make.

    Args:
        stable: The set.
        drive: Of the robot that carries the plate.
        margin: Every twist has more than this.

    Raises:
        EmptyStableSetError: When there are none.
    """
    if drive.axle is None:
        meridians = stable.meridians(margin)
        length = stable.chain.characteristic_length
        ends = [twists_at(meridians.longitude, lat, length) for lat in (meridians.lower, meridians.upper)]
        segments = np.hstack(ends)
    else:
        turns = _stable_turns(stable, drive, margin)
        segments = np.hstack([_drive_twists(drive.axle, turns[:, 0]), _drive_twists(drive.axle, turns[:, 1])])
    if len(segments) == 0:
        raise EmptyStableSetError(
            f"no twist that the {drive.kind} pusher can make keeps every contact with a margin above {margin:g} "
            f"(set {stable.name}); widen the contacts, raise their friction, move the loads, or choose another drive"
        )
    return segments


def steering_families(stable: StableSet, drive: Drive, margin: float) -> FloatArray:
    """Return the families (f, 3, 3) of left, straight and right twists, scaled to a cost rate of 1, best first.

    Rows of zeros stand for motions that are not stable.
    """
    if drive.axle is None:
        pairs = stable.steering_pairs(margin, FAMILIES)
        turns = [(pair.left, pair.straight, pair.right) for pair in pairs]
        families = np.array([[_unit_cost(twist) for twist in turn] for turn in turns]).reshape(-1, 3, 3)
    else:
        families = _drive_family(stable, drive, margin)[None]
    return families if len(families) else np.zeros((1, 3, 3))


def _unit_cost(twist: FloatArray | None) -> FloatArray:
    return np.zeros(3) if twist is None else twist / cost_rate(twist)


def _drive_twists(axle: FloatArray, turns: FloatArray) -> FloatArray:
    """Twists (k, 3) that move the axle's middle ahead at 1 m/s while turning at `turns` (k,) rad/m."""
    x, y, heading = axle
    return np.column_stack([np.cos(heading) + turns * y, np.sin(heading) - turns * x, turns])


def _stable_turns(stable: StableSet, drive: Drive, margin: float) -> FloatArray:
    """Intervals (k, 2) of turns per metre, rad/m, that are stable, their ends found by bisection on the inside."""
    assert drive.axle is not None
    scale = stable.chain.characteristic_length
    limit = math.inf if drive.min_radius == 0.0 else 1.0 / drive.min_radius
    angles = np.linspace(-0.5, 0.5, TURNS + 2)[1:-1] * np.pi
    turns = np.unique(np.append(np.clip(np.tan(angles) / scale, -limit, limit), 0.0))
    inside = _stable_at(stable, drive.axle, turns, margin)
    steps = np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8))
    firsts, lasts = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1
    low = [_bisect(stable, drive.axle, turns, int(i), int(i) - 1, margin) for i in firsts]
    high = [_bisect(stable, drive.axle, turns, int(i), int(i) + 1, margin) for i in lasts]
    return np.column_stack([low, high]) if low else np.zeros((0, 2))


def _stable_at(stable: StableSet, axle: FloatArray, turns: FloatArray, margin: float) -> np.ndarray:
    return np.asarray(stable.margin(_drive_twists(axle, turns)) > margin)


def _bisect(
    stable: StableSet, axle: FloatArray, turns: FloatArray, inside: int, outside: int, margin: float
) -> float:
    """Turn per metre at the edge of the set between two scanned ones, on the stable side."""
    good = float(turns[inside])
    if not 0 <= outside < len(turns):
        return good
    bad = float(turns[outside])
    for _ in range(60):
        middle = 0.5 * (good + bad)
        if _stable_at(stable, axle, np.array([middle]), margin)[0]:
            good = middle
        else:
            bad = middle
    return good


def _drive_family(stable: StableSet, drive: Drive, margin: float) -> FloatArray:
    """The tightest left turn, the straight push and the tightest right turn of a drive."""
    assert drive.axle is not None
    turns = _stable_turns(stable, drive, margin)
    choice = np.zeros((3, 3))
    if len(turns) and turns.max() > 0.0:
        choice[0] = _drive_twists(drive.axle, turns.max(keepdims=True).ravel()[:1])[0]
    if len(turns) and turns.min() < 0.0:
        choice[2] = _drive_twists(drive.axle, turns.min(keepdims=True).ravel()[:1])[0]
    if ((turns[:, 0] <= 0.0) & (turns[:, 1] >= 0.0)).any():
        choice[1] = _drive_twists(drive.axle, np.zeros(1))[0]
    rates = cost_rate(choice)
    return choice / np.where(rates > 0.0, rates, 1.0)[:, None]
