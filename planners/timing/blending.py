"""Timing of a plan's segments, and the fastest trajectory along a path with smooth steps from arc to arc."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from pushplan.core.collision import Scene
from pushplan.geometry.se2 import relative
from pushplan.planners.controls import most_stable_twist
from pushplan.planners.outcome import Segments
from pushplan.planners.problem import scenario_scene
from pushplan.planners.timing.arc_limits import Bounds, least_times, motion_bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.planners.timing.parts import (
    NoFitError,
    corners_of,
    fitted,
    joined,
    make_part,
    nearest_corners,
    passing_speeds,
    sharpest_corners,
    slowed,
    step_bounds,
)
from pushplan.planners.timing.profiles import step_windows
from pushplan.planners.timing.sweep import (
    NOTHING_TOUCHED,
    LengthRows,
    Touches,
    find_touches,
    no_rows,
    nudges,
    off_chords,
    sampled,
    unstable_times,
)
from pushplan.plans.path import SHORTEST_ARC, PushPath, cost_rate
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

SHARES = 2.0 ** np.arange(-12.0, -1.0)
"""Shares by which twists move inward, towards the most stable twist of the path or of the set."""

SAFETY = 2.0
"""Factor on the smallest share that helps, because a twist moves in and out gradually."""

SAMPLES = 65
"""Number of twists checked between two twists."""

MOST = 1.0 / 3.0
"""Maximum share of an arc that is driven with another twist, at either end."""


class Inset(NamedTuple):
    """A path with more arcs, and the index (k,) of the given path's arc for each of them."""

    path: PushPath
    owner: IntArray


def inset_path(path: PushPath, stable: StableSet, minimum: float, bounds: Bounds) -> Inset:
    """Return the path with twists moved inward near corners where the margin would become too small.

    Its end differs slightly from that of the given path. A corner where no share helps stays unchanged.

    Args:
        path: Constant-twist arcs, each with more than the minimum margin.
        stable: Stable set.
        minimum: Lower limit of the margin.
        bounds: Limits of the motion, for the time of a step.
    """
    twists, rest = path.twists, path.lengths.copy()
    speeds = cache(lambda: passing_speeds(twists, path.lengths, bounds))
    towards = (
        cache(lambda: _most_stable(path, stable)),
        # takes a thousand margins; only a few paths on a concave side of the set need it
        cache(lambda: most_stable_twist(stable, stable.chain.pusher.drive)),
    )
    heads: dict[int, FloatArray] = {}
    tails: dict[int, FloatArray] = {}
    for i in np.flatnonzero(~_hold(twists[:-1], twists[1:], stable, minimum)).tolist():
        pair = slice(i, i + 2)
        moved = _moved_inward(twists[pair], towards, stable, minimum)
        if moved is not None:
            spent = _spent(twists[pair], path.lengths[pair], speeds()[pair], bounds)
            tails[i], heads[i + 1] = np.append(moved[0], spent[0]), np.append(moved[1], spent[1])
            rest[pair] -= spent
    made = [
        (row, i)
        for i in range(len(twists))
        for row in (heads.get(i), np.append(twists[i], rest[i]), tails.get(i))
        if row is not None and row[3] > SHORTEST_ARC
    ]
    rows = np.array([row for row, _ in made]).reshape(-1, 4)
    owners = np.array([owner for _, owner in made], dtype=np.int64)
    return Inset(PushPath(path.start, rows[:, :3], rows[:, 3]), owners)


def _most_stable(path: PushPath, stable: StableSet) -> FloatArray:
    """Return the most stable of the path's twists and their mean. The drive can make all of them."""
    tried = np.concatenate([path.twists, path.twists.mean(axis=0, keepdims=True)])
    return np.asarray(tried[np.argmax(stable.margin(tried))])


def _moved(twists: FloatArray, inside: FloatArray, share: float) -> FloatArray:
    """Return twists (k, 3) moved inward, scaled to a cost rate of 1."""
    mixed = (1.0 - share) * twists + share * inside
    return np.asarray(mixed / cost_rate(mixed)[:, None])


def _moved_inward(
    pair: FloatArray, towards: Iterable[Callable[[], FloatArray]], stable: StableSet, minimum: float
) -> FloatArray | None:
    """Return two twists (2, 3) moved inward far enough, with a safety factor; None if no share helps."""
    for inside in towards:
        for share in SHARES:
            near, far = _moved(pair, inside(), share), _moved(pair, inside(), SAFETY * share)
            begin, end = np.stack([near[0], far[0], pair[0], far[1]]), np.stack([near[1], far[1], far[0], pair[1]])
            if _hold(begin, end, stable, minimum).all():
                return far
    return None


