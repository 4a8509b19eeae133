"""Controls of the pusher for a margin: segments of stable twists, and families of twists for exact steering."""

from __future__ import annotations

import math

import numpy as np

from pushplan.core.problem import LEFT, RIGHT, STRAIGHT
from pushplan.errors import EmptyStableSetError
from pushplan.mechanics.chain import Drive
from pushplan.mechanics.sphere import TurningRadii, twists_at
from pushplan.plans.path import cost_rate
from pushplan.scenario.model import Scenario
from pushplan.sets.boundary import margin_peaks
from pushplan.sets.force_limited_set import ForceLimitedSet
from pushplan.sets.known_load_sets import HELP, contact_words, emptiness, weakest_contact
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import AUTO

MARGIN_FLOOR = 1e-6
"""Extra margin of planned twists, so that rounding cannot violate the required margin."""

MERIDIANS = 512
"""Number of meridians of the stable set for the controls of an omnidirectional pusher."""


def control_segments(stable: StableSet, drive: Drive, margin: float, count: int = MERIDIANS) -> FloatArray:
    """Return the segments (k, 6) of stable twists that the drive can make.

    Args:
        stable: Stable set.
        drive: Drive of the robot that carries the plate.
        margin: Lower limit of every twist's margin.
        count: Number of meridians for an omnidirectional pusher.

    Raises:
        EmptyStableSetError: If there are none.
    """
    if drive.axle is None:
        meridians = stable.meridians(margin, count)
        if not len(meridians.longitude):  # the set is so small that it lies between meridians
            meridians = stable.refined_meridians(margin).meridians
        length = stable.chain.characteristic_length
        ends = [twists_at(meridians.longitude, lat, length) for lat in (meridians.lower, meridians.upper)]
        segments = np.hstack(ends)
    else:
        turns = _stable_turns(stable, drive, margin)
        segments = np.hstack([_drive_twists(drive.axle, turns[:, 0]), _drive_twists(drive.axle, turns[:, 1])])
    if len(segments) == 0:
        raise EmptyStableSetError(_why_empty(stable, drive, margin))
    return segments


def _why_empty(stable: StableSet, drive: Drive, margin: float) -> str:
    """Return which contact does not hold, in general or for the twists of the drive."""
    if isinstance(stable, ForceLimitedSet):
        return stable.too_heavy(segment_ends(control_segments(stable.inside, drive, margin)))
    required = max(0.0, margin - MARGIN_FLOOR)
    what, _ = emptiness(stable, required)
    if what or drive.axle is None:
        return what or f"no push has a margin above {margin:g}"
    twists = drive_twists(stable, drive)
    margins = stable.margin(twists)
    best = int(np.argmax(margins))
    weakest = contact_words(stable.chain, weakest_contact(stable, twists[best]))
    return (
        f"the {drive.kind} cannot push the chain: its best push keeps {weakest} with a margin of "
        f"{margins[best]:.3g}; it must be above {required:.3g}; an omnidirectional pusher could push it; "
        f"allowed: {HELP}, or another place of the axle"
    )


def drive_twists(stable: StableSet, drive: Drive) -> FloatArray:
    """Return the twists (k, 3) at which a wheeled drive is sampled."""
    assert drive.axle is not None
    return _drive_twists(drive.axle, _drive_turns(stable, drive))


def segment_ends(segments: FloatArray) -> FloatArray:
    """Return the twists (2 k, 3) at both ends of segments (k, 6)."""
    return np.concatenate([segments[:, :3], segments[:, 3:]])


def drive_radii(stable: StableSet, drive: Drive, minimum: float = 0.0) -> TurningRadii:
    """Return the smallest turning radii of the chain frame's origin for a drive, within the set.

    Args:
        stable: Stable set.
        drive: Drive of the robot that carries the plate. An omnidirectional one turns as tightly as the set allows.
        minimum: Lower limit of every turn's margin.
    """
    if drive.axle is None:
        return stable.turning_radii(minimum)
    try:
        return smallest_radii(control_segments(stable, drive, minimum))
    except EmptyStableSetError:
        return TurningRadii(math.inf, math.inf)


def smallest_radii(segments: FloatArray) -> TurningRadii:
    """Return the smallest turning radii of the chain frame's origin for twists on segments (k, 6)."""
    ends = segment_ends(segments)
    return TurningRadii(*(_radius(ends[side * ends[:, 2] > 0.0]) for side in (1.0, -1.0)))


def _radius(twists: FloatArray) -> float:
    """Return the smallest turning radius (m) of the chain frame's origin for twists (k, 3); infinite for none."""
    return float(np.min(np.hypot(twists[:, 0], twists[:, 1]) / np.abs(twists[:, 2]), initial=math.inf))


