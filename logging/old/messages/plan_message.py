"""A plan as one protobuf message, every number bit for bit; `effort` keeps what it took."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from pushplan.logging.old.messages import schemas
from pushplan.logging.old.messages.effort import Effort
from pushplan.logging.old.messages.schemas import MessageClass, Plan
from pushplan.plans.path import PushPath
from pushplan.plans.result import Diagnosis, PlanResult, ProgressPoint
from pushplan.plans.robustness import Robustness
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray, frozen

_MOST_REASONS = 1000
"""Diagnoses of a plan, and numbers in one, at most: there are some ten."""

_MOST_SEGMENTS = 1000
"""Of a plan, at most: four for each of at most 100 pushes."""

_ROUNDING = 1e-6
"""Share by which the cost of an improvement may differ from its path's, whose arcs of no length are left out."""


def encode(plan: PlanResult) -> MessageClass:
    """Return the `Plan` message of `plan`, without a time stamp."""
    message = Plan(
        solved=plan.solved,
        reason=plan.reason,
        planner=plan.planner,
        stable_set=plan.stable_set,
        seed=plan.seed,
        min_margin=plan.min_margin,
        tree=plan.tree.ravel(),
        lower_bound=plan.lower_bound,
        diagnosis=[_diagnosis_message(found) for found in plan.diagnosis],
        approximate_error=plan.approximate_error or (),
        objective=plan.objective,
        margin_asked=plan.margin_asked,
        margin=plan.margin,
        segments=[segment_message(segment) for segment in plan.segments],
        objective_cost=plan.objective_cost,
    )
    for field, path in (("path", plan.path), ("approximate_path", plan.approximate_path)):
        if path is not None:
            _fill(getattr(message, field), path)
    if plan.robustness is not None:
        message.robustness.SetInParent()
        for name, value in vars(plan.robustness).items():
            if value is not None:
                setattr(message.robustness, name, value)
    if plan.trajectory is not None:
        for name in ("start", "breaks", "coefficients", "arc"):
            getattr(message.trajectory, name).extend(getattr(plan.trajectory, name).ravel())
        if plan.trajectory.base.any():  # older logs do not say it, and mean the chain frame
            message.trajectory.base.extend(plan.trajectory.base)
        message.trajectory.rate = plan.trajectory.rate
    return message


def encode_costs(progress: Sequence[ProgressPoint]) -> MessageClass:
    """Return the `Costs` message of all improvements, without a time stamp."""
    return schemas.Costs(
        iterations=[point.iterations for point in progress], cost=[point.cost for point in progress]
    )


def encode_progress(point: ProgressPoint) -> MessageClass:
    """Return the `Progress` message of an improvement, without a time stamp."""
    message = schemas.Progress(iterations=point.iterations, cost=point.cost)
    if point.path is not None:
        _fill(message.path, point.path)
    return message


def decode_progress(message: MessageClass) -> ProgressPoint:
    """Return the improvement that `message` holds; its wall-clock time, which it does not hold, is NaN.

    Raises:
        ValueError: When the numbers do not make a path of that cost.
        PushplanError: Likewise.
    """
    path = _path(message.path) if message.HasField("path") else None
    if path is not None and abs(path.cost - message.cost) > _ROUNDING * max(1.0, path.cost):
        raise ValueError(f"a path of {path.cost:g} m is said to cost {message.cost:g} m")
    return ProgressPoint(math.nan, message.cost, message.iterations, path)


def _fill(message: MessageClass, path: PushPath) -> None:
    for name in ("start", "twists", "lengths"):
        getattr(message, name).extend(getattr(path, name).ravel())


