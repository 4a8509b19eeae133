"""Write a commented scenario to begin with."""

from __future__ import annotations

from pathlib import Path

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console


@p.command
@click.argument("name", metavar="NAME")
@click.option(
    "--drive",
    type=click.Choice(("omnidirectional", "differential", "car")),
    default="omnidirectional",
    show_default=True,
    help="Of the robot.",
)
@click.option(
    "--map",
    "map_file",
    type=p.PATH,
    metavar="MAP.yaml",
    help="A map as Nav2 and ROS keep it, in the scenario's folder or below; start and goal are where it has room.",
)
def new(console: Console, name: str, drive: str, map_file: Path | None) -> int:
    """Write a commented scenario to begin with, NAME.yaml; a file is never overwritten."""
    from pushplan.scenario.template import write_new_scenario

    path = write_new_scenario(name, drive=drive, map_file=map_file)
    console.say(f"wrote {path}; next:")
    console.table([("see it", f"pushplan check {path} --plot {path.stem}.png"), ("plan it", f"pushplan plan {path}")])
    console.emit({"name": path.stem, "file": path})
    return 0


command = new
