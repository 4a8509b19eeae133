"""Plan, time, execute and log a push."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pushplan.cli.plan_steps import load, plan_and_record, report
from pushplan.cli.steps.exports import draw
from pushplan.cli.steps.physics import add_physics
from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DEFECT, MISMATCH, error_document
from pushplan.cli.terminal.options import (
    add_maps,
    add_output,
    add_plot,
    add_runs,
    add_scenario,
    count,
    margin,
    seconds,
    seed,
    share,
)
from pushplan.util.interruption import Interruption, leaving_at_once
from pushplan.util.names import COSTS
from pushplan.util.naming import planner_names, stable_set_names

if TYPE_CHECKING:
    from pushplan.plans.result import Run


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command; what they leave open is taken from the scenario."""
    add_scenario(parser)
    add_maps(parser)
    add_output(parser, "-o", "--output", help="write the run's log (MCAP), solved or not, here")
    parser.add_argument(
        "--no-log", action="store_true", help="write no log; else one is recorded without -o, too"
    )
    add_runs(parser)
    planners, sets = planner_names(), stable_set_names()
    parser.add_argument("--planner", choices=planners, metavar="NAME", help=f"one of {planners.words}")
    parser.add_argument("--set", choices=sets, metavar="NAME", help=f"one of {sets.words}")
    parser.add_argument("--time-limit", type=seconds, metavar="S", help="seconds of planning, at most")
    parser.add_argument("--iterations", type=count, metavar="N", help="iterations of planning, at most")
    parser.add_argument(
        "--first", action="store_true", help="stop at the first path instead of shortening it"
    )
    parser.add_argument(
        "--gap",
        type=share,
        metavar="G",
        help="stop at a path that costs at most this share more than a lower bound",
    )
    parser.add_argument("--cost", choices=COSTS, metavar="NAME", help=f"rank paths by {', '.join(COSTS)}")
    parser.add_argument(
        "--margin",
        type=margin,
        metavar="X",
        help="margin that contacts keep: a number, or auto (0.05 as a rule)",
    )
    parser.add_argument("--seed", type=seed, metavar="N", help="seed of the random numbers")
    add_plot(parser, "draw the swept chain, its margins and the stable set")
    add_output(parser, "--html", help="write a page that plays the run")
    add_physics(parser)


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.cli.steps.several_objects import plan_several_objects

    with leaving_at_once():  # nothing is lost yet
        scenario = load(args, console)
    if scenario.kind == "rearrangement":
        return plan_several_objects(scenario, args, console)
    interruption = Interruption()
    done, incomplete = plan_and_record(args, scenario, interruption, console)
    code, told = report(done, interruption.requested, console)
    if incomplete is not None:
        console.note(f"error: {incomplete}")
    if args.physics and not interruption.requested:
        from pushplan.cli.steps import physics

        found = physics.execute(scenario, done.plan, console)
        told["physics"] = physics.document(found)
        code = MISMATCH if found is not None and not found.kept else code
    _draw_outputs(done, args, console)
    console.emit(told if incomplete is None else {**told, "error": error_document(incomplete)})
    return code if incomplete is None else DEFECT


def _draw_outputs(done: Run, args: argparse.Namespace, console: Console) -> None:
    if args.plot is not None:
        draw(done.scenario, done.plan, done.execution, args.plot, console)
    if args.html is not None:
        from pushplan.logging.page import write_html

        write_html(done, args.html)
