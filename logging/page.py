"""Export of a run as one web page that plays it: the floor from above, and every contact's margin over time.

The page contains all data and scripts and makes no network requests.
"""

from __future__ import annotations

import html
import json
import math
from collections import Counter
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.drawing import palette
from pushplan.drawing.scene import Line, Scene, piece_colours
from pushplan.geometry import se2
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.shown import (
    cone_height,
    contact_names,
    largest_force,
    longest_arrow,
    object_size,
    parts_of,
    steps_of,
    viewed,
    worst_contacts,
)
from pushplan.logging.signals import series_of
from pushplan.mechanics.contacts import friction_cone
from pushplan.plans.execution import Execution, wilson
from pushplan.plans.goals import goal_columns, goal_units, missed_tolerances
from pushplan.plans.load import Load
from pushplan.plans.run import Run, segments_of
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_whole

_COLOURS = ("GOAL", "NEAREST", "ALONE", "BLOCKING", "OBSTACLE_EDGE", "WALL")

MOST_SAMPLES = 5_000
"""Largest number of samples of an execution in the page, beside those with the smallest margins."""


def write_html(run: Run | RecordedRun, path: Path | str) -> None:
    """Write the page of `run`.

    Raises:
        OutputError: If the file cannot be written.
    """
    write_whole(path, render(run).encode())


def render(run: Run | RecordedRun) -> str:
    """Return the page of `run`."""
    scene = Scene.of(run.scenario, run.plan, run.execution, run.events)
    if run.plan is None:
        why = ["The log ends before a plan."]
    else:
        neither = run.execution is None and not run.trials
        why = run.plan.why_not or ["A path was planned, but not executed."] * neither
    kept = None if run.plan is None else run.plan.margin
    least = float(np.fmin.reduce(scene.margins, initial=np.nan))
    title = palette.margins_title(kept, least, bool(scene.marks))
    data = {
        **_world(run.scenario, scene),
        **_plan(run, scene),
        **_execution(run.scenario, run.execution),
        "window": scene.window,
        "why": why,
        "parts": parts_of(run),
        **(_trials(run) if run.trials else _steps(run)),
        "events": [(one.time, f"{one.kind}: {one.text}", palette.EVENTS.get(one.kind)) for one in run.events],
        "kept": kept,
        "margin_ticks": palette.margin_ticks(kept),
        "margins_title": title.replace("\n", " ").replace("keeps", "(dashed) keeps"),
    }
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")  # no </script>
    page = files("pushplan.logging").joinpath("player.html").read_text(encoding="utf-8")
    return page.replace("@TITLE@", html.escape(f"{run.scenario.name} - pushplan")).replace("@RUN@", text)


def _world(scenario: Scenario, scene: Scene) -> dict[str, Any]:
    names = contact_names(scenario)
    bodies = [
        {"name": body.name, "kind": body.kind.value, "outline": _plain(body.outline), "colour": body.colour}
        for body in scene.bodies
    ]
    reach = max(float(np.linalg.norm(body.outline, axis=1).max()) for body in scene.bodies)
    paints = palette.contact_colours(len(names))
    return {
        "name": scenario.name,
        "workspace": None if scene.walls is None else scene.walls.tolist(),
        "obstacles": [
            {"outline": _plain(one.outline), "unknown": one.unknown, "colour": one.colour} for one in scene.obstacles
        ],
        "start": scenario.plate_start.tolist(),
        "first": [pose.tolist() for pose in scenario.poses.values()],
        "before": list(map(_plain, scene.outlines(scene.start))),
        "goals": [{"outline": _plain(goal.outline), "colour": goal.colour} for goal in scene.goals],
        "bodies": bodies,
        "contacts": [{"name": name, "colour": paint} for name, paint in zip(names, paints, strict=True)],
        "resting": _contacts(scenario, Load.of(scenario)) if scenario.task.held else [],
        "reach": reach,
        "longest_arrow": longest_arrow(scenario),
        "margins": palette.MARGINS,
        "margin_words": palette.MARGIN_WORDS,
        "marks": [
            {"kind": mark.kind, "place": _plain(mark.place), "colour": palette.EVENTS[mark.kind]}
            for mark in scene.marks
        ],
        "colours": {name.lower(): getattr(palette, name) for name in _COLOURS},
    }


def _contacts(scenario: Scenario, load: Load) -> list[dict[str, Any]]:
    """Return each contact of a load: segment in the plate frame, and friction cone at the origin."""
    names, size = list(scenario.poses), object_size(scenario)
    return [
        {
            "column": names.index(name),
            "segment": _plain(se2.transform_points(load.frame_plate, np.stack([contact.right, contact.left]))),
            "cone": _plain(friction_cone(contact, np.zeros(2), cone_height(contact, size))),
        }
        for name, contact in zip(load.names, load.chain.contacts, strict=True)
    ]


def _plan(run: Run | RecordedRun, scene: Scene) -> dict[str, Any]:
    scenario, plan = run.scenario, run.plan
    lines, last = scene.lines or scene.nearest, scene.nearest_poses
    shown: dict[str, Any] = {
        "ways": [_path_line(line, bool(scene.lines)) for line in lines],
        "tree": [] if scene.tree is None else _plain(scene.tree.reshape(-1, 4)),
        "nearest": None if scene.lines or last is None else list(map(_plain, scene.outlines(last))),
        "loads": [],
    }
    if plan is None:
        return {"facts": [], "notes": [], **shown}
    loads = [s.load if s.pushes else None for s in segments_of(plan, run.feedback)]
    shown["loads"] = [None if load is None else _contacts(scenario, load) for load in loads]
    facts = [f"planner {plan.planner}", f"stable set {plan.stable_set}", f"seed {plan.seed}"]
    if not plan.segments:
        facts.append("no plan")
    elif plan.path is not None:
        facts.append(f"{len(plan.path.lengths)} arcs, path cost {plan.path.cost:.3f} m")
    else:
        count, travel = len(plan.pushes), sum(segment.path.cost for segment in plan.segments)
        pushes = f"{count} push{'es' if count > 1 else ''}, {plan.pushed_distance:.3f} m pushed"
        facts.append(f"{pushes}, {travel:.3f} m driven in total; dashed: without a load")
    if run.execution is not None:
        facts.append(run.execution.force_words(scenario.pusher.limits.force))
    facts = [fact for fact in facts if fact]
    notes = [
        *([f"robustness: {plan.robustness_words}"] if plan.solved and plan.robustness_words else []),
        *plan.notes,
    ]
    return {"facts": facts, "notes": notes, **shown}


