"""Read a run's log back: show it, verify it, export it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, time_text
from pushplan.cli.main import DONE, MISMATCH
from pushplan.cli.render import headline, plan_document, plan_rows, remarks_on, segment_rows
from pushplan.errors import PushplanError, RunLogError
from pushplan.util.names import BESIDE_A_BAG

if TYPE_CHECKING:
    from pushplan.logging.old.messages.recorded import RecordedRun
    from pushplan.logging.old.verify import VerifyReport

Document = dict[str, Any]

WRITERS = {
    "html": ("page", "write_html", "Write a page that plays the run."),
    "csv": ("tables", "write_csv", "Write the executed samples as a table."),
    "trajectory": ("tables", "write_trajectory", "Write the timed motion as JSON, of chain and robot."),
    "mp4": ("film", "write_mp4", "Write a film of the run."),
    "ros2": ("bag", "write_ros2", "Write a bag for `ros2 bag play`, and beside it .rviz."),
    "layout": ("layout", "write_layout", "Write a layout for Foxglove and Lichtblick."),
}
"""Module in `pushplan.logging`, function and help of each option that names a file to write."""


def _writer_options(function: Any) -> Any:
    for name, (_, _, about) in reversed(WRITERS.items()):
        function = p.file_option(f"--{name}", help=about)(function)
    return function


class ExportsError(PushplanError):
    """Some of the files asked for cannot be had of this run."""

    def __init__(self, failures: Mapping[str, PushplanError], written: list[str]) -> None:
        done = f"written: {', '.join(written)}; " if written else ""
        reasons = (f"--{name}: {error}" for name, error in failures.items())
        super().__init__(f"{done}not written: " + "; ".join(reasons))


@p.command
@click.argument("log", type=p.PATH, metavar="[RUN]", required=False)
@click.argument("recovered", type=p.PATH, metavar="[OUT]", required=False)
@p.runs_option
@click.option("--recover", is_flag=True, help="Write what is whole of the damaged RUN to OUT.")
@click.option("--verify", is_flag=True, help="Execute the recorded plan again and compare; exit code 4.")
@click.option("--physics", is_flag=True, help="Execute the plan in MuJoCo, too; exit code 4 if it slips.")
@p.plot_option
@_writer_options
@click.option("--frames", metavar="MAP,BASE", help="With --ros2: frames above the chain, or MAP,ODOM,BASE.")
@click.option(
    "--epoch",
    type=p.Number("time for ROS", 0.0, 2.0**31, above=True),
    metavar="S",
    help="With --ros2: ROS time at which the run begins.",
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
    frames: str | None,
    epoch: float | None,
    **files: Path | None,
) -> int:
    """Show a log (@3: the third last recorded run; the last one by default), verify it, export it."""
    if recover != (recovered is not None):
        raise p.UsageError(
            "--recover needs two names, of the damaged log and of the new one; others take one"
        )
    source = log_meant(log, runs)
    wanted = {name: path for name, path in files.items() if path is not None}
    p.check_outputs([source], plot, *_outputs(wanted), log=recovered)
    with console.working(f"reading {source}"):
        found = _read(source, recovered)
    if physics:
        from pushplan.cli.physics import require_executable

        require_executable(found[0].scenario)
    shown = [_with_plan(run, console) for run in found]
    document = _tell(shown, recovered, console)
    report = None
    if verify:
        report = _verified(found, console)
        document["verification"] = _verification(report)
    matches = report is None or report.matches
    if physics:
        from pushplan.cli.physics import execute

        executed = [execute(run.scenario, run.plan, console) for run in shown]
        document["physics"] = [told for told, _ in executed] if len(shown) > 1 else executed[0][0]
        matches = matches and all(kept for _, kept in executed)
    if plot is not None or wanted:
        how: dict[str, Any] = {}
        if "ros2" in wanted:
            from pushplan.logging.old.bag import Frames

            how = {"frames": Frames.from_text(frames) if frames else None, "epoch": epoch}
        _export(_joined(shown), plot, wanted, how, console)
    console.emit(document)
    return DONE if matches else MISMATCH


command = replay


def log_meant(log: Path | None, runs: Path | None) -> str:
    """Return the log that a user means by a file, `@3` for the third last run, or nothing for the last one."""
    word = None if log is None else str(log)
    if word is not None and not word.startswith("@"):
        return word
    from pushplan.logging.runs import RunsError, run_numbered, runs_folder

    if word is not None and not (word[1:].isascii() and word[1:].isdigit()):
        if os.path.lexists(word):
            return word
        raise RunsError(f"{word} is neither a file nor a recorded run; the last run is @1, the one before @2")
    return str(run_numbered(runs_folder(runs), 1 if word is None else int(word[1:])))


def _read(source: str, recovered: Path | None) -> tuple[RecordedRun, ...]:
    if recovered is not None:
        from pushplan.logging.old.recover import recover

        return recover(source, recovered)
    from pushplan.logging.old.reader import read_runs

    return read_runs(source)


def _with_plan(run: RecordedRun, console: Console) -> RecordedRun:
    """Return a run that was cut off with the plan that its best path leads to; others as they are."""
    if run.plan is not None or run.best_path is None:
        return run
    with console.computing("timing and executing the best path"):
        from pushplan.logging.old.cut_off import with_best_path

        return with_best_path(run)


# --- what is shown ----------------------------------------------------------------------------------------------


def _tell(runs: Sequence[RecordedRun], recovered: Path | None, console: Console) -> Document:
    """Show what a log holds; return the document."""
    from pushplan.logging.old.view.summary import summary

    first, last = runs[0], runs[-1]
    about: Document = {"scenario": first.scenario.name, "log": first.path}
    if len(runs) > 1:
        about["errands"] = _tell_errands(runs, console)
        rows = [("log", str(first.path))]
    elif first.plan is None:
        console.say((first.scenario.name, "bold"), ": the log ends before a plan")
        rows = []
    else:
        about = plan_document(first.scenario, first.plan, first.execution, first.path)
        headline(about, console)
        rows = plan_rows(about, remarks_on(first.scenario, first.plan, first.execution))
    console.table([*rows, *summary(last)])
    if recovered is not None:
        console.say(f"{recovered}: a clean log of what is whole")
    return {
        **about,
        "outcome": last.outcome,
        "lost": first.losses,
        "recovered": recovered,
        "verification": None,
    }


def _tell_errands(runs: Sequence[RecordedRun], console: Console) -> list[Document]:
    """Show the tasks of a log of several objects, one after the other."""
    from pushplan.logging.old.errands import aim_of, delivers, errand_of

    console.say((runs[0].scenario.name, "bold"), "  (several objects)")
    found = []
    for k, run in enumerate(runs, start=1):
        began = time_text(1e-9 * run.began) if run.began else "the beginning"
        console.say(f"task {k}: {errand_of(run)} {aim_of(run)}, from {began} on")
        about: Document = {"object": errand_of(run), "delivers": delivers(run), "began": 1e-9 * run.began}
        if run.plan is not None:
            about |= plan_document(run.scenario, run.plan, run.execution, run.path) | {"outcome": run.outcome}
            console.table(segment_rows(about["segments"]))
        found.append(about)
    return found


def _verified(runs: Sequence[RecordedRun], console: Console) -> VerifyReport:
    """Execute the recorded plans again, compare, and tell what differs."""
    with console.computing("executing the recorded plan again"):
        from pushplan.logging.old.errands import check_errands
        from pushplan.logging.old.verify import VerifyReport, verify

        if len(runs) > 1:
            own = [
                replace(check, quantity=f"task {k}: {check.quantity}")
                for k, run in enumerate(runs, start=1)
                for check in verify(run).checks
            ]
            report = VerifyReport((*own, *check_errands(runs)))
        else:
            report = verify(runs[0])
    if not report.checks:
        console.say("nothing to verify: no plan was found")
    elif report.matches:
        console.say((f"verified: all {len(report.checks)} comparisons match", "green"))
    else:
        console.say(("the log differs from what its scenario and its plan lead to:", "red"))
        for check in report.mismatches:
            console.say(f"  {check.text}")
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
    return {"matches": report.matches, "checks": checks}


# --- what is written --------------------------------------------------------------------------------------------


def _outputs(wanted: Mapping[str, Path]) -> list[Path]:
    """Return all files that are written for those asked for."""
    from pushplan.util.files import check_output

    bag = wanted.get("ros2")
    beside = [] if bag is None or check_output(bag).streamed else [bag.with_suffix(BESIDE_A_BAG)]
    return [*wanted.values(), *beside]


def _joined(runs: Sequence[RecordedRun]) -> RecordedRun:
    """Return all runs of a log as one.

    Raises:
        RunLogError: When there are several and nothing was executed.
    """
    if len(runs) == 1:
        return runs[0]
    from pushplan.logging.old.joined import joined

    executed = [run for run in runs if run.plan is not None and run.execution is not None]
    if not executed:
        raise RunLogError(str(runs[0].path), "nothing was executed, so there is nothing to show")
    return joined(executed)


def _export(
    run: RecordedRun,
    plot: Path | None,
    wanted: Mapping[str, Path],
    how_of_ros2: Mapping[str, Any],
    console: Console,
) -> None:
    """Write the files asked for: all that can be, then say which cannot.

    Raises:
        PushplanError: When a package is missing, or a file cannot be written or cannot be made of this run.
    """
    tasks: dict[str, Callable[[], None]] = (
        {} if plot is None else {"plot": partial(_draw, run, plot, console)}
    )
    for name, path in wanted.items():
        tasks[name] = partial(_write, name, run, path, how_of_ros2 if name == "ros2" else {}, console)
    failures: dict[str, PushplanError] = {}
    for name, task in tasks.items():
        try:
            task()
        except PushplanError as error:
            failures[name] = error
    if len(tasks) == 1 and failures:
        raise next(iter(failures.values()))
    if failures:
        raise ExportsError(failures, [f"--{name}" for name in tasks if name not in failures])


def _draw(run: RecordedRun, path: Path, console: Console) -> None:
    if run.plan is None:
        raise RunLogError(str(run.path), "the log ends before a plan, so there is nothing to draw")
    from pushplan.cli.plan import draw

    draw(run, path, console)


def _write(name: str, run: RecordedRun, path: Path, how: Mapping[str, Any], console: Console) -> None:
    module, function, _ = WRITERS[name]
    with console.working(f"writing {path}"):
        getattr(import_module(f"pushplan.logging.old.{module}"), function)(run, path, **how)
