"""List the recorded runs, the last one first."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, counted

if TYPE_CHECKING:
    from pushplan.logging.runs import RunEntry

_HEAD = ("", "outcome", "scenario", "planner", "set", "seed", "cost", "age", "size")


@p.command
@p.runs_option
@click.option("--last", type=p.COUNT, metavar="N", help="Only the last N of them.")
@click.option(
    "--filter",
    "filters",
    metavar="FIELD=PATTERN",
    multiple=True,
    help="Only runs whose outcome, scenario, planner, set or seed fits, e.g. scenario=two-*; may be repeated.",
)
def runs(console: Console, runs: Path | None, last: int | None, filters: tuple[str, ...]) -> int:
    """List the recorded runs, the last one first."""
    from pushplan.logging.runs import chosen, runs_folder, runs_of

    folder = runs_folder(runs)
    every = runs_of(folder)
    found = chosen(every, list(filters))[:last]
    now = datetime.now(UTC)
    if found:
        console.table([_HEAD, *(_row(one, now) for one in found)], styles=())
    some = f"{len(found)} of " if len(found) < len(every) else ""
    console.say(f"{some}{counted(len(every), 'run')} in {folder}")
    console.emit({"folder": folder, "runs": [_document(one, now) for one in found]})
    return 0


command = runs


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
