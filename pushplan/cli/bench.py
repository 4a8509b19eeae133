"""Run a suite of problems, planners and seeds, and report what came out."""

from __future__ import annotations

import argparse
import os
import shlex
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, MISMATCH
from pushplan.cli.terminal.numbers import counted
from pushplan.errors import PushplanError

if TYPE_CHECKING:
    from pushplan.bench.batch import Selection, Tally
    from pushplan.bench.store import Results, ResultsFolder
    from pushplan.bench.suite import Suite


class BenchUsageError(PushplanError, ValueError):
    """Words of the command do not go together."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    add = parser.add_argument
    add("suite", metavar="SUITE", nargs="?", help="a file, or a packaged suite; without it those are listed")
    add("-o", "--output", metavar="DIR", type=Path, help="folder of the results, may be new")
    add(
        "--jobs",
        metavar="N",
        type=_count,
        help="runs at a time (default 1: they disturb one another)",
    )
    add("--scheduler", metavar="ADDRESS", help="do the runs on a Dask cluster, e.g. tcp://HOST:8786")
    add("--resume", action="store_true", help="do what is missing in DIR")
    add(
        "--filter",
        metavar="FIELD=PATTERN",
        action="append",
        default=[],
        help="only runs whose problem, planner, set or seed fits, e.g. problem=gap-*; may be repeated",
    )
    add("--rerun", metavar="KEY", default="", help="do the run with this key again, and only that")
    add(
        "--accept-broken",
        action="store_true",
        help="exit code 0 also when runs crashed, took too much time or memory, or ended with an error",
    )
    add(
        "--compare",
        nargs=2,
        metavar=("OLD", "NEW"),
        type=Path,
        help="tell what two folders' results differ in",
    )
    add(
        "--threshold",
        metavar="PERCENT",
        type=_percent,
        default=0.05,
        help="with --compare: change for the worse that counts as a regression, exit code 4 (default 5)",
    )


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    if args.compare is not None:
        from pushplan.cli.steps.bench_compare import compare

        _refuse_together(
            args,
            "--compare",
            ("suite", "output", "jobs", "scheduler", "resume", "filter", "rerun", "accept_broken"),
        )
        old, new = args.compare
        return compare(old, new, args.threshold, console)
    if args.suite is None:
        return _list(console)
    if args.output is None:
        raise BenchUsageError(f"name a folder for the results: pushplan bench {args.suite} -o DIR")
    return _bench(args, console)


def _refuse_together(args: argparse.Namespace, word: str, others: tuple[str, ...]) -> None:
    """Raise when words were given that `word` would leave without effect."""
    given = [
        name if name == "suite" else f"--{name.replace('_', '-')}" for name in others if getattr(args, name)
    ]
    if given:
        raise BenchUsageError(
            f"{word} does not go together with {' and '.join(given)}; leave one of them out"
        )


def _list(console: Console) -> int:
    from pushplan.bench.suite import suite_names, suite_text
    from pushplan.cli.examples import first_comment

    about = {name: first_comment(suite_text(name)) for name in suite_names()}
    console.table(about.items())
    console.say("run one with: pushplan bench SUITE -o DIR")
    console.emit({"suites": about})
    return DONE


def _bench(args: argparse.Namespace, console: Console) -> int:
    if args.rerun:
        _refuse_together(args, "--rerun", ("filter", "resume"))
    if args.scheduler is not None:
        _refuse_together(
            args, "--scheduler, which does as many runs at a time as its workers can,", ("jobs",)
        )
    with console.working(f"reading {args.suite}"):
        from pushplan.bench.batch import Selection
        from pushplan.bench.machine import package_version
        from pushplan.bench.store import ResultsFolder
        from pushplan.bench.suite import load_suite

        suite = load_suite(args.suite)
    choice = Selection(args.resume, tuple(args.filter), args.rerun)
    choice.of(suite, package_version())  # before a folder is made and all is compiled
    folder = ResultsFolder(args.output)
    with folder.locked():
        try:
            tally = _run(args, suite, choice, folder, console)
        except KeyboardInterrupt:
            if folder.database.exists():
                console.note(f"stopped; go on with: {_resumption(args)}")
            raise
        results = _report(folder, console)
    from pushplan.bench.outcome import BROKEN, INVALID

    ends = Counter(results.runs.outcome)  # now or before
    broken = sum(ends[end] for end in BROKEN)
    _tell(suite, folder, tally, broken, console)
    return MISMATCH if ends[INVALID] or (broken and not args.accept_broken) else DONE


def _resumption(args: argparse.Namespace) -> str:
    """Return the command that does what is missing."""
    words = ["pushplan", "bench", args.suite, "-o", str(args.output), "--resume"]
    words += ["--jobs", str(args.jobs)] if args.jobs else []
    words += ["--scheduler", args.scheduler] if args.scheduler else []
    words += [word for text in args.filter for word in ("--filter", text)]
    return shlex.join(words)


def _run(
    args: argparse.Namespace, suite: Suite, choice: Selection, folder: ResultsFolder, console: Console
) -> Tally:
    from pushplan.bench.batch import run_suite

    with ExitStack() as stack:
        with console.working("preparing, which compiles the first time"):
            if args.scheduler is not None:
                from pushplan.bench.executor import cluster_engine

                engine = stack.enter_context(cluster_engine(args.scheduler))
            else:
                from pushplan.bench.executor import local_engine

                engine = stack.enter_context(local_engine(args.jobs or 1, folder.scratch))
        progress = stack.enter_context(console.working(suite.name))
        return run_suite(suite, folder, engine, choice, lambda tally: progress.tell(progress_text(tally)))


def _report(folder: ResultsFolder, console: Console) -> Results:
    with console.working("writing the report"):
        from pushplan.bench.report import write_report
        from pushplan.bench.store import read_results, write_tables

        results = read_results(folder.path)
        write_tables(results, folder.path)
        write_report(results, folder.report)
    return results


def _tell(suite: Suite, folder: ResultsFolder, tally: Tally, broken: int, console: Console) -> None:
    state = f"{counted(tally.done, 'run')} in {time_left(tally.seconds)}"
    before = f", {tally.before} done before" if tally.before else ""
    console.say(f"{console.paint(suite.name, 'bold')}: {state}{before}")
    colours = {"ok": "green", "no plan": "yellow"}
    console.table(
        (console.paint(outcome, colours.get(outcome, "red")), str(count))
        for outcome, count in tally.counts.items()
    )
    if broken:
        console.say(f"{counted(broken, 'run')} broke off, which --accept-broken would take for done")
    console.say(f"report: {folder.report}")
    console.emit(
        {
            "suite": suite.name,
            "runs": tally.total,
            "before": tally.before,
            "done": tally.done,
            "left": tally.left,
            "outcomes": tally.counts,
            "broken": broken,
            "seconds": tally.seconds,
            "folder": folder.path,
            "database": folder.database,
            "report": folder.report,
        }
    )


def progress_text(tally: Tally) -> str:
    """Return how far a benchmark has come."""
    parts = [f"{tally.before + tally.done} of {tally.total} done", f"{tally.solved} solved"]
    if tally.failed:
        parts.append(f"{tally.failed} failed")
    parts.append(f"{tally.left} left")
    if tally.to_end:
        parts.append(f"about {time_left(tally.to_end)} to go")
    return ", ".join(parts)


def time_left(seconds: float) -> str:
    """Return a time in the unit that people would choose."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _count(text: str) -> int:
    value = int(text)
    if not 1 <= value <= 1024:
        raise argparse.ArgumentTypeError(
            f"{text} is no number of jobs; this machine has {os.cpu_count()} processors"
        )
    return value


def _percent(text: str) -> float:
    value = float(text.removesuffix("%"))
    if not 0.0 <= value <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text} is no threshold; it must be a percentage from 0 to 1000")
    return value / 100.0
