"""Scenario files in which several objects stand apart, each with goals of its own or without any."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, cast

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.scenario.arrangement.meeting import millimetres
from pushplan.scenario.build import check_room_for_inertia, planner_settings
from pushplan.scenario.chain import build_bodies
from pushplan.scenario.files import Attachments
from pushplan.scenario.model import NotOneLoad, Scenario
from pushplan.scenario.parts import PlacedObject, StabilitySettings, Uncertainty
from pushplan.scenario.schema.findings import nearest, validate
from pushplan.scenario.schema.scenario import GoalPose, ObjectGoal
from pushplan.scenario.schema.several_objects import SeveralObjectsFile
from pushplan.scenario.several_pushes import check_places, make_goals, make_pushes
from pushplan.scenario.surroundings import build_surroundings
from pushplan.scenario.yaml.node import Document, Place, shorten
from pushplan.scenario.yaml.report import Report
from pushplan.util.arrays import FloatArray


def build_rearrangement(
    document: Document, path: Path, source: bytes, attachments: Attachments, report: Report
) -> Scenario | None:
    """Return the scenario that a document with `goals` states, or report all that is wrong with it."""
    file = _stated(document, report)
    if file is None:
        return None
    check_room_for_inertia(file, report)
    surroundings = build_surroundings(file, attachments.read, report)
    pushes = make_pushes(file, (), report)
    found = {
        obj.name: _placed(file, i, attachments, _report_of(report, i, obj.name), report)
        for i, obj in enumerate(file.objects)
    }
    bodies = {name: body for name, body in found.items() if body is not None}
    if not bodies:
        return None
    shared = {key: part for key, part in next(iter(bodies.values())).stated.items() if key != "objects"}
    scenario = Scenario(
        name=file.name or path.stem,
        path=path,
        source=source,
        chain=cast(Any, NotOneLoad("chain", bodies)),
        floor_friction=file.floor.friction,
        start=cast(Any, NotOneLoad("start", bodies)),
        goal=cast(Any, NotOneLoad("goal", bodies)),
        workspace=surroundings.workspace,
        obstacles=surroundings.obstacles,
        clearance=file.clearance,
        stability=StabilitySettings(file.stability.set, file.stability.margin),
        planner=planner_settings(file),
        trajectory=file.trajectory,
        attachments=attachments.contents,
        stated=shared | {"contacts": file.contacts.model_dump(mode="json", exclude_none=True)},
        uncertainty=Uncertainty(**file.uncertainty.model_dump()),
        pushes=pushes,
        bodies=bodies,
    )
    for i, obj in enumerate(file.objects):
        if obj.name in bodies:
            _check(scenario, obj.name, _report_of(report, i, obj.name), report)
    if not report.findings:
        _check_apart(scenario, report)
        for name, what in overlapping_goals({name: scenario.alone(name) for name in file.goals}).items():
            report.add(("goals", name), what)
    return None if report.findings else scenario


def _stated(document: Document, report: Report) -> SeveralObjectsFile | None:
    """Return what a file states, or report what is wrong with it and return None."""
    file, faults = validate(SeveralObjectsFile, document)
    for key in ("goal", "start"):
        if document.root.holds((key,)):
            faults.pop((key,), None)
            report.add((key,), "does not go together with goals, and objects have their poses", at_key=True)
    report.extend(tuple(faults.values()))
    names = [] if file is None else [obj.name for obj in file.objects]
    for i, name in enumerate(names):
        if name in names[:i]:
            report.add(
                ("objects", i, "name"), f"'{name}' is also objects[{names.index(name)}]; give it another"
            )
    for name in () if file is None else file.goals:
        if name not in names:
            near = nearest(str(name), names)
            what = f"no object is called '{shorten(str(name))}'{near} allowed: {', '.join(names)}"
            report.add(("goals", name), what, at_key=True)
    return None if report.findings else file


def _report_of(report: Report, i: int, name: str) -> Report:
    """Return a report on one object's own problem, whose places it takes to where the file states them."""

    def moved(place: Place) -> Place:
        match place:
            case ["objects", 0, *rest]:
                return ("objects", i, *rest)
            case ["goal", *rest]:
                stated = ("goals", name, *rest)
                return stated if report.document.root.holds(stated) else ("goals", name)
            case ["start", *_]:
                return ("objects", i, "pose")
        return place

    return Report(report.document, moved)


