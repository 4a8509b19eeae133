"""Several pushes in the physics engine, at full speed: every approach, push and retreat, from where the last has led.

The plate does what was planned; the objects are where the engine leaves them. While the robot drives on alone nothing
touches, which is looked at here by distances, to the objects where they are then.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.planners.validation.clearance import densify
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.several.execution import reached_goal
from pushplan.several.modes import Mode
from pushplan.several.segments import mode_of
from pushplan.sim.physics.drive import Motion, Recording, drive
from pushplan.sim.physics.report import contact_motion
from pushplan.sim.physics.verdict import HARD, LOOKS
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import TRANSIT

NEAR = 5e-3
"""Poses of the robot alone that are looked at are no farther apart, m."""


SETTLED = 0.9
"""Share of the settling push after which contacts are expected to be closed."""

STILL = 1e-3
"""Farthest that an approach or a retreat may move an object that stands where it is thought to, m."""


@dataclass(frozen=True, eq=False)
class PushReport:
    """What a push came to, from the approach to the retreat.

    Attributes:
        face: That was pushed.
        approach: Farthest that any object moved before the push began, m.
        gap: Widest gap of any contact once the push has settled it, m.
        slide: Farthest that any contact slid or opened from then on, m.
        retreat: Farthest that any object moved after the push, m.
        most: Slide at which a contact counts as moved, m.
    """

    face: str
    approach: float
    gap: float
    slide: float
    retreat: float
    most: float

    @property
    def kept(self) -> bool:
        """Whether the contacts held, and neither approach nor retreat moved anything."""
        return self.slide <= self.most and max(self.approach, self.retreat) <= STILL


@dataclass(frozen=True, eq=False)
class SeveralReport:
    """What a plan of several pushes came to.

    Attributes:
        pushes: One after the other.
        clear: Least distance of the robot from any object while it drove alone, m; infinite where it never did.
        loads: (n, 3) where each object would have the frame of the load in the end.
        errors: (n, 2) how far (m, rad) each object ends from its place at the goal that is nearest.
    """

    pushes: tuple[PushReport, ...]
    clear: float
    loads: FloatArray
    errors: FloatArray

    @property
    def kept(self) -> bool:
        """Whether everything went as planned: nothing was touched on the way, and every push kept its contacts."""
        return self.clear > 0.0 and all(push.kept for push in self.pushes)

    def reached(self, position: float, angle: float) -> bool:
        """Tell whether nothing was touched on the way and every object ends so near to its place, m and rad."""
        return self.clear > 0.0 and bool((self.errors <= [position, angle]).all())


def execute_in_physics(
    scenario: Scenario,
    segments: tuple[Segment, ...],
    trajectory: Trajectory,
    modes: tuple[Mode, ...],
    *,
    placed: FloatArray | None = None,
    progress: Callable[[float], None] | None = None,
) -> SeveralReport:
    """Execute the segments of a plan in MuJoCo.

    Args:
        scenario: What was asked; objects with known loads.
        segments: With their times.
        trajectory: Of the robot's frame through all of them.
        modes: The contacts.
        placed: (n, 3) how the objects stand off their places at first, in the load's frame; None for not at all.
        progress: Called with the share of the trajectory that is done.

    Raises:
        MissingEngineError: When the engine is not installed.
        PhysicsError: When the simulation does not stay finite.
        SupportError: When a load is not known.
    """
    count = len(scenario.chain.objects)
    loads = np.tile(scenario.start, (count, 1))
    if placed is not None:
        loads = se2.compose(loads, placed)
    reports, clear = [], np.inf
    for k, segment in enumerate(segments):
        if segment.kind == TRANSIT:
            clear = min(clear, _clearance(scenario, segment, loads))
        if segment.pushes:
            report, loads = _push(segments[k - 1 : k + 2], trajectory, mode_of(segment, modes), loads)
            reports.append(report)
        if progress is not None:
            progress(segment.t1 / trajectory.duration)
    goal = reached_goal(scenario, loads[0]).pose_chain
    errors = [_error(scenario, k, load, goal) for k, load in enumerate(loads)]
    return SeveralReport(tuple(reports), clear, loads, np.array(errors))


def _push(
    around: tuple[Segment, ...], trajectory: Trajectory, mode: Mode, loads: FloatArray
) -> tuple[PushReport, FloatArray]:
    """Return what approach, push and retreat come to, and where the objects (n, 3) are afterwards."""
    approach, push, retreat = around
    settings = replace(HARD, samples=int(np.ceil(LOOKS * (retreat.t1 - approach.t0))) + 1)
    steps = int(np.ceil((retreat.t1 - approach.t0) / settings.time_step))
    t = np.linspace(approach.t0, retreat.t1, steps + 1)
    poses = se2.compose(trajectory.poses_at(t), se2.inverse(push.robot))
    poses[:, 2] = np.unwrap(poses[:, 2])
    order = list(mode.order)
    contact = se2.compose(loads[order], mode.place.contact)
    motion = Motion(float(t[1] - t[0]), se2.relative(poses[0], poses))
    chain = mode.scenario.chain
    recording = drive(chain, motion, settings, se2.relative(poses[0], contact))
    at = t[recording.steps]
    way = np.hypot(*(poses[:, :2] - push.path.start[:2]).T)
    settled = t[np.flatnonzero((t >= push.t0) & (way >= SETTLED * push.path.lengths[0]))[0]]
    ends = np.searchsorted(at, [approach.t1, settled, push.t1])
    moved = np.empty_like(loads)
    moved[order] = se2.compose(
        se2.compose(poses[0], recording.motions[-1, :-1]), se2.inverse(mode.place.contact)
    )
    return _report(push, mode, recording, ends), moved


def _report(push: Segment, mode: Mode, recording: Recording, ends: IntArray) -> PushReport:
    chain, motions = mode.scenario.chain, recording.motions
    begin, settled, last = (int(min(end, len(motions) - 1)) for end in ends)
    gap = contact_motion(chain, motions[settled][None], None)[1].max()
    slide, opening, _ = contact_motion(chain, motions[settled : last + 1])
    return PushReport(
        push.face,
        _farthest(mode, motions[0], motions[begin]),
        float(gap),
        float(max(np.abs(slide).max(), opening.max())),
        _farthest(mode, motions[last], motions[-1]),
        HARD.tolerance * min(contact.length for contact in chain.contacts),
    )


def _farthest(mode: Mode, before: FloatArray, after: FloatArray) -> float:
    """Return the farthest way of any corner of any object between two looks (n + 1, 3), m."""
    ways = [
        np.linalg.norm(
            se2.transform_points(b, obj.outline_chain) - se2.transform_points(a, obj.outline_chain), axis=1
        )
        for obj, b, a in zip(mode.scenario.chain.objects, before[:-1], after[:-1], strict=True)
    ]
    return float(np.concatenate(ways).max())


def _clearance(scenario: Scenario, segment: Segment, loads: FloatArray) -> float:
    """Return the least distance (m) of the robot from the objects where they are while it drives alone."""
    objects = shapely.union_all(
        [
            shapely.Polygon(se2.transform_points(load, obj.outline_chain))
            for load, obj in zip(loads, scenario.chain.objects, strict=True)
        ]
    )
    ways = segment.path.sampled(NEAR)
    robots = [
        shapely.Polygon(se2.transform_points(pose, body.outline))
        for pose in densify(ways, scenario.chain.reach, NEAR)
        for body in scenario.chain.carried
    ]
    return float(shapely.distance(robots, objects).min())


def _error(scenario: Scenario, k: int, load: FloatArray, goal: FloatArray) -> tuple[float, float]:
    inner = scenario.chain.objects[k].pose_chain
    return se2.pose_error(se2.compose(load, inner), se2.compose(goal, inner))
