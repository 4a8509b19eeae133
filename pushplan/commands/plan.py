"""Plan, time, execute and log a push."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.commands.check import require_pushable
from pushplan.commands.console import Console
from pushplan.commands.failure import DEFECT, MISMATCH, error_document
from pushplan.commands.options import (
    add_output,
    add_plot,
    add_runs,
    add_scenario,
    check_outputs,
    count,
    margin,
    seconds,
    seed,
    share,
)
from pushplan.commands.physics import add_physics
from pushplan.errors import PushplanError
from pushplan.interruption import INTERRUPTED, Interruption, leaving_at_once
from pushplan.names import COSTS
from pushplan.naming import planner_names, stable_set_names

if TYPE_CHECKING:
    from pushplan.recording import IncompleteLogError
    from pushplan.result import PlanResult, ProgressPoint, Run
    from pushplan.scenario import Scenario
    from pushplan.sim.kinematic import Execution


class PlanUsageError(PushplanError, ValueError):
    """Words of the command do not go together."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command; what they leave open is taken from the scenario."""
    add_scenario(parser)
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
    with leaving_at_once():  # nothing is lost yet
        scenario = _load(args, console)
    interruption = Interruption()
    done, incomplete = _run(args, scenario, interruption, console)
    code, told = _report(done, interruption.requested, console)
    if incomplete is not None:
        console.note(f"error: {incomplete}")
    if args.physics and not interruption.requested:
        from pushplan.commands import physics

        found = physics.execute(scenario, done.plan.trajectory, console)
        told["physics"] = physics.document(found)
        code = MISMATCH if found is not None and not found.kept else code
    _draw_outputs(done, args, console)
    console.emit(told if incomplete is None else {**told, "error": error_document(incomplete)})
    return code if incomplete is None else DEFECT


def _load(args: argparse.Namespace, console: Console) -> Scenario:
    """Read the scenario, check it and what is asked for, and load what planning needs."""
    from pushplan.commands import physics
    from pushplan.scenario import load_scenario

    if args.no_log and (args.output or args.runs):
        raise PlanUsageError("--no-log does not go together with -o and --runs; leave one of them out")
    check_outputs(args.scenario, args.plot, args.output, args.html)
    scenario = load_scenario(args.scenario)
    if args.physics:
        physics.require_executable(scenario)
    with console.computing("loading the planner"):
        import pushplan.run
        from pushplan.kernels import warm_up
        from pushplan.scenario import StabilitySettings
        from pushplan.stable_sets.named import add_set

        del pushplan
        warm_up(args.planner or scenario.planner.name)
        chosen = add_set(args.set or scenario.stability.set)
        kept = scenario.stability.margin if args.margin is None else args.margin
        require_pushable(replace(scenario, stability=StabilitySettings(chosen, kept)))
    return scenario


def _run(
    args: argparse.Namespace, scenario: Scenario, interruption: Interruption, console: Console
) -> tuple[Run, IncompleteLogError | None]:
    """Plan, execute and record; return the run, and what kept its log from being written to the end."""
    from pushplan.recording import IncompleteLogError
    from pushplan.run import run as run_push

    limit = scenario.planner.time_limit if args.time_limit is None else args.time_limit
    with console.working(f"planning, up to {limit:g} s") as progress, interruption.listening():

        def improved(point: ProgressPoint) -> None:
            progress.tell(f"best path so far {point.cost:.3f} m")

        try:
            done = run_push(
                scenario,
                log=False if args.no_log else args.output,
                runs=args.runs,
                planner=args.planner,
                stable_set=args.set,
                seed=args.seed,
                time_limit=args.time_limit,
                iterations=args.iterations,
                first=args.first,
                cost=args.cost,
                margin=args.margin,
                gap=args.gap,
                progress=improved,
                tell=progress.announce,
                stop=interruption,
            )
        except IncompleteLogError as error:
            return error.run, error
    return done, None


def _report(done: Run, interrupted: bool, console: Console) -> tuple[int, dict[str, object]]:
    """Tell people about a run; return the exit code and the JSON object."""
    from pushplan.commands.report import document, exit_code, headline, rows

    console.say(headline(done.scenario, done.plan, console))
    table = rows(done.scenario, done.plan, done.execution, done.log)
    if interrupted and done.plan.solved:
        table.append(("interrupted", "the search was ended early; this is the best path until then"))
    console.table(table)
    told = document(done.scenario, done.plan, done.execution, done.log)
    code = INTERRUPTED if interrupted else exit_code(done.plan, done.execution)
    return code, {**told, "interrupted": interrupted}


def _draw_outputs(done: Run, args: argparse.Namespace, console: Console) -> None:
    if args.plot is not None:
        draw(done.scenario, done.plan, done.execution, args.plot, console)
    if args.html is not None:
        from pushplan.logging.export.html import write_html

        write_html(done, args.html)


def draw(
    scenario: Scenario, plan: PlanResult, execution: Execution | None, path: Path, console: Console
) -> None:
    """Draw a plan into a file."""
    with console.computing(f"drawing {path}"):
        from pushplan.drawing.run import plot_plan

        plot_plan(scenario, plan, execution, path)
