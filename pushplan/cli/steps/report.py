"""The numbers of a run: a table for people, a JSON object for programs."""

from __future__ import annotations

from dataclasses import asdict
from math import degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, MISMATCH, NO_PLAN
from pushplan.cli.terminal.numbers import angle_text, counted, length_text, plain, time_text
from pushplan.mechanics.chain import Chain
from pushplan.plans.execution import inertia_warning

if TYPE_CHECKING:
    from pushplan.plans.execution import Execution, StabilityLoss
    from pushplan.plans.path import PushPath
    from pushplan.plans.result import PlanResult
    from pushplan.plans.segment import Segment
    from pushplan.scenario.model import Scenario
    from pushplan.util.arrays import FloatArray


def exit_code(plan: PlanResult, execution: Execution | None) -> int:
    """Return the exit code: solved and executed as planned, no plan, or a contact lost on the way."""
    if not plan.solved:
        return NO_PLAN
    return MISMATCH if execution and execution.loss else DONE


def document(
    scenario: Scenario, plan: PlanResult, execution: Execution | None, log: Path | None
) -> dict[str, object]:
    """Return the JSON object of a run."""
    return {
        "scenario": scenario.name,
        "solved": plan.solved,
        "reason": plan.reason,
        "planner": plan.planner,
        "objective": plan.objective,
        "set": plan.stable_set,
        "seed": plan.seed,
        "first_solution_s": plan.first_solution_s,
        "planning_s": plan.planning_s,
        "extensions": plan.extensions,
        "path_cost": plan.path.cost if plan.path else None,
        "lower_bound": plan.lower_bound,
        "gap": plan.gap,
        "diagnosis": [vars(found) for found in plan.diagnosis],
        "nearest": _nearest(plan),
        "arcs": _arcs(plan.path) if plan.path else [],
        "duration_s": plan.trajectory.duration if plan.trajectory else None,
        "goal_error": _goal_error(execution) if execution else None,
        "min_margin": execution.min_margin if execution else plan.min_margin,
        "min_dynamic_margin": execution.min_dynamic_margin if execution else None,
        "margin_asked": plan.margin_asked,
        "margin": plan.margin,
        "robustness": asdict(plan.robustness) if plan.robustness else None,
        "contact_lost": _loss(execution.loss) if execution and execution.loss else None,
        "segments": [_segment(segment) for segment in plan.segments],
        **_of_several(plan),
        "log": log,
    }


def _of_several(plan: PlanResult) -> dict[str, object]:
    """What only a plan of several pushes has."""
    if not plan.segments:
        return {}
    return {"way_pushed": plan.way_pushed, "objective_cost": plan.objective_cost}


def _segment(segment: Segment) -> dict[str, object]:
    robot = segment.robot_path
    return {
        "kind": segment.kind,
        "face": segment.face or None,
        "offset": segment.offset,
        "arcs": _arcs(segment.path),
        "robot_before": robot.start,
        "robot_after": robot.end,
        "object_before": segment.load_before,
        "object_after": segment.load_after,
        "t0": segment.t0,
        "t1": segment.t1,
    }


def segment_rows(plan: PlanResult) -> list[tuple[str, str]]:
    """Return a line for each segment: when, how far, and from where to where what moves."""
    return [
        (f"{k}. {segment.kind}", _segment_text(segment)) for k, segment in enumerate(plan.segments, start=1)
    ]


def _segment_text(segment: Segment) -> str:
    when = f"{segment.t0:7.2f} - {segment.t1:6.2f} s  {segment.path.cost:6.3f} m"
    side = f"  {segment.face}" if segment.face else ""
    if segment.offset:
        side += f" {1e3 * segment.offset:+.3g} mm"
    if not segment.pushes:
        return f"{when}{side}"
    before, after = (_pose_text(pose) for pose in (segment.load_before, segment.load_after))
    return f"{when}{side}  chain frame {before} -> {after}"


def _pose_text(pose: FloatArray) -> str:
    x, y, theta = plain(round(pose[0], 3)), plain(round(pose[1], 3)), plain(round(degrees(pose[2]), 1))
    return f"({x:.3f}, {y:.3f}, {theta:.1f} deg)"


