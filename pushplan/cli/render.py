"""Output of a plan and its execution: a JSON document, printed lines, a page, and an execution in MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pushplan.cli.console import Console, angle_text, counted, length_text, plain, time_text
from pushplan.cli.main import DONE, MISMATCH, NO_PLAN
from pushplan.errors import OutputError
from pushplan.plans.execution import inertia_warning
from pushplan.plans.run import segments_of
from pushplan.util.names import CLOSE, PUSH

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.plans.execution import Execution
    from pushplan.plans.plan import Plan
    from pushplan.plans.run import Feedback, Run
    from pushplan.plans.segment import Segment
    from pushplan.scenario.model import Scenario
    from pushplan.sim.report import ContactReport
    from pushplan.util.arrays import FloatArray

_TELLING_GAP = 1.0
"""Largest printed gap, as a share: a bound below half of the cost says little about the plan."""

MOST_NAMES = 4
"""Largest number of object names in a line."""

Document = dict[str, Any]
Rows = list[tuple[str, str]]


def exit_code(document: Mapping[str, Any]) -> int:
    """Return the exit code of a plan: done, no plan, or a contact lost during execution."""
    if not document["solved"]:
        return NO_PLAN
    return MISMATCH if document["contact_lost"] else DONE


def headline(document: Mapping[str, Any], console: Console) -> None:
    """Print the scenario, the settings and whether the plan is solved."""
    state = ("solved", "green") if document["solved"] else ("not solved", "red")
    how = f"  planner {document['planner']}, stable set {document['set']}, seed {document['seed']}"
    console.say((document["scenario"], "bold"), ": ", state, (how, "dim"))


def plan_rows(document: Mapping[str, Any], remarks: Mapping[str, str]) -> Rows:
    """Return labels and values of a plan's document, with the texts of `remarks_on`."""
    found = [] if document["solved"] else [("reason", document["reason"])]
    if remarks.get("in the way"):
        found.append(("in the way", remarks["in the way"]))
    near = document["nearest"]
    if near is not None:
        off = f"ends {near['position']:.3g} m and {degrees(near['angle']):.3g} deg from the goal"
        found.append(("nearest path", f"{near['path_cost']:.3f} m long, {off}"))
    if len(document["segments"]) > 1:
        found += [(f"{k}. {one['kind']}", _segment_text(one)) for k, one in enumerate(document["segments"], start=1)]
    if document["path_cost"] is not None:
        found.append(("path cost", _cost_text(document)))
        if document["gap"] is not None and document["gap"] < _TELLING_GAP:
            of = "duration" if document["objective"] == "time" else "path cost"
            found.append(("optimality gap", f"<= {100.0 * document['gap']:.3g} % of the {of}"))
    if document["duration_s"] is not None:
        found.append(("duration", f"{document['duration_s']:.2f} s"))
    first = document["first_solution_s"]
    begun = "" if first is None else f"first plan after {time_text(first)} of "
    spent = f"{time_text(document['planning_s'])}, {counted(document['iterations'], 'iteration')}"
    found.append(("planning", begun + spent))
    error = document["goal_error"]
    if error is not None and None not in error.values():
        found.append(("goal error", f"{length_text(error['position'])}, {angle_text(error['angle'])}"))
    if document["min_margin"] is not None:
        text, dynamic = f"{document['min_margin']:.2g}{remarks.get('min_margin', '')}", document["min_dynamic_margin"]
        if dynamic is not None:
            text += f"; with inertia {dynamic:.2g}{remarks.get('min_dynamic_margin', '')}"
        found.append(("margin (min)", text))
    found += [(name, remarks[name]) for name in ("force", "warning") if remarks.get(name)]
    lost = document["contact_lost"]
    if lost is not None:
        found.append(("stopped", f"at {lost['time']:.2f} s: contact {lost['contact']} does not hold"))
    lines = remarks.get("robustness", "").splitlines()
    found += zip(["robustness", *[""] * len(lines)], lines, strict=False)
    found += [("note", note) for note in document["notes"]]
    return found + [(name, str(document[name])) for name in ("log", "page") if document.get(name)]


