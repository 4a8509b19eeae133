"""List the packaged scenarios, or print one."""

from __future__ import annotations

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console


@p.command
@click.argument("name", type=p.SCENARIO, metavar="[NAME]", required=False)
def examples(console: Console, name: str | None) -> int:
    """List the packaged scenarios, or print the file of one."""
    from pushplan.scenario.file import example_names, example_text

    if name is not None:
        text = example_text(name)
        console.say(text.rstrip("\n"))
        console.emit({"name": name, "text": text})
        return 0
    about = {name: first_comment(example_text(name)) for name in example_names()}
    console.table(about.items())
    console.emit({"examples": about})
    return 0


command = examples


def first_comment(text: str) -> str:
    """Return the words of the first line that is a comment, or nothing."""
    comments = (line.lstrip("# ").rstrip() for line in text.splitlines() if line.startswith("#"))
    return next(comments, "")
