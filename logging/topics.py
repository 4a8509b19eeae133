"""Messages of a log for viewers, generated from the run in its attachments.

Viewers get a selection of the samples (`shown.viewed`). The full rate of an execution would make the file several
times larger without a visible gain. Nothing here depends on the clock: the same run gives the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from heapq import merge
from operator import itemgetter
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

import pushplan.logging.schemas as schemas
from pushplan.drawing.scene import PATH_SPACING, smallest
from pushplan.logging.recorded import LogLine, RecordedRun
from pushplan.logging.scene import NANO, contact_messages, frame_messages, nearest, placed, scene, tree
from pushplan.logging.schemas import MessageClass, Topic
from pushplan.logging.shown import WORLD, LoadContacts, contact_names, pushed_at_samples, smoothed_times, viewed
from pushplan.logging.signals import Signal, series_of
from pushplan.plans.execution import Execution, inertia_warning
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan
from pushplan.plans.run import WARNINGS, Feedback, segments_of
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, IntArray

Sent = tuple[int, Topic, bytes]
"""Log time, ns, topic, and serialised message."""


def messages(run: RecordedRun) -> Iterator[Sent]:
    """Yield all messages of a run in order of time; messages of the same time have the order of the parts below."""
    parts = _Messages(run)
    return merge(
        parts.beginning(),
        parts.planning(),
        parts.segments(),
        parts.measured(),
        parts.samples(),
        parts.events(),
        parts.end(),
        parts.lines(),
        key=itemgetter(0),
    )


class _Messages:
    """Messages of a run in several parts, each in order of time."""

    def __init__(self, run: RecordedRun) -> None:
        self._run, self._count = run, len(run.scenario.poses)
        execution = run.execution
        self._execution = execution if execution is not None and len(execution.t) else None

    def _sent(self, topic: Topic, time: float, message: MessageClass) -> Sent:
        """Return a message for a simulated time, s; its field `timestamp`, if any, is set to that time."""
        instant = round(NANO * time)
        if "timestamp" in message.DESCRIPTOR.fields_by_name:
            message.timestamp.FromNanoseconds(instant)
        return instant, topic, message.SerializeToString(deterministic=True)

    def beginning(self) -> Iterator[Sent]:
        """Yield the scene and the initial poses."""
        scenario, now = self._run.scenario, np.zeros(1, dtype=np.int64)
        if self._run.plan is not None and self._run.plan.segments:  # the plan decides the places of a row
            scenario = scenario.settled(self._run.plan.segments[-1].after)
        yield self._sent(schemas.SCENE, 0.0, scene(scenario))
        objects = np.stack(list(scenario.poses.values()))[None]
        for data in frame_messages(scenario, scenario.plate_start[None], objects, now):
            yield 0, schemas.TF, data
        if scenario.task.held:
            shapes = LoadContacts(scenario).at(Load.of(scenario))
            for data in contact_messages(shapes, self._count, now):
                yield 0, schemas.CONTACTS, data

    def planning(self) -> Iterator[Sent]:
        """Yield the results of planning."""
        run, plan = self._run, self._run.plan
        for point in run.improvements:
            message = schemas.Progress(iterations=point.iterations, cost=point.cost)
            yield self._sent(schemas.PROGRESS, 0.0, message)
        if plan is None:
            return
        iterations, costs = ([getattr(one, key) for one in run.improvements] for key in ("iterations", "cost"))
        yield self._sent(schemas.COSTS, 0.0, schemas.Costs(iterations=iterations, cost=costs))
        yield self._sent(schemas.PLAN, 0.0, _plan(plan))
        yield self._sent(schemas.PLAN_TREE, 0.0, tree(plan.tree))
        yield self._sent(schemas.PLAN_NEAREST, 0.0, nearest(run.scenario, plan))
        yield from self._paths(plan, 0.0)

    def _paths(self, plan: Plan, time: float) -> Iterator[Sent]:
        if plan.segments:
            poses = [segment.path.sampled(PATH_SPACING) for segment in plan.segments]
            yield self._sent(schemas.PLAN_PATH, time, poses_in_world(np.concatenate(poses)))
        if plan.trajectory is not None:
            smoothed = plan.trajectory.poses_at(smoothed_times(plan.trajectory))
            yield self._sent(schemas.PLAN_SMOOTHED, time, poses_in_world(smoothed))

    def segments(self) -> Iterator[Sent]:
        """Yield the executed segments, each at its beginning."""
        plan, execution = self._run.plan, self._execution
        if plan is None or execution is None:
            return
        begun = list(zip(plan.segments, plan.times.tolist(), plan.times[1:].tolist(), strict=False))
        if self._run.feedback is not None:
            every = segments_of(plan, self._run.feedback)
            changes = np.flatnonzero(np.diff(execution.segment, prepend=-1))
            ends = execution.t[np.append(changes[1:], len(execution.t) - 1)].tolist()
            owners = execution.segment[changes].tolist()
            begun = [(every[k], t, e) for k, t, e in zip(owners, execution.t[changes].tolist(), ends, strict=True)]
        for segment, begin, end in begun:
            if begin <= execution.t[-1]:
                load = segment.load
                message = schemas.Segment(
                    kind=segment.kind,
                    objects=() if load is None else load.names,
                    face="" if load is None else load.face,
                    offset=0.0 if load is None else load.offset,
                    cost=segment.cost,
                    margin=segment.margin,
                    t0=begin,
                    t1=end,
                )
                yield self._sent(schemas.SEGMENT, begin, message)

    def measured(self) -> Iterator[Sent]:
        """Yield the measurements of a closed loop."""
        feedback = self._run.feedback
        if feedback is not None:
            for time, poses in zip(feedback.measured.t.tolist(), feedback.measured.poses, strict=True):
                yield self._sent(schemas.MEASURED, time, poses_in_world(poses))

    def samples(self) -> Iterator[Sent]:
        """Yield the selected samples of the execution."""
        scenario, execution = self._run.scenario, self._execution
        if execution is None:
            return
        shown = viewed(execution)
        instants = np.rint(execution.t[shown] * NANO).astype(np.int64)
        plates, objects = execution.poses[shown], execution.objects[shown]
        parts: dict[Topic, Iterable[bytes]] = {
            schemas.TF: frame_messages(scenario, plates, objects, instants),
            schemas.CONTACTS: self._contacts(execution, shown, instants),
        }
        for signal, values in series_of(execution):
            if signal.frame:
                parts[schemas.signal_topic(signal)] = _series_messages(signal, values[shown], instants)
        parts[schemas.MARGINS] = _margin_messages(contact_names(scenario), execution, shown, instants)
        for instant, *data in zip(instants.tolist(), *parts.values(), strict=True):
            for topic, one in zip(parts, data, strict=True):
                yield instant, topic, one

    def _contacts(self, execution: Execution, shown: IntArray, instants: IntArray) -> Iterator[bytes]:
        """Yield the pushed contacts, segment by segment."""
        drawn = LoadContacts(self._run.scenario, execution)
        for load, part in pushed_at_samples(self._run, shown):
            shapes = [] if load is None else drawn.at(load, shown[part])
            yield from contact_messages(shapes, self._count, instants[part])

    def events(self) -> Iterator[Sent]:
        """Yield events and replans of a closed loop; an event precedes a replan of the same time."""
        feedback = self._run.feedback
        if feedback is None:
            return
        happened = [(event.time, 0, k) for k, event in enumerate(feedback.events)]
        happened += [(replan.time, 1, k) for k, replan in enumerate(feedback.replans)]
        for time, kind, k in sorted(happened):
            if kind == 0:
                event = feedback.events[k]
                level: Any = schemas.LEVELS.index("info") + 1
                line = Log(level=level, name=event.kind, message=event.text)
                yield self._sent(schemas.EVENTS, time, line)
                continue
            replan = feedback.replans[k]
            plan = replan.result
            message = schemas.Plan(solved=False, reason=replan.reason) if plan is None else _plan(plan)
            yield self._sent(schemas.REPLANS, time, message)
            if plan is not None:
                yield from self._paths(plan, time)

    def end(self) -> Iterator[Sent]:
        """Yield the result of the execution, unless its record is incomplete."""
        execution = self._execution
        if execution is None or math.isnan(execution.goal_error[0]):
            return
        position, angle = execution.goal_error
        message = schemas.ExecutionEnd(samples=len(execution.t), goal_position_error=position, goal_angle_error=angle)
        if execution.loss is not None:
            loss = execution.loss
            message.loss.time, message.loss.contact, message.loss.margin = (loss.time, loss.contact, loss.margin)
            message.loss.pose.extend(loss.pose)
        yield self._sent(schemas.EXECUTION_END, float(execution.t[-1]), message)

    def lines(self) -> Iterator[Sent]:
        """Yield the lines of /log."""
        for line in self._run.lines:
            level: Any = schemas.LEVELS.index(line.level) + 1
            yield self._sent(schemas.LOG, line.time, Log(level=level, message=line.text, name="pushplan"))


def _plan(plan: Plan) -> MessageClass:
    names = ("solved", "reason", "planner", "stable_set", "seed", "cost", "lower_bound", "duration")
    least = min((s.min_margin for s in plan.pushes if s.min_margin is not None), default=None)
    fields = {name: getattr(plan, name) for name in (*names, "margin_asked", "margin")}
    return schemas.Plan(**fields, min_margin=least)


def poses_in_world(poses: FloatArray) -> PosesInFrame:
    """Return poses (k, 3) in the world as a message without a time stamp."""
    made = [
        Pose(position=Vector3(x=x, y=y), orientation=Quaternion(z=z, w=w)) for x, y, z, w in placed(poses).tolist()
    ]
    return PosesInFrame(timestamp=Timestamp(), frame_id=WORLD, poses=made)


def _series_messages(signal: Signal, values: FloatArray, instants: IntArray) -> Iterator[bytes]:
    """Yield the messages of a series (m, ...) of the plate for instants (m,), ns."""
    message = schemas.signal_topic(signal).message(frame_id=signal.frame)
    for instant, row in zip(instants.tolist(), values.reshape(len(values), -1).tolist(), strict=True):
        for name, value in zip(signal.columns, row, strict=True):
            setattr(message, name, value)
        message.timestamp.seconds, message.timestamp.nanos = divmod(instant, NANO)
        yield message.SerializeToString(deterministic=True)


def _margin_messages(
    names: Sequence[str], execution: Execution, samples: IntArray, instants: IntArray
) -> Iterator[bytes]:
    """Yield the state of all contacts: margins and, if known, the forces and their points of application."""
    message = schemas.Margins(contacts=[{"name": name} for name in names])
    entries = list(message.contacts)
    known = [(one, values) for one, values in series_of(execution) if one.topic == schemas.MARGINS.name]
    numbers, pairs = ([(s.field, v[samples].tolist()) for s, v in known if len(s.columns) == k] for k in (1, 2))
    least = smallest(execution.margins)[samples].tolist()
    for i, instant in enumerate(instants.tolist()):
        message.smallest = least[i]
        for field, rows in numbers:
            for entry, value in zip(entries, rows[i], strict=True):
                setattr(entry, field, value)
        for field, rows in pairs:
            for entry, (x, y) in zip(entries, rows[i], strict=True):
                pair = getattr(entry, field)
                pair.x, pair.y = x, y
        message.timestamp.seconds, message.timestamp.nanos = divmod(instant, NANO)
        yield message.SerializeToString(deterministic=True)


def lines_of(
    scenario: Scenario,
    plan: Plan | None,
    execution: Execution | None,
    feedback: Feedback | None,
    others: Sequence[LogLine],
) -> tuple[LogLine, ...]:
    """Return the lines of /log in order of time: those that follow from a run, and `others`."""
    lines = list(others)
    if plan is not None:
        lines.append(LogLine(0.0, "info" if plan.solved else "warning", plan_sentence(plan)))
    for event in () if feedback is None else feedback.events:
        level = "warning" if event.kind in WARNINGS else "info"
        lines.append(LogLine(event.time, level, f"{event.kind}: {event.text}"))
    if execution is not None and len(execution.t):
        end = float(execution.t[-1])
        level = "info" if execution.loss is None else "warning"
        lines.append(LogLine(end, level, execution_sentence(scenario, execution)))
        warning = inertia_warning(scenario, execution) if feedback is None else ""
        lines += [LogLine(end, "warning", warning)] if warning else []
    return tuple(sorted(lines, key=lambda line: line.time))


def plan_sentence(plan: Plan) -> str:
    """Return the outcome of planning as a sentence."""
    who = f"{plan.planner} within the stable set {plan.stable_set}, seed {plan.seed}"
    if not plan.segments:
        return f"{who}: no plan: {'; '.join(plan.why_not)}"
    took = "" if plan.duration is None else f", {plan.duration:.2f} s"
    notes = "".join(f"; {note}" for note in plan.notes)
    if plan.path is None:
        count, travel = len(plan.pushes), sum(segment.path.cost for segment in plan.segments)
        driven = f"{plan.pushed_distance:.4f} m pushed of {travel:.4f} m driven"
        return f"{who}: {count} push{'es' if count > 1 else ''}, {driven}{took}{notes}"
    return f"{who}: a path of {len(plan.path.lengths)} arcs, path cost {plan.path.cost:.4f} m{took}{notes}"


def execution_sentence(scenario: Scenario, execution: Execution) -> str:
    """Return the outcome of an execution as a sentence."""
    if execution.loss is not None:
        loss = execution.loss
        return f"contact {loss.contact} is lost at {loss.time:.3f} s (margin {loss.margin:.3g})"
    position, angle = execution.goal_error
    if math.isnan(position):
        return f"the record of the execution ends early, after {len(execution.t)} samples"
    missed = f"executed; the goal is missed by {1e3 * position:.3g} mm and {math.degrees(angle):.3g} deg"
    force = execution.force_words(scenario.pusher.limits.force)
    return f"{missed}; the plate {force}" if force else missed
