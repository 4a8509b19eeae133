"""`plan` and `check` for a scenario of several objects, until plans of all kinds are logged as one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pushplan.cli.check import (
    document,
    object_rows,
    pusher_text,
    require_pushable,
    robot_text,
    workspace_text,
)
from pushplan.cli.console import Console, counted, time_text
from pushplan.cli.main import DONE, NO_PLAN
from pushplan.cli.render import plan_document, segment_rows
from pushplan.util.interruption import INTERRUPTED, Interruption
from pushplan.util.names import OUT_OF_THE_WAY, TO_ITS_GOAL

if TYPE_CHECKING:
    from pushplan.rearrangement.plan import Rearrangement
    from pushplan.scenario.model import Scenario


def _movable(scenario: Scenario) -> list[str]:
    """Return the names of the objects that have no goal."""
    return [name for name in scenario.bodies if name not in scenario.goals]


def check_rearrangement(scenario: Scenario, plot: Path | None, console: Console) -> int:
    """Check a scenario and show what was understood; return the exit code."""
    from pushplan.several.modes import find_modes

    alone = {name: scenario.alone(name) for name in scenario.bodies}
    first = next(iter(alone.values()))
    rows, found = [("file", str(first.path))], []
    for name, one in alone.items():
        with console.computing(f"looking at the contacts of {name}"):
            require_pushable(one)
            faces = list(dict.fromkeys(mode.place.face for mode in find_modes(one)))
        goals = len(scenario.bodies[name].goals)
        aim = f"goes to {'its goal' if goals == 1 else f'one of {goals} goals'}"
        aim = aim if goals else "is moved where it is in the way"
        rows += [*object_rows(one, 0), ("", f"{aim}, can be pushed at {', '.join(faces)}")]
        found.append({**document(one), "goals": goals, "faces": faces})
    rows += [
        ("pusher", pusher_text(first.chain.pusher)),
        ("robot", robot_text(first.chain.pusher)),
        ("workspace", workspace_text(first)),
    ]
    if plot is not None:
        with console.computing(f"drawing {plot}"):
            from pushplan.drawing.plans import plot_scenario

            plot_scenario(scenario, plot)
    console.say((f"{scenario.name}  (several objects)", "bold"))
    console.table(rows)
    console.say(("no findings", "green"))
    console.emit({"scenario": scenario.name, "objects": found, "movable": _movable(scenario)})
    return DONE


def plan_rearrangement(
    scenario: Scenario,
    search: dict[str, Any],
    log: Path | bool | None,
    runs: Path | None,
    console: Console,
) -> int:
    """Plan, record and tell; return the exit code."""
    from pushplan.run import record_errands

    with console.computing("loading the planner"):
        from pushplan.rearrangement.plan import Rearranging

        alone = {name: scenario.alone(name) for name in scenario.bodies}
        rearranging = Rearranging.of(alone, _movable(scenario))
    settings = scenario.planner
    limit = settings.time_limit if search["time_limit"] is None else search["time_limit"]
    interruption = Interruption()
    with console.working(f"planning, up to {limit:g} s"), interruption.listening():
        found = rearranging.plan(
            seed=settings.seed if search["seed"] is None else search["seed"],
            time_limit=limit,
            first=search["first"],
            stop=interruption,
        )
    path = None
    if log is not False and found.legs:
        path = record_errands(found.legs, log=log, runs=runs, tell=console.note)  # type: ignore[arg-type]
    _tell(scenario, found, path, console)
    told = {
        "scenario": scenario.name,
        "solved": found.solved,
        "reason": found.reason,
        "first_solution_s": found.first_solution_s,
        "planning_s": found.planning_s,
        "relocations": found.relocations,
        "cost": found.cost,
        "errands": [
            {
                "object": leg.name,
                "delivers": leg.delivers,
                **plan_document(leg.scenario, leg.plan, leg.plan.execution, None),
            }
            for leg in found.legs
        ],
        "log": path,
        "interrupted": interruption.requested,
    }
    console.emit(told)
    return INTERRUPTED if interruption.requested else DONE if found.solved else NO_PLAN


def _tell(scenario: Scenario, found: Rearrangement, log: Path | None, console: Console) -> None:
    state = ("solved", "green") if found.solved else ("not solved", "red")
    console.say((scenario.name, "bold"), ": ", state, "  (several objects)")
    for k, leg in enumerate(found.legs, start=1):
        console.say(f"task {k}: {leg.name} {TO_ITS_GOAL if leg.delivers else OUT_OF_THE_WAY}")
        console.table(segment_rows(plan_document(leg.scenario, leg.plan, None, None)["segments"]))
    rows = [] if found.solved else [("reason", found.reason)]
    first = ""
    if found.first_solution_s is not None:
        pushes = sum(segment.pushes for leg in found.legs for segment in leg.plan.segments)
        way = sum(leg.plan.way_pushed or 0.0 for leg in found.legs)
        pushed = f"pushed {way:.3f} m in {counted(pushes, 'push', 'pushes')}"
        rows.append(("out of the way", counted(found.relocations, "object")))
        rows.append(("cost", f"{found.cost:.3f} m: {pushed}, transits and changes of the contact"))
        first = f"first order after {time_text(found.first_solution_s)} of "
    spent = f"{time_text(found.planning_s)}, {counted(found.looked_at, 'task')} looked at"
    rows.append(("planning", first + spent))
    console.table([*rows, *([] if log is None else [("log", str(log))])])
