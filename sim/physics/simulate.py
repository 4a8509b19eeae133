"""Execution of plans with real contacts in a physics engine (MuJoCo).

It is an independent check of the stable sets: the engine does not use the mechanics of this package. It gets bodies,
feet with known loads, edges, and coefficients of friction, and moves the plate. A push is executed together with its
approach and its retreat. Objects outside the load, and transits, are checked by distances only.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.plans.plan import Plan
from pushplan.sim.physics.engine import PhysicsError
from pushplan.sim.physics.simulator import HARD, PhysicsSimulator, sliding_speed
from pushplan.sim.report import (
    TOLERANCE,
    ContactReport,
    Part,
    columns_of,
    contact_motion,
    first_closed,
    motions_of,
    report_of,
    wanted_at_end,
)
from pushplan.sim.slip import SETTLED, step_times
from pushplan.slip.world import World
from pushplan.util.arrays import BoolArray, FloatArray, IntArray
from pushplan.util.names import APPROACH, CLOSE, PUSH

STEPS = (1.0, 0.25, 0.125)
"""Successive time steps of a push while a contact moves, as shares of the usual one.

The engine's friction creeps: a held contact slides a little, in proportion to the path length and the time step.
After 20 m, this reaches the thousandth of a segment at which a contact counts as moved: 1.0e-3 with a step of 1 ms,
0.8e-3 with 0.25 ms (random 4 of benchmarks/plans_in_physics.py). After 35 m it is 2.6e-3 and 1.0e-3 (random 26).
"""
LATER = 1.2
"""Smallest ratio of the times of a moved contact with the smaller and the larger step if it creeps; a slip has 1."""
LOOKS, FEWEST = 50.0, 200
"""Checks of the contacts per second, because a contact can open and close again, and smallest number in all."""
NEAR = 5e-3
"""Largest distance between checked poses of a transit, m."""


def simulate_in_physics(
    plan: Plan,
    world: World | None = None,
    *,
    until_moved: bool = False,
    progress: Callable[[float], None] | None = None,
) -> ContactReport:
    """Execute a plan at full speed with inertia; repeat pushes with smaller steps while a contact creeps.

    Args:
        plan: Timed plan of any kind of scenario, with known loads.
        world: World of the execution; None for the plan's scenario. Obstacles and walls are not simulated.
        until_moved: Whether to end as soon as a contact counts as moved.
        progress: Callback with the finished share of the trajectory.

    Raises:
        MissingExtraError: If the engine is not installed.
        PhysicsError: If there is nothing to simulate, or the simulation diverges.
        SupportError: If a load is not known.
    """
    if plan.trajectory is None:
        raise PhysicsError(f"there is no plan to execute: {plan.reason or 'it is not timed'}")
    there = World.from_scenario(plan.scenario) if world is None else world
    there.require(plan.scenario)
    objects = there.object_poses
    parts, clear, stalled = list[Part](), math.inf, False
    for group in _groups(plan):
        standing = _standing(plan, there, group, objects)
        if plan.segments[group[0]].load is None:
            parts.append(_alone(plan, there, group[0], objects))
            clear = min(clear, _clearance(plan, there, parts[-1], standing))
        else:
            own = _Push(plan, there, group, objects, until_moved, progress)
            found = own.executed()
            parts += found
            clear = min(clear, *(_clearance(plan, there, part, standing) for part in found))
            stalled = own.stalled
            if own.stopped or stalled:
                break
        objects = parts[-1].objects[-1]
        if progress is not None:
            progress(plan.times[group[-1] + 1] / plan.times[-1])
    wanted = wanted_at_end(plan, parts[-1], there.names)
    ended = {"stalled_at": float(parts[-1].t[-1])} if stalled else {}
    return report_of(there.names, parts, wanted, **ended, clear=clear)


def _groups(plan: Plan) -> list[list[int]]:
    """Return the indices of segments that are executed together: each push with its approach and its retreat.

    A close before another push belongs to that push, because the load can touch the next object early.
    """
    found: list[list[int]] = []
    for k, segment in enumerate(plan.segments):
        takes = segment.kind == CLOSE and plan.segments[k + 1].kind == PUSH
        begins = segment.load is None or segment.kind == APPROACH or takes or not found
        if begins or plan.segments[found[-1][-1]].load is None:
            found.append([])
        found[-1].append(k)
    return found


class _Push:
    """A push with approach and retreat, from object poses (n, 3)."""

    def __init__(
        self,
        plan: Plan,
        world: World,
        group: list[int],
        objects: FloatArray,
        until_moved: bool,
        progress: Callable[[float], None] | None,
    ) -> None:
        self._own = next(j for j, k in enumerate(group) if plan.segments[k].kind == PUSH)
        self._push = group[self._own]
        load = plan.segments[self._push].pushed_load
        assert plan.trajectory is not None
        self.chain = world.chain if world.plate is None else world.pushed(load.chain)
        self.stopped = self.stalled = False
        self._plan, self._world, self._group, self._objects = plan, world, group, objects
        self._until_moved, self._progress = until_moved, progress
        self._t0, self._t1 = float(plan.times[group[0]]), float(plan.times[group[-1] + 1])
        self._trajectory, self._frame = plan.trajectory, load.frame_plate

    def executed(self) -> list[Part]:
        """Execute the push, with smaller steps while a contact creeps; the last execution counts."""
        moved_at = 0.0
        for share in STEPS:
            driven = self._driven(share, until_moved=True)
            before, moved_at = moved_at, driven.moved_at - self._t0
            if not math.isfinite(moved_at) or (before > 0.0 and moved_at <= LATER * before):
                break
        self.stopped = self._until_moved and math.isfinite(moved_at)
        if math.isfinite(moved_at) and not self._until_moved:
            driven = self._driven(share, until_moved=False)
        self.stalled = driven.stalled
        return self._parts(driven)

    def _settled(self) -> float:
        """Return the time from which slides and gaps count, s; after an approach, contacts close first."""
        push, begin = self._plan.segments[self._push], float(self._plan.times[self._push])
        if self._push == self._group[0]:
            return begin
        own = push.contact_trajectory
        gone = np.hypot(*(own.poses[:, :2] - own.poses[0, :2]).T)
        settled = np.flatnonzero(gone >= SETTLED * push.contact_path.lengths[0])
        return begin + float(own.t[settled[0]])

    def _driven(self, share: float, until_moved: bool) -> _Driven:
        """Execute the push with a share of the usual time step."""
        duration = self._t1 - self._t0
        count = math.ceil(duration / (share * HARD.time_step))
        dt = duration / count
        at = np.asarray(self._t0 + dt * np.arange(count + 1), dtype=np.float64)
        frames = se2.compose(self._trajectory.poses_at(at), self._frame)
        frames[:, 2] = np.unwrap(frames[:, 2])
        ends = self._plan.times[[*self._group, self._group[-1] + 1]]
        marks = np.searchsorted(at, ends - 0.5 * dt)
        samples = max(FEWEST, math.ceil(LOOKS * duration))
        looks = np.union1d(np.linspace(0, count, samples + 1).astype(np.int64), marks)
        own = self._objects[columns_of(self.chain, self._world.names)]
        world = World.from_chain(self.chain, frames[0]).with_object_poses(own)
        sliding = sliding_speed(self.chain, frames, dt)
        simulator = PhysicsSimulator(world, replace(HARD, time_step=dt), sliding)
        driven = _Driven(self.chain, self._own, at[marks], self._settled())
        moved = self._look(driven, float(at[0]), simulator)
        for begin, end in itertools.pairwise(looks.tolist()):
            if simulator.stalled or (moved and until_moved):
                break
            done = len(simulator.move_along(frames[begin : end + 1]))
            moved = self._look(driven, float(at[begin + done]), simulator)
        return driven

    def _look(self, driven: _Driven, t: float, simulator: PhysicsSimulator) -> bool:
        if self._progress is not None:
            self._progress(t / float(self._plan.times[-1]))
        return driven.look(t, simulator)

    def _parts(self, driven: _Driven) -> list[Part]:
        """Return the executed part of each segment."""
        t, frames = np.array(driven.t), np.array(driven.frames)
        objects = np.repeat(self._objects[None], len(t), axis=0)
        objects[:, columns_of(self.chain, self._world.names)] = driven.objects
        found, plate = [], self.chain.pusher.plate_pose
        for j, k in enumerate(self._group):
            rows = driven.rows(j)
            if len(rows) < 2:
                break
            segment = self._plan.segments[k]
            chain, base = None, driven.base
            if segment.pushes and segment.load is not None:
                chain = self.chain if k == self._push else self._world.pushed(segment.load.chain)
            if k == self._push and base is not None:
                base = max(base - int(rows[0]), 0)
            elif segment.kind == CLOSE:
                base = 0
            found.append(Part(k, chain, t[rows], frames[rows], plate, objects[rows], base, touched=segment.touched))
        return found


@dataclass(eq=False)
class _Driven:
    """Recorded execution of a push, one entry for each check.

    Attributes:
        chain: Pushed chain.
        own: Index of the push among the executed segments.
        marks: Times at which segments begin, and end of the last one, s.
        settled: Time from which slides and gaps count, to the end of the push, s.
        t: Times of the checks, s.
        frames: Poses of the chain frame, each (3,).
        objects: Poses of the chain's objects, each (n, 3).
        base: Index of the check from which slides and gaps count: the first one with all gaps below a tenth of the
            tolerance, because displaced objects touch with a corner at first. None before that.
        stalled: Whether the plate lacked the force to continue after the last check.
    """

    chain: Chain
    own: int
    marks: FloatArray
    settled: float
    t: list[float] = field(default_factory=list)
    frames: list[FloatArray] = field(default_factory=list)
    objects: list[FloatArray] = field(default_factory=list)
    base: int | None = None
    stalled: bool = False

    def look(self, t: float, simulator: PhysicsSimulator) -> bool:
        """Record all poses; return whether a contact has moved while slides and gaps count."""
        self.t.append(t)
        self.frames.append(simulator.plate_pose)
        self.objects.append(simulator.object_poses)
        self.stalled = simulator.stalled
        if self.stalled or not self.settled <= t <= self.marks[self.own + 1]:
            return False
        last = len(self.t) - 1
        if self.base is None and first_closed(self.chain, self._motions([last])) is not None:
            self.base = last
        return self.base is not None and bool(self._over([self.base, last], 0)[1])

    def rows(self, j: int) -> IntArray:
        """Return the indices of the checks in segment j."""
        t = np.array(self.t)
        return np.flatnonzero((t >= self.marks[j]) & (t <= self.marks[j + 1]))

    @property
    def moved_at(self) -> float:
        """Time of the first check with a moved contact during the push, s; infinite if none has moved."""
        rows = self.rows(self.own)
        over = self._over(range(len(self.t)), self.base)[rows]
        return self.t[rows[over.argmax()]] if over.any() else math.inf

    def _over(self, looks: Sequence[int], base: int | None) -> BoolArray:
        """Return at which checks (k,) a contact has moved; see `contact_motion`."""
        slide, opening, _ = contact_motion(self.chain, self._motions(looks), base)
        lengths = np.array([contact.length for contact in self.chain.contacts])
        return np.asarray((np.maximum(np.abs(slide), opening) / lengths > TOLERANCE).any(axis=1))

    def _motions(self, looks: Sequence[int]) -> FloatArray:
        frames, objects = ([column[k] for k in looks] for column in (self.frames, self.objects))
        return motions_of(self.chain, np.array(frames), np.array(objects))


def _alone(plan: Plan, world: World, k: int, objects: FloatArray) -> Part:
    """Return the executed part of a segment in which the robot drives alone."""
    trajectory = plan.segments[k].contact_trajectory
    t = step_times(trajectory, world.chain.reach, NEAR)
    poses = trajectory.poses_at(t)
    return Part(k, None, t + plan.times[k], poses, np.zeros(3), np.repeat(objects[None], len(t), axis=0))


def _standing(plan: Plan, world: World, group: Sequence[int], objects: FloatArray) -> shapely.Geometry | None:
    """Return the union of the objects that a group of segments does not push; None if it pushes all."""
    loads = [plan.segments[k].load for k in group]
    pushed = {name for load in loads if load is not None for name in load.names}
    pushed |= {plan.segments[k].onto for k in group}
    outlines = [
        shapely.Polygon(se2.transform_points(pose, obj.outline))
        for obj, pose in zip(world.objects, objects, strict=True)
        if obj.name not in pushed
    ]
    return shapely.union_all(outlines) if outlines else None


def _clearance(plan: Plan, world: World, part: Part, standing: shapely.Geometry | None) -> float:
    """Return the smallest distance (m) of robot and load from resting objects along a part."""
    if standing is None:
        return math.inf
    load = plan.segments[part.segment].load
    pusher = plan.scenario.pusher if load is None else load.chain.pusher
    into = se2.compose(part.plate, se2.inverse(pusher.plate_pose))
    moving = [
        shapely.Polygon(se2.transform_points(se2.compose(pose, into), outline))
        for pose in part.frame
        for outline in (pusher.outline, *pusher.footprint)
    ]
    for name in () if load is None else load.names:
        i = world.names.index(name)
        outline = world.objects[i].outline
        moving += [shapely.Polygon(se2.transform_points(poses[i], outline)) for poses in part.objects]
    return float(shapely.distance(moving, standing).min())
