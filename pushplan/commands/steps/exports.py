"""The files that `replay` makes of a run: one option and one writer each, loaded when they are asked for."""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.commands.terminal.console import Console
from pushplan.commands.terminal.options import add_output

if TYPE_CHECKING:
    from pushplan.logging.messages.recorded import RecordedRun

WRITERS = {
    "html": ("export.html", "write_html", "write a page that plays the run"),
    "csv": ("export.csv", "write_csv", "write the executed samples as a table"),
    "parquet": ("export.parquet", "write_parquet", "write the executed samples as a Parquet table"),
    "mp4": ("export.mp4", "write_mp4", "write a film of the run"),
    "rrd": ("export.rrd", "write_rrd", "write a recording for Rerun"),
    "ros2": ("export.ros2", "write_ros2", "write a bag that `ros2 bag play` takes (MCAP, CDR)"),
    "layout": (
        "view.layout",
        "write_layout",
        "write a layout that makes Foxglove and Lichtblick show the run",
    ),
}
"""Module in `pushplan.logging`, function and help of each option."""


def declare_exports(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    for name, (_, _, about) in WRITERS.items():
        add_output(parser, f"--{name}", help=about)


def asked_for(args: argparse.Namespace) -> dict[str, Path]:
    """Return the files asked for, by option."""
    return {name: path for name in WRITERS if (path := getattr(args, name)) is not None}


def write_exports(recorded: RecordedRun, args: argparse.Namespace, console: Console) -> None:
    """Write the files asked for.

    Raises:
        PushplanError: When a package is missing or a file cannot be written.
    """
    for name, path in asked_for(args).items():
        module, function, _ = WRITERS[name]
        with console.working(f"writing {path}"):
            getattr(import_module(f"pushplan.logging.{module}"), function)(recorded, path)