def _placed(
    file: SeveralObjectsFile, i: int, attachments: Attachments, own: Report, report: Report
) -> PlacedObject | None:
    """Return one object of a file, with its chain and goals."""
    obj = file.objects[i]
    between = tuple(pair for pair in file.contacts.between if set(pair.objects) == {obj.name, "pusher"})
    one = file.model_copy(
        update={
            "objects": (obj.model_copy(update={"pose": None, "offset": None}),),
            "contacts": file.contacts.model_copy(update={"friction": None, "between": between}),
        }
    )
    bodies = build_bodies(one, attachments.read, own)
    report.extend(own.findings)
    if bodies is None:
        return None
    return PlacedObject(
        np.array(obj.pose),
        make_goals(_goals(file.goals[obj.name], obj.name) if obj.name in file.goals else (), bodies.chain),
        bodies.chain,
        bodies.interval,
        bodies.contact_friction,
        bodies.stated,
    )


def _goals(stated: Any, name: str) -> tuple[GoalPose, ...]:
    """Return the goals of one object as a scenario of one load has them."""
    if isinstance(stated, ObjectGoal):
        return (GoalPose.model_construct(of=name, **dict(stated)),)
    if isinstance(stated[0], float):
        return (GoalPose.model_construct(of=name, pose=stated),)
    return tuple(goal for one in stated for goal in _goals(one, name))


def _check(scenario: Scenario, name: str, own: Report, report: Report) -> None:
    check_places(scenario.alone(name), ("goal", "pose"), own)
    report.extend(own.findings)


def _check_apart(scenario: Scenario, report: Report) -> None:
    """Report objects that touch one another at first."""
    placed = {name: _area(body.chain, body.start) for name, body in scenario.bodies.items()}
    index = {name: i for i, name in enumerate(placed)}
    for one, other in combinations(placed, 2):
        gap, kept = float(placed[one].distance(placed[other])), scenario.clearance
        if gap < kept:
            what = f"'{other}' is {millimetres(gap)} from '{one}'; allowed: at least {millimetres(kept)}"
            report.add(("objects", index[other], "pose"), what)


def overlapping_goals(scenarios: Mapping[str, Scenario]) -> dict[str, str]:
    """Return in words which objects cannot be at their goals together with another, by the name of the later one.

    Args:
        scenarios: The problem of each object that has goals, alone in the room, by its name.
    """
    ends = {name: _ends(scenario) for name, scenario in scenarios.items()}
    found = {}
    for one, other in combinations(ends, 2):
        gap, kept = (
            max(float(a.distance(b)) for a in ends[one] for b in ends[other]),
            scenarios[other].clearance,
        )
        if gap < kept:
            found[other] = (
                f"at their goals, '{one}' and '{other}' are {millimetres(gap)} apart; "
                f"allowed: at least {millimetres(kept)}"
            )
    return found


def _ends(scenario: Scenario) -> list[shapely.MultiPolygon]:
    """Return what the objects of one problem cover at each goal, and at the start where that reaches one."""
    goals = (scenario.goal,) if scenario.pushes is None else scenario.pushes.goals
    poses = [goal.pose_chain for goal in goals]
    poses += [scenario.start for goal in goals if goal.is_reached(scenario.start)]
    return [_area(scenario.chain, pose) for pose in poses]


def _area(chain: Chain, pose: FloatArray) -> shapely.MultiPolygon:
    """Return what the objects cover with the chain frame at a pose (3,)."""
    outlines = (se2.transform_points(pose, obj.outline_chain) for obj in chain.objects)
    return shapely.MultiPolygon([shapely.Polygon(outline) for outline in outlines])


@dataclass(frozen=True, eq=False)
class SeveralObjects:
    """What a file states.

    Attributes:
        name: For people.
        scenarios: The problem of each object, alone in the room, by its name.
        movable: Names of the objects that have no goal.
    """

    name: str
    scenarios: Mapping[str, Scenario]
    movable: tuple[str, ...]


def load_several_objects(source: str | Path) -> SeveralObjects:
    """Read a scenario file with `goals`; every object has its pose in the world.

    Raises:
        ScenarioError: With everything found wrong.
    """
    from pushplan.scenario.file import load_scenario

    scenario = load_scenario(source)
    movable = tuple(name for name in scenario.bodies if name not in scenario.goals)
    return SeveralObjects(scenario.name, {name: scenario.alone(name) for name in scenario.bodies}, movable)