def decode(message: MessageClass, effort: Effort, progress: Sequence[ProgressPoint]) -> PlanResult:
    """Return the plan that `message` holds.

    Args:
        message: A `Plan` message.
        effort: What it took.
        progress: The improvements, as many as `effort.progress_s`.

    Raises:
        ValueError: When the numbers do not make a plan.
        PushplanError: Likewise.
    """
    if len(message.diagnosis) > _MOST_REASONS or any(
        len(found.numbers) > _MOST_REASONS for found in message.diagnosis
    ):
        raise ValueError(f"more than {_MOST_REASONS} reasons, or numbers of one")
    if len(message.segments) > _MOST_SEGMENTS:
        raise ValueError(f"more than {_MOST_SEGMENTS} segments")
    if len(progress) != len(effort.progress_s):
        raise ValueError(f"{len(effort.progress_s)} times for {len(progress)} improvements")
    points = zip(effort.progress_s, progress, strict=True)
    path = _path(message.path) if message.HasField("path") else None
    found = [point.path.start for point in progress if point.path is not None]
    if path is not None and any((start != path.start).any() for start in found):
        raise ValueError("a path that was found begins elsewhere than the plan's")
    return PlanResult(
        solved=message.solved,
        reason=message.reason,
        planner=message.planner,
        stable_set=message.stable_set,
        seed=message.seed,
        path=path,
        trajectory=_trajectory(message.trajectory) if message.HasField("trajectory") else None,
        first_solution_s=effort.first_solution_s,
        planning_s=effort.planning_s,
        progress=tuple(replace(point, seconds=seconds) for seconds, point in points),
        extensions=effort.extensions,
        min_margin=_optional(message, "min_margin"),
        tree=frozen(_array(message.tree, (-1, 2, 3)), (None, 2, 3), "tree"),
        lower_bound=_optional(message, "lower_bound"),
        diagnosis=tuple(map(_diagnosis, message.diagnosis)),
        approximate_path=_path(message.approximate_path) if message.HasField("approximate_path") else None,
        approximate_error=_pair(message.approximate_error),
        objective=message.objective,
        margin_asked=_optional(message, "margin_asked"),
        margin=_optional(message, "margin"),
        robustness=_robustness(message.robustness) if message.HasField("robustness") else None,
        segments=tuple(map(_segment, message.segments)),
        objective_cost=_optional(message, "objective_cost"),
    )


def segment_message(segment: Segment) -> MessageClass:
    """Return the `Segment` message of a segment, without a time stamp."""
    message = schemas.Segment(
        kind=segment.kind,
        face=segment.face,
        offset=segment.offset,
        robot=segment.robot,
        load_before=segment.load_before,
        load_after=segment.load_after,
        margin=segment.margin,
        t0=segment.t0,
        t1=segment.t1,
    )
    _fill(message.path, segment.path)
    return message


def _segment(message: MessageClass) -> Segment:
    return Segment(
        kind=message.kind,
        face=message.face,
        offset=message.offset,
        path=_path(message.path),
        robot=_array(message.robot),
        load_before=_array(message.load_before),
        load_after=_array(message.load_after),
        margin=message.margin,
        t0=message.t0,
        t1=message.t1,
    )


def _diagnosis_message(diagnosis: Diagnosis) -> MessageClass:
    numbers = [{"name": name, "value": value} for name, value in diagnosis.numbers.items()]
    return schemas.Diagnosis(
        cause=diagnosis.cause, text=diagnosis.text, proven=diagnosis.proven, numbers=numbers
    )


def _diagnosis(message: MessageClass) -> Diagnosis:
    numbers = {number.name: number.value for number in message.numbers}
    return Diagnosis(message.cause, message.text, message.proven, numbers)


def _pair(values: Sequence[float]) -> tuple[float, float] | None:
    if not values:
        return None
    first, second = values
    return first, second


def _optional(message: MessageClass, field: str) -> float | None:
    return getattr(message, field) if message.HasField(field) else None


def _robustness(message: MessageClass) -> Robustness:
    names = [field.name for field in fields(Robustness)]
    return Robustness(**{name: getattr(message, name) if message.HasField(name) else None for name in names})


def _path(message: MessageClass) -> PushPath:
    return PushPath(_array(message.start), _array(message.twists, (-1, 3)), _array(message.lengths))


def _trajectory(message: MessageClass) -> Trajectory:
    return Trajectory(
        start=_array(message.start),
        breaks=_array(message.breaks),
        coefficients=_array(message.coefficients, (-1, 3, 3)),
        arc=_array(message.arc),
        rate=message.rate,
        base=_array(message.base) if message.base else np.zeros(3),
    )


def _array(values: Sequence[float], shape: tuple[int, ...] = (-1,)) -> FloatArray:
    row = math.prod(shape[1:])
    if len(values) % row:
        raise ValueError(f"{len(values)} numbers do not fill rows of {row}")
    return np.array(values, dtype=np.float64).reshape(shape)
