"""Run a suite of problems, planners and seeds, and write a report."""

from __future__ import annotations

import math
import re
import shlex
from collections import Counter
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, counted, span_text
from pushplan.cli.main import DONE, MISMATCH

if TYPE_CHECKING:
    from pushplan.bench.batch import Selection, Tally
    from pushplan.bench.results import Results
    from pushplan.bench.store import ResultsFolder
    from pushplan.bench.suite import Suite


def _shard(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[int, int]:
    """Return I and N of I/N."""
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", value or "1/1")
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise p.UsageError(f"--shard is '{value}'; allowed: I/N with I from 1 to N, such as 3/32")
    return int(found[1]), int(found[2])


@p.command
@click.argument("suite", type=p.PATH, metavar="[SUITE | merge DIR...]", required=False)
@click.argument("shards", type=p.PATH, metavar="", nargs=-1)
@click.option("-o", "--output", type=p.PATH, metavar="DIR", help="Folder of the results; created if missing.")
@click.option(
    "--jobs",
    type=p.number("number of jobs", 1, 1024, whole=True),
    metavar="N",
    help="Number of parallel runs (default 1: parallel runs slow one another down).",
)
@click.option("--scheduler", metavar="ADDRESS", help="Execute on a Dask cluster, e.g. tcp://HOST:8786.")
@click.option("--resume", is_flag=True, help="Execute the runs that are missing in DIR.")
@click.option(
    "--shard",
    callback=_shard,
    metavar="I/N",
    help="Execute only part I of N equal parts, each into its own DIR; `bench merge` combines them.",
)
@click.option(
    "--filter",
    "filters",
    metavar="FIELD=PATTERN",
    multiple=True,
    help="Execute only runs whose problem, planner, set or seed matches, e.g. problem=gap-*; can be repeated.",
)
@click.option("--rerun", metavar="KEY", default="", help="Repeat only the run with this key.")
@click.option("--accept-broken", is_flag=True, help="Exit code 0 even if runs crashed or exceeded a limit.")
@click.option("--compare", type=p.PATH, nargs=2, metavar="OLD NEW", help="Compare the results of two folders.")
@click.option(
    "--threshold",
    type=p.number("threshold", 0.0, 1000.0, {"%": 1.0}),
    metavar="PERCENT",
    default=5.0,
    show_default=True,
    help="With --compare: smallest deterioration that counts as a regression (exit code 4).",
)
@p.no_code_option
def bench(
    console: Console,
    suite: Path | None,
    shards: tuple[Path, ...],
    output: Path | None,
    jobs: int | None,
    scheduler: str | None,
    resume: bool,
    shard: tuple[int, int],
    filters: tuple[str, ...],
    rerun: str,
    accept_broken: bool,
    compare: tuple[Path, Path] | None,
    threshold: float,
    no_code: bool,
) -> int:
    """Run a suite of problems, planners and seeds, and write a report.

    SUITE is a file or a packaged suite. Without SUITE, the packaged suites are listed. `merge` combines the folders
    of all shards into one.
    """
    given: dict[str, object] = {
        "SUITE": suite,
        "-o": output,
        "--jobs": jobs,
        "--scheduler": scheduler,
        "--resume": resume,
        "--shard": shard[1] > 1,
        "--filter": filters,
        "--rerun": rerun,
        "--accept-broken": accept_broken,
    }
    if compare:
        _refuse("--compare", given, list(given))
        return _compare(*compare, 0.01 * threshold, console)
    if suite is None:
        return _list(console)
    merging = str(suite) == "merge"
    if merging and not shards:
        raise p.UsageError("name the folders of the shards: pushplan bench merge DIR... -o DIR")
    if shards and not merging:
        raise p.UsageError(f"'{shards[0]}' is one argument too many; only `bench merge` takes several folders")
    if output is None:
        raise p.UsageError(f"name a folder for the results: pushplan bench {suite} -o DIR")
    if merging:
        _refuse("merge", given, ["--jobs", "--scheduler", "--resume", "--shard", "--filter", "--rerun"])
        return _merge(output, shards, accept_broken, console)
    if rerun:
        _refuse("--rerun", given, ["--filter", "--resume", "--shard"])
    if scheduler is not None:
        _refuse("--scheduler (its workers set the number of parallel runs)", given, ["--jobs"])
    from pushplan.bench.batch import Selection

    selection = Selection(resume, filters, rerun, shard)
    with p.code_of(suite, console.note, no_code) as observer:
        with console.working(f"reading {suite}"):
            from pushplan.bench.store import package_version
            from pushplan.bench.suite import load_suite

            read = load_suite(str(suite))
            selection.of(read, package_version())  # refuses unknown runs before the folder is created
        for name in read.code:
            observer(name)
    words = ["pushplan", "bench", str(suite), "-o", str(output), "--resume"]
    words += ["--jobs", str(jobs)] if jobs else []
    words += ["--scheduler", scheduler] if scheduler else []
    words += ["--shard", f"{shard[0]}/{shard[1]}"] if shard[1] > 1 else []
    words += [word for text in filters for word in ("--filter", text)]
    return _bench(read, output, selection, jobs, scheduler, accept_broken, shlex.join(words), console)


def _refuse(word: str, given: dict[str, object], others: list[str]) -> None:
    """Refuse arguments that have no effect together with `word`."""
    some = [name for name in others if given[name]]
    if some:
        raise p.UsageError(f"{word} cannot be combined with {' and '.join(some)}; leave one of them out")


def _list(console: Console) -> int:
    from pushplan.bench.suite import suite_names, suite_text
    from pushplan.cli.more import first_comment

    about = {name: first_comment(suite_text(name)) for name in suite_names()}
    console.table(about.items())
    console.say("run one with: pushplan bench SUITE -o DIR")
    console.emit({"suites": about})
    return DONE


def _bench(
    suite: Suite,
    output: Path,
    selection: Selection,
    jobs: int | None,
    scheduler: str | None,
    accept_broken: bool,
    resumption: str,
    console: Console,
) -> int:
    from pushplan.bench.batch import run_suite
    from pushplan.bench.store import ResultsFolder

    folder = ResultsFolder(output)
    with folder.locked(p.overwriting()), ExitStack() as stack:
        try:
            with console.working("preparing"):
                from pushplan.bench.executor import cluster_engine, local_engine

                engine = stack.enter_context(
                    local_engine(jobs or 1, folder.scratch) if scheduler is None else cluster_engine(scheduler)
                )
            with console.working(suite.name) as progress:
                tally = run_suite(suite, folder, engine, selection, lambda now: progress.update(progress_text(now)))
        except KeyboardInterrupt:
            if folder.database.exists():
                console.note(f"stopped; continue with: {resumption}")
            raise
        before = f", {tally.before} done before" if tally.before else ""
        heading = f": {counted(tally.done, 'run')} in {span_text(tally.seconds)}{before}"
        results = _results_with_report(folder, console, with_report=selection.shard[1] == 1)
    return _report(results, folder, tally, heading, accept_broken, console)


def _merge(output: Path, shards: tuple[Path, ...], accept_broken: bool, console: Console) -> int:
    from pushplan.bench.batch import Tally, merge
    from pushplan.bench.results import MISSING
    from pushplan.bench.store import ResultsFolder

    folder = ResultsFolder(output)
    with folder.locked(p.overwriting()):
        with console.working("merging"):
            double = merge(folder, shards, p.overwriting())
        results = _results_with_report(folder, console)
    counts = Counter(results.runs.outcome)
    left = counts.pop(MISSING, 0)
    heading = f": {counted(counts.total(), 'run')} of {counted(len(shards), 'folder')}"
    heading += f", {left} without a result" if left else ""
    if double:
        console.note(f"{counted(double, 'result')} skipped: an earlier folder already has the run")
    return _report(results, folder, Tally(len(results.runs), 0, counts), heading, accept_broken, console)


def _results_with_report(folder: ResultsFolder, console: Console, with_report: bool = True) -> Results:
    """Return all results of a folder after their report and tables are written."""
    with console.working("writing the report"):
        from pushplan.bench.report import write_latex, write_report
        from pushplan.bench.results import read_results, write_tables

        results = read_results(folder.path)
        if with_report:
            write_tables(results, folder.path)
            write_latex(results, folder.path / "tables.tex")
            write_report(results, folder.report)
    return results


def _report(
    results: Results, folder: ResultsFolder, tally: Tally, heading: str, accept_broken: bool, console: Console
) -> int:
    """Print the outcomes of the runs and return the exit code."""
    from pushplan.bench.outcome import BROKEN, INVALID

    broken = results.runs[results.runs.outcome.isin(BROKEN)]  # in this session or before
    console.say((str(results.about["name"]), "bold"), heading)
    console.table([(outcome, str(count)) for outcome, count in tally.counts.items()], style="")
    if results.processors:
        text = f"the runs used different processors, so their times are not comparable: {results.processors}"
        console.note(f"warning: {text}")
    for first in broken.head(1).itertuples():
        console.say(
            f"{counted(len(broken), 'run')} crashed or exceeded a limit (--accept-broken accepts this); first:"
        )
        why = (first.message or first.outcome).rstrip().rpartition("\n")[2]
        console.say(f"  {first.problem}, {first.planner}, seed {first.seed}: {why}")
    report = folder.report if folder.report.exists() else None
    console.say(f"report: {report}" if report else f"results: {folder.path}; after all shards: pushplan bench merge")
    console.emit(
        {
            "suite": results.about["name"],
            "runs": tally.total,
            "before": tally.before,
            "done": tally.done,
            "left": tally.left,
            "outcomes": tally.counts,
            "broken": len(broken),
            "seconds": tally.seconds,
            "folder": folder.path,
            "database": folder.database,
            "report": report,
            "processors": results.processors,
        }
    )
    failed = (results.runs.outcome == INVALID).any() or (len(broken) and not accept_broken)
    return MISMATCH if failed else DONE


def _compare(old: Path, new: Path, threshold: float, console: Console) -> int:
    from pushplan.bench.report import effect_text
    from pushplan.bench.results import read_results
    from pushplan.bench.statistics import compare_versions

    found = compare_versions(read_results(old), read_results(new), threshold)
    for style, word, comparisons in (("green", "better", found.better), ("red", "worse", found.worse)):
        for one in comparisons:
            what = f"{one.first}, {one.respect}: {effect_text(one)} in {one.pairs} runs (p = {one.p:.2g})"
            console.say((word, style), f": {what}")
    for run in found.newly_invalid.itertuples():
        text = f"{run.problem}, {run.planner}, seed {run.seed}: {run.message.partition(chr(10))[0]}"
        console.say(("newly invalid", "red"), f": {text}")
    if not (found.better or found.worse or len(found.newly_invalid)):
        console.say("no significant change")
    elif found.is_regression:
        console.say(f"regression: worse by more than {100.0 * threshold:g} %, or newly invalid")
    else:
        console.say(f"no regression: nothing is worse by more than {100.0 * threshold:g} %")
    rows = [
        {
            **asdict(one),
            "effect": one.effect if math.isfinite(one.effect) else None,  # infinite if most runs are no longer solved
            "significant": one.significant,
            "better": one.second_is_better,
        }
        for one in found.comparisons
    ]
    console.emit(
        {
            "regression": found.is_regression,
            "threshold": threshold,
            "comparisons": rows,
            "newly_invalid": list(found.newly_invalid.key),
        }
    )
    return MISMATCH if found.is_regression else DONE


def progress_text(tally: Tally) -> str:
    """Return the progress of a benchmark as text."""
    parts = [f"{tally.before + tally.done} of {tally.total} done", f"{tally.solved} solved"]
    if tally.failed:
        parts.append(f"{tally.failed} failed")
    parts.append(f"{tally.left} left")
    if tally.to_end:
        parts.append(f"about {span_text(tally.to_end)} to go")
    return ", ".join(parts)