def _hold(begin: FloatArray, end: FloatArray, stable: StableSet, minimum: float) -> BoolArray:
    """Return (k,) whether the margin stays above the minimum on straight lines between twists (k, 3)."""
    mix = np.linspace(0.0, 1.0, SAMPLES)[:, None, None]
    twists = (1.0 - mix) * begin + mix * end
    margins = stable.margin(twists.reshape(-1, 3)).reshape(SAMPLES, -1)
    return np.asarray((margins > minimum).all(axis=0))


def _spent(twists: FloatArray, lengths: FloatArray, speeds: FloatArray, bounds: Bounds) -> FloatArray:
    """Return the lengths (2,) of two neighbouring arcs within half a step's time of their corner."""
    time = step_windows(step_bounds(twists * speeds[:, None], bounds.limits)).sum()
    return np.asarray(np.minimum(speeds * time / 2.0, MOST * lengths))


NUDGES = 6
"""Number of attempts to avoid collisions by other lengths before a stop is added."""

OFF_CHORDS = 0.2
"""Maximum deviation of a motion from its samples, as a share of `clearance` - `kept`. With more, the samples are
checked instead of the motion."""

FEW = 128
"""Number of corners for each stop that is added at a time. So paths of hundreds of arcs take only seconds."""

WORTH_A_STOP = 0.5
"""Delay (s) of a slowed section above which a stop at its worst corner is better."""


@dataclass(frozen=True, eq=False)
class Blend:
    """A blended trajectory and its stops.

    Attributes:
        trajectory: Trajectory to the path's end.
        stops: Indices of the arcs, except the last, at whose end the pusher stops.
    """

    trajectory: Trajectory
    stops: frozenset[int]


class Nudging(NamedTuple):
    """Attempts to avoid collisions without a further stop.

    Attributes:
        rows: Conditions on the lengths.
        suspects: Corner nearest to the last collision.
        tries: Number of attempts.
    """

    rows: LengthRows
    suspects: frozenset[int] = frozenset()
    tries: int = 0

    def further(self, rows: LengthRows, suspects: frozenset[int]) -> Nudging:
        """Return the attempts with more conditions."""
        return Nudging(self.rows.joined(rows), suspects, self.tries + 1)


@dataclass(eq=False)
class BlendSearch:
    """The search for the stops and lengths of one blend.

    Attributes:
        scenario: Scenario with the pusher's limits, the required margin and the obstacles.
        scene: Its collision scene.
        path: Constant-twist arcs.
        goal: (3,) end pose in the world, near the path's end.
        stable: Stable set.
        rate: Samples per second of the trajectory.
        bounds: Limits of the motion.
    """

    scenario: Scenario
    scene: Scene
    path: PushPath
    goal: FloatArray
    stable: StableSet
    rate: float
    bounds: Bounds

    def __post_init__(self) -> None:
        self.reach, self.corners = self.scenario.chain.reach, corners_of(self.path)
        self.few = 1 + len(self.corners) // FEW
        self.stops: frozenset[int] = frozenset()
        speeds = passing_speeds(self.path.twists, self.path.lengths, self.bounds)
        self.parts = [make_part(self.path, np.arange(len(speeds)), self.bounds, speeds)]
        self.nudging = Nudging(no_rows(len(self.path.lengths)))

    def blended(self, worthwhile: Callable[[float], bool]) -> Blend | None:
        """Return the blend; None if its duration (s) is not worthwhile, or if every corner needs a stop."""
        while self.stops < self.corners and worthwhile(self._least_duration()):
            blend = self._attempt()
            if blend is not None:
                return blend if worthwhile(blend.trajectory.duration) else None
        return None

    def _least_duration(self) -> float:
        """Return the duration (s) with the current stops if lengths and steps need no change."""
        return sum(part.duration(self.path.lengths) for part in self.parts)

    def _attempt(self) -> Blend | None:
        """Return the blend with the current stops and nudges. If it fails, add some and return None."""
        try:
            self.parts, lengths = fitted(self.path, self.goal, self.parts, self.nudging.rows)
        except NoFitError:
            self._stop(self.nudging.suspects or sharpest_corners(self.path, self.parts, self.few))
            return None
        parts, strained = slowed(self.parts, lengths, WORTH_A_STOP)
        if len(strained):  # never build a section a million times slower: its pieces would fill the memory
            self._stop(nearest_corners(parts, lengths, strained))
            return None
        trajectory = joined(self.path, parts, lengths, self.rate)
        lost = unstable_times(self.scenario, self.stable, trajectory, self.bounds)
        touches = self._touches(trajectory) if not len(lost) else NOTHING_TOUCHED
        if not len(lost) and not len(touches.times):
            return Blend(trajectory, self.stops)
        worst = touches.times[np.argsort(touches.gaps, kind="stable")] if len(touches.times) else lost
        corners = nearest_corners(parts, lengths, worst, self.few)
        if len(touches.times) and self.nudging.tries < NUDGES:
            rows = nudges(self.scene, self.path, trajectory, lengths, touches, self.reach)
            self.nudging = self.nudging.further(rows, corners)
        else:
            self._stop(corners)
        return None

    def _touches(self, trajectory: Trajectory) -> Touches:
        """Return the collisions of the motion, with enough clearance for the arcs between its samples.

        The validator assumes a constant twist between samples. The motion's deviation from it is added to the
        required clearance. If it is too large, the samples are checked instead.
        """
        scene = self.scene
        off = off_chords(trajectory, self.reach)
        if off > OFF_CHORDS * (scene.clearance - scene.kept):
            return find_touches(scene, sampled(trajectory), self.reach)
        return find_touches(scene.with_distances(scene.clearance, scene.kept + off), trajectory, self.reach)

    def _stop(self, corners: frozenset[int]) -> None:
        """Add stops at corners and discard all nudges."""
        self.stops |= corners
        self.parts = [piece for part in self.parts for piece in part.split(self.path, self.stops)]
        self.nudging = Nudging(no_rows(len(self.path.lengths)))


