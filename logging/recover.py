"""Writes a clean log from what is whole of a damaged one."""

from __future__ import annotations

import hashlib
from pathlib import Path

from pushplan.logging.messages import metadata
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.messages.sentences import execution_sentence, plan_sentence
from pushplan.logging.reader import read_run
from pushplan.logging.writer import RunLogWriter


def recover(source: Path | str, target: Path | str) -> RecordedRun:
    """Read what is whole of a log, write it as a new one, and return it.

    The new log has the metadata of the run as it was, and says in `pushplan.recovery` what was lost. Samples are
    numbered anew; at a gap their times leap. What viewers see is made anew from plan and execution.

    Raises:
        RunLogError: When too little is left of the log.
        OutputError: When the new one is there already or cannot be written.
    """
    run = read_run(source, recover=True)
    _write(run, target)
    return run


def _write(run: RecordedRun, path: Path | str) -> None:
    with RunLogWriter.create(path, run.scenario, {}, _run_words(run), new=True) as log:
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
        log.finish(run.outcome, _seconds(run))


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
