"""What the pusher can do with a margin: stable twists between meridians, and families that steer exactly."""

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
"""Planned twists keep this much more than the margin asked for, so that rounding cannot put them outside."""

MERIDIANS = 512
"""Meridians of the stable set that an omnidirectional pusher's controls are taken from."""


def control_segments(stable: StableSet, drive: Drive, margin: float, count: int = MERIDIANS) -> FloatArray:
    """Return the segments (k, 6) of stable twists that the drive can make.

    Args:
        stable: The set.
        drive: Of the robot that carries the plate.
        margin: Every twist has more than this.
        count: Meridians of an omnidirectional pusher's set.

    Raises:
        EmptyStableSetError: If there are none.
    """
    if drive.axle is None:
        meridians = stable.meridians(margin, count)
        if not len(meridians.longitude):  # a set so small that it lies between them
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
    """Tell which contact does not hold, in general or under what the drive can do."""
    if isinstance(stable, ForceLimitedSet):
        return stable.too_heavy(segment_ends(control_segments(stable.inside, drive, margin)))
    asked = max(0.0, margin - MARGIN_FLOOR)
    what, _ = emptiness(stable, asked)
    if what or drive.axle is None:
        return what or f"no push has a margin above {margin:g}"
    twists = drive_twists(stable, drive)
    margins = stable.margin(twists)
    best = int(np.argmax(margins))
    weakest = contact_words(stable.chain, weakest_contact(stable, twists[best]))
    return (
        f"the {drive.kind} cannot push the chain: its best push keeps {weakest} with a margin of "
        f"{margins[best]:.3g}, it must be above {asked:.3g}; an omnidirectional pusher could; allowed: {HELP}, "
        "or another place of the axle"
    )


def drive_twists(stable: StableSet, drive: Drive) -> FloatArray:
    """Return the twists (k, 3) at which a wheeled drive's family is scanned."""
    assert drive.axle is not None
    return _drive_twists(drive.axle, _drive_turns(stable, drive))


def segment_ends(segments: FloatArray) -> FloatArray:
    """Return the twists (2 k, 3) at both ends of segments (k, 6)."""
    return np.concatenate([segments[:, :3], segments[:, 3:]])


def drive_radii(stable: StableSet, drive: Drive, minimum: float = 0.0) -> TurningRadii:
    """Return the smallest radii at which a drive turns the chain frame's origin, within the set.

    Args:
        stable: The set.
        drive: Of the robot that carries the plate; an omnidirectional one turns as tightly as the set allows.
        minimum: Every turn has more than this margin.
    """
    if drive.axle is None:
        return stable.turning_radii(minimum)
    try:
        return smallest_radii(control_segments(stable, drive, minimum))
    except EmptyStableSetError:
        return TurningRadii(math.inf, math.inf)


def smallest_radii(segments: FloatArray) -> TurningRadii:
    """Return the smallest radii at which twists on segments (k, 6) turn the chain frame's origin."""
    ends = segment_ends(segments)
    return TurningRadii(*(_radius(ends[side * ends[:, 2] > 0.0]) for side in (1.0, -1.0)))


def _radius(twists: FloatArray) -> float:
    """Smallest radius (m) at which twists (k, 3) turn the chain frame's origin, infinite without any."""
    return float(np.min(np.hypot(twists[:, 0], twists[:, 1]) / np.abs(twists[:, 2]), initial=math.inf))


