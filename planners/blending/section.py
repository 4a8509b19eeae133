"""Arcs of several twists driven from rest to rest without a stop in between.

Every arc has a speed; the twist moves from one arc's to the next on a jerk-limited step around the time at
which the arc's length is spent. Each step is the fastest that the limits allow;
where the sum of overlapping steps exceeds a limit, the steps there are widened.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pushplan.mechanics.chain import Limits
from pushplan.planners.blending.part import Part, Push
from pushplan.planners.timing.arc_limits import contact_limits, contact_limits_of
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.contact_use import ORDERS, bounds_use
from pushplan.planners.timing.exact_timing import SAME
from pushplan.planners.timing.profile import step_widths
from pushplan.planners.timing.step_sum import Pieces, ordered_widths, step_sum
from pushplan.plans.path import PushPath
from pushplan.util.arrays import FloatArray, IntArray, columns_of

PACES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3)
"""Shares of the arcs' top speeds that are tried: a short section is sooner over when driven below full speed."""

WIDENINGS = 25
"""How often steps are widened to meet the limits, at most."""

HELPING = 0.995
"""Widening goes on for as long as it reduces the worst excess at least to this share."""

MOST = 1.5
"""A step is widened by no more than this factor at a time."""

WIDTH_POWERS = np.array([0.0, 1.0, 0.5, 1.0])
"""By which power of the use of each limit a lone step has to be widened to meet it."""

PASSED = 0.3
"""A shorter arc may be passed as fast as one of this length, m."""

USED_UP = 1.0 + 1e-9
"""A limit is kept when no more than this share of it is used."""


