"""Plan, time, execute and log a push."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console
from pushplan.cli.main import DEFECT, MISMATCH, error_document
from pushplan.drawing import PANELS
from pushplan.util.interruption import INTERRUPTED, Interruption, leaving_at_once
from pushplan.util.names import COSTS, PLANNERS

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.logging.recording import IncompleteLogError
    from pushplan.plans.plan import Improvement, Plan
    from pushplan.plans.run import Run
    from pushplan.scenario.model import Scenario


HELP = f"{', '.join(PLANNERS)}, or module:attribute. auto grows two RRTs of OMPL from start and goal."


@p.command
@p.scenario_argument
@p.map_option
@p.log_options("Write the log (MCAP) of the run, solved or not, and its page beside it.")
@click.option("--planner", type=p.PLANNER, help=HELP)
@click.option("--set", "stable_set", type=p.STABLE_SET, help="Name of the stable set, or module:attribute.")
@click.option("--time-limit", type=p.SECONDS, metavar="S", help="Largest planning time, s.")
@click.option("--iterations", type=p.COUNT, metavar="N", help="Largest number of planning iterations.")
@click.option("--first", is_flag=True, help="Stop at the first plan instead of improving it.")
@click.option("--gap", type=p.SHARE, metavar="G", help="Stop at this optimality gap, e.g. 0.05 or 5%.")
@click.option("--cost", type=click.Choice(COSTS), metavar="NAME", help=f"Objective: {', '.join(COSTS)}.")
@click.option("--margin", type=p.MARGIN, metavar="X", help="Margin that all contacts keep: a number, or auto.")
@click.option("--seed", type=p.SEED, metavar="N", help="Seed of the random numbers.")
@p.plot_option
@p.panels_option
@p.file_option("--html", help="Write a page that plays the run.")
@p.physics_option
@p.no_code_option
def plan(
    console: Console,
    scenario: str,
    maps: tuple[Path, ...],
    log: p.LogChoice,
    plot: Path | None,
    panels: tuple[str, ...] | None,
    html: Path | None,
    physics: bool,
    no_code: bool,
    **search: Any,
) -> int:
    """Plan, time, execute and log a push.

    Options override the settings of the scenario. Without -o, the log goes into the folder of the recorded runs.
    """
    from pushplan.cli.render import exit_code, headline, plan_document, plan_rows, remarks_on, write_page

    p.check_outputs([scenario, *maps], plot, html, log=log.output)
    p.only_with("plot", plot is not None, panels=panels)
    with p.code_of(scenario, console.note, no_code):
        with leaving_at_once():  # an interruption loses nothing yet
            stated = _load(scenario, maps, console)
            _prepare(stated, search, physics, console)
        interruption = Interruption()
        done, incomplete = _run(stated, search, log, interruption, console)
    page = write_page(done, html, log.paged, console)
    document = plan_document(done.plan, done.log)
    document |= {"page": page, "interrupted": interruption.requested}
    headline(document, console)
    rows = plan_rows(document, remarks_on(done.plan, done.execution))
    if interruption.requested and done.plan.solved:
        rows.append(("interrupted", "the search was stopped early; this is the best plan so far"))
    console.table(rows)
    code = INTERRUPTED if interruption.requested else exit_code(document)
    if incomplete is not None:
        console.note(f"error: {incomplete}")
        document["error"], code = error_document(incomplete), DEFECT
    if physics and not interruption.requested:
        from pushplan.cli.render import execute_in_physics

        document["physics"], kept = execute_in_physics(stated, done.plan, console)
        code = code if kept or incomplete is not None else MISMATCH
    if plot is not None:
        draw(done, done.plan, plot, panels, console)
    console.emit(document)
    return code


def _load(source: str, maps: tuple[Path, ...], console: Console) -> Scenario:
    from pushplan.cli.check import ask
    from pushplan.scenario.file import load_scenario

    scenario = load_scenario(source, maps)
    ask(scenario, console)
    return scenario


def _prepare(scenario: Scenario, search: dict[str, Any], physics: bool, console: Console) -> None:
    """Load the planner and check that the chain can be pushed."""
    if physics:
        from pushplan.cli.render import require_executable

        require_executable(scenario)
    with console.working("loading the planner"):
        import pushplan.run
        from pushplan.cli.check import require_pushable
        from pushplan.sets.named import add_set

        del pushplan
        chosen = add_set(search["stable_set"] or scenario.stability.set)
        kept = scenario.stability.margin if search["margin"] is None else search["margin"]
        for one in scenario.each_alone():
            stability = one.stability.model_copy(update={"set": chosen, "margin": kept})
            require_pushable(replace(one, stability=stability))


def _run(
    scenario: Scenario, search: dict[str, Any], log: p.LogChoice, interruption: Interruption, console: Console
) -> tuple[Run, IncompleteLogError | None]:
    """Plan, execute and record; return the run, and the error if its log is incomplete."""
    from pushplan.logging.recording import IncompleteLogError
    from pushplan.plans.settings import Observer
    from pushplan.run import run

    limit = scenario.planner.time_limit if search["time_limit"] is None else search["time_limit"]
    with console.working(f"planning, up to {limit:g} s") as progress, interruption.listening():

        def improved(improvement: Improvement) -> None:
            progress.update(f"best plan so far {improvement.cost:.3f} m")

        try:
            done = run(
                scenario,
                log=log.where,
                runs=log.runs,
                observer=Observer(progress.announce, improved, interruption),
                **search,
            )
        except IncompleteLogError as error:
            return error.run, error
    return done, None


def draw(done: Run | RecordedRun, plan: Plan, path: Path, panels: tuple[str, ...] | None, console: Console) -> None:
    """Write a picture of a run, or some panels of it."""
    with console.working(f"drawing {path}"):
        from pushplan.drawing.plans import plot_plan

        plot_plan(plan, path, done.execution, done.events, panels or PANELS)