def _cost_text(document: Mapping[str, Any]) -> str:
    if len(document["segments"]) < 2:
        return f"{document['path_cost']:.3f} m in {counted(len(document['arcs']), 'arc')}"
    pushing = [segment for segment in document["segments"] if segment["kind"] in (PUSH, CLOSE)]
    pushed = sum(arc["length"] for segment in pushing for arc in segment["arcs"])
    pushes = counted(sum(segment["kind"] == PUSH for segment in pushing), "push", "pushes")
    return (
        f"{document['path_cost']:.3f} m: {pushed:.3f} m pushed in {pushes}, the rest for transits and changes of the "
        "contact"
    )


def _segment_text(segment: Mapping[str, Any]) -> str:
    length = sum(arc["length"] for arc in segment["arcs"])
    text = f"{segment['t0']:7.2f} - {segment['t1']:6.2f} s  {length:6.3f} m"
    if segment["face"]:
        names = [link["object"] for link in segment["load"]]
        if len(names) > MOST_NAMES:
            names = [*names[: MOST_NAMES - 1], f"{len(names) - MOST_NAMES + 1} more"]
        held = f"{' + '.join(names)} " if len(segment["before"]) > len(segment["load"]) or segment["onto"] else ""
        text += f"  {held}onto {segment['onto']}" if segment["onto"] else f"  {held}{segment['face']} face"
    if segment["offset"]:
        text += f" {1e3 * segment['offset']:+.3g} mm"
    if segment["max_force"] is not None:
        text += f"  {segment['max_force']:.3g} N"
    if segment["kind"] != PUSH:
        return text
    places = []
    for x, y, theta in (segment["object_before"], segment["object_after"]):
        place = plain(round(x, 3)), plain(round(y, 3)), plain(round(degrees(theta), 1))
        places.append("({:.3f}, {:.3f}, {:.1f} deg)".format(*place))
    return f"{text}  {' -> '.join(places)}"


def plan_document(plan: Plan, log: Path | None) -> Document:
    """Return the document of a plan and its execution."""
    document: Document = plan.to_dict()
    error = document["goal_error"]
    if isinstance(error, dict):  # an execution that lost its load has no goal error
        document["goal_error"] = {name: value if isfinite(value) else None for name, value in error.items()}
    return {**document, "log": log}


def remarks_on(plan: Plan, execution: Execution | None, feedback: Feedback | None = None) -> dict[str, str]:
    """Return texts beside the numbers of a plan: places of the smallest margins, robustness, force, warnings."""
    remarks = {"force": plan.force_words, "in the way": plan.in_the_way}
    if plan.robustness:
        remarks["robustness"] = plan.robustness_words
    if execution is not None:
        remarks["warning"] = inertia_warning(plan.scenario, execution)
        segments = segments_of(plan, feedback)
        remarks["min_margin"] = _where(segments, execution, execution.margins)
        if execution.dynamic_margins is not None:
            remarks["min_dynamic_margin"] = _where(segments, execution, execution.dynamic_margins)
    return remarks


def _where(segments: tuple[Segment, ...], execution: Execution, margins: FloatArray) -> str:
    """Return time and contact of the smallest of margins (m, n) as text; empty if nothing was pushed."""
    if np.isnan(margins).all():
        return ""
    sample, column = np.unravel_index(int(np.nanargmin(margins)), margins.shape)
    load = segments[int(execution.segment[sample])].load
    name = execution.names[int(column)]
    contact = name if load is None else load.contact_name(name)
    return f" at {execution.t[sample]:.2f} s, contact {contact}"