@dataclass(frozen=True, eq=False)
class Section:
    """Arcs of several twists, blended; see `Part`.

    Attributes:
        arcs: (a,) their indices.
        levels: (a + 2, 3) the arcs' twists at full speed, m/s and rad/s, and rest at either end.
        speeds: (a,) rates of the arcs' parameters.
        widths: (a + 1, 2) windows of the steps between the levels, s.
        bounds: What limits the motion.
        slower: Factor by which everything is stretched in time.
    """

    arcs: IntArray
    levels: FloatArray
    speeds: FloatArray
    widths: FloatArray
    bounds: Bounds
    slower: float = 1.0

    def pieces(self, lengths: FloatArray) -> Pieces:
        """Return the twist over time."""
        made = step_sum(self.levels / self.slower, *self._steps(lengths))
        return made._replace(level=self.arcs[np.clip(made.level - 1, 0, len(self.arcs) - 1)])

    def duration(self, lengths: FloatArray) -> float:
        """Return how long it takes, s."""
        centers, widths = self._steps(lengths)
        return float(centers[-1] + widths[-1].sum() / 2.0)

    def motion(self, lengths: FloatArray) -> FloatArray:
        """Return the pose (3,) at the end."""
        return self.pieces(lengths).motion

    def corners(self, lengths: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the arcs (c,) after which the twist changes, and when (c,)."""
        turns = np.abs(np.diff(self.levels[1:-1], axis=0)).max(axis=1) > 0.0
        return self.arcs[:-1][turns], self._steps(lengths)[0][1:-1][turns]

    def eased(self, lengths: FloatArray) -> Section:
        """Return the section with wider steps wherever a limit is exceeded, as far as that helps."""
        section, worst = self, np.inf
        for _ in range(WIDENINGS):
            pieces = section.pieces(lengths)
            use = bounds_use(pieces, self.bounds)
            excess = columns_of(use.shares**WIDTH_POWERS).max(axis=0)
            if excess.max() <= USED_UP or excess.max() > HELPING * worst:
                break
            section = section._widened(lengths, pieces.durations, np.maximum(excess, use.slowing))
            worst = float(excess.max())
            if HELPING * worst <= 1.0:  # whatever is seen next ends this
                break
        return section

    def slowed(self, lengths: FloatArray) -> tuple[Section, float]:
        """Return the section slowed down until no limit is exceeded, and when the most was."""
        pieces = self.pieces(lengths)
        use = columns_of(bounds_use(pieces, self.bounds).shares ** (1.0 / ORDERS)).max(axis=0)
        factor = float(use.max())
        at = float(pieces.durations[: int(np.argmax(use))].sum()) * factor
        return (self if factor <= USED_UP else replace(self, slower=self.slower * factor)), at

    def _widened(self, lengths: FloatArray, durations: FloatArray, excess: FloatArray) -> Section:
        """The section with steps wider by up to the `excess` (q,) of the pieces that they overlap."""
        centers, widths = self._steps(lengths)
        half = widths.sum(axis=1) / 2.0
        ends = np.cumsum(durations)
        near = (ends - durations < (centers + half)[:, None]) & (ends > (centers - half)[:, None])
        factor = np.max(np.where(near, np.clip(excess, 1.0, MOST), 1.0), axis=1)
        return replace(self, widths=self.widths * factor[:, None])

    def _steps(self, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Centres (a + 1,) of the steps, s from the section's beginning, and their windows (a + 1, 2), s."""
        centers = np.concatenate([[0.0], np.cumsum(lengths[self.arcs] / self.speeds)])
        widths = ordered_widths(centers, self.widths)
        return (centers + widths[0].sum() / 2.0) * self.slower, widths * self.slower


def make_part(path: PushPath, arcs: IntArray, bounds: Bounds) -> Part:
    """Return some arcs (a,) of a path as one part: the pace is the one that is over soonest.

    Raises:
        TimingError: When an arc cannot be timed.
    """
    twists, lengths = path.twists[arcs], path.lengths[arcs]
    if np.abs(twists - twists[0]).max() <= SAME:
        return Push(arcs, twists[0], bounds)
    tops = bounds.pace * passing_speeds(twists, lengths, bounds)
    times = [_least_time(twists, lengths, pace * tops, bounds) for pace in PACES]
    speeds = PACES[int(np.argmin(times))] * tops
    levels = _levels(twists, speeds)
    return Section(arcs, levels, speeds, step_windows(levels, bounds.limits), bounds)


def passing_speeds(twists: FloatArray, lengths: FloatArray, bounds: Bounds) -> FloatArray:
    """Return the top speeds (k,) of arcs (k, 3) that are passed without a stop, at full pace.

    Where speed and acceleration compete for the room that a contact leaves, an arc from rest to rest takes the more
    acceleration the shorter it is. Passing needs little of it: the steps to and fro are eased afterwards.
    """
    found, able = contact_limits_of(twists, np.maximum(lengths, PASSED), bounds)
    speeds = np.array(found.speed)
    for i in np.flatnonzero(~able):  # at the boundary of the set, only a shorter arc is over soon enough
        speeds[i] = contact_limits(twists[i], float(lengths[i]), bounds).speed
    return speeds


def step_windows(levels: FloatArray, limits: Limits) -> FloatArray:
    """Return the windows (m, 2) of the fastest steps between twists (m + 1, 3), each taken for itself, s."""
    turning = np.hypot(levels[:, 0], levels[:, 1]) * np.abs(levels[:, 2])  # centripetal acceleration
    braking, gaining = limits.both("acceleration")
    resting = (levels == 0.0).all(axis=1)
    most = np.where(resting[:-1], gaining, np.where(resting[1:], braking, min(braking, gaining)))
    room = most - np.maximum(turning[:-1], turning[1:])
    steps = np.diff(levels, axis=0)
    linear, angular = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    rightward, leftward = limits.both("angular_acceleration")
    turn = np.where(steps[:, 2] > 0.0, leftward, rightward)
    rise = np.maximum(linear / room, angular / turn)
    return step_widths(rise, np.maximum(linear / limits.jerk, angular / limits.angular_jerk))


def _levels(twists: FloatArray, speeds: FloatArray) -> FloatArray:
    """The twists of arcs (k, 3) at some speeds (k,), and rest at either end."""
    rest = np.zeros((1, 3))
    return np.concatenate([rest, twists * speeds[:, None], rest])


def _least_time(twists: FloatArray, lengths: FloatArray, speeds: FloatArray, bounds: Bounds) -> float:
    """How long arcs take at some speeds with half of the first step before them and of the last one after, s."""
    levels = _levels(twists, speeds)
    ends = (step_windows(levels[:2], bounds.limits), step_windows(levels[-2:], bounds.limits))
    return float((lengths / speeds).sum() + sum(windows.sum() for windows in ends) / 2.0)
