"""Print the JSON Schema of scenario files or of benchmark suites, for editors."""

from __future__ import annotations

import argparse

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    parser.add_argument(
        "format",
        choices=("scenario", "suite"),
        nargs="?",
        default="scenario",
        help="of which files (scenario)",
    )


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.bench.schema import suite_schema
    from pushplan.scenario.json_schema import scenario_schema, schema_text

    schema = suite_schema() if args.format == "suite" else scenario_schema()
    console.say(schema_text(schema).rstrip("\n"))
    console.emit(schema)
    return DONE