def rows(
    scenario: Scenario, plan: PlanResult, execution: Execution | None, log: Path | None
) -> list[tuple[str, str]]:
    """Return label and value of the numbers of a run."""
    found = [] if plan.solved else [("reason", plan.reason)]
    if plan.approximate_path and plan.approximate_error:
        position, angle = plan.approximate_error
        off = f"ends {position:.3g} m and {degrees(angle):.3g} deg from the goal"
        found.append(("nearest path", f"{plan.approximate_path.cost:.3f} m long, {off}"))
    if plan.segments and plan.trajectory:
        found += segment_rows(plan)
        most = "" if plan.gap is None else f", at most {100.0 * plan.gap:.3g} % above the least possible"
        pushes = sum(segment.pushes for segment in plan.segments)
        found.append(("pushed", f"{plan.way_pushed:.3f} m in {counted(pushes, 'push', 'pushes')}"))
        found.append(("cost", f"{plan.objective_cost:.3f} m with the robot's own ways and changes{most}"))
        found.append(("duration", f"{plan.trajectory.duration:.2f} s"))
    elif plan.path and plan.trajectory:
        most = "" if plan.gap is None else f", at most {100.0 * plan.gap:.3g} % above the least possible"
        found.append(
            ("path cost", f"{plan.path.cost:.3f} m in {counted(len(plan.path.lengths), 'arc')}{most}")
        )
        found.append(("duration", f"{plan.trajectory.duration:.2f} s"))
    spent = f"{time_text(plan.planning_s)}, {counted(plan.extensions, 'extension')}"
    first = (
        "" if plan.first_solution_s is None else f"first path after {time_text(plan.first_solution_s)} of "
    )
    found.append(("planning", first + spent))
    if execution:
        found += _execution_rows(scenario, execution)
    if plan.robustness:
        found.append(("robustness", plan.robustness.sentence))
    if plan.lowered:
        found.append(("note", plan.lowered))
    return found if log is None else [*found, ("log", str(log))]


def headline(scenario: Scenario, plan: PlanResult, console: Console) -> str:
    """Return what was run and whether it was solved."""
    state = console.paint("solved", "green") if plan.solved else console.paint("not solved", "red")
    how = console.paint(f"({plan.planner} in {plan.stable_set}, seed {plan.seed})", "dim")
    return f"{console.paint(scenario.name, 'bold')}: {state}  {how}"


def _execution_rows(scenario: Scenario, execution: Execution) -> list[tuple[str, str]]:
    chain = scenario.chain
    position, angle = execution.goal_error
    found = [
        ("goal error", f"{length_text(position)}, {angle_text(angle)} after execution"),
        ("smallest margin", _smallest(chain, execution, execution.margins)),
    ]
    if execution.dynamic_margins is not None:
        found.append(("with inertia", _smallest(chain, execution, execution.dynamic_margins)))
    warning = inertia_warning(scenario, execution)
    if warning:
        found.append(("warning", warning))
    if execution.loss:
        place = f"contact {chain.contact_name(execution.loss.contact)}"
        found.append(("stopped", f"at {execution.loss.time:.2f} s: {place} does not hold"))
    return found


def _smallest(chain: Chain, execution: Execution, margins: FloatArray) -> str:
    """The smallest of margins (m, n), when and where."""
    sample, contact = np.unravel_index(int(np.argmin(margins)), margins.shape)
    at, name = execution.t[sample], chain.contact_name(int(contact))
    return f"{margins[sample, contact]:.2g} at {at:.2f} s, contact {name}"


def _arcs(path: PushPath) -> list[dict[str, object]]:
    return [
        {"twist": twist, "length": length} for twist, length in zip(path.twists, path.lengths, strict=True)
    ]


def _nearest(plan: PlanResult) -> dict[str, object] | None:
    """The path that ends nearest to the goal where none reaches it."""
    if plan.approximate_path is None or plan.approximate_error is None:
        return None
    position, angle = plan.approximate_error
    path = plan.approximate_path
    return {"path_cost": path.cost, "position": position, "angle": angle, "arcs": _arcs(path)}


def _goal_error(execution: Execution) -> dict[str, float | None]:
    position, angle = (error if isfinite(error) else None for error in execution.goal_error)
    return {"position": position, "angle": angle}


def _loss(loss: StabilityLoss) -> dict[str, object]:
    return {"time": loss.time, "contact": loss.contact, "margin": loss.margin, "pose": loss.pose}
