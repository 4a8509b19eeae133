"""List the recorded runs, the last one first."""

from __future__ import annotations

import argparse
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE
from pushplan.cli.terminal.numbers import counted
from pushplan.cli.terminal.options import add_runs, count

if TYPE_CHECKING:
    from pushplan.logging.runs import RunEntry

_COLOURS = {"solved": "green", "running": "yellow", "unsolved": "yellow"}
_HEAD = ("", "outcome", "scenario", "planner", "set", "seed", "cost", "age", "size")


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    add_runs(parser)
    parser.add_argument("--last", metavar="N", type=count, help="only the last N of them")
    parser.add_argument(
        "--filter",
        metavar="FIELD=PATTERN",
        action="append",
        default=[],
        help="only runs whose outcome, scenario, planner, set or seed fits, e.g. scenario=two-*; may be repeated",
    )


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.logging.runs import chosen, runs_folder, runs_of

    folder = runs_folder(args.runs)
    every = runs_of(folder)
    found = chosen(every, args.filter)[: args.last]
    now = datetime.now(UTC)
    _tell(found, now, console)
    if len(found) < len(every):
        console.say(f"{len(found)} of {counted(len(every), 'run')} in {folder}")
    else:
        console.say(f"{counted(len(every), 'run')} in {folder}")
    console.emit({"folder": folder, "runs": [_document(one, now) for one in found]})
    return DONE


def _tell(found: list[RunEntry], now: datetime, console: Console) -> None:
    if not found:
        return
    rows = [_HEAD, *(_row(one, now) for one in found)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_HEAD))]
    for k, row in enumerate(rows):
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True)]
        if k == 0:
            console.say(console.paint("  ".join(cells).rstrip(), "dim"))
        else:
            cells[1] = console.paint(cells[1], _COLOURS.get(found[k - 1].outcome, "red"))
            console.say("  ".join(cells).rstrip())


def _row(one: RunEntry, now: datetime) -> tuple[str, ...]:
    cost = "" if one.cost is None else f"{one.cost:.3f} m"
    age = "" if one.started is None else age_text((now - one.started).total_seconds())
    number = "" if one.number is None else f"@{one.number}"
    about = (one.scenario, one.planner, one.set, one.seed)
    return (number, one.outcome, *about, cost, age, f"{one.size / 1000:.0f} KB")


def age_text(seconds: float) -> str:
    """Return how long ago something was, in the unit that people would choose."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{max(seconds, 0.0):.0f} s"


def _document(one: RunEntry, now: datetime) -> dict[str, object]:
    return {
        "number": one.number,
        "log": one.path,
        "outcome": one.outcome,
        "scenario": one.scenario,
        "planner": one.planner,
        "set": one.set,
        "seed": int(one.seed) if one.seed.lstrip("-").isdigit() else None,
        "path_cost": one.cost,
        "started_at": None if one.started is None else one.started.isoformat(),
        "age_s": None if one.started is None else (now - one.started).total_seconds(),
        "bytes": one.size,
    }


def log_meant(word: str | None, runs: Path | None) -> str:
    """Return the log that a user means by a file, `@3` for the third last run, or nothing for the last one."""
    if word is not None and not word.startswith("@"):
        return word
    from pushplan.logging.runs import RunsError, run_numbered, runs_folder

    if word is not None and not (word[1:].isascii() and word[1:].isdigit()):
        if os.path.lexists(word):
            return word
        raise RunsError(f"{word} is neither a file nor a recorded run; the last run is @1, the one before @2")
    return str(run_numbered(runs_folder(runs), 1 if word is None else int(word[1:])))
