"""All options of the command line that name an output file, and a command line that writes each."""

from pathlib import Path

import click

from pushplan.cli.main import COMMANDS, MORE, pushplan
from pushplan.cli.parameters import PATH

_SUFFIXES = {"plot": ".svg", "output": ".mcap", "recovered": ".mcap", "worst": ".mcap", "name": ".yaml"}
"""Suffixes by the option's name; the suffix of an export is its name."""

_FOLDERS = {"compare", "runs", "shards"}
_INPUTS = {"maps", "map_file", "log", "logs", "suite"}
_ELSEWHERE = {("bench", "output"), ("identify", "output"), ("identify", "plot")}
"""Options that need more than a scenario or the log of a plan; other tests cover them."""


def _declared() -> list[tuple[str, str]]:
    """Return command and name of every option or argument with a path."""
    context, found = click.Context(pushplan), []
    for name in (*COMMANDS, *MORE):
        command = pushplan.get_command(context, name)
        assert command is not None
        found += [
            (name, str(param.name))
            for param in command.params
            if param.type is PATH or (name, param.name) == ("new", "name")
        ]
    return found


OPTIONS = [
    (command, option, _SUFFIXES.get(option, f".{option}"))
    for command, option in _declared()
    if option not in _FOLDERS | _INPUTS and (command, option) not in _ELSEWHERE
]
"""Command, option and suffix of every output."""


def words(command: str, option: str, path: Path, log: Path) -> list[str]:
    """Return a command line that writes an output to `path`; replays read `log`."""
    match command, option:
        case "new", _:
            return ["new", str(path)]
        case "replay", "recovered":
            return ["replay", "--recover", str(log), str(path)]
        case "replay", _:
            return ["replay", str(log), f"--{option}", str(path)]
        case "trial", _:
            return ["trial", str(log), "--samples", "3", "--no-page", f"--{option}", str(path)]
        case "simulate", _:
            return ["simulate", "one-box", "--no-page", f"--{option}", str(path)]
        case "plan", _:
            return ["plan", "one-box", "--first", "--no-page", f"--{option}", str(path)]
        case "check" | "stable-set", _:
            return [command, "one-box", f"--{option}", str(path)]
    raise ValueError(f"say how {command} writes {option}")
