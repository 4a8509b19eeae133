"""The steps of `pushplan plan`: load, plan and record, report."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from pushplan.cli.check import ask
from pushplan.cli.steps.pushable import require_pushable
from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.options import check_outputs
from pushplan.errors import PushplanError
from pushplan.util.interruption import INTERRUPTED, Interruption

if TYPE_CHECKING:
    from pushplan.plans.result import ProgressPoint, Run
    from pushplan.recording import IncompleteLogError
    from pushplan.scenario.model import Scenario


class PlanUsageError(PushplanError, ValueError):
    """Words of the command do not go together."""


def load(args: argparse.Namespace, console: Console) -> Scenario:
    """Read the scenario, check it and what is asked for, and load what planning needs."""
    from pushplan.cli.steps import physics
    from pushplan.scenario.file import load_scenario

    if args.no_log and (args.output or args.runs):
        raise PlanUsageError("--no-log does not go together with -o and --runs; leave one of them out")
    check_outputs([args.scenario, *args.map], args.plot, args.html, log=args.output)
    scenario = load_scenario(args.scenario, args.map)
    ask(scenario, console)
    if scenario.kind == "rearrangement":
        return scenario
    if args.physics:
        physics.require_executable(scenario)
    with console.computing("loading the planner"):
        import pushplan.run
        from pushplan.kernels import warm_up
        from pushplan.scenario.model import StabilitySettings
        from pushplan.sets.named import add_set

        del pushplan
        chosen = add_set(args.set or scenario.stability.set)
        intervals = scenario.interval is not None
        if scenario.pushes is None:
            warm_up(args.planner or scenario.planner.name, stable=chosen, intervals=intervals)
        else:
            from pushplan.several.warm import warm_up_several

            warm_up_several(None, chosen, intervals)
        kept = scenario.stability.margin if args.margin is None else args.margin
        require_pushable(replace(scenario, stability=StabilitySettings(chosen, kept)))
    return scenario


def plan_and_record(
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


def report(done: Run, interrupted: bool, console: Console) -> tuple[int, dict[str, object]]:
    """Tell people about a run; return the exit code and the JSON object."""
    from pushplan.cli.steps.report import document, exit_code, headline, rows

    console.say(headline(done.scenario, done.plan, console))
    table = rows(done.scenario, done.plan, done.execution, done.log)
    if interrupted and done.plan.solved:
        table.append(("interrupted", "the search was ended early; this is the best path until then"))
    console.table(table)
    told = document(done.scenario, done.plan, done.execution, done.log)
    code = INTERRUPTED if interrupted else exit_code(done.plan, done.execution)
    return code, {**told, "interrupted": interrupted}