def blend_path(
    scenario: Scenario,
    path: PushPath,
    stable: StableSet,
    bounds: Bounds,
    rate: float = SAMPLE_RATE,
    scene: Scene | None = None,
    below: float = math.inf,
) -> Blend:
    """Return the trajectory along a path that stops at few corners and takes no longer than the exact one.

    Args:
        scenario: Scenario with the obstacles and the required margin.
        path: Constant-twist arcs, collision-free and stable.
        stable: Stable set whose margin must exceed `scenario.required_margin`.
        bounds: Limits of the motion.
        rate: Samples per second of the trajectory.
        scene: Collision scene of the scenario, if it exists already.
        below: Duration (s) above which no blend is needed. The exact trajectory can be returned instead.

    Raises:
        TimingError: If an arc cannot be timed.
    """
    exact = cache(lambda: time_path(path, bounds, rate))
    if not corners_of(path):
        return Blend(exact(), frozenset())
    scene = scenario_scene(scenario) if scene is None else scene
    inset = inset_path(path, stable, scenario.required_margin, bounds)
    least = float(least_times(path.twists, path.lengths, bounds.limits).sum())

    def worthwhile(duration: float) -> bool:
        return duration < below and (duration < least or duration < exact().duration)

    blend = BlendSearch(scenario, scene, inset.path, path.end, stable, rate, bounds).blended(worthwhile)
    if blend is None:
        return Blend(exact(), corners_of(path))
    arcs = inset.owner[blend.trajectory.arc.astype(np.int64)].astype(np.float64)
    stops = frozenset(int(inset.owner[i]) for i in blend.stops)
    return Blend(replace(blend.trajectory, arc=arcs), stops)


def time_segments(
    scenario: Scenario,
    segments: Segments,
    rate: float = SAMPLE_RATE,
    stable_set: str | None = None,
    scene: Scene | None = None,
    below: float = math.inf,
) -> Segments:
    """Return segments with trajectories within the limits of the pusher and, if required, of the contacts.

    Args:
        scenario: Scenario. Its `trajectory` selects stops at every corner of a push (`exact`) or at as few as
            possible (`blended`). Its `limits.contact` selects whether the contacts must hold with inertia.
        segments: Segments of a plan, collision-free and stable.
        rate: Samples per second of the trajectories.
        stable_set: Name of the segments' stable set; None for the scenario's.
        scene: Collision scene of a single push, if it exists already.
        below: Duration (s) above which a push need not be blended.

    Raises:
        TimingError: If an arc cannot be timed within the limits.
    """
    return tuple(_timed(scenario, segment, rate, stable_set, scene, below) for segment in segments)


def _timed(
    scenario: Scenario, segment: Segment, rate: float, stable_set: str | None, scene: Scene | None, below: float
) -> Segment:
    pusher = scenario.pusher
    if not segment.pushes or segment.load is None:
        alone = time_path(segment.path, Bounds(pusher.limits), rate)
        return replace(segment, trajectory=replace(alone, base=relative(pusher.plate_pose, pusher.base_pose)))
    problem, stable = segment.problem(scenario), segment.load.stable_set(stable_set)
    bounds = motion_bounds(problem, stable)
    if scenario.trajectory == "blended":
        timed: Trajectory = blend_path(problem, segment.contact_path, stable, bounds, rate, scene, below).trajectory
    else:
        timed = time_path(segment.contact_path, bounds, rate)
    own = segment.load.chain.pusher
    least = float(stable.margin(segment.contact_path.twists).min())
    return replace(segment, trajectory=replace(timed, base=own.base_pose).of_frame(own.plate_pose), min_margin=least)