def steering_families(segments: FloatArray) -> FloatArray:
    """Return families (3, 3, 3) of left, straight and right twists for steering, scaled to a cost rate of 1.

    The turns are those with the closest CORs among the ends of the segments. The straight push of the first family is
    the one nearest to the heading for which these turns form a Dubins car. The other two have the straight pushes
    with the largest angles to it. Rows of zeros stand for motions that are not stable.

    Args:
        segments: (k, 6) stable twists; see `control_segments`.
    """
    ends = segment_ends(segments)
    left, right = _closest_turns(ends)
    families = np.zeros((3, 3, 3))
    families[:, LEFT], families[:, RIGHT] = left, right
    straight = straight_pushes(segments)
    if len(straight):
        ahead = _dubins_heading(left, right)
        order = np.arctan2(straight @ [-ahead[1], ahead[0]], straight @ ahead)
        chosen = [np.argmin(np.abs(order)), np.argmin(order), np.argmax(order)]
        families[:, STRAIGHT, :2] = straight[chosen]
    elif not (left.any() and right.any()):
        families[:, LEFT], families[:, RIGHT] = _farthest_turns(ends)
    return families


def _farthest_turns(ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the tightest turn (3,) and the one with the farthest COR from it, for the longest steering paths."""
    turns = ends / cost_rate(ends)[:, None]
    cors = _cors(turns)
    tightest = int(np.argmax(np.abs(turns[:, 2])))
    away = np.hypot(*(cors - cors[tightest]).T)
    return turns[tightest], turns[np.argmax(away)]


def _closest_turns(ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the left and the right turn (3,) with the closest CORs, scaled; zero for a side without turns."""
    lefts, rights = ends[ends[:, 2] > 0.0], ends[ends[:, 2] < 0.0]
    lefts, rights = (turns / cost_rate(turns)[:, None] for turns in (lefts, rights))
    if not len(lefts) or not len(rights):
        best = [turns[np.argmax(np.abs(turns[:, 2]))] if len(turns) else np.zeros(3) for turns in (lefts, rights)]
        return best[0], best[1]
    left, right = _cors(lefts), _cors(rights)
    most = np.hypot(*(left[np.argmin(np.hypot(*left.T))] - right[np.argmin(np.hypot(*right.T))]))
    # leave out turns that are farther from all turns on the other side along y alone
    i = np.flatnonzero(left[:, 1] - right[:, 1].max() <= most)
    j = np.flatnonzero(left[:, 1].min() - right[:, 1] <= most)
    apart = left[i, None] - right[j]
    k, m = np.unravel_index(np.argmin(np.hypot(apart[..., 0], apart[..., 1])), apart.shape[:2])
    return lefts[i[k]], rights[j[m]]


def _cors(twists: FloatArray) -> FloatArray:
    """Return the centres of rotation (k, 2) of turning twists (k, 3)."""
    return np.asarray(np.stack([-twists[:, 1], twists[:, 0]], axis=1) / twists[:, 2:])


def straight_pushes(segments: FloatArray) -> FloatArray:
    """Return the directions (m, 2) of the translations on segments."""
    low, high = segments[:, 2], segments[:, 5]
    across = segments[(low <= 0.0) & (high >= 0.0) | (low >= 0.0) & (high <= 0.0)]
    span = np.abs(across[:, 2]) + np.abs(across[:, 5])
    share = np.where(span > 0.0, np.abs(across[:, 2]) / np.where(span > 0.0, span, 1.0), 0.0)[:, None]
    velocity = (1.0 - share) * across[:, :2] + share * across[:, 3:5]
    return np.asarray(velocity / np.linalg.norm(velocity, axis=1, keepdims=True))


def _dubins_heading(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the direction (2,) of J (cR - cL), in which equal parts of both turns translate; +x without one."""
    if left[2] == 0.0 or right[2] == 0.0:
        return np.array([1.0, 0.0])
    x, y = (_cors(right[None]) - _cors(left[None]))[0]
    return np.asarray(np.array([-y, x]) / np.hypot(x, y))


def _drive_twists(axle: FloatArray, turns: FloatArray) -> FloatArray:
    """Return twists (k, 3) that move the axle's middle ahead at 1 m/s with `turns` (k,) in rad/m."""
    x, y, heading = axle
    return np.column_stack([np.cos(heading) + turns * y, np.sin(heading) - turns * x, turns])


def _stable_turns(stable: StableSet, drive: Drive, margin: float) -> FloatArray:
    """Return intervals (k, 2) of stable turns per metre, rad/m. Bisection finds their ends from the inside."""
    assert drive.axle is not None
    turns = _drive_turns(stable, drive)
    inside = _stable_at(stable, drive.axle, turns, margin)
    steps = np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8))
    firsts, lasts = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1
    inner = np.stack([firsts, lasts], axis=1)
    return _edges(stable, drive.axle, turns, inner, inner + np.array([-1, 1]), margin)


