"""Check a scenario and show its bodies, weights and contacts, and the free space at start and goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import atan, degrees, isfinite
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, counted, plain
from pushplan.errors import EmptyStableSetError, ScenarioError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, PLATE, PushedObject, Pusher
from pushplan.mechanics.heights import tipping_room
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
from pushplan.scenario.goals import Row
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import KNOWN_LOAD_SETS

Rows = list[tuple[str, str]]


@p.command
@p.scenario_argument
@p.map_option
@p.plot_option
@p.no_code_option
def check(console: Console, scenario: str, maps: tuple[Path, ...], plot: Path | None, no_code: bool) -> int:
    """Check a scenario and show how pushplan reads it: bodies, weights, contacts, and free space."""
    from pushplan.scenario.file import load_scenario

    p.check_outputs([scenario, *maps], plot)
    with p.code_of(scenario, console.note, no_code):
        stated = load_scenario(scenario, maps)
        questions = ask(stated, console)
        if not stated.task.one_load:
            return _check_rearrangement(stated, plot, console)
        console.say((stated.name, "bold"))
        understood = document(stated)
        console.table(rows(stated, understood))
        from pushplan.cli.stable_set import describe, set_rows

        with console.working("computing the stable set"):
            require_pushable(stated)
            stable, described = describe(stated, stated.stability.set)
            warnings = turn_warnings(stated, stable)
    console.say((f"stable set {stated.stability.set}", "bold"))
    console.table(set_rows(described, stated.chain.pusher.drive.kind))
    if plot is not None:
        with console.working(f"drawing {plot}"):
            from pushplan.drawing.plans import plot_scenario

            plot_scenario(stated, plot, stable)
    for warning in warnings:
        console.note(f"warning: {warning}")
    doubts = [counted(n, noun) for n, noun in ((questions, "question"), (len(warnings), "warning")) if n]
    console.say(("no errors" + ", but " * bool(doubts) + " and ".join(doubts), "yellow" if doubts else "green"))
    set_document = {"set": stated.stability.set, **described}
    console.emit({**understood, "stable_set": set_document, "warnings": warnings})
    return 0


def ask(scenario: Scenario, console: Console) -> int:
    """Print questions about valid but unlikely numbers in the file; return their count."""
    from pushplan.scenario.check import questions

    found = () if scenario.origin is None else questions(scenario.origin)
    for question in found:
        console.note(f"question: {question.text(str(scenario.path))}")
    return len(found)


def require_pushable(scenario: Scenario) -> None:
    """Check what loading does not: that the chain has a stable push, and the robot enough force for it.

    Raises:
        ScenarioError: If not, with the findings.
    """
    from pushplan.plans.judge import planning_set
    from pushplan.scenario.check import check_scenario

    findings = check_scenario(scenario)
    if not findings and scenario.task.held and scenario.origin is not None:
        try:
            planning_set(scenario, None)
        except EmptyStableSetError as error:
            findings = (scenario.origin.finding(("robot", "limits", "force"), str(error)),)
    if findings:
        raise ScenarioError(str(scenario.path), findings)


def turn_warnings(scenario: Scenario, stable: StableSet) -> list[str]:
    """Return warnings if the turns of a single push can be too wide for the free space, or go to one side only."""
    from pushplan.planners.controls import control_segments, margins_to_try
    from pushplan.planners.infeasible.turning import a_word_fits, turning_faults

    if not scenario.task.held:
        return []
    margin = margins_to_try(scenario, stable)[-1]
    segments = control_segments(stable, scenario.chain.pusher.drive, margin)
    if a_word_fits(scenario, segments):
        return []
    return [fault.text for fault in turning_faults(scenario.with_margin(margin), stable, segments)]


# --- contents of a scenario -------------------------------------------------------------------------------------


def document(scenario: Scenario) -> dict[str, Any]:
    """Return the contents of a scenario as a JSON object."""
    chain, interval = scenario.chain, scenario.interval
    room = tipping_room(chain, interval, off=scenario.stability.set in KNOWN_LOAD_SETS)  # as in the stable set
    frictions = scenario.contact_friction
    if frictions is None:
        frictions = np.array([[contact.friction] * 2 for contact in chain.contacts])
    return {
        "scenario": scenario.name,
        "robot": {"footprint": chain.pusher.footprint, "drive": chain.pusher.drive.kind},
        "objects": [
            {
                "name": obj.name,
                "mass": _stated(scenario, i, "mass"),
                "weight": _stated(scenario, i, "mass", GRAVITY),
                "floor_friction": _stated(scenario, i, "floor_friction"),
                "support": support_text(obj),
                "pressure_off_by": 0.0 if interval is None else interval.pressures.get(i, 0.0),
                "tipping_room": None if room is None else room[i],
                "pose": obj.pose_chain,
            }
            for i, obj in enumerate(chain.objects)
        ],
        "contacts": [
            {
                "pushed": chain.objects[contact.pushed].name,
                "pusher": None if contact.pusher == PLATE else chain.objects[contact.pusher].name,
                "length": contact.length,
                "friction": _one_or_two(*frictions[k].tolist()),
                "height": _one_or_two(*chain.contact_heights[k].tolist()),
            }
            for k, contact in enumerate(chain.contacts)
        ],
        "uncertainty": scenario.uncertainty.model_dump(),
        "snapped": None if scenario.load.snapping is None else asdict(scenario.load.snapping),
        "start": _place(scenario, scenario.start),
        "goal": _place(scenario, scenario.goal.pose_chain),
    }


def rows(scenario: Scenario, found: Mapping[str, Any]) -> Rows:
    """Return the contents of a scenario's document as labels and values."""
    chain, chosen = scenario.chain, scenario.stability.set
    rows = [("file", str(scenario.path)), *pusher_rows(chain.pusher)]
    for i in range(len(chain.objects)):
        rows += object_rows(scenario, i, found)
    for k, contact in enumerate(found["contacts"]):
        friction, height = contact["friction"], contact["height"]
        ends = friction if isinstance(friction, list) else [friction]
        angles = " to ".join(f"{degrees(atan(end)):.1f}" for end in ends)
        text = f"{contact['length']:.3f} m long, friction {_range_text(friction, '.3g')} ({angles} deg)"
        text += f", {_range_text(height, '.3f')} m above the floor" if height else ""
        rows.append((f"contact {chain.contact_name(k)}", text))
    if scenario.uncertainty.load > 0.0 and chosen not in KNOWN_LOAD_SETS:
        what = f"the uncertainty of the load has no effect: the set {chosen!r} holds for every pressure with the "
        rows.append(("uncertainty", f"{what}given centre"))
    if (snapping := scenario.load.snapping) is not None:
        for moved in snapping.objects:
            by = f"{1e3 * moved.gap:.3g} mm and {degrees(moved.turn):.3g} deg"
            rows.append((f"snapped {moved.name}", f"by {by} onto {moved.onto}"))
        if snapping.sideways:
            what = f"moved sideways by {1e3 * snapping.sideways:.3g} mm to the middle of the plate's contact"
            rows.append(("chain frame", what))
    return [*rows, ("workspace", workspace_text(scenario)), *((e, _place_text(found[e])) for e in ("start", "goal"))]


