"""Plan, time, execute and log a push."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console
from pushplan.cli.main import DEFECT, MISMATCH, error_document
from pushplan.errors import OutputError
from pushplan.util.interruption import INTERRUPTED, Interruption, leaving_at_once
from pushplan.util.names import COSTS

if TYPE_CHECKING:
    from pushplan.plans.result import ProgressPoint, Run
    from pushplan.recording import IncompleteLogError
    from pushplan.scenario.model import Scenario

OF_ONE_LOAD = (
    "maps",
    "planner",
    "stable_set",
    "iterations",
    "gap",
    "cost",
    "margin",
    "plot",
    "html",
    "physics",
)
"""Options that plans of several objects do not take; `replay` makes the outputs among them from the log."""


@p.command
@p.scenario_argument
@p.map_option
@p.file_option(
    "-o", "--output", help="Write the run's log (MCAP), solved or not, here, and its page beside it."
)
@click.option("--no-page", is_flag=True, help="Write no page beside the log.")
@p.no_log_option
@p.runs_option
@click.option("--planner", type=p.PLANNER, help="Name of the planner, or module:attribute.")
@click.option("--set", "stable_set", type=p.STABLE_SET, help="Name of the stable set, or module:attribute.")
@click.option("--time-limit", type=p.SECONDS, metavar="S", help="Seconds of planning, at most.")
@click.option("--iterations", type=p.COUNT, metavar="N", help="Iterations of planning, at most.")
@click.option("--first", is_flag=True, help="Stop at the first path instead of shortening it.")
@click.option(
    "--gap", type=p.SHARE, metavar="G", help="Stop at a path that costs at most this share above a bound."
)
@click.option("--cost", type=click.Choice(COSTS), metavar="NAME", help=f"Rank paths by {', '.join(COSTS)}.")
@click.option("--margin", type=p.MARGIN, metavar="X", help="Margin that contacts keep: a number, or auto.")
@click.option("--seed", type=p.SEED, metavar="N", help="Seed of the random numbers.")
@p.plot_option
@p.file_option("--html", help="Write the page that plays the run here.")
@p.physics_option
@p.no_code_option
def plan(
    console: Console,
    scenario: str,
    maps: tuple[Path, ...],
    output: Path | None,
    no_page: bool,
    no_log: bool,
    runs: Path | None,
    plot: Path | None,
    html: Path | None,
    physics: bool,
    no_code: bool,
    **search: Any,
) -> int:
    """Plan, time, execute and log a push.

    What the options leave open is taken from the scenario. A log is recorded without -o, too, in the folder of the
    recorded runs.
    """
    from pushplan.cli.render import exit_code, headline, plan_document, plan_rows, remarks_on

    if no_log and (output or runs):
        raise p.UsageError("--no-log does not go together with -o and --runs; leave one of them out")
    p.check_outputs([scenario, *maps], plot, html, log=output)
    log: Path | bool | None = False if no_log else output
    with p.code_of(scenario, console.note, no_code):
        with leaving_at_once():  # nothing is lost yet
            stated = _load(scenario, maps, console)
            if stated.kind == "rearrangement":
                from pushplan.cli.rearrangement import plan_rearrangement

                given = {"maps": maps, "plot": plot, "html": html, "physics": physics, **search}
                _refuse(given)
                return plan_rearrangement(stated, search, log, runs, console)
            _prepare(stated, search, physics, console)
        interruption = Interruption()
        done, incomplete = _run(stated, search, log, runs, interruption, console)
    page = html or (None if output is None or no_page else _page_beside(output, console))
    if page is not None:
        page = _write_page(done, page, html is not None, console)
    document = plan_document(done.scenario, done.plan, done.execution, done.log)
    document |= {"page": page, "interrupted": interruption.requested}
    headline(document, console)
    rows = plan_rows(document, remarks_on(done.scenario, done.plan, done.execution))
    if interruption.requested and done.plan.solved:
        rows.append(("interrupted", "the search was ended early; this is the best path until then"))
    console.table(rows)
    code = INTERRUPTED if interruption.requested else exit_code(document)
    if incomplete is not None:
        console.note(f"error: {incomplete}")
        document["error"], code = error_document(incomplete), DEFECT
    if physics and not interruption.requested:
        from pushplan.cli.physics import execute

        document["physics"], kept = execute(stated, done.plan, console)
        code = code if kept or incomplete is not None else MISMATCH
    if plot is not None:
        draw(done, plot, console)
    console.emit(document)
    return code


command = plan


def _page_beside(output: Path, console: Console) -> Path | None:
    """Return where the page goes that is written beside a log; None where something else is there."""
    from pushplan.util.files import check_output

    page = output.with_suffix(".html")
    if check_output(output).streamed or page == output:
        return None
    if page.is_file() and b'id="run"' not in page.read_bytes():
        console.note(f"{page} exists and is no page of a run; --html names another one")
        return None
    return page


def _write_page(done: Run, page: Path, asked: bool, console: Console) -> Path | None:
    """Write the page of a run; where nobody has asked for it, what hinders that is only a remark."""
    from pushplan.logging.old.page import write_html

    try:
        with console.working(f"writing {page}"):
            write_html(done, page)
    except OutputError as error:
        if asked:
            raise
        console.note(f"no page: {error}")
        return None
    return page


def _refuse(given: dict[str, Any]) -> None:
    """Refuse options that do not go together with goals of several objects."""
    names = {"maps": "map", "stable_set": "set"}
    words = [f"--{names.get(name, name)}" for name in OF_ONE_LOAD if given[name]]
    if words:
        raise p.UsageError(
            f"{', '.join(words)} does not go together with goals of several objects; "
            "replay makes outputs from the log"
        )


def _load(source: str, maps: tuple[Path, ...], console: Console) -> Scenario:
    from pushplan.cli.check import ask
    from pushplan.scenario.file import load_scenario

    scenario = load_scenario(source, maps)
    ask(scenario, console)
    return scenario


def _prepare(scenario: Scenario, search: dict[str, Any], physics: bool, console: Console) -> None:
    """Load what planning needs, and check that the chain can be pushed at all."""
    if physics:
        from pushplan.cli.physics import require_executable

        require_executable(scenario)
    with console.computing("loading the planner"):
        import pushplan.run
        from pushplan.cli.check import require_pushable
        from pushplan.kernels import warm_up
        from pushplan.scenario.parts import StabilitySettings
        from pushplan.sets.named import add_set

        del pushplan
        chosen = add_set(search["stable_set"] or scenario.stability.set)
        planner = search["planner"] or scenario.planner.name
        warm_up(planner, None, chosen, scenario.interval is not None, scenario.pushes is not None)
        kept = scenario.stability.margin if search["margin"] is None else search["margin"]
        require_pushable(replace(scenario, stability=StabilitySettings(chosen, kept)))


def _run(
    scenario: Scenario,
    search: dict[str, Any],
    log: Path | bool | None,
    runs: Path | None,
    interruption: Interruption,
    console: Console,
) -> tuple[Run, IncompleteLogError | None]:
    """Plan, execute and record; return the run, and what kept its log from being written to the end."""
    from pushplan.recording import IncompleteLogError
    from pushplan.run import run

    limit = scenario.planner.time_limit if search["time_limit"] is None else search["time_limit"]
    with console.working(f"planning, up to {limit:g} s") as progress, interruption.listening():

        def improved(point: ProgressPoint) -> None:
            progress.tell(f"best path so far {point.cost:.3f} m")

        try:
            done = run(
                scenario,
                log=log,  # type: ignore[arg-type]
                runs=runs,
                progress=improved,
                tell=progress.announce,
                stop=interruption,
                **search,
            )
        except IncompleteLogError as error:
            return error.run, error
    return done, None


def draw(done: Any, path: Path, console: Console) -> None:
    """Draw a run, or one that was recorded, into a file."""
    with console.computing(f"drawing {path}"):
        from pushplan.drawing.plans import plot_plan

        plot_plan(done.plan.as_plan(done.scenario, done.execution), path)