def _drive_turns(stable: StableSet, drive: Drive) -> FloatArray:
    """Return the increasing turns per metre (k,) at which a drive is sampled, rad/m."""
    limit = math.inf if drive.min_radius == 0.0 else 1.0 / drive.min_radius
    angles = np.linspace(-0.5, 0.5, 1026)[1:-1] * np.pi
    turns = np.tan(angles) / stable.chain.characteristic_length
    return np.unique(np.append(np.clip(turns, -limit, limit), 0.0))


def _stable_at(stable: StableSet, axle: FloatArray, turns: FloatArray, margin: float) -> np.ndarray:
    return np.asarray(stable.margin(_drive_twists(axle, turns)) > margin)


def _edges(
    stable: StableSet, axle: FloatArray, turns: FloatArray, inside: IntArray, outside: IntArray, margin: float
) -> FloatArray:
    """Return turns per metre (k, 2) at edges of the set between two samples, on the stable side."""
    good, bad = turns[inside], turns[np.where((outside < 0) | (outside == len(turns)), inside, outside)]
    while True:
        middle = 0.5 * (good + bad)
        if not ((middle != good) & (middle != bad)).any():
            return np.asarray(good)
        holds = _stable_at(stable, axle, middle.ravel(), margin).reshape(middle.shape)
        good, bad = np.where(holds, middle, good), np.where(holds, bad, middle)


MOST_MARGIN = 0.05
"""Largest margin that `auto` requires.

With it, 89 % of plans survive nine perturbations (frictions, loads, poses), without it 39 %. Paths become 0.4 %
longer.
"""

MARGIN_SHARE = 0.5
"""Upper limit of the margin for `auto`, as a share of the largest margin of any twist."""

HALVINGS = 5
"""Number of times that a margin is halved if no path is found."""


BELOW = 0.05
"""Margin below the best sampled twist at which a climb to the largest margin can begin.

This limit saves half of the time. Over 134 random chains of up to 20 boxes, even 0.02 missed no maximum.
"""


def margins_to_try(scenario: Scenario, stable: StableSet, most: float = MOST_MARGIN) -> tuple[float, ...]:
    """Return the margins to plan with, in order, until there is a path; a specified number is the only one.

    Args:
        scenario: Scenario with the chain.
        stable: Stable set of the chain.
        most: Upper limit of the first margin.
    """
    stated = scenario.stability.margin
    if stated != AUTO:
        return (stated,)
    first = automatic_margin(stable, scenario.chain.pusher.drive, most)
    return tuple(first * 0.5**k for k in range(HALVINGS + 1))


def automatic_margin(stable: StableSet, drive: Drive, most: float = MOST_MARGIN) -> float:
    """Return the smaller of `most` and `MARGIN_SHARE` of the largest margin; 0 if nothing is stable."""
    return min(most, MARGIN_SHARE * _best_margin(stable, drive, most / MARGIN_SHARE))


def _best_margin(stable: StableSet, drive: Drive, enough: float) -> float:
    """Return the largest margin, or one that is at least `enough`."""
    ahead = np.array([[1.0, 0.0, 0.0]]) if drive.axle is None else _drive_twists(drive.axle, np.zeros(1))
    found = float(stable.margin(ahead)[0])  # enough for most chains
    if found >= enough:
        return found
    found = float(stable.margin(most_stable_twist(stable, drive)[None])[0])
    if drive.axle is not None:
        return max(0.0, found)
    return found if found >= enough else max(found, _highest_peak(stable, found - BELOW))


def _highest_peak(stable: StableSet, least: float) -> float:
    """Return the largest margin by climbing from samples above `least`; 0 if nothing is stable."""

    def margin(twists: FloatArray, floor: float) -> FloatArray:
        floor = max(floor, least)
        found = stable.margin_values(twists, floor)
        return np.where(found > floor, found, -1.0)

    return float(margin_peaks(margin, stable.chain.characteristic_length)[1].max(initial=0.0))


def most_stable_twist(stable: StableSet, drive: Drive) -> FloatArray:
    """Return the sampled twist (3,) with the largest margin that the drive can make."""
    if drive.axle is not None:
        twists = drive_twists(stable, drive)
    else:
        # Forward pushes: a contact cannot pull.
        longitudes, latitudes = (np.linspace(-0.5, 0.5, count + 2)[1:-1] * np.pi for count in (48, 25))
        length = stable.chain.characteristic_length
        twists = twists_at(longitudes[:, None], latitudes[None, :], length).reshape(-1, 3)
    return np.asarray(twists[np.argmax(stable.margin(twists))])
