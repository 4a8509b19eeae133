"""The segments of a plan on a clock; and the fastest trajectory along a path that turns smoothly from arc to arc."""

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
"""How far twists are moved inward: shares of the way to the path's most stable twist, or the set's."""

SAFETY = 2.0
"""Multiple of the smallest share that helps: on its way in and out the twist is moved by a part of it only."""

SAMPLES = 65
"""Twists looked at between two."""

MOST = 1.0 / 3.0
"""Share of an arc that may be driven with another twist at either end."""


class Inset(NamedTuple):
    """A path with more arcs, and (k,) the arc of the given path that each of its arcs belongs to."""

    path: PushPath
    owner: IntArray


def inset_path(path: PushPath, stable: StableSet, minimum: float, bounds: Bounds) -> Inset:
    """Return the path with twists moved inward near the corners where the margin would dip.

    It does not quite end where the given path does. A corner where no share helps stays as it is.

    Args:
        path: Constant-twist arcs, each with more than the minimum margin.
        stable: The set.
        minimum: The margin has to exceed it.
        bounds: What limits the motion, for the time that a step takes.
    """
    twists, rest = path.twists, path.lengths.copy()
    speeds = cache(lambda: passing_speeds(twists, path.lengths, bounds))
    towards = (
        cache(lambda: _most_stable(path, stable)),
        # a thousand margins, for the few paths that lie on a concave side of the set
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
    """The most stable of the path's twists and their mean: one that the pusher's drive can make, too."""
    tried = np.concatenate([path.twists, path.twists.mean(axis=0, keepdims=True)])
    return np.asarray(tried[np.argmax(stable.margin(tried))])


def _moved(twists: FloatArray, inside: FloatArray, share: float) -> FloatArray:
    """Twists (k, 3) moved inward, scaled to a cost rate of 1."""
    mixed = (1.0 - share) * twists + share * inside
    return np.asarray(mixed / cost_rate(mixed)[:, None])


def _moved_inward(
    pair: FloatArray, towards: Iterable[Callable[[], FloatArray]], stable: StableSet, minimum: float
) -> FloatArray | None:
    """Two twists (2, 3) moved inward as far as they have to be, and safely so; None if nothing helps."""
    for inside in towards:
        for share in SHARES:
            near, far = _moved(pair, inside(), share), _moved(pair, inside(), SAFETY * share)
            begin, end = np.stack([near[0], far[0], pair[0], far[1]]), np.stack([near[1], far[1], far[0], pair[1]])
            if _hold(begin, end, stable, minimum).all():
                return far
    return None


def _hold(begin: FloatArray, end: FloatArray, stable: StableSet, minimum: float) -> BoolArray:
    """Whether (k,) the margin stays above the minimum on the straight way from twists (k, 3) to others."""
    mix = np.linspace(0.0, 1.0, SAMPLES)[:, None, None]
    twists = (1.0 - mix) * begin + mix * end
    margins = stable.margin(twists.reshape(-1, 3)).reshape(SAMPLES, -1)
    return np.asarray((margins > minimum).all(axis=0))


def _spent(twists: FloatArray, lengths: FloatArray, speeds: FloatArray, bounds: Bounds) -> FloatArray:
    """Lengths (2,) of two neighbouring arcs that are driven within half a step's time of the corner."""
    time = step_windows(step_bounds(twists * speeds[:, None], bounds.limits)).sum()
    return np.asarray(np.minimum(speeds * time / 2.0, MOST * lengths))


NUDGES = 6
"""How often lengths are changed to keep away from what is touched before a stop is made."""

OFF_CHORDS = 0.2
"""Share of the room between the distances that poses looked at have and that is kept between, which may be used up by
proving for a motion what its samples, with constant twists between them, keep; these are looked at otherwise."""

FEW = 128
"""Of so many corners one more gets a stop at a time, so that paths of hundreds of arcs are timed in seconds, too."""

WORTH_A_STOP = 0.5
"""Delay (s) by slowing down a whole section from which on a stop at its worst corner is preferred."""


@dataclass(frozen=True, eq=False)
class Blend:
    """A blended trajectory and what was done to the path for it.

    Attributes:
        trajectory: Ends where the path ends.
        stops: Indices of the path's arcs at whose end the pusher stops although the path goes on.
    """

    trajectory: Trajectory
    stops: frozenset[int]


class Nudging(NamedTuple):
    """What is tried to keep away from things without a further stop.

    Attributes:
        rows: Conditions on the lengths.
        suspects: The corner nearest to what was touched last.
        tries: How often conditions were added.
    """

    rows: LengthRows
    suspects: frozenset[int] = frozenset()
    tries: int = 0

    def further(self, rows: LengthRows, suspects: frozenset[int]) -> Nudging:
        """Return it with more conditions."""
        return Nudging(self.rows.joined(rows), suspects, self.tries + 1)


@dataclass(eq=False)
class BlendSearch:
    """The search for the stops and lengths of one blend.

    Attributes:
        scenario: Limits of the pusher, margin to keep, and what is in the way.
        scene: What moves and what stands still in it.
        path: Constant-twist arcs.
        goal: (3,) pose in the world to end on, near the path's end.
        stable: The set whose margin has to be kept.
        rate: Samples per second of the trajectory.
        bounds: What limits the motion.
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
        """Return the blend; None where its duration (s) is not worthwhile, or it needs a stop at every corner."""
        while self.stops < self.corners and worthwhile(self._least_duration()):
            blend = self._attempt()
            if blend is not None:
                return blend if worthwhile(blend.trajectory.duration) else None
        return None

    def _least_duration(self) -> float:
        """How long it takes with the present stops, s, if the lengths can stay and no step has to be widened."""
        return sum(part.duration(self.path.lengths) for part in self.parts)

    def _attempt(self) -> Blend | None:
        """Return the trajectory with the present stops and nudges; None, after adding some, where it fails."""
        try:
            self.parts, lengths = fitted(self.path, self.goal, self.parts, self.nudging.rows)
        except NoFitError:
            self._stop(self.nudging.suspects or sharpest_corners(self.path, self.parts, self.few))
            return None
        parts, strained = slowed(self.parts, lengths, WORTH_A_STOP)
        if len(strained):  # a section a million times slower is never made: its pieces would fill the memory
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
        """Return where the motion comes too near to something, so that its samples, too, keep what they have to.

        The motion between two samples may be off the constant twist that the checker assumes there. It has to keep so
        much more; where that takes up too much of the room, the samples are looked at instead.
        """
        scene = self.scene
        off = off_chords(trajectory, self.reach)
        if off > OFF_CHORDS * (scene.clearance - scene.kept):
            return find_touches(scene, sampled(trajectory), self.reach)
        return find_touches(scene.with_distances(scene.clearance, scene.kept + off), trajectory, self.reach)

    def _stop(self, corners: frozenset[int]) -> None:
        """Stop at more corners, and see anew what is touched then."""
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
        scenario: What is in the way, and the margin to keep.
        path: Constant-twist arcs, free of collision and stable.
        stable: The set whose margin has to exceed `scenario.required_margin`.
        bounds: What limits the motion.
        rate: Samples per second of the trajectory.
        scene: The scenario's, where it is there already.
        below: Duration (s) from which on a blend need not be found; the exact trajectory may be returned instead.

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
    """Return segments with their trajectories, within the limits of the pusher and, if asked for, of the contacts.

    Args:
        scenario: Chooses by `trajectory` whether the pusher stops at every corner of a push (`exact`) or at as few as
            possible (`blended`), and by `limits.contact` whether inertia may make a contact slip.
        segments: Of a plan: free of collision and stable.
        rate: Samples per second of the trajectories.
        stable_set: That they were planned in; None stands for the scenario's.
        scene: Of a single push, where it is there already.
        below: Duration (s) from which on a push need not be blended.

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
