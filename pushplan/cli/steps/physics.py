"""Execute a plan in the physics engine as well, and tell what every contact did."""

from __future__ import annotations

import argparse
from math import degrees, isfinite
from typing import TYPE_CHECKING

from pushplan.cli.steps import physics_of_several as several
from pushplan.cli.terminal.console import Console

if TYPE_CHECKING:
    from pushplan.plans.result import PlanResult
    from pushplan.scenario.model import Scenario
    from pushplan.several.physics import SeveralReport
    from pushplan.sim.physics.report import PhysicsReport


def add_physics(parser: argparse.ArgumentParser) -> None:
    """Declare the option."""
    parser.add_argument(
        "--physics",
        action="store_true",
        help="execute the plan in MuJoCo too, at its own speed with all inertia, and tell how far anything moved in "
        "its contact; exit code 4 when a contact moved (extra physics)",
    )


def require_executable(scenario: Scenario) -> None:
    """Find out before the work whether the engine can execute plans of this scenario.

    Raises:
        MissingEngineError: When it is not installed.
        PhysicsError: When a load is not known, or nothing rubs on the floor.
    """
    from pushplan.sim.physics.model.engine import PhysicsError, engine

    engine()
    unknown = [obj.name for obj in scenario.chain.objects if not obj.support.known]
    if unknown:
        names = ", ".join(repr(name) for name in unknown)
        raise PhysicsError(
            f"the physics engine cannot execute a push of {names}: it needs the load on every point of the floor, "
            "and the scenario leaves open how the load rests there; allowed: support uniform, feet with loads, or a "
            "pressure map"
        )


def execute(
    scenario: Scenario, plan: PlanResult | None, console: Console
) -> PhysicsReport | SeveralReport | None:
    """Execute a plan in the engine and tell what every contact did; None where there is none."""
    if plan is None or plan.trajectory is None:
        console.say("nothing to execute in the physics engine: no plan was found")
        return None
    if plan.segments:
        return several.execute(scenario, plan, console)
    trajectory = plan.trajectory
    with console.working(f"executing {trajectory.duration:.1f} s in the physics engine") as progress:
        from pushplan.sim.physics.verdict import verdict_of_physics

        report = verdict_of_physics(
            scenario.chain,
            trajectory,
            progress=lambda share: progress.tell(f"{100.0 * share:.0f} %"),
        )
    verdict = ("every contact held", "green") if report.kept else ("a contact moved", "red")
    console.say(f"in the physics engine, at full speed: {console.paint(*verdict)}")
    if scenario.interval is not None:
        console.say("  executed with the middles of intervals, and the lowest friction of contacts")
    console.table(_rows(report))
    return report


def _rows(report: PhysicsReport) -> list[tuple[str, str]]:
    contacts = [tuple(text.split(" ", 1)) for text in report.sentences()]
    ends = [
        f"{obj.name} {1e3 * position:.2g} mm, {degrees(angle):.2g} deg"
        for obj, (position, angle) in zip(report.chain.objects, report.object_errors, strict=True)
    ]
    return [*((name, told) for name, told in contacts), ("off the plan", "; ".join(ends))]


def document(report: PhysicsReport | SeveralReport | None) -> dict[str, object] | None:
    """Return what the engine found as a JSON object, None where nothing was executed."""
    if report is None:
        return None
    from pushplan.several.physics import SeveralReport

    if isinstance(report, SeveralReport):
        return several.document(report)
    chain = report.chain
    slide, opening, rotation = abs(report.slide), report.opening, abs(report.rotation)
    contacts = [
        {
            "contact": chain.contact_name(k),
            "moved": bool(report.moved[k]),
            "moved_at": float(report.moved_at[k]) if isfinite(report.moved_at[k]) else None,
            "slide": slide[:, k].max(),
            "opening": opening[:, k].max(),
            "rotation": rotation[:, k].max(),
        }
        for k in range(len(chain.contacts))
    ]
    objects = [
        {"object": obj.name, "position": position, "angle": angle}
        for obj, (position, angle) in zip(chain.objects, report.object_errors.tolist(), strict=True)
    ]
    return {"kept": report.kept, "tolerance": report.tolerance, "contacts": contacts, "objects": objects}
