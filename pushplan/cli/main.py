"""The command line: parses arguments and returns an exit code, without a traceback for wrong input."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from typing import Any, NoReturn, TextIO

import click

from pushplan.errors import PushplanError, ScenarioError
from pushplan.util.interruption import INTERRUPTED, Interruption, leaving_at_once

DONE, DEFECT, WRONG_INPUT, NO_PLAN, MISMATCH = range(5)
PIPE_CLOSED = 141
"""Exit code that a shell reports for a program that writes to a closed pipe."""

COMMANDS = {
    "plan": "Plan, time, execute and log a push.",
    "check": "Check a scenario and show how pushplan reads it.",
    "stable-set": "Show which pusher twists keep every contact.",
    "view": "Open a scenario in a browser and drag its poses.",
    "replay": "Show, verify or export the log of a run.",
    "simulate": "Simulate a push with disturbances, in open or closed loop.",
    "trial": "Execute a plan in Monte Carlo samples and count how often it arrives.",
    "identify": "Estimate friction and loads from logs of pushes.",
    "bench": "Run a suite of problems, planners and seeds, and write a report.",
}
MORE = {
    "new": "Write a commented scenario to start from.",
    "examples": "List the packaged scenarios, or print one.",
    "runs": "List the recorded runs, newest first.",
    "schema": "Print the JSON Schema of scenario files or of benchmark suites.",
    "completion": "Print a completion script for a shell.",
}

_WRONG_PATH = (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError, PermissionError)


class Commands(click.Group):
    """Group of the commands, each imported at first use; `commands` has their names."""

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Return a command by its name; None if there is no such command."""
        if name not in COMMANDS | MORE:
            return _added_command(name)
        attribute = name.replace("-", "_")
        module = "more" if name in MORE else attribute
        command: click.Command = getattr(import_module(f"pushplan.cli.{module}"), attribute)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of the commands, and notes on scenarios and exit codes."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))
        formatter.write_paragraph()
        formatter.write_text(f"More: {', '.join(MORE)}")
        formatter.write_text("SCENARIO is a file or a packaged example (`pushplan examples` lists them).")
        formatter.write_text(
            "Exit codes: 0 success, 1 bug in pushplan, 2 wrong input, 3 no plan, 4 mismatch (replay, execution or "
            "benchmark), 130 interrupted."
        )


def _added_command(name: str) -> click.Command | None:
    """Return the command that an installed package adds by this name (entry point group `pushplan.commands`)."""
    from pushplan.util.naming import attribute_named

    found = attribute_named(name, "pushplan.commands") if ":" not in name else None
    return found if isinstance(found, click.Command) else None


@click.group(
    cls=Commands,
    commands={name: click.Command(name) for name in COMMANDS | MORE},
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    subcommand_metavar="COMMAND ...",
    options_metavar="",
    help="Plan how a robot pushes a chain of objects to a goal pose without anything slipping.",
)
@click.version_option(package_name="pushplan", message="pushplan %(version)s", help="Show the version.")
def pushplan() -> None:
    """Do nothing: each command does its own work."""


def entry() -> NoReturn:
    """Run the command line and end the process with its exit code.

    The process ends without the interpreter's clean-up, because OMPL's bindings print warnings about leaked objects
    there.
    """
    with leaving_at_once():
        sys.stdout, sys.stderr = _writable(sys.stdout), _writable(sys.stderr)
        code = main(sys.argv[1:])
        for stream in (sys.stdout, sys.stderr):
            code = _flushed(stream, code)
        os._exit(code)


def main(argv: Sequence[str]) -> int:
    """Run the command line with arguments (without the program's name) and return the exit code."""
    interruption = Interruption()
    json, verbose = "--json" in argv, "--verbose" in argv
    try:
        if "" in argv:  # from an unset shell variable: as a path it would be the current folder
            raise click.UsageError("an argument is empty; is a shell variable not set?")
        if "_PUSHPLAN_COMPLETE" in os.environ:
            pushplan.main(list(argv), prog_name="pushplan")
        with interruption.raising(), pushplan.make_context("pushplan", list(argv)) as context:
            code: Any = pushplan.invoke(context)
            sys.stdout.flush()
        return int(code or 0)
    except click.exceptions.Exit as done:  # from --help and --version
        return done.exit_code
    except click.ClickException as error:
        error.show()
        return _emit_error({"kind": "UsageError", "message": error.format_message()}, json, WRONG_INPUT)
    except (Exception, KeyboardInterrupt) as error:
        return _failed(KeyboardInterrupt() if interruption.requested else error, json, verbose)


def _failed(error: BaseException, json: bool, verbose: bool) -> int:
    """Print an error, in JSON mode also as JSON, and return the exit code."""
    if isinstance(error, BrokenPipeError):
        return PIPE_CLOSED
    from pushplan.util.printable import printable

    code, message = _explain(error)
    try:
        if verbose and code == DEFECT:
            sys.stderr.write("".join(traceback.format_exception(error)).rstrip() + "\n")
        sys.stderr.write(printable(message, "\n\t") + "\n")
    except BrokenPipeError:
        return PIPE_CLOSED
    return _emit_error(error_document(error), json, code)


def _emit_error(error: dict[str, object], json: bool, code: int) -> int:
    from pushplan.cli.console import Console

    try:
        Console(json).emit({"error": error})
    except BrokenPipeError:
        return PIPE_CLOSED
    return code


def _explain(error: BaseException) -> tuple[int, str]:
    match error:
        case KeyboardInterrupt() | click.Abort():
            return INTERRUPTED, "interrupted"
        case ScenarioError():
            return WRONG_INPUT, str(error)
        case PushplanError():
            return WRONG_INPUT, f"error: {error}"
        case OSError():
            place = f"{error.filename}: " if error.filename else ""
            code = WRONG_INPUT if isinstance(error, _WRONG_PATH) else DEFECT
            return code, f"error: {place}{error.strerror or error}"
        case MemoryError():
            return DEFECT, "error: out of memory"
    return DEFECT, (
        f"error: {type(error).__name__}: {error}\n"
        "This is a bug in pushplan, not in your input. Please report it with the command and its scenario; "
        "--verbose shows where it happened."
    )


def error_document(error: BaseException) -> dict[str, object]:
    """Return an error as a JSON object."""
    found = {"kind": type(error).__name__, "message": str(error)}
    if not isinstance(error, ScenarioError):
        return {**found}
    return {**found, "findings": [vars(finding) | {"path": error.path} for finding in error.findings]}


def _writable(stream: TextIO | None) -> TextIO:
    """Return a stream that accepts every character, or a null stream if the caller has closed it."""
    if not isinstance(stream, TextIOWrapper):
        return open(os.devnull, "w")
    stream.reconfigure(errors="backslashreplace")
    return stream


def _flushed(stream: TextIO, code: int) -> int:
    try:
        stream.flush()
    except BrokenPipeError:
        return PIPE_CLOSED
    except OSError:
        return code or 1
    return code
