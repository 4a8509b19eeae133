"""Writes a clean log from what is whole of a damaged one."""

from __future__ import annotations

import hashlib
from itertools import pairwise
from pathlib import Path

from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.messages.sentences import execution_sentence, plan_sentence
from pushplan.logging.old.reader import read_runs
from pushplan.logging.old.writer import RunLogWriter


def recover(source: Path | str, target: Path | str) -> tuple[RecordedRun, ...]:
    """Read what is whole of a log, write it as a new one, and return its runs.

    The new log has the metadata of the run as it was, and says in `pushplan.recovery` what was lost. Samples are
    numbered anew; at a gap their times leap. What viewers see is made anew from plan and execution.

    Raises:
        RunLogError: When too little is left of the log.
        OutputError: When the new one is there already or cannot be written.
    """
    runs = read_runs(source, recover=True)
    first, last = runs[0], runs[-1]
    with RunLogWriter.create(target, first.scenario, {}, _run_words(first), new=True) as log:
        for run, after in pairwise(runs):
            _write(run, log)
            log.follow(run.outcome, after.scenario, {}, _seconds(run), _run_words(after))
        _write(last, log)
        log.finish(last.outcome, _seconds(last))
    return runs


def _write(run: RecordedRun, log: RunLogWriter) -> None:
    for line in _others(run, begun=False):
        log.log(*line)
    for point in run.progress if run.plan is None else ():
        log.improved(point)
    if run.plan is not None:
        log.plan(run.plan)
    if run.execution is not None:
        log.execution(run.execution)
    for line in _others(run, begun=True):
        log.log(*line)
    lost = {f"lost_{k:04d}": loss for k, loss in enumerate(run.losses)}
    log.note(metadata.RECOVERY, {"from": run.path.name, **lost})


def _run_words(run: RecordedRun) -> dict[str, str]:
    """Return the metadata of the run as they were; of a lost scenario file the resolved one takes the place."""
    words = run.words.get(metadata.RUN) or metadata.run_words(run.scenario, {})
    return {**words, "scenario_sha256": hashlib.sha256(run.scenario.source).hexdigest()}


def _others(run: RecordedRun, begun: bool) -> list[tuple[str, str]]:
    """Return level and text of the lines before or behind the plan, but for those that writing it makes."""
    written = {
        *(() if run.plan is None else (plan_sentence(run.plan),)),
        *(() if run.execution is None else (execution_sentence(run.execution),)),
    }
    return [
        (line.level, line.text)
        for line in run.lines
        if line.text not in written and (line.time > 0.0) == begun
    ]


def _seconds(run: RecordedRun) -> dict[str, float]:
    """Return what the phases of the run took, as far as that is known."""
    effort = set(run.words.get(metadata.PLANNING, {}))
    words = run.words.get(metadata.RESULT, {})
    return {
        key.removesuffix("_s"): float(value)
        for key, value in words.items()
        if key.endswith("_s") and key not in effort
    }
