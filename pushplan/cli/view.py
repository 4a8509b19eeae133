"""Open a scenario in a browser: drag its poses, see the plan change at once."""

from __future__ import annotations

import argparse
import sys
import webbrowser

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE
from pushplan.cli.terminal.options import add_maps, add_scenario


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    add_scenario(parser)
    add_maps(parser)
    parser.add_argument("--port", metavar="PORT", type=_port, default=8080, help="where to listen (8080)")
    parser.add_argument("--no-browser", action="store_true", help="say the address, open nothing")


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.scenario.file import load_scenario

    scenario = load_scenario(args.scenario, args.map)
    with console.computing("opening the window"):
        from pushplan.view.window import Window

        window = Window(scenario, args.port, console.note)
    try:
        console.note(f"{scenario.name} is at {window.url}; Ctrl-C ends it")
        console.emit({"scenario": scenario.name, "url": window.url})
        sys.stdout.flush()  # whoever reads it through a pipe wants to go there now
        if not args.no_browser:
            webbrowser.open(window.url)
        window.wait()
    except KeyboardInterrupt:  # the way in which it ends
        pass
    finally:
        window.close()
    return DONE


def _port(text: str) -> int:
    """Return a port; argparse's `type`."""
    value = int(text)
    if not 0 < value < 2**16:
        raise argparse.ArgumentTypeError(f"{text} is no port; it must be from 1 to {2**16 - 1}")
    return value
