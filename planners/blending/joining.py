"""From the parts of a path between two stops to one trajectory, and back from its times to the path's corners."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.blending.goal_fit import fit_lengths
from pushplan.planners.blending.nudge import LengthRows
from pushplan.planners.blending.part import Part
from pushplan.planners.blending.section import make_part
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.exact_timing import SAME
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray, IntArray

FITS = 2
"""How often steps are widened and lengths fitted in turn."""


def moving_arcs(path: PushPath) -> IntArray:
    """Return the indices (a,) of the arcs that have a length."""
    return np.flatnonzero(path.lengths > 0.0)


def corners_of(path: PushPath) -> frozenset[int]:
    """Return the arcs at whose end the twist changes."""
    arcs = moving_arcs(path)
    change = np.abs(np.diff(path.twists[arcs], axis=0)).max(axis=1, initial=0.0)
    return frozenset(arcs[:-1][change > SAME].tolist())


def split_part(path: PushPath, part: Part, stops: frozenset[int], bounds: Bounds) -> list[Part]:
    """Return the parts of a part between the arcs after which the pusher stops; itself where there is no stop."""
    ends = np.flatnonzero(np.isin(part.arcs[:-1], list(stops))) + 1
    if not len(ends):
        return [part]
    return [make_part(path, arcs, bounds) for arcs in np.split(part.arcs, ends)]


def fitted(
    path: PushPath, goal: FloatArray, parts: Sequence[Part], rows: LengthRows
) -> tuple[list[Part], FloatArray]:
    """Widen steps to meet the limits, and fit lengths (k,) that end on the goal (3,), in turn.

    Raises:
        NoFitError: When no lengths lead there and meet the conditions.
    """
    lengths = path.lengths
    for _ in range(FITS):
        parts = [part.eased(lengths) for part in parts]
        lengths = fit_lengths(partial(_end, path, parts), goal, path, lengths, rows)
    return list(parts), lengths


def slowed(parts: Sequence[Part], lengths: FloatArray, bearable: float) -> tuple[list[Part], FloatArray]:
    """Slow parts down as wholes until they keep the limits.

    Returns:
        The parts, and (k,) when the limits were exceeded most in those that it delays by more than `bearable`, s.
    """
    slow, strained, begin = [], [], 0.0
    for part in parts:
        changed, worst = part.slowed(lengths)
        duration = changed.duration(lengths)
        if duration - part.duration(lengths) > bearable:
            strained.append(begin + worst)
        slow.append(changed)
        begin += duration
    return slow, np.array(strained)


def joined(path: PushPath, parts: Sequence[Part], lengths: FloatArray, rate: float) -> Trajectory:
    """Return the parts as one trajectory."""
    pieces = [part.pieces(lengths) for part in parts]
    durations, coefficients, arcs = (np.concatenate(column) for column in zip(*pieces, strict=True))
    breaks = np.concatenate([[0.0], np.cumsum(durations)])
    return Trajectory(path.start, breaks, coefficients, arcs.astype(np.float64), rate)


def nearest_corners(parts: Sequence[Part], lengths: FloatArray, times: FloatArray) -> frozenset[int]:
    """Return the corners without a stop that are nearest to some times (k,)."""
    arcs, at = _blended_corners(parts, lengths)
    return frozenset(arcs[np.abs(at - times[:, None]).argmin(axis=1)].tolist())


def sharpest_corner(path: PushPath, parts: Sequence[Part]) -> frozenset[int]:
    """Return the corner without a stop whose twists commute least: its blend moves the end most."""
    arcs, _ = _blended_corners(parts, path.lengths)
    moving = moving_arcs(path)
    a, b = path.twists[arcs], path.twists[moving[np.searchsorted(moving, arcs) + 1]]
    bracket = a[:, 2:] * b[:, :2] - b[:, 2:] * a[:, :2]
    return frozenset({int(arcs[np.argmax(np.hypot(*bracket.T))])})


def _end(path: PushPath, parts: Sequence[Part], lengths: FloatArray) -> FloatArray:
    pose = path.start
    for part in parts:
        pose = se2.compose(pose, part.motion(lengths))
    return pose


def _blended_corners(parts: Sequence[Part], lengths: FloatArray) -> tuple[IntArray, FloatArray]:
    """The arcs (c,) after which the twist changes without a stop, and when (c,)."""
    begins = np.cumsum([0.0, *(part.duration(lengths) for part in parts[:-1])])
    corners = [part.corners(lengths) for part in parts]
    times = [begin + at for begin, (_, at) in zip(begins, corners, strict=True)]
    return np.concatenate([arcs for arcs, _ in corners]), np.concatenate(times)
