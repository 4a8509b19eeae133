"""From a scenario's document to the scenario, or to findings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pushplan.scenario.arrangement.placement import Surroundings, bodies_at, placement_troubles
from pushplan.scenario.chain import Bodies, build_bodies
from pushplan.scenario.files import Attachments
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PlannerSettings, StabilitySettings, Uncertainty
from pushplan.scenario.salvage import salvage
from pushplan.scenario.schema.findings import nearest, validate
from pushplan.scenario.schema.scenario import ScenarioFile, StatedRoom
from pushplan.scenario.several_pushes import (
    check_places,
    make_goals,
    make_pushes,
    report_meaningless,
    stated_goals,
)
from pushplan.scenario.surroundings import Stated, build_surroundings
from pushplan.scenario.yaml.node import Document, shorten
from pushplan.scenario.yaml.report import Report
from pushplan.util.names import RANKED_BY


def build_scenario(
    document: Document, path: Path, source: bytes, attachments: Attachments, report: Report
) -> Scenario | None:
    """Return the scenario that a document states, or report all that is wrong with it and return None."""
    file, faults = validate(ScenarioFile, document)
    report.extend(tuple(faults.values()))
    doubtful: set[str] = set()
    if file is None:
        mended = salvage(document.root.plain(), faults)
        if mended is None:
            return None
        file, doubtful = mended
    bodies = _bodies(file, attachments, doubtful, report)
    if not _goal_exists(file, report):
        doubtful.add("goal")
    if bodies is None:
        return None
    check_room_for_inertia(file, report)
    surroundings = build_surroundings(file, attachments.read, report)
    scenario = _scenario(file, path, source, bodies, surroundings, attachments, report)
    _check_ends(scenario, file, doubtful, report)
    return None if report.findings else scenario


def _bodies(
    file: ScenarioFile, attachments: Attachments, doubtful: set[str], report: Report
) -> Bodies | None:
    """Return the chain; what follows from stand-ins alone is not reported."""
    own = Report(report.document)
    bodies = build_bodies(file, attachments.read, own)
    report.extend(tuple(f for f in own.findings if f.where.split(".")[0] not in doubtful))
    return bodies


def _goal_exists(file: ScenarioFile, report: Report) -> bool:
    """Tell whether the object that the goal names exists, and report it if not."""
    known = [obj.name for obj in file.objects]
    for place, goal in stated_goals(file):
        if goal.of is not None and goal.of not in known:
            near = nearest(goal.of, known)
            what = f"no object is called '{shorten(goal.of)}'{near} allowed: {', '.join(known)}"
            report.add((*place, "of"), what)
            return False
    return True


def check_room_for_inertia(file: StatedRoom, report: Report) -> None:
    """Report dynamic contact limits where contacts may be pushed at their limit."""
    if file.pusher.limits.contact == "dynamic" and file.stability.margin == 0.0:
        report.add(
            ("pusher", "limits", "contact"),
            "'dynamic', the default, needs a stability.margin above 0, for a contact at its limit has nothing to "
            "spare for inertia; allowed: a stability.margin such as auto or 0.05, or quasi-static",
        )


def _scenario(
    file: ScenarioFile,
    path: Path,
    source: bytes,
    bodies: Bodies,
    surroundings: Stated,
    attachments: Attachments,
    report: Report,
) -> Scenario:
    goals = make_goals((goal for _, goal in stated_goals(file)), bodies.chain)
    report_meaningless(file, report)
    return Scenario(
        name=file.name or path.stem,
        path=path,
        source=source,
        chain=bodies.chain,
        floor_friction=file.floor.friction,
        start=np.array(file.start),
        goal=goals[0],
        workspace=surroundings.workspace,
        obstacles=surroundings.obstacles,
        clearance=file.clearance,
        stability=StabilitySettings(file.stability.set, file.stability.margin),
        planner=planner_settings(file),
        trajectory=file.trajectory,
        attachments=attachments.contents,
        stated=bodies.stated,
        interval=bodies.interval,
        uncertainty=Uncertainty(**file.uncertainty.model_dump()),
        contact_friction=bodies.contact_friction,
        snapping=bodies.snapping,
        pushes=make_pushes(file, goals, report),
    )


def planner_settings(file: StatedRoom) -> PlannerSettings:
    """Return how to search; several pushes have one cost only."""
    stated = PlannerSettings(**file.planner.model_dump())
    return stated if file.robot.start is None else replace(stated, cost=RANKED_BY)


def _check_ends(scenario: Scenario, file: ScenarioFile, doubtful: set[str], report: Report) -> None:
    """Report collisions at start and goal, as far as all that matters for them is known."""
    if doubtful & {"workspace", "obstacles", "clearance"}:
        return
    surroundings = Surroundings(scenario.workspace, scenario.obstacles, scenario.clearance)
    if scenario.pushes is not None:
        if not doubtful & {"start", "goal", "robot"}:
            check_places(scenario, (*stated_goals(file)[0][0], "pose"), report)
        return
    for what, place, pose in (
        ("start", ("start",), scenario.start),
        ("goal", ("goal", "pose"), scenario.goal.pose_chain),
    ):
        if what not in doubtful:
            for trouble in placement_troubles(what, bodies_at(scenario.chain, pose), surroundings):
                report.add(place, trouble)
