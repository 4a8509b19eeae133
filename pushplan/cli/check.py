"""Check a scenario and show what was understood."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE
from pushplan.cli.terminal.numbers import counted
from pushplan.cli.terminal.options import add_maps, add_plot, add_scenario, check_outputs

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    add_scenario(parser)
    add_maps(parser)
    add_plot(parser, "draw start, goal and obstacles, and the chain with its stable set")


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.cli.stable_set import describe, document, rows
    from pushplan.cli.steps import understood
    from pushplan.cli.steps.pushable import require_pushable
    from pushplan.cli.steps.several_objects import check_several_objects
    from pushplan.scenario.file import load_scenario

    check_outputs([args.scenario, *args.map], args.plot)
    scenario = load_scenario(args.scenario, args.map)
    if scenario.kind == "rearrangement":
        return check_several_objects(scenario, args, console)
    asked = ask(scenario, console)
    console.say(console.paint(scenario.name, "bold"))
    console.table(understood.rows(scenario))
    with console.computing("computing the stable set"):
        require_pushable(scenario)
        described = describe(scenario, scenario.stability.set)
    console.say(console.paint(f"stable set {scenario.stability.set}", "bold"))
    console.table(rows(described))
    if args.plot is not None:
        with console.computing(f"drawing {args.plot}"):
            from pushplan.drawing.plans import plot_scenario

            plot_scenario(scenario, args.plot, described.stable)
    told = f"no findings, but {counted(asked, 'question')}" if asked else "no findings"
    console.say(console.paint(told, "yellow" if asked else "green"))
    console.emit(
        {
            **understood.document(scenario),
            "stable_set": {"set": scenario.stability.set, **document(described)},
        }
    )
    return DONE


def ask(scenario: Scenario, console: Console) -> int:
    """Ask about numbers that the file may state but hardly means; return how many."""
    from pushplan.scenario.check import questions

    found = () if scenario.origin is None else questions(scenario.origin)
    for question in found:
        console.note(f"question: {question.text(str(scenario.path))}")
    return len(found)
