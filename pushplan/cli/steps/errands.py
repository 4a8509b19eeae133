"""Read a log of several errands back: show them, verify them, export them as one."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pushplan.cli.steps import physics
from pushplan.cli.steps.exports import asked_for, write_exports
from pushplan.cli.steps.report import document, segment_rows
from pushplan.cli.steps.verification import tell_verification, verification
from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, MISMATCH
from pushplan.cli.terminal.numbers import time_text
from pushplan.errors import RunLogError

if TYPE_CHECKING:
    from pushplan.logging.messages.recorded import RecordedRun
    from pushplan.logging.verify import VerifyReport


def replay_errands(runs: Sequence[RecordedRun], args: argparse.Namespace, console: Console) -> int:
    """Carry out `replay` for a log of errands that follow one another; return the exit code."""
    from pushplan.logging.view.summary import summary

    first = runs[0]
    if args.physics:
        physics.require_executable(first.scenario)
    console.say(f"{console.paint(first.scenario.name, 'bold')}  (several objects)")
    for k, run in enumerate(runs, start=1):
        console.say(_headline(run, k))
        console.table([] if run.plan is None else segment_rows(run.plan))
    console.table([("log", str(first.path)), *summary(runs[-1])])
    if args.recover:
        console.say(f"{args.recovered}: a clean log of what is whole")
    report = tell_verification(_checked(runs, console), console) if args.verify else None
    found = [physics.execute(run.scenario, run.plan, console) for run in runs if args.physics]
    if args.plot is not None or asked_for(args):
        _show(runs, args, console)
    told = {
        "scenario": first.scenario.name,
        "log": first.path,
        "errands": [_document(run) for run in runs],
        "outcome": runs[-1].outcome,
        "lost": first.losses,
        "recovered": args.recovered,
        "verification": None if report is None else verification(report),
    }
    if args.physics:
        told["physics"] = [physics.document(one) for one in found]
    console.emit(told)
    matches = (report is None or report.matches) and all(one is None or one.kept for one in found)
    return DONE if matches else MISMATCH


def _headline(run: RecordedRun, number: int) -> str:
    from pushplan.logging.errands import aim_of, errand_of

    began = time_text(1e-9 * run.began) if run.began else "the beginning"
    return f"errand {number}: {errand_of(run)} {aim_of(run)}, from {began} on"


def _checked(runs: Sequence[RecordedRun], console: Console) -> VerifyReport:
    """Execute every errand again and compare, and compare where one ends with where the next begins."""
    with console.computing("executing the recorded plans again"):
        from pushplan.logging.errands import check_errands
        from pushplan.logging.verify import VerifyReport, verify

        own = [
            replace(check, quantity=f"errand {k}: {check.quantity}")
            for k, run in enumerate(runs, start=1)
            for check in verify(run).checks
        ]
        return VerifyReport((*own, *check_errands(runs)))


def _show(runs: Sequence[RecordedRun], args: argparse.Namespace, console: Console) -> None:
    """Write the files asked for of all errands as one run.

    Raises:
        RunLogError: When nothing was executed.
    """
    from pushplan.logging.joined import joined

    executed = [run for run in runs if run.plan is not None and run.execution is not None]
    if not executed:
        raise RunLogError(str(runs[0].path), "nothing was executed, so there is nothing to show")
    whole = joined(executed)
    write_exports(whole, args, console)


def _document(run: RecordedRun) -> dict[str, object]:
    from pushplan.logging.errands import delivers, errand_of

    about = {"object": errand_of(run), "delivers": delivers(run), "began": 1e-9 * run.began}
    if run.plan is None:
        return about
    return {**about, **document(run.scenario, run.plan, run.execution, run.path), "outcome": run.outcome}
