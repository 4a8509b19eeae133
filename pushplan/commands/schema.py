"""Print the JSON Schema of scenario files, for editors."""

from __future__ import annotations

import argparse

from pushplan.commands.console import Console
from pushplan.commands.failure import DONE


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command: there are none."""


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.json_schema import scenario_schema, schema_text

    schema = scenario_schema()
    console.say(schema_text(schema).rstrip("\n"))
    console.emit(schema)
    return DONE
