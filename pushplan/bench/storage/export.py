"""Results as tables for other programs: CSV always, Parquet where pyarrow is installed."""

from __future__ import annotations

import csv
import io
import math
from importlib.util import find_spec
from pathlib import Path

from pushplan.bench.storage.arena import ATTRIBUTES
from pushplan.bench.storage.results import Results, RunRow
from pushplan.util.files import write_whole

WORDS = ("key", "problem", "planner", "stable_set", "seed", "outcome", "message", "log", "host")

MEASURED = tuple(name for name, _ in ATTRIBUTES if name not in ("seed", "status", "solved"))
"""Columns of numbers; empty where there is none."""


def write_tables(results: Results, folder: Path) -> list[Path]:
    """Write a row for each run, and a row for each improvement during planning; return the files.

    The files are `runs` and `progress`, as .csv and, where pyarrow is installed, as .parquet.
    """
    tables = {"runs": [_row(run) for run in results.runs], "progress": _progress(results)}
    written = []
    for name, rows in tables.items():
        columns = [*WORDS, *MEASURED] if name == "runs" else ["key", "time", "cost"]
        written.append(_write_csv(columns, rows, folder / f"{name}.csv"))
        if find_spec("pyarrow") is not None:
            written.append(_write_parquet(columns, rows, folder / f"{name}.parquet"))
    return written


def _row(run: RunRow) -> dict[str, object]:
    words = {name: getattr(run, name) for name in WORDS}
    values = ((name, run.values[name]) for name in MEASURED)
    return {**words, **{name: None if math.isnan(value) else value for name, value in values}}


def _progress(results: Results) -> list[dict[str, object]]:
    return [
        {"key": run.key, "time": time, "cost": cost}
        for run in results.runs
        for time, cost in run.progress.tolist()
    ]


def _write_csv(columns: list[str], rows: list[dict[str, object]], path: Path) -> Path:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns)
    writer.writeheader()
    writer.writerows(rows)
    write_whole(path, text.getvalue().encode())
    return path


def _write_parquet(columns: list[str], rows: list[dict[str, object]], path: Path) -> Path:
    import pyarrow
    from pyarrow import parquet

    table, buffer = pyarrow.table({name: [row[name] for row in rows] for name in columns}), io.BytesIO()
    parquet.write_table(table, buffer)
    write_whole(path, buffer.getvalue())
    return path
