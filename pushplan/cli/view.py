"""Open a scenario in a browser, where dragging its poses updates the plan."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console


@p.command
@p.scenario_argument
@p.map_option
@click.option("--port", type=p.PORT, metavar="PORT", default=8080, show_default=True, help="Port of the server.")
@click.option("--no-browser", is_flag=True, help="Print the address without opening a browser.")
@p.no_code_option
def view(console: Console, scenario: str, maps: tuple[Path, ...], port: int, no_browser: bool, no_code: bool) -> int:
    """Open a scenario in a browser: drag its poses and see how the plan changes."""
    from pushplan.scenario.file import load_scenario

    with p.code_of(scenario, console.note, no_code):
        stated = load_scenario(scenario, maps)
        with console.working("opening the window"):
            from pushplan.view.window import Window

            window = Window(stated, port, console.note)
        try:
            console.note(f"{stated.name} is at {window.url}; stop with Ctrl-C")
            console.emit({"scenario": stated.name, "url": window.url})
            sys.stdout.flush()  # a program that reads a pipe needs the address now
            if not no_browser:
                webbrowser.open(window.url)
            window.wait()
        except KeyboardInterrupt:  # the normal way to stop
            pass
        finally:
            window.close()
    return 0
