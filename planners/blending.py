"""Blended timing of a path: the pusher does not stop where the path's twist changes.

The twist moves from one arc's to the next on smooth steps (`section`), which cuts the corners of the way a
little; the arcs' lengths are solved for anew so that the motion ends exactly where the path does. What comes
out is checked again, stability and collision; where either fails, the pusher stops at the nearest corner after
all, corner by corner, in the worst case at every one: then it is the exact timing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pushplan import se2
from pushplan.arrays import FloatArray, IntArray
from pushplan.dynamics import ContactDynamics
from pushplan.path import PushPath
from pushplan.planners.arc_limits import Bounds
from pushplan.planners.blend_check import failure_times
from pushplan.planners.goal_fit import NoFitError, end_twists, fit_lengths
from pushplan.planners.section import Driven, make_driven
from pushplan.planners.timing import SAME, time_path
from pushplan.scenario import Scenario
from pushplan.stable_set import StableSet
from pushplan.trajectory import SAMPLE_RATE, Trajectory

FITS = 2
"""How often steps are widened and lengths fitted in turn."""

WORTH_A_STOP = 0.5
"""Delay (s) by slowing down a whole section from which on a stop at its worst corner is preferred."""


@dataclass(frozen=True, eq=False)
class Blend:
    """A blended trajectory and what was done to the path for it.

    Attributes:
        trajectory: Ends where the path ends.
        lengths: (k,) lengths of the path's arcs, solved for anew, m of cost.
        stops: Indices of the arcs after which the pusher stops although the path goes on.
    """

    trajectory: Trajectory
    lengths: FloatArray
    stops: frozenset[int]


def blend_path(
    scenario: Scenario,
    path: PushPath,
    stable: StableSet,
    rate: float = SAMPLE_RATE,
    contacts: ContactDynamics | None = None,
) -> Blend:
    """Return the trajectory along a path that stops at few corners and takes no longer than the exact one.

    Args:
        scenario: Limits of the pusher, margin to keep, and what is in the way.
        path: Constant-twist arcs, free of collision and stable.
        stable: The set whose margin has to exceed `scenario.stability.margin`.
        rate: Samples per second of the trajectory.
        contacts: The chain, to keep speed and acceleration low enough for its contacts; None leaves inertia
            out.

    Raises:
        TimingError: When an arc cannot be timed.
    """
    bounds = Bounds(scenario.chain.pusher.limits, contacts)
    exact = time_path(path, bounds.limits, rate, contacts)
    every = _corners(path)
    stops: frozenset[int] = frozenset()
    parts = [make_driven(path, _driven_arcs(path), bounds)] if every else []
    while stops < every:
        try:
            parts, lengths = _fitted(path, parts)
        except NoFitError:
            stops |= {_sharpest_corner(path, parts)}
        else:
            slowed, strained = _within_limits(parts, lengths)
            trajectory = _joined(path, slowed, lengths, rate)
            failures = strained if len(strained) else failure_times(scenario, stable, trajectory)
            if not len(failures):
                slower = trajectory.duration >= exact.duration
                return Blend(exact, path.lengths, every) if slower else Blend(trajectory, lengths, stops)
            stops |= _nearest_corners(slowed, lengths, failures)
        parts = [piece for part in parts for piece in _split(path, part, stops, bounds)]
    return Blend(exact, path.lengths, every)


def _driven_arcs(path: PushPath) -> IntArray:
    return np.flatnonzero(path.lengths > 0.0)


def _corners(path: PushPath) -> frozenset[int]:
    """The arcs at whose end the twist changes."""
    arcs = _driven_arcs(path)
    change = np.abs(np.diff(path.twists[arcs], axis=0)).max(axis=1, initial=0.0)
    return frozenset(arcs[:-1][change > SAME].tolist())


def _split(path: PushPath, part: Driven, stops: frozenset[int], bounds: Bounds) -> list[Driven]:
    """The part between stops; itself where there is none in it."""
    ends = np.flatnonzero(np.isin(part.arcs[:-1], list(stops))) + 1
    if not len(ends):
        return [part]
    return [make_driven(path, arcs, bounds) for arcs in np.split(part.arcs, ends)]


def _fitted(path: PushPath, parts: Sequence[Driven]) -> tuple[list[Driven], FloatArray]:
    """Widen steps to meet the limits, and fit lengths (k,) that end where the path does, in turn.

    Raises:
        NoFitError: When no lengths lead there.
    """
    effect, lengths = end_twists(path), path.lengths
    for _ in range(FITS):
        parts = [part.eased(lengths) for part in parts]
        lengths = fit_lengths(partial(_end, path, parts), path.end, lengths, effect)
    return list(parts), lengths


def _end(path: PushPath, parts: Sequence[Driven], lengths: FloatArray) -> FloatArray:
    pose = path.start
    for part in parts:
        pose = se2.compose(pose, part.motion(lengths))
    return pose


def _within_limits(parts: Sequence[Driven], lengths: FloatArray) -> tuple[list[Driven], FloatArray]:
    """Slow parts down until they keep the limits; return them and when (k,) a stop would delay less."""
    slowed, strained, begin = [], [], 0.0
    for part in parts:
        slow, worst = part.slowed(lengths)
        duration = slow.duration(lengths)
        if duration - part.duration(lengths) > WORTH_A_STOP:
            strained.append(begin + worst)
        slowed.append(slow)
        begin += duration
    return slowed, np.array(strained)


def _joined(path: PushPath, parts: Sequence[Driven], lengths: FloatArray, rate: float) -> Trajectory:
    pieces = [part.pieces(lengths) for part in parts]
    durations, coefficients, arcs = (np.concatenate(column) for column in zip(*pieces, strict=True))
    breaks = np.concatenate([[0.0], np.cumsum(durations)])
    return Trajectory(path.start, breaks, coefficients, arcs.astype(np.float64), rate)


def _blended_corners(parts: Sequence[Driven], lengths: FloatArray) -> tuple[IntArray, FloatArray]:
    """The arcs (c,) after which the twist changes without a stop, and when (c,)."""
    begins = np.cumsum([0.0, *(part.duration(lengths) for part in parts)])
    corners = [part.corners(lengths) for part in parts]
    times = [begin + at for begin, (_, at) in zip(begins, corners, strict=False)]
    return np.concatenate([arcs for arcs, _ in corners]), np.concatenate(times)


def _nearest_corners(parts: Sequence[Driven], lengths: FloatArray, times: FloatArray) -> frozenset[int]:
    """The blended corners nearest to some times (k,)."""
    arcs, at = _blended_corners(parts, lengths)
    return frozenset(arcs[np.abs(at - times[:, None]).argmin(axis=1)].tolist())


def _sharpest_corner(path: PushPath, parts: Sequence[Driven]) -> int:
    """The blended corner whose twists, per unit of cost, commute least: its blend moves the end most."""
    arcs, _ = _blended_corners(parts, path.lengths)
    driven = _driven_arcs(path)
    a, b = path.twists[arcs], path.twists[driven[np.searchsorted(driven, arcs) + 1]]
    bracket = a[:, 2:] * b[:, :2] - b[:, 2:] * a[:, :2]
    return int(arcs[np.argmax(np.hypot(*bracket.T))])
