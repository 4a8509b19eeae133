"""Read a run's log back: show it, verify it, export it."""

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


@p.command
@click.argument("log", type=p.PATH, metavar="[RUN]", required=False)
@click.argument("recovered", type=p.PATH, metavar="[OUT]", required=False)
@p.runs_option
@click.option("--recover", is_flag=True, help="Write what is whole of the damaged RUN to OUT.")
@click.option("--verify", is_flag=True, help="Execute the plan again and compare.")
@click.option("--physics", is_flag=True, help="Execute the plan in MuJoCo, too.")
@p.plot_option
@p.panels_option
@_writer_options
@click.option("--export", "exports", type=p.EXPORT, multiple=True, help="Write a FILE by an exporter of yours.")
@click.option("--rate", type=p.RATE, metavar="X", help="With --mp4: seconds of the run in each of the film.")
@click.option("--frames", metavar="MAP,BASE", help="With --ros2: frames above the chain, or MAP,ODOM,BASE.")
@click.option(
    "--epoch",
    type=p.number("time for ROS", 0.0, 2.0**31, above=True),
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
    panels: tuple[str, ...] | None,
    rate: float | None,
    frames: str | None,
    epoch: float | None,
    exports: tuple[tuple[str, Path], ...],
    **files: Path | None,
) -> int:
    """Show a log (@3: the third last recorded run; the last one by default), verify it, export it."""
    if recover != (recovered is not None):
        raise p.UsageError("--recover needs two names, of the damaged log and of the new one; others take one")
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
    document = _tell(run, recovered, console)
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


def _read(source: str, recovered: Path | None, messages: bool) -> RecordedRun:
    if recovered is not None:
        from pushplan.logging.recording import recover

        return recover(source, recovered)
    from pushplan.logging.reader import load_run

    return load_run(source, messages=messages)


# --- what is shown ----------------------------------------------------------------------------------------------


def _tell(run: RecordedRun, recovered: Path | None, console: Console) -> Document:
    """Show what a log holds; return the document."""
    about: Document = {"scenario": run.scenario.name, "log": run.path}
    if run.plan is None:
        console.say((run.scenario.name, "bold"), ": the log ends before a plan")
        best = run.improvements[-1:]  # that a search had found when its log broke off
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
        console.say(f"{recovered}: a clean log of what is whole")
    return {**about, "outcome": run.outcome, "lost": run.losses, "recovered": recovered, "verification": None}


def _verified(run: RecordedRun, console: Console) -> VerifyReport:
    """Execute the recorded plan again, compare, and tell what differs."""
    with console.working("executing the recorded plan again"):
        from pushplan.verification import verify_run

        report = verify_run(run)
    if report.matches:
        far = " as far as the log goes" if run.losses else ""
        console.say((f"verified{far}: all {len(report.checks)} comparisons match", "green"))
    else:
        console.say(("the log differs from what its scenario and its plan lead to:", "red"))
        for check in report.mismatches:
            console.say(f"  {check.text}")
    parts = "; ".join(report.not_compared)
    console.say((f"not compared, as scenario and plan do not decide it: {parts}", "dim"))
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


# --- what is written --------------------------------------------------------------------------------------------


def _outputs(wanted: Mapping[str, Path]) -> list[Path]:
    """Return all files that are written for those asked for."""
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
    """Write the files asked for: all that can be, then say which cannot.

    Raises:
        PushplanError: When a package is missing, or a file cannot be written or cannot be made of this run.
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
    if run.trials and run.execution is None:  # the log of one sample has its execution
        from pushplan.cli.trial import draw_trials

        if panels is not None:
            raise p.UsageError("--panels names parts of a plan's picture; this log has trials")
        draw_trials(run.plan, run.trials, path, console)
        return
    from pushplan.cli.plan import draw

    draw(run, run.plan, path, panels, console)


def _write(name: str, run: RecordedRun, path: Path, how: Mapping[str, Any], console: Console) -> None:
    from pushplan.util.naming import EXPORTER_NAMES, code_of_others, function_named

    with console.working(f"writing {path}"):
        if name in WRITERS:
            module, function, _ = WRITERS[name]
            write = getattr(import_module(f"pushplan.logging.{module}"), function)
        else:
            write = function_named(name, EXPORTER_NAMES, "exporter")
        with code_of_others("exporter", write):
            write(run, path, **how)
