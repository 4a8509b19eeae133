"""Parts of a path between two stops: a single arc, or several blended arcs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, wraps
from typing import TypeVar

import daqp
import numpy as np

import pushplan.core.timing as timing
from pushplan.errors import TimingError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Limits
from pushplan.planners.timing.arc_limits import Bounds, contact_limits, contact_limits_of, ratio
from pushplan.planners.timing.exact_timing import ORDERS, Pieces, bounds_use
from pushplan.planners.timing.profiles import rest_to_rest, step_windows
from pushplan.planners.timing.sweep import LengthRows, effects_on
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray, IntArray

P = TypeVar("P", bound="Part")
T = TypeVar("T")


def remembered(method: Callable[[P, FloatArray], T]) -> Callable[[P, FloatArray], T]:
    """Cache the results of a part's method by the lengths of its arcs."""

    @wraps(method)
    def cached(self: P, lengths: FloatArray) -> T:
        answers = self.__dict__.setdefault(f"_{method.__name__}_for", {})
        key = lengths[self.arcs].tobytes()
        if key not in answers:
            answers[key] = method(self, lengths)
        answer: T = answers[key]
        return answer

    return cached


@dataclass(frozen=True, eq=False)
class Part(ABC):
    """Arcs of a path between two stops. Methods take the lengths (k,) of all arcs of the path.

    Attributes:
        arcs: (a,) indices of the arcs.
        bounds: Limits of the motion.
    """

    arcs: IntArray
    bounds: Bounds

    @abstractmethod
    def pieces(self, lengths: FloatArray) -> Pieces:
        """Return the twist over time. The level of a piece is the index of its arc."""

    def duration(self, lengths: FloatArray) -> float:
        """Return the duration, s."""
        return float(self.pieces(lengths).durations.sum())

    def motion(self, lengths: FloatArray) -> FloatArray:
        """Return the end pose (3,) relative to the beginning."""
        return self.pieces(lengths).motion

    def corners(self, lengths: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the arcs (c,) after which the twist changes, and the times (c,) since the beginning, s."""
        del lengths
        return np.zeros(0, dtype=np.int64), np.zeros(0)

    def eased(self, lengths: FloatArray) -> Part:
        """Return the part with wider steps wherever a limit is exceeded, as far as that helps."""
        del lengths
        return self

    def slowed(self, lengths: FloatArray) -> tuple[Part, float]:
        """Return the part slowed until it keeps all limits, and the time of the largest excess, s."""
        del lengths
        return self, 0.0

    def split(self, path: PushPath, stops: frozenset[int]) -> list[Part]:
        """Return the parts between stops at the ends of some arcs; the part itself if there are none."""
        del path, stops
        return [self]


@dataclass(frozen=True, eq=False)
class Push(Part):
    """One arc with the exact profile, which keeps the limits.

    Attributes:
        twist: (3,) body twist per unit of the arc's parameter.
    """

    twist: FloatArray

    @remembered
    def pieces(self, lengths: FloatArray) -> Pieces:
        """Return the twist over time."""
        length = float(lengths[self.arcs[0]])
        profile = rest_to_rest(length, contact_limits(self.twist, length, self.bounds))
        level = np.repeat(self.arcs, len(profile.durations))
        return Pieces(profile.durations, profile.along(self.twist), level)

    def motion(self, lengths: FloatArray) -> FloatArray:
        """Return the end pose (3,) relative to the beginning."""
        return se2.exp(self.twist * lengths[self.arcs[0]])


WIDENINGS = 25
"""Maximum number of times that steps are widened to keep the limits."""

HELPING = 0.995
"""Widening continues while it reduces the worst excess to this share or less."""

MOST = 1.5
"""Maximum factor by which a step is widened at a time."""

PASSED = 0.3
"""Length (m) up to which all arcs have the same passing speed."""

DERIVATIVES = np.array([1.0, 2.0])
"""Powers of a step's duration with which its derivatives decrease."""

USED_UP = 1.0 + 1e-9
"""Used share up to which a limit counts as kept."""


@dataclass(frozen=True, eq=False)
class Section(Part):
    """Several arcs, blended.

    Attributes:
        levels: (a + 2, 3) twists of the arcs at full speed, m/s and rad/s, with rest at both ends.
        speeds: (a,) rates of the arcs' parameters.
        steps: (a + 1, 2) limits of the first and second derivative of the steps between levels, each scaled to go
            from 0 to 1; 1/s and 1/s^2.
        slower: Factor by which the motion is stretched in time.
    """

    levels: FloatArray
    speeds: FloatArray
    steps: FloatArray
    slower: float = 1.0

    @remembered
    def pieces(self, lengths: FloatArray) -> Pieces:
        """Return the twist over time."""
        made = Pieces.through(self.levels / self.slower, *self._placed(lengths))
        return made._replace(level=self.arcs[np.clip(made.level - 1, 0, len(self.arcs) - 1)])

    def duration(self, lengths: FloatArray) -> float:
        """Return the duration, s."""
        centers, windows = self._placed(lengths)
        return float(centers[-1] + windows[-1].sum() / 2.0)

    def corners(self, lengths: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the arcs (c,) after which the twist changes, and the times (c,) since the beginning, s."""
        return self.arcs[:-1], self._placed(lengths)[0][1:-1]

    def eased(self, lengths: FloatArray) -> Section:
        """Return the section with wider steps wherever a limit is exceeded, as far as that helps."""
        section, worst = self, np.inf
        for _ in range(WIDENINGS):
            pieces = section.pieces(lengths)
            use = bounds_use(pieces, self.bounds)
            _, rise, bend, hold = use.shares
            # factor by which a single step must widen to keep each limit
            excess = np.maximum(np.maximum(rise, np.sqrt(bend)), np.maximum(hold, 1.0))
            if excess.max() <= USED_UP or excess.max() > HELPING * worst:
                break
            section = section._widened(lengths, pieces.durations, np.maximum(excess, use.slowing))
            worst = float(excess.max())
            if HELPING * worst <= 1.0:  # the next pass would end the loop anyway
                break
        return section

    def slowed(self, lengths: FloatArray) -> tuple[Section, float]:
        """Return the section slowed until it keeps all limits, and the time of the largest excess, s."""
        pieces = self.pieces(lengths)
        use = (bounds_use(pieces, self.bounds).shares ** (1.0 / ORDERS)).max(axis=0)
        factor = float(use.max())
        at = float(pieces.durations[: int(np.argmax(use))].sum()) * factor
        return (self if factor <= USED_UP else replace(self, slower=self.slower * factor)), at

    def split(self, path: PushPath, stops: frozenset[int]) -> list[Part]:
        """Return the parts between stops."""
        ends = np.flatnonzero(np.isin(self.arcs[:-1], list(stops))) + 1
        if not len(ends):
            return [self]
        split = zip(np.split(self.arcs, ends), np.split(self.speeds, ends), strict=True)
        return [make_part(path, arcs, self.bounds, speeds) for arcs, speeds in split]

    def _widened(self, lengths: FloatArray, durations: FloatArray, excess: FloatArray) -> Section:
        """Return the section with steps widened by up to the `excess` (q,) of the pieces that they overlap."""
        centers, windows = self._placed(lengths)
        half = windows.sum(axis=1) / 2.0
        ends = np.cumsum(durations)
        near = np.searchsorted(ends, centers - half, "right"), np.searchsorted(ends - durations, centers + half)
        factors = np.append(np.clip(excess, 1.0, MOST), 1.0)
        factor = np.maximum.reduceat(factors, np.stack(near, axis=1).ravel())[::2]
        return replace(self, steps=self.steps / factor[:, None] ** DERIVATIVES)

    @remembered
    def _placed(self, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the centre times (a + 1,) of the steps in the section, and their windows (a + 1, 2), s.

        Steps that overlap others are recomputed within lower limits, which makes them wider.
        """
        centers = self.slower * np.concatenate([[0.0], np.cumsum(lengths[self.arcs] / self.speeds)])
        windows = self._windows
        which, bounds = timing.wider_steps(centers, windows)
        if len(which):
            windows = windows.copy()
            windows[which] = step_windows(bounds)
        return centers + windows[0].sum() / 2.0, windows

    @cached_property
    def _windows(self) -> FloatArray:
        """Windows (a + 1, 2) of the steps without their neighbours, s."""
        return step_windows(self.steps / self.slower**DERIVATIVES)


def make_part(path: PushPath, arcs: IntArray, bounds: Bounds, speeds: FloatArray) -> Part:
    """Return some arcs (a,) of a path, with their `passing_speeds` (a,), as one part."""
    twists = path.twists[arcs]
    if len(arcs) == 1:
        return Push(arcs, bounds, twists[0])
    rest = np.zeros((1, 3))
    levels = np.concatenate([rest, twists * speeds[:, None], rest])
    return Section(arcs, bounds, levels, speeds, step_bounds(levels, bounds.limits))


def passing_speeds(twists: FloatArray, lengths: FloatArray, bounds: Bounds) -> FloatArray:
    """Return the top speeds (k,) of arcs (k, 3) that are passed without a stop.

    If speed and acceleration compete for a contact's reserve, short arcs from rest to rest need more acceleration.
    Passing an arc needs little, because the steps before and after it are eased later.
    """
    found, able = contact_limits_of(twists, np.maximum(lengths, PASSED), bounds)
    speeds = np.array(found.speed)
    for i in np.flatnonzero(~able):  # at the boundary of the set, only a shorter arc is fast enough
        speeds[i] = contact_limits(twists[i], float(lengths[i]), bounds).speed
    return speeds


def step_bounds(levels: FloatArray, limits: Limits) -> FloatArray:
    """Return limits (m, 2) of the first two derivatives of steps between twists (m + 1, 3), 1/s and 1/s^2.

    Each step is scaled to go from 0 to 1. So the limits are the pusher's limits divided by the size of the step, and
    infinite if two twists are equal.
    """
    turning = np.hypot(levels[:, 0], levels[:, 1]) * np.abs(levels[:, 2])  # centripetal acceleration
    braking, gaining = limits.both("acceleration")
    resting = (levels == 0.0).all(axis=1)
    most = np.where(resting[:-1], gaining, np.where(resting[1:], braking, min(braking, gaining)))
    room = most - np.maximum(turning[:-1], turning[1:])
    steps = np.diff(levels, axis=0)
    linear, angular = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    rightward, leftward = limits.both("angular_acceleration")
    turn = np.where(steps[:, 2] > 0.0, leftward, rightward)
    rates = np.minimum(ratio(room, linear), ratio(turn, angular))
    return np.stack([rates, np.minimum(ratio(limits.jerk, linear), ratio(limits.angular_jerk, angular))], axis=1)


CLOSE = 1e-12
"""End error (m, rad) that counts as zero."""

ENOUGH = 1e-10
"""End error (m, rad) that is accepted if rounding allows no better one."""

ROUNDS = 25


class NoFitError(TimingError):
    """No arc lengths near the path's own make a blended motion end where the path does."""


def fit_lengths(
    end: Callable[[FloatArray], FloatArray], goal: FloatArray, path: PushPath, lengths: FloatArray, rows: LengthRows
) -> FloatArray:
    """Return the lengths (k,) at which a motion along a path's twists ends on a pose.

    Args:
        end: Returns the end pose (3,) of the motion in the world for lengths (k,).
        goal: (3,) pose in the world, near the path's end.
        path: Path that approximates the effect of the lengths on the end.
        lengths: (k,) initial lengths. Long arcs change more than short ones, and none becomes negative.
        rows: Further conditions on the lengths.

    Raises:
        NoFitError: If Newton's method does not converge.
    """
    effects = effects_on(path.end, path)
    best, least = lengths, np.inf
    for _ in range(ROUNDS):
        error = se2.relative(end(lengths), goal)
        missing = rows.values - rows.matrix @ lengths
        size = max(float(np.abs(error).max()), float(missing.max(initial=0.0)))
        if size < least:
            best, least = lengths, size
        if size < CLOSE:
            break
        lengths = lengths + _change(effects, error, rows.matrix, missing, lengths)
    if least > ENOUGH:
        raise NoFitError(f"no arc lengths found that end on the goal: the best miss a condition by {least:.2g}")
    return best


def _change(
    effects: FloatArray, error: FloatArray, matrix: FloatArray, missing: FloatArray, lengths: FloatArray
) -> FloatArray:
    """Return the change of the lengths, relatively small, that removes the error and meets the conditions.

    Raises:
        NoFitError: If the conditions need a negative length.
    """
    identity = np.eye(len(lengths))
    share = least_change(
        effects * lengths, error, np.vstack([matrix * lengths, identity]), np.append(missing, -identity.sum(axis=1))
    )
    if share is None:
        raise NoFitError("no non-negative arc lengths avoid all collisions")
    return np.maximum(share, -1.0) * lengths


RANK = 1e-9
"""Singular values below this share of the largest one count as 0."""

MISSED = 1e-12
"""Tolerance of inequalities. The lengths must end on the goal to 1e-10."""


def least_change(
    equations: FloatArray, values: FloatArray, rows: FloatArray, bounds: FloatArray
) -> FloatArray | None:
    """Return the shortest y (k,) with equations y = values and rows y >= bounds; None if there is none.

    Contradictory equations are solved by least squares. Their solutions are y = y_0 + N z. The shortest z with G z >=
    h solves a quadratic program (DAQP, Arnstrom, Bemporad and Axehill 2022).

    Args:
        equations: (m, k) matrix.
        values: (m,) right-hand sides.
        rows: (c, k) matrix of the inequalities.
        bounds: (c,) lower bounds.
    """
    left, sizes, right = np.linalg.svd(equations)
    rank = int((sizes > RANK * sizes[0]).sum())
    particular = right[:rank].T @ ((left[:, :rank].T @ values) / sizes[:rank])
    h = bounds - rows @ particular
    if (h <= 0.0).all():
        return np.asarray(particular)
    free = right[rank:].T
    if not free.shape[1]:
        return None
    g = rows @ free
    square, none = np.eye(free.shape[1]), np.zeros(free.shape[1])
    z, _, flag, _ = daqp.solve(square, none, np.ascontiguousarray(g), np.full(len(h), np.inf), h, primal_tol=MISSED)
    return np.asarray(particular + free @ z) if flag > 0 else None


FITS = 2
"""Number of rounds of widening steps and fitting lengths."""


def corners_of(path: PushPath) -> frozenset[int]:
    """Return the arcs at whose end the twist changes: all except the last."""
    return frozenset(range(len(path.lengths) - 1))


def fitted(
    path: PushPath, goal: FloatArray, parts: Sequence[Part], rows: LengthRows
) -> tuple[list[Part], FloatArray]:
    """Return parts with steps widened to keep the limits, and lengths (k,) that end on the goal (3,).

    Raises:
        NoFitError: If no lengths reach the goal and meet the conditions.
    """
    lengths = path.lengths
    for _ in range(FITS):
        parts = [part.eased(lengths) for part in parts]
        lengths = fit_lengths(partial(_end, path, parts), goal, path, lengths, rows)
    return list(parts), lengths


def slowed(parts: Sequence[Part], lengths: FloatArray, bearable: float) -> tuple[list[Part], FloatArray]:
    """Slow whole parts until they keep the limits.

    Returns:
        The parts, and the times (k,) of the largest excess in parts that are delayed by more than `bearable`, s.
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


def nearest_corners(
    parts: Sequence[Part], lengths: FloatArray, times: FloatArray, most: int | None = None
) -> frozenset[int]:
    """Return the corners without a stop that are nearest to some times (k,), at most `most` of them."""
    arcs, at = _blended_corners(parts, lengths)
    nearest = arcs[np.abs(at - times[:, None]).argmin(axis=1)]
    return frozenset(list(dict.fromkeys(nearest.tolist()))[:most])


def sharpest_corners(path: PushPath, parts: Sequence[Part], most: int) -> frozenset[int]:
    """Return the corners without a stop whose twists commute least. Their blends move the end most."""
    arcs, _ = _blended_corners(parts, path.lengths)
    a, b = path.twists[arcs], path.twists[arcs + 1]
    bracket = a[:, 2:] * b[:, :2] - b[:, 2:] * a[:, :2]
    return frozenset(arcs[np.argsort(-np.hypot(*bracket.T), kind="stable")[:most]].tolist())


def _end(path: PushPath, parts: Sequence[Part], lengths: FloatArray) -> FloatArray:
    pose = path.start
    for part in parts:
        pose = se2.compose(pose, part.motion(lengths))
    return pose


def _blended_corners(parts: Sequence[Part], lengths: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the arcs (c,) after which the twist changes without a stop, and the times (c,), s."""
    begins = np.cumsum([0.0, *(part.duration(lengths) for part in parts[:-1])])
    corners = [part.corners(lengths) for part in parts]
    times = [begin + at for begin, (_, at) in zip(begins, corners, strict=True)]
    return np.concatenate([arcs for arcs, _ in corners]), np.concatenate(times)
