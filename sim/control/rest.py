"""Transits to the next object from measured poses, and plans for the rest of a multi-push plan."""

from __future__ import annotations

import itertools
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, inverse, pose_error
from pushplan.planner import Planner
from pushplan.planners.multi.room import AHEAD, find_drive
from pushplan.planners.timing.blending import time_segments
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.run import Replan
from pushplan.plans.segment import Poses, Segment, end_of, standing_obstacles
from pushplan.plans.settings import Margin, Observer, PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.sim.control.replanner import OFTEN, planned_for_least
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, AUTO, FACES, TRANSIT

TIME_LIMIT = 20.0
"""Time limit of a plan for the rest, s; the search usually ends earlier, so runs are repeatable."""
BATCHES = 4
"""Largest number of batches of poses in the search of several pushes of one load."""
CAREFUL = 0.08
"""Margin of a plan for the rest. Replans during a push keep less and can turn more tightly, as corrections need. With
0.12, a plan for two boxes behind one another took twice the travel."""
SAME = 1e-4, 1e-4
"""Largest distance (m, rad) from the start of a planned transit at which it is kept."""
BERTH = 0.03
"""Preferred clearance of transits, m: a wheel error of 1.5 % gives this error after 2 m."""
Leg = tuple[int, Segment]
"""Index of a segment of the plan, and the segment to drive."""


def travel_of(segments: Iterable[Segment]) -> float:
    """Return the travel of the plate in some segments, m."""
    return sum(segment.path.travel for segment in segments)


def carried_by(load: Load, poses: Poses) -> FloatArray:
    """Return the pose (3,) of the load's contact frame at which its first object is flush with the plate."""
    obj = load.chain.objects[load.chain.first_pushed]
    return compose(poses[obj.name], inverse(obj.pose_chain))


def legs_to(
    plan: Plan,
    begin: int,
    plate: FloatArray,
    poses: Poses,
    obstacles: Sequence[Obstacle],
    near: tuple[float, float],
    rate: float,
) -> list[Leg]:
    """Return the legs of the plate to the load of the next push; empty if there is no transit.

    Args:
        plan: Executed plan.
        begin: Index of the next segment.
        plate: Pose of the plate frame, (3,).
        poses: Measured poses of all objects.
        obstacles: Obstacles in the room.
        near: Largest error (m, rad) of the load from its planned pose for which planned transits are kept.
        rate: Sample rate of trajectories, Hz.
    """
    scenario, segments = plan.scenario, plan.segments
    k = next(k for k in range(begin, len(segments)) if segments[k].pushes)
    load = segments[k].pushed_load
    contact = carried_by(load, poses)
    off, away = (pose_error(contact, segments[k].contact_path.start), pose_error(plate, segments[begin].path.start))
    as_planned = all(e <= m for e, m in zip((*off, *away), (*near, *SAME), strict=True))
    pushes = scenario.transport
    around = (*obstacles, *standing_obstacles(scenario, poses, load.names))
    problem = replace(
        load.problem.push_of(replace(load.problem.load, start=contact)),
        obstacles=around,
        workspace=scenario.workspace,
        clearance=scenario.clearance,
    )
    robot = compose(plate, load.frame_plate)
    wide = replace(problem, clearance=max(scenario.clearance, min(BERTH, 0.6 * pushes.approach)))
    arcs = find_drive(wide, contact, robot, pushes.approach, plan.seed)
    if arcs is None and as_planned:
        return [(i, segments[i]) for i in range(begin, k)]
    if arcs is None:
        arcs = find_drive(problem, contact, robot, pushes.approach, plan.seed)
    if arcs is None:
        return []
    ways = {
        TRANSIT: PushPath.of_arcs(robot, arcs),
        APPROACH: PushPath(compose(contact, [-pushes.approach, 0.0, 0.0]), AHEAD[None], np.array([pushes.approach])),
    }
    kinds = {TRANSIT: None, APPROACH: load}
    made = [
        Segment(kind, way.of_frame(load.chain.pusher.plate_pose), poses, poses, kinds[kind])
        for kind, way in ways.items()
        if len(way.lengths)
    ]
    last = [i for i in range(begin, k) if segments[i].kind == APPROACH]
    index = {TRANSIT: begin, APPROACH: last[-1] if last else begin}
    return [(index[one.kind], one) for one in time_segments(scenario, tuple(made), rate)]