def _one_or_two(low: float, high: float) -> float | list[float]:
    """Return a number if both are equal, else the interval."""
    return low if low == high else [low, high]


def _stated(scenario: Scenario, i: int, name: str, factor: float = 1.0) -> float | list[float]:
    """Return a number of object i times a factor, or its interval."""
    if scenario.interval is not None:
        low, high = factor * getattr(scenario.interval, name)[i]
        if low < high:
            return [float(low), float(high)]
    return factor * float(getattr(scenario.chain.objects[i], name))


def _range_text(value: float | list[float], form: str) -> str:
    return " to ".join(format(end, form) for end in (value if isinstance(value, list) else [value]))


def pusher_rows(pusher: Pusher) -> Rows:
    """Return the rows of the plate and of the robot."""
    thickness, width = np.ptp(pusher.outline, axis=0)
    plate = f"{width:.3f} m wide, {thickness:.3f} m thick, drive {pusher.drive.kind}"
    robot = "no footprint: collisions of the robot behind the plate are not checked"
    if pusher.footprint:
        points = np.concatenate(pusher.footprint)
        length, width = np.ptp(points, axis=0)
        parts = counted(len(pusher.footprint), "part")
        behind = f"up to {-float(points[:, 0].min()):.3f} m behind the plate's front"
        robot = f"{length:.3f} x {width:.3f} m in {parts}, {behind}"
    return [("pusher", plate), ("robot", robot)]


def workspace_text(scenario: Scenario) -> str:
    """Return the workspace and the number of obstacles as text."""
    area = scenario.workspace
    space = "unlimited" if area is None else f"x {area.xmin:g} to {area.xmax:g} m, y {area.ymin:g} to {area.ymax:g} m"
    return f"{space}, {counted(len(scenario.obstacles), 'obstacle')}"


def object_rows(scenario: Scenario, i: int, found: Mapping[str, Any]) -> Rows:
    """Return the rows of an object: shape, mass and friction, and its load on the floor."""
    outline, stated = scenario.chain.objects[i].outline, found["objects"][i]
    length, width = np.ptp(outline, axis=0)
    shape = f"{length:.3f} x {width:.3f} m, {len(outline)} corners"
    mass, weight = _range_text(stated["mass"], "g"), _range_text(stated["weight"], ".1f")
    friction, load = _range_text(stated["floor_friction"], ".3g"), stated["support"]
    if scenario.interval is not None and i in scenario.interval.fractions:
        load = load.replace("known loads", "loads in intervals")
    if share := stated["pressure_off_by"]:
        load += f", pressure off by up to {100.0 * share:.3g} %"
    if stated["tipping_room"] is not None:
        load += f", {1e3 * stated['tipping_room']:.3g} mm from tipping"
    return [(f"object {stated['name']}", f"{shape}, {mass} kg ({weight} N), floor friction {friction}"), ("", load)]


