"""Write a commented scenario to begin with."""

from __future__ import annotations

import argparse
from pathlib import Path

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    parser.add_argument(
        "name", metavar="NAME", help="the scenario's name; NAME.yaml is written, never overwritten"
    )
    parser.add_argument(
        "--drive",
        choices=("omnidirectional", "differential", "car"),
        default="omnidirectional",
        help="of the robot (omnidirectional)",
    )
    parser.add_argument(
        "--map",
        metavar="MAP.yaml",
        type=Path,
        help="a map as Nav2 and ROS keep it, in the scenario's folder or below; start and goal are where it has room",
    )


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.scenario.template import write_new_scenario

    path = write_new_scenario(args.name, drive=args.drive, map_file=args.map)
    console.say(f"wrote {path}; next:")
    console.table(
        [("see it", f"pushplan check {path} --plot {path.stem}.png"), ("plan it", f"pushplan plan {path}")]
    )
    console.emit({"name": path.stem, "file": path})
    return DONE
