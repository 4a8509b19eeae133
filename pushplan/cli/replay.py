"""Show, verify or export the log of a run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console
from pushplan.cli.main import DONE, MISMATCH
from pushplan.cli.render import execute_in_physics, headline, plan_document, plan_rows, remarks_on, require_executable
from pushplan.errors import PushplanError, RunLogError
from pushplan.plans.execution import wilson
from pushplan.util.names import BESIDE_A_BAG

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.logging.verify import VerifyReport

Document = dict[str, Any]

WRITERS = {
    "html": ("page", "write_html", "Write a page that plays the run."),
    "csv": ("tables", "write_csv", "Write the executed samples as a CSV table."),
    "trajectory": ("tables", "write_trajectory", "Write the timed motion of chain and robot as JSON."),
    "mp4": ("film", "write_mp4", "Write a film of the run."),
    "ros2": ("bag", "write_ros2", "Write a bag for `ros2 bag play`, and an RViz file beside it."),
    "layout": ("layout", "write_layout", "Write a layout for Foxglove and Lichtblick."),
}
"""Module in `pushplan.logging`, function and help text of each export option."""


def _writer_options(function: Any) -> Any:
    for name, (_, _, about) in reversed(WRITERS.items()):
        function = p.file_option(f"--{name}", help=about)(function)
    return function


class ExportsError(PushplanError):
    """This run cannot provide some of the requested files."""


@p.command
@click.argument("log", type=p.PATH, metavar="[RUN]", required=False)
@click.argument("recovered", type=p.PATH, metavar="[OUT]", required=False)
@p.runs_option
@click.option("--recover", is_flag=True, help="Write the intact part of the damaged RUN to OUT.")
@click.option("--verify", is_flag=True, help="Re-execute the plan and compare it with the log.")
@click.option("--physics", is_flag=True, help="Also execute the plan in MuJoCo.")
@p.plot_option
@p.panels_option
@_writer_options
@click.option("--export", "exports", type=p.EXPORT, multiple=True, help="Write FILE with your own exporter NAME.")
@click.option("--rate", type=p.RATE, metavar="X", help="With --mp4: seconds of the run per second of film.")
@click.option("--frames", metavar="MAP,BASE", help="With --ros2: names of the frames, also as MAP,ODOM,BASE.")
@click.option(
    "--epoch",
    type=p.number("time for ROS", 0.0, 2.0**31, above=True),
    metavar="S",
    help="With --ros2: ROS time of the start of the run.",
)
def replay(
    console: Console,
    log: Path | None,
    recovered: Path | None,
    runs: Path | None,
    recover: bool,
    verify: bool,
    physics: bool,
    plot: Path | None,
    panels: tuple[str, ...] | None,
    rate: float | None,
    frames: str | None,
    epoch: float | None,
    exports: tuple[tuple[str, Path], ...],
    **files: Path | None,
) -> int:
    """Show, verify or export the log of a run.

    RUN is a log, or @N for the N-th last recorded run (default: @1, the last one).
    """
    if recover and recovered is None:
        raise p.UsageError("--recover needs two files: the damaged log and the new one")
    if recovered is not None and not recover:
        raise p.UsageError(f"the second file {recovered} is allowed only with --recover")
    source = log_meant(log, runs)
    wanted = {name: path for name, path in files.items() if path is not None} | dict(exports)
    p.check_outputs([source], plot, *_outputs(wanted), log=recovered)
    p.only_with("plot", plot is not None, panels=panels)
    p.only_with("mp4", "mp4" in wanted, rate=rate)
    p.only_with("ros2", "ros2" in wanted, frames=frames, epoch=epoch)
    with console.working(f"reading {source}"):
        run = _read(source, recovered, verify)
    if physics:
        require_executable(run.scenario)
    document = _report(run, recovered, console)
    report = None
    if verify:
        report = _verified(run, console)
        document["verification"] = _verification(report)
    matches = report is None or report.matches
    if physics:
        document["physics"], kept = execute_in_physics(run.scenario, run.plan, console)
        matches = matches and kept
    if plot is not None or wanted:
        how: dict[str, dict[str, Any]] = {"plot": {"panels": panels}, "mp4": {"rate": rate or 1.0}}
        if "ros2" in wanted:
            from pushplan.logging.rviz import Frames

            how["ros2"] = {"frames": Frames.from_text(frames) if frames else None, "epoch": epoch}
        _export(run, plot, wanted, how, console)
    console.emit(document)
    return DONE if matches else MISMATCH


def log_meant(log: Path | None, runs: Path | None) -> str:
    """Return the log for a file, for `@3` (the third last recorded run), or for None (the last one)."""
    word = None if log is None else str(log)
    if word is not None and not word.startswith("@"):
        return word
    from pushplan.logging.runs import RunsError, run_numbered, runs_folder

    if word is not None and not (word[1:].isascii() and word[1:].isdigit()):
        if os.path.lexists(word):
            return word
        raise RunsError(f"{word} is neither a file nor a recorded run; allowed: @1 for the last run, @2, @3, ...")
    return str(run_numbered(runs_folder(runs), 1 if word is None else int(word[1:])))


def _read(source: str, recovered: Path | None, messages: bool) -> RecordedRun:
    if recovered is not None:
        from pushplan.logging.recording import recover

        return recover(source, recovered)
    from pushplan.logging.reader import load_run

    return load_run(source, messages=messages)


# --- printed lines ----------------------------------------------------------------------------------------------


def _report(run: RecordedRun, recovered: Path | None, console: Console) -> Document:
    """Show the contents of a log; return them as a document."""
    about: Document = {"scenario": run.scenario.name, "log": run.path}
    if run.plan is None:
        console.say((run.scenario.name, "bold"), ": the log ends before a plan")
        best = run.improvements[-1:]  # best plan so far when the log ended
        rows = [("best plan", f"{one.cost:.3f} m, not timed yet") for one in best]
    else:
        about = plan_document(run.plan, run.path)
        headline(about, console)
        rows = plan_rows(about, remarks_on(run.plan, run.execution, run.feedback))
    if run.trials:
        arrived, of = sum(end.arrived for end in run.trials), len(run.trials)
        low, high = wilson(arrived, of)
        rows.append(("trials", f"{arrived} of {of} samples arrive ({100 * low:.1f} to {100 * high:.1f} % at 95 %)"))
        about["trials"] = {"samples": of, "arrived": arrived}
    console.table([*rows, ("outcome", run.outcome), *(("lost", loss) for loss in run.losses)])
    if recovered is not None:
        console.say(f"{recovered}: a clean log with the intact part")
    return {**about, "outcome": run.outcome, "lost": run.losses, "recovered": recovered, "verification": None}


def _verified(run: RecordedRun, console: Console) -> VerifyReport:
    """Re-execute the recorded plan, compare it with the log and print the differences."""
    with console.working("re-executing the recorded plan"):
        from pushplan.verification import verify_run

        report = verify_run(run)
    if report.matches:
        far = " as far as the log goes" if run.losses else ""
        console.say((f"verified{far}: all {len(report.checks)} comparisons match", "green"))
    else:
        console.say(("the log differs from the re-executed plan:", "red"))
        for check in report.mismatches:
            console.say(f"  {check.text}")
    parts = "; ".join(report.not_compared)
    console.say((f"not compared, because scenario and plan do not determine it: {parts}", "dim"))
    return report


def _verification(report: VerifyReport) -> Document:
    checks = [
        {
            "quantity": check.quantity,
            "matches": check.matches,
            "difference": check.difference if isfinite(check.difference) else None,
            "tolerance": check.tolerance,
            "time": check.time,
            "what": check.what or None,
        }
        for check in report.checks
    ]
    return {"matches": report.matches, "checks": checks, "not_compared": list(report.not_compared)}


# --- exported files ---------------------------------------------------------------------------------------------


def _outputs(wanted: Mapping[str, Path]) -> list[Path]:
    """Return all files that the requested exports write."""
    from pushplan.util.files import check_output

    bag = wanted.get("ros2")
    beside = [] if bag is None or check_output(bag).streamed else [bag.with_suffix(BESIDE_A_BAG)]
    return [*wanted.values(), *beside]


def _export(
    run: RecordedRun,
    plot: Path | None,
    wanted: Mapping[str, Path],
    how: Mapping[str, Mapping[str, Any]],
    console: Console,
) -> None:
    """Write all requested files that the run can provide, then report the others.

    Raises:
        PushplanError: If a package is missing, a file cannot be written, or the run cannot provide it.
    """
    files = {**({} if plot is None else {"plot": plot}), **wanted}
    written, failures = list[str](), list[str]()
    for name, path in files.items():
        option = f"--{name}" if name in (*WRITERS, "plot") else f"--export {name}"
        try:
            (_draw if name == "plot" else _write)(name, run, path, how.get(name, {}), console)
            written.append(option)
        except PushplanError as error:
            if len(files) == 1:
                raise
            failures.append(f"{option}: {error}")
    if failures:
        done = f"written: {', '.join(written)}; " if written else ""
        raise ExportsError(f"{done}not written: " + "; ".join(failures))


def _draw(_: str, run: RecordedRun, path: Path, how: Mapping[str, Any], console: Console) -> None:
    panels = how["panels"]
    if run.plan is None:
        raise RunLogError(str(run.path), "the log ends before a plan, so there is nothing to draw")
    if run.trials and run.execution is None:  # the log of a single sample has an execution
        from pushplan.cli.trial import draw_trials

        if panels is not None:
            raise p.UsageError("--panels is only for pictures of plans, and this log holds trials; leave it out")
        draw_trials(run.plan, run.trials, path, console)
        return
    from pushplan.cli.plan import draw

    draw(run, run.plan, path, panels, console)


def _write(name: str, run: RecordedRun, path: Path, how: Mapping[str, Any], console: Console) -> None:
    from pushplan.util.naming import EXPORTER_NAMES, function_named, user_code

    with console.working(f"writing {path}"):
        if name in WRITERS:
            module, function, _ = WRITERS[name]
            write = getattr(import_module(f"pushplan.logging.{module}"), function)
        else:
            write = function_named(name, EXPORTER_NAMES, "exporter")
        with user_code("exporter", write):
            write(run, path, **how)