def steering_families(segments: FloatArray) -> FloatArray:
    """Return families (3, 3, 3) of left, straight and right twists, scaled to a cost rate of 1, for connections.

    The turns are those with the closest CORs among the ends of the segments. The straight pushes are the one along
    which these turns combine to Dubins' car, as nearly as there is one, and the two that lean most. Rows of zeros
    stand for motions that are not stable.

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
    """The tightest turn (3,) and the one whose COR is farthest from its own: the farther, the more a word reaches."""
    turns = ends / cost_rate(ends)[:, None]
    cors = _cors(turns)
    tightest = int(np.argmax(np.abs(turns[:, 2])))
    away = np.hypot(*(cors - cors[tightest]).T)
    return turns[tightest], turns[np.argmax(away)]


def _closest_turns(ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The left and the right turn (3,) with the closest CORs, scaled; zero where there is no turn to that side."""
    lefts, rights = ends[ends[:, 2] > 0.0], ends[ends[:, 2] < 0.0]
    lefts, rights = (turns / cost_rate(turns)[:, None] for turns in (lefts, rights))
    if not len(lefts) or not len(rights):
        best = [turns[np.argmax(np.abs(turns[:, 2]))] if len(turns) else np.zeros(3) for turns in (lefts, rights)]
        return best[0], best[1]
    left, right = _cors(lefts), _cors(rights)
    most = np.hypot(*(left[np.argmin(np.hypot(*left.T))] - right[np.argmin(np.hypot(*right.T))]))
    # of the others, many are farther from all on the other side already along y
    i = np.flatnonzero(left[:, 1] - right[:, 1].max() <= most)
    j = np.flatnonzero(left[:, 1].min() - right[:, 1] <= most)
    apart = left[i, None] - right[j]
    k, m = np.unravel_index(np.argmin(np.hypot(apart[..., 0], apart[..., 1])), apart.shape[:2])
    return lefts[i[k]], rights[j[m]]


def _cors(twists: FloatArray) -> FloatArray:
    """Centres of rotation (k, 2) of turning twists (k, 3)."""
    return np.asarray(np.stack([-twists[:, 1], twists[:, 0]], axis=1) / twists[:, 2:])


def straight_pushes(segments: FloatArray) -> FloatArray:
    """Directions (m, 2) of the translations on segments."""
    low, high = segments[:, 2], segments[:, 5]
    across = segments[(low <= 0.0) & (high >= 0.0) | (low >= 0.0) & (high <= 0.0)]
    span = np.abs(across[:, 2]) + np.abs(across[:, 5])
    share = np.where(span > 0.0, np.abs(across[:, 2]) / np.where(span > 0.0, span, 1.0), 0.0)[:, None]
    velocity = (1.0 - share) * across[:, :2] + share * across[:, 3:5]
    return np.asarray(velocity / np.linalg.norm(velocity, axis=1, keepdims=True))


def _dubins_heading(left: FloatArray, right: FloatArray) -> FloatArray:
    """Direction (2,) of J (cR - cL), along which equal parts of both turns translate; +x where one is missing."""
    if left[2] == 0.0 or right[2] == 0.0:
        return np.array([1.0, 0.0])
    x, y = (_cors(right[None]) - _cors(left[None]))[0]
    return np.asarray(np.array([-y, x]) / np.hypot(x, y))


def _drive_twists(axle: FloatArray, turns: FloatArray) -> FloatArray:
    """Twists (k, 3) that move the axle's middle ahead at 1 m/s while turning at `turns` (k,) rad/m."""
    x, y, heading = axle
    return np.column_stack([np.cos(heading) + turns * y, np.sin(heading) - turns * x, turns])


def _stable_turns(stable: StableSet, drive: Drive, margin: float) -> FloatArray:
    """Intervals (k, 2) of turns per metre, rad/m, that are stable, their ends found by bisection on the inside."""
    assert drive.axle is not None
    turns = _drive_turns(stable, drive)
    inside = _stable_at(stable, drive.axle, turns, margin)
    steps = np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8))
    firsts, lasts = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1
    inner = np.stack([firsts, lasts], axis=1)
    return _edges(stable, drive.axle, turns, inner, inner + np.array([-1, 1]), margin)


def _drive_turns(stable: StableSet, drive: Drive) -> FloatArray:
    """Turns per metre (k,) at which a drive's family is scanned, increasing, rad/m."""
    limit = math.inf if drive.min_radius == 0.0 else 1.0 / drive.min_radius
    angles = np.linspace(-0.5, 0.5, 1026)[1:-1] * np.pi
    turns = np.tan(angles) / stable.chain.characteristic_length
    return np.unique(np.append(np.clip(turns, -limit, limit), 0.0))


