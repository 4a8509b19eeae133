"""Execute a plan in the physics engine as well, and tell what every contact did."""

from __future__ import annotations

from dataclasses import asdict
from math import degrees, isfinite
from typing import TYPE_CHECKING, Any

from pushplan.cli.console import Console

if TYPE_CHECKING:
    from pushplan.plans.plan import Plan
    from pushplan.scenario.model import Scenario
    from pushplan.sim.report import ContactReport

Document = dict[str, Any]


def require_executable(scenario: Scenario) -> None:
    """Find out before the work whether the engine can execute plans of this scenario.

    Raises:
        MissingEngineError: When it is not installed.
        PhysicsError: When a load is not known, or nothing rubs on the floor.
    """
    from pushplan.sim.physics.engine import PhysicsError, engine

    engine()
    unknown = [repr(obj.name) for task in scenario.tasks for obj in task.chain.objects if not obj.support.known]
    if unknown:
        raise PhysicsError(
            f"the physics engine cannot execute a push of {', '.join(unknown)}: it needs the load on every point of "
            "the floor, and the scenario leaves open how the load rests there; allowed: support uniform, feet with "
            "loads, or a pressure map"
        )


def execute(scenario: Scenario, plan: Plan | None, console: Console) -> tuple[Document | None, bool]:
    """Execute a plan in the engine, tell what every contact did; return that, and whether all held or nothing was."""
    if plan is None or plan.trajectory is None:
        console.say("nothing to execute in the physics engine: no plan was found")
        return None, True
    with console.working(f"executing {plan.trajectory.duration:.1f} s in the physics engine") as progress:

        def share(done: float) -> None:
            progress.tell(f"{100.0 * done:.0f} %")

        from pushplan.sim.physics.simulate import simulate_in_physics

        report = simulate_in_physics(plan, progress=share)
    verdict = ("every contact held", "green") if report.kept else ("a contact moved", "red")
    console.say("in the physics engine, at full speed: ", verdict)
    if scenario.has_intervals:
        console.say("  executed with the middles of intervals, and the lowest friction of contacts")
    console.table(_rows(report))
    return _document(report), report.kept


def _rows(report: ContactReport) -> list[tuple[str, str]]:
    rows = [(one.contact, str(one).split(" ", 1)[1]) for one in report.summaries]
    if isfinite(report.clear):
        moved = f"none moved by more than {1e3 * report.disturbed:.2g} mm"
        rows.append(("objects at rest", f"{1e3 * report.clear:.3g} mm from what moves; {moved}"))
    ends = [
        f"{name} {1e3 * position:.2g} mm, {degrees(angle):.2g} deg"
        for name, (position, angle) in zip(report.names, report.object_errors, strict=True)
    ]
    return [*rows, ("pose error", "; ".join(ends))]


def _document(report: ContactReport) -> Document:
    return {
        "kept": report.kept,
        "tolerance": report.tolerance,
        "contacts": [asdict(one) | {"moved": one.moved_at is not None} for one in report.summaries],
        "objects": [
            {"object": name, "position": position, "angle": angle}
            for name, (position, angle) in zip(report.names, report.object_errors.tolist(), strict=True)
        ],
        "disturbed": report.disturbed,
        "clear": report.clear if isfinite(report.clear) else None,
    }
