"""The command line: words in, an exit code out, and never a traceback for wrong input."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from typing import NoReturn, TextIO

from pushplan.cli import (
    bench,
    check,
    completion,
    examples,
    identify,
    new,
    plan,
    replay,
    run,
    runs,
    schema,
    stable_set,
    trial,
    view,
)
from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import PIPE_CLOSED, WRONG_INPUT, report_failure
from pushplan.cli.terminal.parsing import Parser
from pushplan.util.interruption import Interruption, leaving_at_once

COMMANDS = {
    "plan": plan,
    "stable-set": stable_set,
    "view": view,
    "replay": replay,
    "trial": trial,
    "identify": identify,
    "run": run,
    "runs": runs,
    "bench": bench,
    "check": check,
    "new": new,
    "examples": examples,
    "schema": schema,
    "completion": completion,
}

_EPILOG = """\
SCENARIO is a file or the name of a packaged example (`pushplan examples` lists them).

exit codes:
  0    done
  1    a failure that is not yours
  2    the input is wrong
  3    no plan: none found within the time limit, or none exists; the run is logged all the same
  4    a replay or an execution does not match the plan, or loses a contact in the physics engine (--physics);
       a run does not arrive; a benchmark found an invalid solution or a regression, or runs of it broke off (crash,
       timeout, out of memory, error; not with --accept-broken)
  130  interrupted
"""


def entry() -> NoReturn:
    """Run the command line and end the process with its exit code.

    The process ends without the interpreter's clean-up: there the bindings of OMPL write a list of the objects
    that they call leaked onto the user's screen.
    """
    with leaving_at_once():
        sys.stdout, sys.stderr = _writable(sys.stdout), _writable(sys.stderr)
        code = main(sys.argv[1:])
        for stream in (sys.stdout, sys.stderr):
            code = _flushed(stream, code)
        os._exit(code)


def main(argv: Sequence[str]) -> int:
    """Run the command line with the words `argv` (without the program's name) and return the exit code."""
    if not argv:
        parser().print_help(sys.stderr)
        return WRONG_INPUT
    try:
        if "" in argv:  # of a variable of the shell that is not set: as a path it would be the present folder
            parser().error("there is an empty word, which names nothing; is a variable of the shell not set?")
        args = parser().parse_every(argv)
    except SystemExit as stop:  # argparse has written its help or what is wrong
        return int(stop.code or 0)
    console = Console(json=args.json, verbose=args.verbose)
    interruption = Interruption()
    try:
        with interruption.raising():
            code: int = COMMANDS[args.command].run(args, console)
            sys.stdout.flush()
    except (Exception, KeyboardInterrupt) as error:
        return report_failure(KeyboardInterrupt() if interruption.requested else error, console)
    return code


def parser() -> Parser:
    """Return the parser of all commands."""
    top = Parser(
        prog="pushplan",
        description="Plan how a robot pushes a chain of objects to a goal pose without anything slipping.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in COMMANDS.items():
        summary = (module.__doc__ or "").partition("\n")[0]
        child = commands.add_parser(name, help=summary, description=summary)
        module.declare(child)
        child.add_argument("--json", action="store_true", help="print one JSON object on stdout")
        child.add_argument(
            "--verbose", action="store_true", help="show the traceback of an unexpected failure"
        )
    commands.choices["completion"].set_defaults(every_command=top)
    return top


class _Version(argparse.Action):
    """Prints the installed version, looked up only when asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        import pushplan

        sys.stdout.write(f"pushplan {pushplan.__version__}\n")
        parser.exit()


def _writable(stream: TextIO | None) -> TextIO:
    """Return a stream that takes every character; one that the caller has closed is replaced by none."""
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
