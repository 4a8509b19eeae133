"""The errands of one log as one run, to be shown: what they move stands apart in one chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pushplan.geometry import se2
from pushplan.logging.old.errands import delivers, errand_of
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.view.scene import obstacle_outline
from pushplan.mechanics.chain import PLATE, Chain, Contact, PushedObject
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult
from pushplan.plans.segment import Segment, join_paths, join_trajectories, trajectory_of
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Obstacle, Scenario
from pushplan.several.execution import NOTHING_TO_LOSE
from pushplan.util.arrays import FloatArray


def joined(runs: Sequence[RecordedRun]) -> RecordedRun:
    """Return errands, each planned and executed, as one run, to be shown.

    Its chain is no push problem: what different errands move has nothing to do with one another. Margins are 1 where
    nothing is pushed.
    """
    together = _Errands(tuple(runs))
    execution = together.execution
    lines = [
        replace(line, time=line.time + begin)
        for run, begin in zip(runs, together.begins, strict=True)
        for line in run.lines
    ]
    return replace(
        runs[0],
        scenario=together.scenario,
        plan=replace(together.plan, execution=execution),
        execution=execution,
        lines=tuple(lines),
        losses=tuple(loss for run in runs for loss in run.losses),
        progress=(),
    )


@dataclass(frozen=True, eq=False)
class _Errands:
    """Errands that follow one another.

    Attributes:
        runs: In their order.
    """

    runs: tuple[RecordedRun, ...]

    @cached_property
    def firsts(self) -> dict[str, RecordedRun]:
        """The first errand of everything that is moved, by name."""
        found: dict[str, RecordedRun] = {}
        for run in self.runs:
            found.setdefault(errand_of(run), run)
        return found

    @cached_property
    def columns(self) -> dict[str, slice]:
        """Where the objects of each name are among all."""
        ends = np.cumsum([0, *(len(run.scenario.chain.objects) for run in self.firsts.values())]).tolist()
        return {name: slice(a, b) for name, a, b in zip(self.firsts, ends, ends[1:], strict=False)}

    @cached_property
    def shifts(self) -> dict[str, FloatArray]:
        """(3,) pose of each name's chain frame in that of the first errand, at first."""
        start = self.runs[0].scenario.start
        return {name: se2.relative(start, run.scenario.start) for name, run in self.firsts.items()}

    @cached_property
    def chain(self) -> Chain:
        """Everything that is moved, where it is at first."""
        objects: list[PushedObject] = []
        contacts: list[Contact] = []
        for name, run in self.firsts.items():
            own, shift, before = run.scenario.chain, self.shifts[name], len(objects)
            contacts += [_moved(contact, shift, before) for contact in own.contacts]
            objects += [replace(obj, pose_chain=se2.compose(shift, obj.pose_chain)) for obj in own.objects]
        return Chain(tuple(objects), tuple(contacts), self.runs[0].scenario.chain.pusher)

    @cached_property
    def scenario(self) -> Scenario:
        """The room with everything in it that is moved; goals are those of the errands that lead to one."""
        first = self.runs[0].scenario
        shapes = [{_shape(one) for one in run.scenario.obstacles} for run in self.runs]
        standing = tuple(one for one in first.obstacles if all(_shape(one) in each for each in shapes))
        goals = [
            replace(
                goal, pose_chain=self._fixed_to(errand_of(run), goal.pose_chain), objects=self._names(run)
            )
            for run in self.runs
            if run.scenario.pushes is not None and delivers(run)
            for goal in run.scenario.pushes.goals
        ]
        assert first.pushes is not None
        pushes = replace(first.pushes, goals=tuple(goals))
        return replace(first, chain=self.chain, obstacles=standing, pushes=pushes)

    @cached_property
    def plan(self) -> PlanResult:
        """All segments, one after the other."""
        plans = [run.plan for run in self.runs if run.plan is not None]
        segments, trajectory = self._timed
        margins = [plan.min_margin for plan in plans if plan.min_margin is not None]
        return replace(
            plans[0],
            segments=segments,
            trajectory=replace(trajectory, base=self.runs[0].scenario.chain.pusher.base_pose),
            path=join_paths(segments),
            objective_cost=sum(plan.objective_cost or 0.0 for plan in plans),
            min_margin=min(margins, default=None),
            robustness=None,
        )

    @property
    def begins(self) -> list[float]:
        """When each errand begins, s."""
        counts = [0 if run.plan is None else len(run.plan.segments) for run in self.runs]
        segments, _ = self._timed
        return [segments[k].t0 for k in np.cumsum([0, *counts[:-1]])]

    @cached_property
    def _timed(self) -> tuple[tuple[Segment, ...], Trajectory]:
        segments, trajectories = [], []
        for run in self.runs:
            plan, beside = run.plan, self._robot(run)
            assert plan is not None
            assert plan.trajectory is not None
            for one in plan.segments:
                trajectories.append(trajectory_of(one, plan.trajectory))
                loads = (self._fixed_to(errand_of(run), pose) for pose in (one.load_before, one.load_after))
                before, after = loads
                robot = se2.compose(one.robot, beside)
                names = self._names(run)
                segments.append(
                    replace(one, robot=robot, load_before=before, load_after=after, objects=names)
                )
        return join_trajectories(tuple(segments), trajectories)

    @cached_property
    def execution(self) -> Execution:
        """All samples, one errand after the other."""
        parts = [self._part(run, begin) for run, begin in zip(self.runs, self.begins, strict=True)]
        count = sum(len(part.t) for part in parts)
        objects = self.chain.objects
        places = np.array([se2.compose(self.runs[0].scenario.start, obj.pose_chain) for obj in objects])
        object_poses = np.empty((count, len(objects), 3))
        at = 0
        for run, part in zip(self.runs, parts, strict=True):
            these = slice(at, at + len(part.t))
            own = run.scenario.chain.objects
            object_poses[these] = places
            for k, obj in enumerate(own, start=self.columns[errand_of(run)].start):
                object_poses[these, k] = se2.compose(part.load_poses, obj.pose_chain)
            places, at = object_poses[at + len(part.t) - 1], at + len(part.t)
        errors = [run.execution.goal_error for run in self.runs if run.execution is not None]
        losses = [part.loss for part in parts if part.loss is not None]
        return Execution(
            t=np.maximum.accumulate(np.concatenate([part.t for part in parts])),  # rounding: none goes back
            poses=np.concatenate([part.poses for part in parts]),
            twists=np.concatenate([part.twists for part in parts]),
            margins=np.concatenate([part.margins for part in parts]),
            friction_margins=None,
            lambdas=None,
            forces=None,
            loss=losses[0] if losses else None,
            goal_error=(max(error[0] for error in errors), max(error[1] for error in errors)),
            loads=np.broadcast_to(self.runs[0].scenario.start, (count, 3)),
            object_poses=object_poses,
        )

    def _part(self, run: RecordedRun, begin: float) -> Execution:
        """Return an errand's execution as part of the whole: the frame of the robot is that of the first errand."""
        own, beside = run.execution, self._robot(run)
        assert own is not None
        margins = np.full((len(own.t), len(self.chain.contacts)), NOTHING_TO_LOSE)
        margins[:, self.columns[errand_of(run)]] = own.margins
        loss = None
        if own.loss is not None:
            contact = own.loss.contact + self.columns[errand_of(run)].start
            loss = replace(own.loss, time=own.loss.time + begin, contact=contact)
        return replace(
            own,
            t=own.t + begin,
            poses=se2.compose(own.poses, beside),
            twists=se2.twist_of(beside, own.twists),
            margins=margins,
            loss=loss,
        )

    def _robot(self, run: RecordedRun) -> FloatArray:
        """Return (3,) pose of the joined chain's frame, fixed to the plate, in that of an errand: beside it by y."""
        pusher, first = run.scenario.chain.pusher, self.runs[0].scenario.chain.pusher
        return se2.compose(pusher.plate_pose, se2.inverse(first.plate_pose))

    def _names(self, run: RecordedRun) -> tuple[str, ...]:
        return tuple(obj.name for obj in run.scenario.chain.objects)

    def _fixed_to(self, name: str, pose: FloatArray) -> FloatArray:
        """Return where the joined chain's frame would be, were it fixed to the chain of a name at a pose (3,)."""
        return se2.compose(pose, se2.inverse(self.shifts[name]))


def _moved(contact: Contact, shift: FloatArray, before: int) -> Contact:
    """Return a contact in another frame, behind so many objects of others."""
    right, left = se2.transform_points(shift, contact.right), se2.transform_points(shift, contact.left)
    pusher = contact.pusher if contact.pusher == PLATE else contact.pusher + before
    return replace(contact, right=right, left=left, pushed=contact.pushed + before, pusher=pusher)


def _shape(obstacle: Obstacle) -> bytes:
    return obstacle_outline(obstacle).tobytes()