def _stable_at(stable: StableSet, axle: FloatArray, turns: FloatArray, margin: float) -> np.ndarray:
    return np.asarray(stable.margin(_drive_twists(axle, turns)) > margin)


def _edges(
    stable: StableSet, axle: FloatArray, turns: FloatArray, inside: IntArray, outside: IntArray, margin: float
) -> FloatArray:
    """Turns per metre (k, 2) at edges of the set between two scanned ones, on the stable side."""
    good, bad = turns[inside], turns[np.where((outside < 0) | (outside == len(turns)), inside, outside)]
    while True:
        middle = 0.5 * (good + bad)
        if not ((middle != good) & (middle != bad)).any():
            return np.asarray(good)
        holds = _stable_at(stable, axle, middle.ravel(), margin).reshape(middle.shape)
        good, bad = np.where(holds, middle, good), np.where(holds, bad, middle)


MOST_MARGIN = 0.05
"""What `auto` asks for where the chain can have it.

With it 89 % of plans survive nine perturbations (frictions, loads, places), without it 39 %, for 0.4 % more way.
"""

MARGIN_SHARE = 0.5
"""What `auto` asks for at most, as a share of the largest margin there is."""

HALVINGS = 5
"""So many times a margin is halved where no path is found with it."""


BELOW = 0.05
"""So much lower than the best twist that was looked at may be where the climb to the largest margin begins.

Over 134 random chains of up to 20 boxes a bound of 0.02 lost nothing either; half of the time is saved.
"""


def margins_to_try(scenario: Scenario, stable: StableSet, most: float = MOST_MARGIN) -> tuple[float, ...]:
    """Return the margins to plan with, one after the other until there is a path; a stated number is the only one.

    Args:
        scenario: With the chain.
        stable: Its set.
        most: The first one is no larger.
    """
    stated = scenario.stability.margin
    if stated != AUTO:
        return (stated,)
    first = automatic_margin(stable, scenario.chain.pusher.drive, most)
    return tuple(first * 0.5**k for k in range(HALVINGS + 1))


def automatic_margin(stable: StableSet, drive: Drive, most: float = MOST_MARGIN) -> float:
    """Return the smaller of `most` and `MARGIN_SHARE` of the largest there is; 0 where nothing is stable."""
    return min(most, MARGIN_SHARE * _best_margin(stable, drive, most / MARGIN_SHARE))


def _best_margin(stable: StableSet, drive: Drive, enough: float) -> float:
    """Return the largest margin, or one that is at least `enough`."""
    ahead = np.array([[1.0, 0.0, 0.0]]) if drive.axle is None else _drive_twists(drive.axle, np.zeros(1))
    found = float(stable.margin(ahead)[0])  # that of most chains is enough
    if found >= enough:
        return found
    found = float(stable.margin(most_stable_twist(stable, drive)[None])[0])
    if drive.axle is not None:
        return max(0.0, found)
    return found if found >= enough else max(found, _highest_peak(stable, found - BELOW))


def _highest_peak(stable: StableSet, least: float) -> float:
    """Return the largest margin, 0 where nothing is stable, climbing from samples with more than `least` only."""

    def margin(twists: FloatArray, floor: float) -> FloatArray:
        floor = max(floor, least)
        found = stable.margin_values(twists, floor)
        return np.where(found > floor, found, -1.0)

    return float(margin_peaks(margin, stable.chain.characteristic_length)[1].max(initial=0.0))


def most_stable_twist(stable: StableSet, drive: Drive) -> FloatArray:
    """Return the twist (3,) with the largest margin of those that are looked at, which the drive can make."""
    if drive.axle is not None:
        twists = drive_twists(stable, drive)
    else:
        # Forward pushes: a contact cannot pull.
        longitudes, latitudes = (np.linspace(-0.5, 0.5, count + 2)[1:-1] * np.pi for count in (48, 25))
        length = stable.chain.characteristic_length
        twists = twists_at(longitudes[:, None], latitudes[None, :], length).reshape(-1, 3)
    return np.asarray(twists[np.argmax(stable.margin(twists))])