def write_page(done: Run | RecordedRun, html: Path | None, log: Path | None, console: Console) -> Path | None:
    """Write the page of a run and return its path.

    Args:
        done: Run that the page plays.
        html: File that the user named for the page; a failure to write it is an error.
        log: Log that the user named. Without `html` the page goes beside it, and a failure is only a note. None
            without a log, or if no page is wanted.
        console: Console for notes.

    Raises:
        OutputError: If the page `html` cannot be written.
    """
    from pushplan.util.files import check_output

    page = html
    if html is None and log is not None and not check_output(log).streamed and log.suffix != ".html":
        page = log.with_suffix(".html")
        if page.is_file() and b'id="run"' not in page.read_bytes():
            console.note(f"{page} exists and is not the page of a run, so it was kept; name another file with --html")
            page = None
    if page is None:
        return None
    from pushplan.logging.page import write_html

    try:
        with console.working(f"writing {page}"):
            write_html(done, page)
    except OutputError as error:
        if html is not None:
            raise
        console.note(f"no page: {error}")
        return None
    return page


def require_executable(scenario: Scenario) -> None:
    """Check before the planning that the physics engine can execute plans of this scenario.

    Raises:
        MissingExtraError: If the engine is not installed.
        PhysicsError: If the load of an object on the floor is unknown.
    """
    from pushplan.sim.physics.engine import PhysicsError, engine

    engine()
    unknown = [repr(obj.name) for obj in scenario.objects if not obj.support.known]
    if unknown:
        raise PhysicsError(
            f"the physics engine cannot push {', '.join(unknown)}: the scenario does not state the distribution of "
            "the load on the floor; allowed: support uniform, feet with loads, or a pressure map"
        )


def execute_in_physics(scenario: Scenario, plan: Plan | None, console: Console) -> tuple[Document | None, bool]:
    """Execute a plan in the physics engine and print the motion of every contact.

    Returns:
        The document of the contacts, None without a plan; and whether every contact held.
    """
    if plan is None or plan.trajectory is None:
        console.say("the physics engine has nothing to execute: no plan was found")
        return None, True
    with console.working(f"executing {plan.trajectory.duration:.1f} s in the physics engine") as progress:

        def share(done: float) -> None:
            progress.update(f"{100.0 * done:.0f} %")

        from pushplan.sim.physics.simulate import simulate_in_physics

        report = simulate_in_physics(plan, progress=share)
    verdict = ("every contact held", "green") if report.kept else ("a contact moved", "red")
    console.say("in the physics engine, at full speed: ", verdict)
    if scenario.has_intervals:
        console.say("  executed with the middle of every interval, but the lowest contact friction")
    console.table(_contact_rows(report))
    return _contacts_document(report), report.kept


def _contact_rows(report: ContactReport) -> list[tuple[str, str]]:
    rows = [(one.contact, str(one).split(" ", 1)[1]) for one in report.summaries]
    if isfinite(report.clear):
        moved = f"none moved by more than {1e3 * report.disturbed:.2g} mm"
        rows.append(("objects at rest", f"{1e3 * report.clear:.3g} mm from the moving bodies; {moved}"))
    ends = [
        f"{name} {1e3 * position:.2g} mm, {degrees(angle):.2g} deg"
        for name, (position, angle) in zip(report.names, report.object_errors, strict=True)
    ]
    return [*rows, ("pose error", "; ".join(ends))]


def _contacts_document(report: ContactReport) -> Document:
    from pushplan.sim.report import TOLERANCE

    return {
        "kept": report.kept,
        "tolerance": TOLERANCE,
        "contacts": [asdict(one) | {"moved": one.moved_at is not None} for one in report.summaries],
        "objects": [
            {"object": name, "position": position, "angle": angle}
            for name, (position, angle) in zip(report.names, report.object_errors.tolist(), strict=True)
        ],
        "disturbed": report.disturbed,
        "clear": report.clear if isfinite(report.clear) else None,
    }
