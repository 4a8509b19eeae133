"""Print the JSON Schema of scenario files or of benchmark suites, for editors."""

from __future__ import annotations

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console


@p.command
@click.argument("kind", type=click.Choice(("scenario", "suite")), metavar="[scenario|suite]", default="scenario")
def schema(console: Console, kind: str) -> int:
    """Print the JSON Schema of scenario files (the default) or of benchmark suites, for editors."""
    from pushplan.bench.schema import suite_schema
    from pushplan.scenario.json_schema import scenario_schema, schema_text

    found = suite_schema() if kind == "suite" else scenario_schema()
    console.say(schema_text(found).rstrip("\n"))
    console.emit(found)
    return 0


command = schema
