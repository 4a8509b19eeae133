"""Read a run's log back: show it, verify it, export it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.runs import log_meant
from pushplan.cli.steps.exports import declare_exports, outputs, write_exports
from pushplan.cli.steps.physics import add_physics
from pushplan.cli.steps.verification import tell_verification, verification
from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, MISMATCH
from pushplan.cli.terminal.options import add_plot, add_runs, check_outputs
from pushplan.errors import PushplanError

if TYPE_CHECKING:
    from pushplan.logging.messages.recorded import RecordedRun
    from pushplan.logging.verify import VerifyReport


class ReplayUsageError(PushplanError, ValueError):
    """Words of the command do not go together."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    parser.add_argument(
        "log",
        metavar="RUN",
        nargs="?",
        help="a log (.mcap), or what a killed run left (.mcap.partial); @3 is the third last recorded run, and "
        "without any it is the last",
    )
    add_runs(parser)
    parser.add_argument(
        "recovered", metavar="OUT", nargs="?", type=Path, help="with --recover: the clean log, a new file"
    )
    parser.add_argument(
        "--recover", action="store_true", help="write what is whole of a damaged log as a clean one: IN OUT"
    )
    parser.add_argument("--verify", action="store_true", help="execute the recorded plan again and compare")
    add_physics(parser)
    add_plot(parser, "draw the swept chain, its margins and the stable set")
    declare_exports(parser)


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.cli.steps import physics

    if args.recover != (args.recovered is not None):
        raise ReplayUsageError(
            "--recover needs two names, of the damaged log and of the new one; others take one"
        )
    args.log = log_meant(args.log, args.runs)
    check_outputs([args.log], args.plot, *outputs(args), log=args.recovered)
    with console.working(f"reading {args.log}"):
        runs = _read(args)
    if len(runs) > 1:
        from pushplan.cli.steps.errands import replay_errands

        return replay_errands(runs, args, console)
    recorded = runs[0]
    if args.physics:
        physics.require_executable(recorded.scenario)
    kept, recorded = recorded, _with_plan(recorded, console)
    _tell(recorded, console)
    if args.recover:
        console.say(f"{args.recovered}: a clean log of what is whole")
    report = tell_verification(_checked(kept, console), console) if args.verify else None
    found = physics.execute(recorded.scenario, recorded.plan, console) if args.physics else None
    write_exports(recorded, args, console)
    told = _document(recorded, report, args.recovered)
    if args.physics:
        told["physics"] = physics.document(found)
    console.emit(told)
    matches = (report is None or report.matches) and (found is None or found.kept)
    return DONE if matches else MISMATCH


def _read(args: argparse.Namespace) -> tuple[RecordedRun, ...]:
    if args.recover:
        from pushplan.logging.recover import recover

        return recover(args.log, args.recovered)
    from pushplan.logging.reader import read_runs

    return read_runs(args.log)


def _with_plan(recorded: RecordedRun, console: Console) -> RecordedRun:
    """Return a run that was cut off with the plan that its best path leads to; others as they are."""
    if recorded.plan is not None or recorded.best_path is None:
        return recorded
    with console.computing("timing and executing the best path"):
        from pushplan.logging.cut_off import with_best_path

        return with_best_path(recorded)


def _tell(recorded: RecordedRun, console: Console) -> None:
    from pushplan.cli.steps.report import headline, rows
    from pushplan.logging.view.summary import summary

    if recorded.plan is None:
        console.say(f"{console.paint(recorded.scenario.name, 'bold')}: the log ends before a plan")
        console.table(summary(recorded))
        return
    console.say(headline(recorded.scenario, recorded.plan, console))
    about = rows(recorded.scenario, recorded.plan, recorded.execution, recorded.path)
    console.table([*about, *summary(recorded)])


def _checked(recorded: RecordedRun, console: Console) -> VerifyReport:
    """Execute the recorded plan again and compare."""
    with console.computing("executing the recorded plan again"):
        from pushplan.logging.verify import VerifyReport, verify

        if recorded.feedback is None:
            return verify(recorded)
        from pushplan.sim.control.again import check_closed_loop

        return VerifyReport(tuple(check_closed_loop(recorded)))


def _document(
    recorded: RecordedRun, report: VerifyReport | None, recovered: Path | None
) -> dict[str, object]:
    from pushplan.cli.steps.report import document

    plan = recorded.plan
    about: dict[str, object] = {"scenario": recorded.scenario.name, "log": recorded.path}
    if plan is not None:
        about = document(recorded.scenario, plan, recorded.execution, recorded.path)
    return {
        **about,
        "outcome": recorded.outcome,
        "lost": recorded.losses,
        "recovered": recovered,
        "verification": None if report is None else verification(report),
    }