def _steps(run: Run | RecordedRun) -> dict[str, Any]:
    """Return the steps of the run with their times and texts, and a summary for the operator."""
    steps = steps_of(run)
    if not steps or run.execution is None:
        return {"steps": [], "summary": [], "trials": []}
    known = [(step.margin, k) for k, step in enumerate(steps) if step.margin is not None]
    x, y, heading = run.execution.poses[-1].tolist()
    summary = [f"The run takes {run.execution.t[-1]:.1f} s."]
    if known:
        margin, k = min(known)
        summary.append(f"Most likely to slip: step {k + 1}, contact {steps[k].contact}, margin {margin:.3f}.")
    turn = round(math.degrees(float(se2.wrap_angle(heading)))) + 0
    summary.append(f"The middle of the plate ends at x {x:.2f} m, y {y:.2f} m, heading {turn} deg.")
    listed = [
        (step.begin, step.end, step.words, None if step.margin is None else round(step.margin, 3)) for step in steps
    ]
    return {"steps": listed, "summary": summary, "trials": []}


def _trials(run: Run | RecordedRun) -> dict[str, Any]:
    """Return the final poses of all samples, worst first, and what happened in those that failed."""
    scenario, ends = run.scenario, run.trials
    arrived, columns = sum(end.arrived for end in ends), goal_columns(scenario)
    low, high = wilson(arrived, len(ends))
    summary = [f"{arrived} of {len(ends)} samples arrive ({100 * low:.1f} to {100 * high:.1f} % at 95 %)."]
    missed = Counter(name for end in ends for name in missed_tolerances(scenario, end.errors))
    summary += [f"{name.capitalize()} tolerance missed in {count}." for name, count in missed.items()]
    summary += [
        f"{name} moves first in {n}." for name, n in Counter(end.contact for end in ends if end.contact).items()
    ]
    samples = []
    for end in sorted(ends, key=lambda end: -float(goal_units(scenario, end.errors).max())):
        position, angle = end.errors[columns].max(axis=0)
        words = [f"sample {end.sample}: {1e3 * position:.1f} mm and {math.degrees(angle):.2f} deg off the goal"]
        words += [f"{name} tolerance missed" for name in missed_tolerances(scenario, end.errors)]
        words += ["jammed"] * end.jammed
        if end.contact:
            how = "would slip with inertia" if end.mode == "inertia" else f"moves first ({end.mode})"
            words.append(f"{end.contact} {how} at {end.time:.1f} s")
        samples.append(
            {
                "arrived": end.arrived,
                "objects": _plain(end.objects),
                "point": _plain(np.array(end.point)) if end.contact else None,
                "colour": palette.ARRIVED if end.arrived else palette.MISSED,
                "words": "" if end.arrived and not end.contact else "; ".join(words),
            }
        )
    return {"steps": [], "summary": summary, "trials": samples}


def _path_line(line: Line, leads: bool) -> dict[str, Any]:
    """Return a line of the path; the pieces of a push to the goal have colours by margin."""
    colours = piece_colours(line.margins) if line.pushes and leads else None
    return {"points": _plain(line.points), "alone": not line.pushes, "colours": colours}


def _execution(scenario: Scenario, execution: Execution | None) -> dict[str, Any]:
    """Return the samples by signal, object or contact, and column (null without a push), and the numbers to show."""
    if execution is None or len(execution.t) == 0:
        nothing: dict[str, Any] = {"t": [], "margins": [[] for _ in scenario.poses]}
        return {"samples": nothing, "margin_range": [-0.05, 1.0], "largest_force": 1.0, "named": [], "read_out": []}
    shown = viewed(execution)[:: math.ceil(len(viewed(execution)) / MOST_SAMPLES)]  # fewer for very long executions
    worst = np.argmin(np.where(np.isnan(execution.margins), np.inf, execution.margins), axis=0)
    kept = np.union1d(shown, [0, len(execution.t) - 1, *worst])
    margins = execution.margins[kept]
    shared = [(signal, values) for signal, values in series_of(execution) if signal.page]
    samples = {signal.name: _plain(np.moveaxis(values[kept], 0, -1)) for signal, values in shared}
    numbers = [one for one, values in shared if values.ndim == 1 and one.name not in ("t", "segment")]
    read_out = [(one.name, one.quantity, one.unit) for one in numbers]
    known = margins[~np.isnan(margins)]
    low, high = min(0.0, float(known.min(initial=0.0))), float(known.max(initial=0.0))
    room = 0.05 * max(high - low, 0.1)
    scales = {"margin_range": [low - room, high + room], "largest_force": largest_force(execution)}
    return {"samples": samples, **scales, "named": worst_contacts(execution), "read_out": read_out}


def _plain(values: FloatArray) -> list[Any]:
    plain = np.round(values, 5).astype(object)  # 0.01 mm: far below a pixel
    plain[~np.isfinite(values)] = None
    rows: list[Any] = plain.tolist()
    return rows
