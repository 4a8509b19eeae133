"""The runs of a report that deserve a look, with pictures drawn from their logs."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pushplan.bench.processes.outcome import INVALID, NO_PLAN, OK
from pushplan.bench.reports.plots import data_uri
from pushplan.bench.storage.results import MISSING, Results, RunRow
from pushplan.errors import PushplanError

MOST_PICTURES = 6


def worst_runs(results: Results, most: int = MOST_PICTURES) -> list[RunRow]:
    """Return the runs most worth a look: invalid ones, one of each other failure, then the costliest solved ones.

    At most one run of each problem and planner, so that a single hard problem does not fill the list.
    """
    ranked = sorted(
        (run for run in results.runs if run.outcome != MISSING), key=lambda run: _rank(results, run)
    )
    chosen: dict[tuple[str, str, str], RunRow] = {}
    for run in ranked:
        chosen.setdefault((run.problem, run.planner, run.outcome), run)
    return list(chosen.values())[:most]


def _rank(results: Results, run: RunRow) -> tuple[int, float]:
    """Return what runs are sorted by: kind of end, then cost, the highest first."""
    kind = {INVALID: 0, NO_PLAN: 2, OK: 3}.get(run.outcome, 1)
    excess = results.excess(run)
    return kind, -excess if math.isfinite(excess) else 0.0


def failures(results: Results) -> list[RunRow]:
    """Return all runs that were neither solved nor just without a plan."""
    return [run for run in results.runs if run.outcome not in (OK, NO_PLAN, MISSING)]


def pictures(results: Results, runs: Sequence[RunRow]) -> dict[str, str]:
    """Return pictures (data URIs) by key of those runs whose logs hold enough to draw one."""
    found = {}
    for run in runs:
        if run.log is not None:
            image = _picture(results.path.parent / run.log)
            if image is not None:
                found[run.key] = image
    return found


def _picture(log: Path) -> str | None:
    """Return the picture of a logged run, None when its log does not hold a plan (any more)."""
    from pushplan.drawing.plans import plot_plan
    from pushplan.logging.reader import read_run

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.png"
        try:
            recorded = read_run(log)
            if recorded.plan is None:
                return None
            plot_plan(recorded.plan.as_plan(recorded.scenario, recorded.execution), path)
        except PushplanError:
            return None  # a log that was cut off is listed without a picture
        return data_uri(path.read_bytes(), "png")
