"""Commands for a file in which several objects have goals: `plan` and `check`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE, NO_PLAN
from pushplan.cli.terminal.numbers import counted, time_text
from pushplan.errors import PushplanError
from pushplan.util.interruption import INTERRUPTED, Interruption
from pushplan.util.names import OUT_OF_THE_WAY, TO_ITS_GOAL

if TYPE_CHECKING:
    from pushplan.rearrangement.plan import Rearrangement
    from pushplan.scenario.model import Scenario

_NOT_HERE = ("planner", "set", "iterations", "gap", "cost", "margin", "plot", "html", "physics")
"""Options that are for one load; `replay` makes the outputs among them from the log."""


class SeveralObjectsError(PushplanError, ValueError):
    """Options do not go together with a file of several objects."""


def check_several_objects(scenario: Scenario, args: argparse.Namespace, console: Console) -> int:
    """Check a file and show what was understood; return the exit code."""
    from pushplan.cli.steps import understood
    from pushplan.cli.steps.pushable import require_pushable
    from pushplan.several.modes import find_modes

    _refuse(args, ("plot",), "it is for one load")
    alone = {name: scenario.alone(name) for name in scenario.bodies}
    first = next(iter(alone.values()))
    console.say(console.paint(f"{scenario.name}  (several objects)", "bold"))
    rows, found = [("file", str(first.path))], []
    for name, one in alone.items():
        with console.computing(f"looking at the contacts of {name}"):
            require_pushable(one)
            faces = list(dict.fromkeys(mode.place.face for mode in find_modes(one)))
        goals = len(scenario.bodies[name].goals)
        rows += understood.object_rows(one, 0)
        rows.append(("", _aim_text(goals, faces)))
        found.append({**understood.document(one), "goals": goals, "faces": faces})
    rows += [
        ("pusher", understood.pusher_text(first.chain.pusher)),
        ("robot", understood.robot_text(first.chain.pusher)),
        ("workspace", understood.workspace_text(first)),
    ]
    console.table(rows)
    console.say(console.paint("no findings", "green"))
    console.emit({"scenario": scenario.name, "objects": found, "movable": _movable(scenario)})
    return DONE


def _movable(scenario: Scenario) -> list[str]:
    """Return the names of the objects that have no goal."""
    return [name for name in scenario.bodies if name not in scenario.goals]


def _aim_text(goals: int, faces: list[str]) -> str:
    """Return in words what becomes of an object, and from where it can be pushed."""
    aim = f"goes to {'its goal' if goals == 1 else f'one of {goals} goals'}"
    return f"{aim if goals else 'is moved where it is in the way'}, can be pushed at {', '.join(faces)}"


def _refuse(args: argparse.Namespace, names: tuple[str, ...], why: str) -> None:
    """Refuse options that do not go together with several objects.

    Raises:
        SeveralObjectsError: When one is given.
    """
    given = [f"--{name}" for name in names if getattr(args, name, None)]
    if given:
        raise SeveralObjectsError(
            f"{', '.join(given)} does not go together with goals of several objects; {why}"
        )


def plan_several_objects(scenario: Scenario, args: argparse.Namespace, console: Console) -> int:
    """Plan, record and tell; return the exit code."""
    _refuse(args, _NOT_HERE, "replay makes the outputs among them from the log")
    with console.computing("loading the planner"):
        from pushplan.rearrangement.plan import Rearranging

        alone = {name: scenario.alone(name) for name in scenario.bodies}
        rearranging = Rearranging.of(alone, _movable(scenario))
    settings = scenario.planner
    limit = settings.time_limit if args.time_limit is None else args.time_limit
    interruption = Interruption()
    with console.working(f"planning, up to {limit:g} s"), interruption.listening():
        found = rearranging.plan(
            seed=settings.seed if args.seed is None else args.seed,
            time_limit=limit,
            first=args.first,
            stop=interruption,
        )
    log = _recorded(found, args, console)
    _tell(scenario, found, log, console)
    console.emit(_document(scenario, found, log, interruption.requested))
    return INTERRUPTED if interruption.requested else DONE if found.solved else NO_PLAN


def _recorded(found: Rearrangement, args: argparse.Namespace, console: Console) -> Path | None:
    from pushplan.run import record_errands

    if args.no_log or not found.legs:
        return None
    return record_errands(found.legs, log=args.output, runs=args.runs, tell=console.note)


def _tell(scenario: Scenario, found: Rearrangement, log: Path | None, console: Console) -> None:
    from pushplan.cli.steps.report import segment_rows

    state = console.paint("solved", "green") if found.solved else console.paint("not solved", "red")
    console.say(f"{console.paint(scenario.name, 'bold')}: {state}  (several objects)")
    for k, leg in enumerate(found.legs, start=1):
        why = TO_ITS_GOAL if leg.delivers else OUT_OF_THE_WAY
        console.say(f"errand {k}: {leg.name} {why}")
        console.table(segment_rows(leg.plan))
    rows = [] if found.solved else [("reason", found.reason)]
    if found.first_solution_s is not None:
        pushes = sum(segment.pushes for leg in found.legs for segment in leg.plan.segments)
        way = sum(leg.plan.way_pushed or 0.0 for leg in found.legs)
        away = counted(found.relocations, "object")
        rows.append(
            (
                "pushed",
                f"{way:.3f} m in {counted(pushes, 'push', 'pushes')}",
            )
        )
        rows.append(("out of the way", away))
        rows.append(("cost", f"{found.cost:.3f} m with the robot's own ways and changes"))
    first = (
        "" if found.first_solution_s is None else f"first order after {time_text(found.first_solution_s)} of "
    )
    rows.append(
        ("planning", f"{first}{time_text(found.planning_s)}, {counted(found.looked_at, 'errand')} looked at")
    )
    console.table([*rows, *([] if log is None else [("log", str(log))])])


def _document(
    scenario: Scenario, found: Rearrangement, log: Path | None, interrupted: bool
) -> dict[str, object]:
    from pushplan.cli.steps.report import document

    return {
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
                **document(leg.scenario, leg.plan, leg.plan.execution, None),
            }
            for leg in found.legs
        ],
        "log": log,
        "interrupted": interrupted,
    }
