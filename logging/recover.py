"""Writes a clean log from what is whole of a damaged one, or of one that was cut off."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pushplan.logging.metadata as metadata
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.topics import lines_of
from pushplan.logging.writer import RunLogWriter


def recover(source: Path | str, target: Path | str) -> RecordedRun:
    """Read what is whole of a log, write it as a new one, and return its run.

    The new log has the metadata of the run as it was, and says in `pushplan.recovery` what was lost; the messages are
    made again.

    Raises:
        RunLogError: When too little is left of the log.
        OutputError: When the new one is there already or cannot be written.
    """
    run = load_run(source, recover=True)
    with RunLogWriter.create(target, run.scenario, {}, _run_words(run), new=True) as log:
        _write(run, log)
        log.finish(run.outcome, _seconds(run))
    return run


def _write(run: RecordedRun, log: RunLogWriter) -> None:
    lost = {f"lost_{k:04d}": loss for k, loss in enumerate(run.losses)}
    log.note(metadata.RECOVERY, {"from": run.path.name, **lost})
    for name, words in run.fields.items():
        if name not in _WRITTEN and not name.startswith(metadata.PROGRESS):
            log.note(name, words)
    for point in run.improvements:
        log.improved(point)
    if run.plan is not None:
        log.plan(run.plan)
    if run.execution is not None and run.feedback is not None:
        log.closed_loop(run.execution, run.feedback)
    elif run.execution is not None:
        log.execution(run.execution)
    for end in run.trials:
        log.trial(end)
    follow = set(lines_of(run.scenario, run.plan, run.execution, run.feedback, ()))
    for line in run.lines:
        if line not in follow:
            log.line(line)


_WRITTEN = (metadata.RUN, metadata.PLANNING, metadata.RESULT, metadata.RECOVERY)


def _run_words(run: RecordedRun) -> dict[str, str]:
    """Return the metadata of the run as they were; of a lost scenario file the resolved one takes the place."""
    words = run.fields.get(metadata.RUN) or metadata.run_words(run.scenario, {})
    return {**words, "scenario_sha256": hashlib.sha256(run.scenario.source).hexdigest()}


def _seconds(run: RecordedRun) -> dict[str, float]:
    """Return what the phases of the run took, as far as that is known."""
    effort = set(run.fields.get(metadata.PLANNING, {}))
    words = run.fields.get(metadata.RESULT, {})
    return {
        key.removesuffix("_s"): float(value)
        for key, value in words.items()
        if key.endswith("_s") and key not in effort
    }
