"""Execute a plan in the physics engine as well, and tell what every contact did."""

from __future__ import annotations

from dataclasses import asdict
from math import degrees, isfinite
from typing import TYPE_CHECKING, Any

from pushplan.cli.console import Console

if TYPE_CHECKING:
    from pushplan.plans.result import PlanResult
    from pushplan.scenario.model import Scenario
    from pushplan.several.physics import SeveralReport
    from pushplan.sim.physics.report import PhysicsReport

Document = dict[str, Any]


def require_executable(scenario: Scenario) -> None:
    """Find out before the work whether the engine can execute plans of this scenario.

    Raises:
        MissingEngineError: When it is not installed.
        PhysicsError: When a load is not known, or nothing rubs on the floor.
    """
    from pushplan.sim.physics.model.engine import PhysicsError, engine

    engine()
    unknown = [repr(obj.name) for obj in scenario.chain.objects if not obj.support.known]
    if unknown:
        raise PhysicsError(
            f"the physics engine cannot execute a push of {', '.join(unknown)}: it needs the load on every point of "
            "the floor, and the scenario leaves open how the load rests there; allowed: support uniform, feet with "
            "loads, or a pressure map"
        )


def execute(scenario: Scenario, plan: PlanResult | None, console: Console) -> tuple[Document | None, bool]:
    """Execute a plan in the engine, tell what every contact did; return that, and whether all held or nothing was."""
    if plan is None or plan.trajectory is None:
        console.say("nothing to execute in the physics engine: no plan was found")
        return None, True
    with console.working(f"executing {plan.trajectory.duration:.1f} s in the physics engine") as progress:

        def share(done: float) -> None:
            progress.tell(f"{100.0 * done:.0f} %")

        if plan.segments:
            from pushplan.several.modes import find_modes
            from pushplan.several.physics import execute_in_physics

            modes = find_modes(scenario, plan.stable_set)
            report: Any = execute_in_physics(scenario, plan.segments, plan.trajectory, modes, progress=share)
        else:
            from pushplan.sim.physics.verdict import verdict_of_physics

            report = verdict_of_physics(scenario.chain, plan.trajectory, progress=share)
    held, not_held = (
        ("every push went as planned", "a push did not go as planned")
        if plan.segments
        else ("every contact held", "a contact moved")
    )
    verdict = (held, "green") if report.kept else (not_held, "red")
    console.say("in the physics engine, at full speed: ", verdict)
    if scenario.interval is not None:
        console.say("  executed with the middles of intervals, and the lowest friction of contacts")
    console.table(_push_rows(scenario, report) if plan.segments else _contact_rows(report))
    return (_pushes(report) if plan.segments else _contacts(report)), bool(report.kept)


def _contact_rows(report: PhysicsReport) -> list[tuple[str, str]]:
    rows = [(name, said) for name, said in (text.split(" ", 1) for text in report.sentences())]
    ends = [
        f"{obj.name} {1e3 * position:.2g} mm, {degrees(angle):.2g} deg"
        for obj, (position, angle) in zip(report.chain.objects, report.object_errors, strict=True)
    ]
    return [*rows, ("pose error", "; ".join(ends))]


def _contacts(report: PhysicsReport) -> Document:
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


def _push_rows(scenario: Scenario, report: SeveralReport) -> list[tuple[str, str]]:
    rows = [
        (
            f"{k}. {push.face}",
            f"moved {1e3 * push.approach:.2g} mm in the approach, contact slid or opened {1e3 * push.slide:.2g} mm, "
            f"moved {1e3 * push.retreat:.2g} mm in the retreat",
        )
        for k, push in enumerate(report.pushes, start=1)
    ]
    if isfinite(report.clear):
        rows.append(("robot alone", f"{1e3 * report.clear:.3g} mm from the objects"))
    ends = [
        f"{obj.name} {1e3 * position:.2g} mm, {degrees(angle):.2g} deg"
        for obj, (position, angle) in zip(scenario.chain.objects, report.errors, strict=True)
    ]
    return [*rows, ("goal error", "; ".join(ends))]


def _pushes(report: SeveralReport) -> Document:
    return {
        "kept": report.kept,
        "pushes": [asdict(push) | {"kept": push.kept} for push in report.pushes],
        "clear": report.clear if isfinite(report.clear) else None,
        "errors": [{"position": position, "angle": angle} for position, angle in report.errors.tolist()],
    }
