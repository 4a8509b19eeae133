"""The folder of recorded runs: logs named by their time, a list of them, and a size limit."""

from __future__ import annotations

import contextlib
import os
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from math import isfinite
from pathlib import Path

from pushplan.errors import OutputError, PushplanError
from pushplan.logging.mcap_file import DamageError, metadata_of
from pushplan.util.files import PARTIAL, is_being_written

FOLDER, MEGABYTES = "PUSHPLAN_RUNS", "PUSHPLAN_RUNS_MB"
"""Environment variables with the folder and its size limit, MB."""

_MEGABYTES = 1000.0
"""Default size limit of the folder, MB."""

RUNNING, CUT_OFF, DAMAGED = "running", "cut off", "damaged"
"""Outcomes that are not written in a log."""

FILTERS = ("outcome", "scenario", "planner", "set", "seed")

_RESULT = "pushplan.result"  # as in `metadata`, which is slow to import

_NAME = re.compile(r"\d{8}T\d{6}\.\d{3}Z-[\w.+-]+-seed-?\d+(-\d+)?\.mcap(\.partial)?", re.ASCII)


class RunsError(PushplanError, ValueError):
    """A reference names no recorded run."""


def runs_folder(asked: Path | str | None = None) -> Path:
    """Return the folder of the runs, even if it does not exist.

    It is `asked`, else $PUSHPLAN_RUNS, else `pushplan/runs` in $XDG_STATE_HOME or in ~/.local/state.

    Raises:
        OutputError: If the user has no home folder.
    """
    if asked or os.environ.get(FOLDER):
        return Path(asked or os.environ[FOLDER])
    state = os.environ.get("XDG_STATE_HOME", "")
    if os.path.isabs(state):  # the XDG specification ignores relative paths
        return Path(state, "pushplan", "runs")
    try:
        return Path.home() / ".local" / "state" / "pushplan" / "runs"
    except RuntimeError as error:
        raise OutputError("~", f"there is no home folder; set {FOLDER}") from error


def new_log(folder: Path, scenario: str, seed: int) -> Path:
    """Return a path for the log of a run that begins now; the alphabetical order of the names is that of time.

    Raises:
        OutputError: If the folder cannot be created.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(str(folder), f"cannot create this folder: {error.strerror}") from error
    now = datetime.now(UTC)
    plain = re.sub(r"[^\w.+-]+", "_", scenario, flags=re.ASCII)[:64] or "_"
    stem = f"{now:%Y%m%dT%H%M%S}.{now.microsecond // 1000:03d}Z-{plain}-seed{seed}"
    tried = 1
    path = folder / f"{stem}.mcap"
    while os.path.lexists(path) or os.path.lexists(f"{path}{PARTIAL}"):
        tried += 1
        path = folder / f"{stem}-{tried}.mcap"
    return path


def recorded_logs(folder: Path) -> list[os.DirEntry[str]]:
    """Return the recorded logs in a folder, oldest first; other files and links are ignored.

    Raises:
        OSError: If the folder exists but cannot be read.
    """
    try:
        with os.scandir(folder) as entries:
            found = [
                entry for entry in entries if _NAME.fullmatch(entry.name) and entry.is_file(follow_symlinks=False)
            ]
    except FileNotFoundError:
        return []
    return sorted(found, key=lambda entry: entry.name)


def prune(folder: Path, newest: Path) -> None:
    """Remove the oldest runs beyond the size limit, but never `newest` or a run that is being written.

    Raises:
        OutputError: If the folder cannot be read or written, or the limit in the environment is invalid.
    """
    stated, size = os.environ.get(MEGABYTES, ""), 0
    cap = number_in(stated) if stated else _MEGABYTES
    if cap is None or not (isfinite(cap) and cap > 0.0):
        raise OutputError(MEGABYTES, f"'{stated}' is not a size limit; it must be a number of MB above 0")
    try:
        for entry in reversed(recorded_logs(folder)):
            size += entry.stat(follow_symlinks=False).st_size
            if size > 1e6 * cap and entry.name != newest.name and not _is_running(entry):
                os.unlink(entry.path)
    except OSError as error:
        raise OutputError(str(folder), f"cannot remove old runs: {error.strerror}") from error


def _is_running(log: os.DirEntry[str]) -> bool:
    return log.name.endswith(PARTIAL) and is_being_written(log.path)


@dataclass(frozen=True)
class RunEntry:
    """A recorded run; texts are empty if the log does not have them.

    Attributes:
        number: 1 for the last run, 2 for the one before, ...; None while it is being written.
        path: Path of its log.
        outcome: Outcome of the run: how it ended, or `running`, `cut off` or `damaged`.
        scenario: Name of the scenario.
        planner: Name of the planner.
        set: Name of the stable set.
        seed: Seed, as text.
        cost: Cost of its path, m; None without one.
        started: Start time; None if unknown.
        size: Size of the log, bytes.
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
    """Return the recorded runs in a folder, the last one first.

    Raises:
        RunsError: If the folder cannot be read.
    """
    try:
        logs = [(log, log.stat().st_size) for log in reversed(recorded_logs(folder))]
    except OSError as error:
        raise RunsError(f"{folder}: cannot read the recorded runs: {error.strerror}") from error
    found: list[RunEntry] = []
    number = 0
    for log, size in logs:
        running = _is_running(log)
        number += not running
        found.append(_entry(None if running else number, log, size))
    return found


def run_numbered(folder: Path, number: int) -> Path:
    """Return the log of the last run (1), the one before (2), ...

    Raises:
        RunsError: If there are fewer runs.
    """
    runs = [log for log in reversed(recorded_logs(folder)) if not _is_running(log)]
    if not 1 <= number <= len(runs):
        raise RunsError(
            f"{folder}: there is no run @{number}; {len(runs)} are recorded, the latest one is @1"
            if runs
            else f"{folder}: no run is recorded here yet"
        )
    return Path(runs[number - 1].path)


def chosen(runs: list[RunEntry], filters: list[str]) -> list[RunEntry]:
    """Return the runs that match all filters FIELD=PATTERN, where `*` matches any text.

    Raises:
        RunsError: If a filter is invalid.
    """
    for text in filters:
        field, sign, pattern = text.partition("=")
        if not sign or field not in FILTERS:
            raise RunsError(f"'{text}' is not a filter; allowed: FIELD=PATTERN, FIELD one of {', '.join(FILTERS)}")
        runs = [run for run in runs if fnmatchcase(getattr(run, field), pattern)]
    return runs


def _entry(number: int | None, log: os.DirEntry[str], size: int) -> RunEntry:
    words, started = dict[str, str](), None
    outcome = RUNNING if number is None else CUT_OFF
    try:
        for name, group in metadata_of(Path(log.path)):
            if name == _RESULT:
                words.pop("path_cost", None)  # drop the cost of an improvement: only that of the result counts
            if name.startswith("pushplan."):
                words |= group
    except (DamageError, OSError, ValueError):
        outcome = DAMAGED
    with contextlib.suppress(ValueError):
        started = datetime.fromisoformat(words.get("started_at", ""))
    return RunEntry(
        number=number,
        path=Path(log.path),
        cost=number_in(words.get("path_cost", "")),
        started=started,
        size=size,
        **dict.fromkeys(FILTERS, "") | {"outcome": outcome} | {key: words[key] for key in FILTERS if key in words},
    )


def number_in(text: str) -> float | None:
    """Return the number in a text; None if it is not a number."""
    try:
        return float(text)
    except ValueError:
        return None
