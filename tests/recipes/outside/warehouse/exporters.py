"""An exporter of the final poses for a spreadsheet."""

from __future__ import annotations

from pathlib import Path

from pushplan.logging.recorded import RecordedRun
from pushplan.util.files import write_whole


def write_places(run: RecordedRun, path: Path) -> None:
    """Write name, x, y and heading of every object at the end, separated by tabs."""
    execution = run.execution
    rows = () if execution is None else zip(execution.names, execution.objects[-1].tolist(), strict=True)
    lines = ["\t".join([name, *(f"{value:.4f}" for value in pose)]) for name, pose in rows]
    write_whole(path, "\n".join(lines).encode())
