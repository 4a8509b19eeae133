"""Execute a plan of several pushes in the physics engine, and tell what every push came to."""

from __future__ import annotations

from dataclasses import asdict
from math import degrees, isfinite
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console

if TYPE_CHECKING:
    from pushplan.plans.result import PlanResult
    from pushplan.scenario.model import Scenario
    from pushplan.several.physics import SeveralReport


def execute(scenario: Scenario, plan: PlanResult, console: Console) -> SeveralReport:
    """Execute the segments one after the other, each from where the one before has led, and tell about them."""
    assert plan.trajectory is not None
    with console.working(f"executing {plan.trajectory.duration:.1f} s in the physics engine") as progress:
        from pushplan.several.modes import find_modes
        from pushplan.several.physics import execute_in_physics

        report = execute_in_physics(
            scenario,
            plan.segments,
            plan.trajectory,
            find_modes(scenario, plan.stable_set),
            progress=lambda share: progress.tell(f"{100.0 * share:.0f} %"),
        )
    verdict = (
        ("every push went as planned", "green") if report.kept else ("a push did not go as planned", "red")
    )
    console.say(f"in the physics engine, at full speed: {console.paint(*verdict)}")
    console.table(_rows(scenario, report))
    return report


def _rows(scenario: Scenario, report: SeveralReport) -> list[tuple[str, str]]:
    rows = [
        (
            f"{k}. {push.face}",
            f"moved {1e3 * push.approach:.2g} mm in the approach, contact slid or opened {1e3 * push.slide:.2g} mm, "
            f"moved {1e3 * push.retreat:.2g} mm in the retreat",
        )
        for k, push in enumerate(report.pushes, start=1)
    ]
    ends = [
        f"{obj.name} {1e3 * position:.2g} mm, {degrees(angle):.2g} deg"
        for obj, (position, angle) in zip(scenario.chain.objects, report.errors, strict=True)
    ]
    nearest = (
        [("robot alone", f"{1e3 * report.clear:.3g} mm from the objects")] if isfinite(report.clear) else []
    )
    return [*rows, *nearest, ("off the goal", "; ".join(ends))]


def document(report: SeveralReport) -> dict[str, object]:
    """Return what the engine found as a JSON object."""
    return {
        "kept": report.kept,
        "pushes": [asdict(push) | {"kept": push.kept} for push in report.pushes],
        "clear": report.clear if isfinite(report.clear) else None,
        "errors": [{"position": position, "angle": angle} for position, angle in report.errors.tolist()],
    }
