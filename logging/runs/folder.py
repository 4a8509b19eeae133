"""Where runs are recorded, and what their logs are called there."""

from __future__ import annotations

import os
import re
from datetime import UTC, datetime
from pathlib import Path

from pushplan.errors import OutputError

FOLDER = "PUSHPLAN_RUNS"
"""Names the folder in the environment."""

_NAME = re.compile(r"\d{8}T\d{6}\.\d{3}Z-[\w.+-]+-seed-?\d+(-\d+)?\.mcap(\.partial)?", re.ASCII)


def runs_folder(asked: Path | str | None = None) -> Path:
    """Return the folder of the runs, whether it is there or not.

    That is `asked`, else $PUSHPLAN_RUNS, else `pushplan/runs` in $XDG_STATE_HOME or in ~/.local/state.

    Raises:
        OutputError: When the user has no home.
    """
    if asked or os.environ.get(FOLDER):
        return Path(asked or os.environ[FOLDER])
    state = os.environ.get("XDG_STATE_HOME", "")
    if os.path.isabs(state):  # the specification: others are to be ignored
        return Path(state, "pushplan", "runs")
    try:
        return Path.home() / ".local" / "state" / "pushplan" / "runs"
    except RuntimeError as error:
        raise OutputError("~", f"there is no home folder; set {FOLDER}") from error


def new_log(folder: Path, scenario: str, seed: int) -> Path:
    """Return a name for the log of a run that begins now; names in the order of time are in alphabetical order.

    Raises:
        OutputError: When the folder is not there and cannot be made.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(str(folder), f"cannot make this folder: {error.strerror}") from error
    now = datetime.now(UTC)
    plain = re.sub(r"[^\w.+-]+", "_", scenario, flags=re.ASCII)[:64] or "_"
    stem = f"{now:%Y%m%dT%H%M%S}.{now.microsecond // 1000:03d}Z-{plain}-seed{seed}"
    tried = 1
    path = folder / f"{stem}.mcap"
    while os.path.lexists(path) or os.path.lexists(f"{path}.partial"):
        tried += 1
        path = folder / f"{stem}-{tried}.mcap"
    return path


def recorded_logs(folder: Path) -> list[os.DirEntry[str]]:
    """Return the logs that were recorded in a folder, oldest first; other files are none of ours.

    Raises:
        OSError: When the folder is there but cannot be read.
    """
    try:
        with os.scandir(folder) as entries:
            found = [
                entry
                for entry in entries
                if _NAME.fullmatch(entry.name) and entry.is_file(follow_symlinks=False)
            ]
    except FileNotFoundError:
        return []
    return sorted(found, key=lambda entry: entry.name)