def support_text(obj: PushedObject) -> str:
    """Return an object's load on the floor as text."""
    support = obj.support
    x, y = np.round(support.center, 4) + 0.0  # no "-0"
    center = f"centre at ({x:g}, {y:g}) m of its frame"
    match support:
        case UniformSupport(center_of_mass=None):
            return f"load spread evenly, {center}"
        case UniformSupport():
            return f"load spread linearly, {center}"
        case FeetSupport():
            known = "known" if support.known else "unknown"
            return f"{counted(len(support.positions), 'foot', 'feet')} with {known} loads, {center}"
        case PressureMapSupport():
            return f"pressure map of {counted(len(support.points), 'point')}, {center}"
    if not support.known:
        return f"load unknown, {center}"
    points = counted(len(support.point_loads.positions), "point")
    return f"known loads on {points} ({type(support).__name__}), {center}"


def room(scenario: Scenario, pose: FloatArray) -> float:
    """Return the distance from the chain at `pose` to the nearest obstacle or wall, m; infinite without one."""
    corners = [transform_points(pose, body.outline) for body in scenario.chain.bodies]
    bodies = shapely.MultiPolygon([shapely.Polygon(outline) for outline in corners])
    distances = [float(shapely.distance(bodies, one.core)) - one.radius for one in scenario.obstacles]
    area = scenario.workspace
    if area is not None:
        walls = np.array([area.xmin, area.ymin, -area.xmax, -area.ymax])
        points = np.concatenate(corners)
        distances.append(float((np.hstack([points, -points]) - walls).min()))
    return min(distances, default=np.inf)


def _place(scenario: Scenario, pose: FloatArray) -> dict[str, Any]:
    free = room(scenario, pose)
    return {"pose": pose, "room": free if isfinite(free) else None}


def _pose_text(pose: FloatArray) -> str:
    x, y, theta = plain(pose[0]), plain(pose[1]), plain(degrees(pose[2]))
    return f"({x:.4g}, {y:.4g}) m, {theta:.4g} deg"


def _place_text(place: Mapping[str, Any]) -> str:
    free = place["room"]
    room = "no obstacles" if free is None else f"{free:.3f} m from the nearest obstacle or wall"
    return f"chain frame at {_pose_text(place['pose'])}; {room}"


def _row_text(row: Row) -> str:
    where = "anywhere" if row.wall is None else f"at {'any wall' if row.wall == 'any' else f'the wall {row.wall}'}"
    if row.pose is not None:
        where = f"its rear at {_pose_text(row.pose)}"
    order = "in any order" if row.order == "any" else "in this order from the pusher outward"
    together = {"auto": "together if that costs less", "never": "one by one", "always": "all together"}
    return f"{', '.join(row.of)}, {order}, {where}; pushed {together[row.gather]}"


def _check_rearrangement(scenario: Scenario, plot: Path | None, console: Console) -> int:
    """Show the contents of a scenario with several objects; return the exit code."""
    from pushplan.planners.multi.contact_modes import find_modes
    from pushplan.plans.settings import PlanSettings

    first = scenario.alone(scenario.loads[0].name)
    rows, found = [("file", str(first.path))], []
    aims = {name: goal.aim(name) for goal in scenario.task.goals for name in goal.names}
    idle = "stays in place" if scenario.task.flush else "is moved only if it is in the way"
    for one in scenario.each_alone():
        name = one.load.name
        with console.working(f"computing the contacts of {name}"):
            require_pushable(one)
            modes = find_modes(one, PlanSettings().completed(one))
            faces = list(dict.fromkeys(mode.place.face for mode in modes))
        understood = document(one)
        rows += [
            *object_rows(one, 0, understood),
            ("", f"{aims.get(name, idle)}, can be pushed at {', '.join(faces)}"),
        ]
        found.append({**understood, "goals": len(scenario.goals.get(name, ())), "faces": faces})
    rows += [*pusher_rows(first.chain.pusher), ("workspace", workspace_text(first))]
    rows += [("row", _row_text(goal)) for goal in scenario.task.goals if isinstance(goal, Row)]
    if plot is not None:
        with console.working(f"drawing {plot}"):
            from pushplan.drawing.plans import plot_scenario

            plot_scenario(scenario, plot)
    console.say((f"{scenario.name}  (rearrangement)", "bold"))
    console.table(rows)
    console.say(("no errors", "green"))
    movable = [] if scenario.task.flush else [load.name for load in scenario.loads if load.name not in aims]
    console.emit({"scenario": scenario.name, "objects": found, "movable": movable})
    return 0
