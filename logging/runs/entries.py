"""The runs of a folder as `pushplan runs` lists them, told by their logs' metadata alone."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from datetime import datetime
from fnmatch import fnmatchcase
from pathlib import Path

from pushplan.errors import PushplanError
from pushplan.logging.mcap.cursor import DamageError
from pushplan.logging.mcap.words import metadata_words
from pushplan.logging.messages.seal import unsealed
from pushplan.logging.runs.folder import recorded_logs
from pushplan.logging.runs.retention import is_being_written

RUNNING, CUT_OFF, DAMAGED = "running", "cut off", "damaged"
"""Outcomes that no log states."""

RESULT = "pushplan.result"
"""As in `messages.metadata`, which takes long to load."""

FILTERS = ("outcome", "scenario", "planner", "set", "seed")


class RunsError(PushplanError, ValueError):
    """No recorded run is meant by what was written."""


@dataclass(frozen=True)
class RunEntry:
    """A recorded run.

    Attributes:
        number: 1 for the last run, 2 for the one before, ...; None while it is being written.
        path: Its log.
        outcome: How it ended, `running`, `cut off` or `damaged`.
        scenario: Name of the scenario.
        planner: Name of the planner; empty where the log does not say, here as below.
        set: Name of the stable set.
        seed: In words.
        cost: Of its path, m; None without one.
        started: When it began.
        size: Of the log, bytes.
    """

    number: int | None
    path: Path
    outcome: str
    scenario: str
    planner: str
    set: str
    seed: str
    cost: float | None
    started: datetime | None
    size: int


def runs_of(folder: Path) -> list[RunEntry]:
    """Return the runs recorded in a folder, the last one first.

    Raises:
        RunsError: When the folder cannot be read.
    """
    try:
        logs = [(log, log.stat().st_size) for log in reversed(recorded_logs(folder))]
    except OSError as error:
        raise RunsError(f"{folder}: cannot read the recorded runs: {error.strerror}") from error
    found: list[RunEntry] = []
    number = 0
    for log, size in logs:
        running = log.name.endswith(".partial") and is_being_written(log.path)
        number += not running
        found.append(_entry(None if running else number, log, size))
    return found


def run_numbered(folder: Path, number: int) -> Path:
    """Return the log of the last run (1), the one before (2), ...

    Raises:
        RunsError: When there are not so many.
    """
    runs = [log for log in reversed(recorded_logs(folder)) if not _is_running(log)]
    if not 1 <= number <= len(runs):
        raise RunsError(
            f"{folder}: there is no run @{number}; {len(runs)} are recorded, the last one is @1"
            if runs
            else f"{folder}: no run is recorded here yet"
        )
    return Path(runs[number - 1].path)


def _is_running(log: os.DirEntry[str]) -> bool:
    return log.name.endswith(".partial") and is_being_written(log.path)


def chosen(runs: list[RunEntry], filters: list[str]) -> list[RunEntry]:
    """Return the runs that fit all texts FIELD=PATTERN, where `*` stands for anything.

    Raises:
        RunsError: When one is written wrongly.
    """
    for text in filters:
        field, sign, pattern = text.partition("=")
        if not sign or field not in FILTERS:
            raise RunsError(
                f"'{text}' is no filter; allowed: FIELD=PATTERN, FIELD one of {', '.join(FILTERS)}"
            )
        runs = [run for run in runs if fnmatchcase(getattr(run, field), pattern)]
    return runs


def _entry(number: int | None, log: os.DirEntry[str], size: int) -> RunEntry:
    words: dict[str, str] = {}
    costs: list[float] = []
    outcome = RUNNING if number is None else CUT_OFF
    try:
        for name, group in metadata_words(Path(log.path)):
            if name == RESULT:
                words.pop("path_cost", None)  # of an improvement: the result has the last word
            if name.startswith("pushplan."):
                words |= {key: value for key, value in unsealed(group).items() if key in _WORDS}
            if name == RESULT and "path_cost" in words:
                costs.append(
                    _number(words["path_cost"]) or 0.0
                )  # of errands that follow one another each has one
    except (DamageError, OSError, ValueError):
        outcome = DAMAGED
    texts = {field: words.get(field, "") for field in ("scenario", "planner", "set", "seed")}
    return RunEntry(
        number=number,
        path=Path(log.path),
        outcome=words.get("outcome", outcome),
        cost=sum(costs) if costs else _number(words.get("path_cost", "")),
        started=_time(words.get("started_at", "")),
        size=size,
        **texts,
    )


_WORDS = {*(field.name for field in fields(RunEntry)), "path_cost", "started_at"}


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _time(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None
