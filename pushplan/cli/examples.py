"""List the packaged scenarios, or print one."""

from __future__ import annotations

import argparse

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    parser.add_argument("name", metavar="NAME", nargs="?", help="print this one's file")


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.scenario.file import example_names, example_text

    if args.name is not None:
        text = example_text(args.name)
        console.say(text.rstrip("\n"))
        console.emit({"name": args.name, "text": text})
        return DONE
    about = {name: first_comment(example_text(name)) for name in example_names()}
    console.table(about.items())
    console.emit({"examples": about})
    return DONE


def first_comment(text: str) -> str:
    """Return the words of the first line that is a comment, or nothing."""
    comments = (line.lstrip("# ").rstrip() for line in text.splitlines() if line.startswith("#"))
    return next(comments, "")