def _planned(scenario: Scenario, settings: PlanSettings, first: bool) -> Plan:
    return Planner(scenario, settings=settings).plan(first=first, explain=False)


class RestPlanner:
    """Plans the rest of a task from measured poses.

    Args:
        scenario: Believed scenario.
        plan: First plan.
        tolerance: Largest distance (m) and angle (rad) of a delivered object from its goal.
        friction: Relative error of the friction coefficients.
        observer: Receiver of messages about slow steps.
        wary: Whether plans assume the least friction from the beginning, if possible, as the first plan does.
    """

    def __init__(
        self,
        scenario: Scenario,
        plan: Plan,
        tolerance: tuple[float, float],
        friction: float,
        observer: Observer,
        wary: bool = False,
    ) -> None:
        self._scenario, self._friction, self._observer = scenario, friction, observer
        self._wary = wary
        end = end_of(scenario, plan.segments)
        self._goals = tuple(goal.resumed(end, tolerance) for goal in scenario.task.goals)

    def plan(
        self,
        now: float,
        plate: FloatArray,
        poses: Poses,
        obstacles: tuple[Obstacle, ...],
        delivered: frozenset[str],
        seed: int,
        most: float,
        slips: Mapping[str, int],
        avoided: Collection[str] = (),
    ) -> Replan:
        """Return a plan for the rest, with a margin for corrections unless it then exceeds the largest travel.

        Args:
            now: Time of the record, s.
            plate: Pose of the plate frame, (3,).
            poses: Poses of all objects.
            obstacles: Obstacles in the room.
            delivered: Objects that stay at their poses.
            seed: Seed of the random numbers.
            most: Largest travel, m.
            slips: Number of slides of each object, by name, since the last plan. From `OFTEN` slides of one object
                on, this and all later plans assume the least friction, if possible.
            avoided: Faces that are not pushed if possible, because a push through them stalled.
        """
        began, reason, result = time.process_time(), "", None
        self._wary |= max(slips.values(), default=0) >= OFTEN
        levels = [(0.0, margin) for margin in self._margins]
        levels = [(self._friction, None), *levels] if self._wary else levels
        for faces, (friction, margin) in itertools.product(self._faces(avoided), levels):
            try:
                remaining = self._remaining(plate, poses, obstacles, delivered).with_task(faces=faces)
                several = not remaining.task.one_load
                settings = PlanSettings(
                    first=several,
                    time_limit=TIME_LIMIT,
                    iterations=None if several else BATCHES,
                    seed=seed,
                    margin=margin,
                    observer=self._observer,
                )
                make = partial(_planned, settings=settings, first=several)
                result = planned_for_least(remaining, friction, make)
                reason = result.reason
            except PushplanError as error:
                result, reason = None, str(error)
            if result is not None and result.solved and travel_of(result.segments) <= most:
                break
        return Replan(now, result, reason, time.process_time() - began, rest=True)

    def _faces(self, avoided: Collection[str]) -> list[tuple[str | float, ...] | None]:
        """Return the allowed faces for successive attempts."""
        stated = self._scenario.transport.faces
        rest = tuple(face for face in stated or FACES if face not in avoided)
        return [rest, stated] if avoided and rest else [stated]

    @property
    def _margins(self) -> tuple[Margin | None, ...]:
        """Margins for successive attempts; a row determines its own margins."""
        stated = self._scenario.stability.margin
        usual = 0.0 if stated == AUTO else float(stated)
        return (CAREFUL, None) if usual < CAREFUL and not self._scenario.task.flush else (None,)

    def _remaining(
        self, plate: FloatArray, poses: Poses, obstacles: tuple[Obstacle, ...], delivered: frozenset[str]
    ) -> Scenario:
        """Return the scenario with the current poses of plate and objects and the remaining goals."""
        loads = tuple(replace(load, start=load.start_for(poses[load.name])) for load in self._scenario.loads)
        by_name = {load.name: load for load in loads}
        goals = tuple(goal.remaining(by_name, delivered) for goal in self._goals)
        remaining = self._scenario.with_task(loads=loads, goals=goals, robot_start=plate)
        return replace(remaining, obstacles=obstacles)
