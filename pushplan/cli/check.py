"""Check a scenario and show what was understood: bodies, weights, contacts, and the room at start and goal."""

from __future__ import annotations

from dataclasses import asdict
from math import atan, degrees, isfinite
from pathlib import Path

import numpy as np
import shapely

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, counted, plain
from pushplan.errors import EmptyStableSetError, ScenarioError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, PLATE, PushedObject, Pusher
from pushplan.mechanics.heights import tipping_room
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Row, Snapping
from pushplan.util.arrays import FloatArray
from pushplan.util.names import KNOWN_LOAD_SETS


@p.command
@p.scenario_argument
@p.map_option
@p.plot_option
@p.no_code_option
def check(console: Console, scenario: str, maps: tuple[Path, ...], plot: Path | None, no_code: bool) -> int:
    """Check a scenario and show what was understood."""
    from pushplan.scenario.file import load_scenario

    p.check_outputs([scenario, *maps], plot)
    with p.code_of(scenario, console.note, no_code):
        stated = load_scenario(scenario, maps)
        questions = ask(stated, console)
        if stated.kind == "rearrangement":
            return _check_rearrangement(stated, plot, console)
        console.say((stated.name, "bold"))
        console.table(rows(stated))
        from pushplan.cli.stable_set import describe, set_document, set_rows

        with console.working("computing the stable set"):
            require_pushable(stated)
            described = describe(stated, stated.stability.set)
    console.say((f"stable set {stated.stability.set}", "bold"))
    console.table(set_rows(described))
    if plot is not None:
        with console.working(f"drawing {plot}"):
            from pushplan.drawing.plans import plot_scenario

            plot_scenario(stated, plot, described.stable)
    said = f"no errors, but {counted(questions, 'question')}" if questions else "no errors"
    console.say((said, "yellow" if questions else "green"))
    console.emit({**document(stated), "stable_set": {"set": stated.stability.set, **set_document(described)}})
    return 0


def ask(scenario: Scenario, console: Console) -> int:
    """Ask about numbers that the file may state but hardly means; return how many."""
    from pushplan.scenario.check import questions

    found = () if scenario.origin is None else questions(scenario.origin)
    for question in found:
        console.note(f"question: {question.text(str(scenario.path))}")
    return len(found)


def require_pushable(scenario: Scenario) -> None:
    """Check what loading leaves out: whether any push keeps the chain together, and the robot has the force for one.

    Raises:
        ScenarioError: With the findings.
    """
    from pushplan.plans.judge import planning_set
    from pushplan.scenario.check import check_scenario

    findings = check_scenario(scenario)
    if not findings and scenario.pushes is None and scenario.origin is not None:
        try:
            planning_set(scenario, None)
        except EmptyStableSetError as error:
            findings = (scenario.origin.finding(("robot", "limits", "force"), str(error)),)
    if findings:
        raise ScenarioError(str(scenario.path), findings)


# --- what was understood ----------------------------------------------------------------------------------------


def rows(scenario: Scenario) -> list[tuple[str, str]]:
    """Return label and value of everything that a user should recognise."""
    chain = scenario.chain
    return [
        ("file", str(scenario.path)),
        ("pusher", pusher_text(chain.pusher)),
        ("robot", robot_text(chain.pusher)),
        *(row for i in range(len(chain.objects)) for row in object_rows(scenario, i)),
        *(
            (
                f"contact {chain.contact_name(k)}",
                f"{contact.length:.3f} m long, {friction_text(*_frictions(scenario, k))}"
                + _height_text(*chain.contact_heights[k]),
            )
            for k, contact in enumerate(chain.contacts)
        ),
        *_uncounted(scenario),
        *_snapped_rows(scenario.snapping),
        ("workspace", workspace_text(scenario)),
        ("start", _place_text(scenario, scenario.start)),
        ("goal", _place_text(scenario, scenario.goal.pose_chain)),
    ]


def document(scenario: Scenario) -> dict[str, object]:
    """Return the same as an object for JSON."""
    chain, room = scenario.chain, _tipping_room(scenario)
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
                "pressure_off_by": _pressure_share(scenario, i),
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
                "friction": _one_or_two(_frictions(scenario, k)),
                "height": _one_or_two(tuple(chain.contact_heights[k].tolist())),
            }
            for k, contact in enumerate(chain.contacts)
        ],
        "uncertainty": scenario.uncertainty.model_dump(),
        "snapped": None if scenario.snapping is None else asdict(scenario.snapping),
        "start": _place(scenario, scenario.start),
        "goal": _place(scenario, scenario.goal.pose_chain),
    }


def _one_or_two(ends: tuple[float, float]) -> float | list[float]:
    """Return a number, or the ends of an interval."""
    return ends[0] if ends[0] == ends[1] else list(ends)


def pusher_text(pusher: Pusher) -> str:
    """Return the pusher in words."""
    thickness, width = np.ptp(pusher.outline, axis=0)
    return f"{width:.3f} m wide, {thickness:.3f} m thick, drive {pusher.drive.kind}"


def _height_text(low: float, high: float) -> str:
    """Return how high a contact is, in words; nothing at the floor."""
    if high == 0.0:
        return ""
    return f", {_range_text(low if low == high else [low, high], '.3f')} m above the floor"


def robot_text(pusher: Pusher) -> str:
    """Return the robot's body in words, or that it is not known."""
    if not pusher.footprint:
        return "no footprint stated: the robot behind the plate is not looked at"
    points = np.concatenate(pusher.footprint)
    length, width = np.ptp(points, axis=0)
    behind = -float(points[:, 0].min())
    parts = counted(len(pusher.footprint), "part")
    return f"{length:.3f} x {width:.3f} m in {parts}, up to {behind:.3f} m behind the plate's front"


def _stated(scenario: Scenario, i: int, name: str, factor: float = 1.0) -> float | list[float]:
    """Return a number of object i times a factor, or its lowest and highest value."""
    if scenario.interval is not None:
        low, high = factor * getattr(scenario.interval, name)[i]
        if low < high:
            return [float(low), float(high)]
    return factor * float(getattr(scenario.chain.objects[i], name))


def _frictions(scenario: Scenario, k: int) -> tuple[float, float]:
    """Return the least and largest friction of contact k."""
    if scenario.contact_friction is None:
        return (scenario.chain.contacts[k].friction,) * 2
    low, high = scenario.contact_friction[k]
    return float(low), float(high)


def _pressure_share(scenario: Scenario, i: int) -> float:
    """Return the share by which the pressure under object i may be off, 0 where none is stated."""
    return 0.0 if scenario.interval is None else scenario.interval.pressures.get(i, 0.0)


def _uncounted(scenario: Scenario) -> list[tuple[str, str]]:
    """Return what to know of `uncertainty` where the stable set does not go by the load."""
    chosen = scenario.stability.set
    if scenario.uncertainty.load == 0.0 or chosen in KNOWN_LOAD_SETS:
        return []
    return [
        (
            "uncertainty",
            f"load is not counted: the set {chosen!r} holds for every pressure with the stated centre, "
            "and takes that centre as it is",
        )
    ]


def _snapped_rows(snapping: Snapping | None) -> list[tuple[str, str]]:
    """Return how each object with a measured pose was moved."""
    if snapping is None:
        return []
    rows = [
        (f"snapped {moved.name}", f"by {1e3 * moved.gap:.3g} mm and {degrees(moved.turn):.3g} deg onto {moved.onto}")
        for moved in snapping.objects
    ]
    if snapping.sideways:
        what = f"moved by {1e3 * snapping.sideways:.3g} mm sideways, to the middle of the plate's contact"
        rows.append(("chain frame", what))
    return rows


def _range_text(value: float | list[float], form: str) -> str:
    return " to ".join(format(end, form) for end in (value if isinstance(value, list) else [value]))


def workspace_text(scenario: Scenario) -> str:
    """Return the room in words."""
    area = scenario.workspace
    space = "unlimited" if area is None else f"x {area.xmin:g} to {area.xmax:g} m, y {area.ymin:g} to {area.ymax:g} m"
    return f"{space}, {counted(len(scenario.obstacles), 'obstacle')}"


def object_rows(scenario: Scenario, i: int) -> list[tuple[str, str]]:
    """Return the rows of an object: shape, mass and friction, and how its load rests on the floor."""
    obj = scenario.chain.objects[i]
    length, width = np.ptp(obj.outline, axis=0)
    shape = f"{length:.3f} x {width:.3f} m, {len(obj.outline)} corners"
    mass = _range_text(_stated(scenario, i, "mass"), "g")
    weight = _range_text(_stated(scenario, i, "mass", GRAVITY), ".1f")
    friction = _range_text(_stated(scenario, i, "floor_friction"), ".3g")
    load = support_text(obj)
    if scenario.interval is not None and i in scenario.interval.fractions:
        load = load.replace("known loads", "loads in intervals")
    if share := _pressure_share(scenario, i):
        load += f", pressure off by up to {100.0 * share:.3g} %"
    room = _tipping_room(scenario)
    if room is not None:
        load += f", {1e3 * room[i]:.3g} mm from tipping"
    return [(f"object {obj.name}", f"{shape}, {mass} kg ({weight} N), floor friction {friction}"), ("", load)]


def _tipping_room(scenario: Scenario) -> FloatArray | None:
    """Return by how much (n,) loads could move on before an object tips, m, as the stable set has it."""
    return tipping_room(scenario.chain, scenario.interval, off=scenario.stability.set in KNOWN_LOAD_SETS)


def support_text(obj: PushedObject) -> str:
    """Return in words how an object's load rests on the floor."""
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
    return f"load unknown, {center}"


def friction_text(lowest: float, highest: float | None = None) -> str:
    """Return a friction coefficient, or the ends of its interval, and its angle."""
    ends = [lowest] if highest is None or highest == lowest else [lowest, highest]
    angles = " to ".join(f"{degrees(atan(friction)):.1f}" for friction in ends)
    return f"friction {' to '.join(f'{friction:.3g}' for friction in ends)} ({angles} deg)"


def room(scenario: Scenario, pose: FloatArray) -> float:
    """Return the distance of the chain at `pose` to the nearest obstacle or wall, m; infinite without any."""
    corners = [transform_points(pose, body.outline) for body in scenario.chain.bodies]
    bodies = shapely.MultiPolygon([shapely.Polygon(outline) for outline in corners])
    distances = [float(shapely.distance(bodies, one.core)) - one.radius for one in scenario.obstacles]
    area = scenario.workspace
    if area is not None:
        walls = np.array([area.xmin, area.ymin, -area.xmax, -area.ymax])
        points = np.concatenate(corners)
        distances.append(float((np.hstack([points, -points]) - walls).min()))
    return min(distances, default=np.inf)


def _place(scenario: Scenario, pose: FloatArray) -> dict[str, object]:
    free = room(scenario, pose)
    return {"pose": pose, "room": free if isfinite(free) else None}


def _place_text(scenario: Scenario, pose: FloatArray) -> str:
    free = room(scenario, pose)
    x, y, theta = plain(pose[0]), plain(pose[1]), plain(degrees(pose[2]))
    text = f"chain frame at ({x:.4g}, {y:.4g}) m, {theta:.4g} deg"
    return f"{text}; nothing in the way" if not isfinite(free) else f"{text}; {free:.3f} m from the nearest thing"


def _row_text(row: Row) -> str:
    """Return what a row is made of and where it shall be."""
    where = "anywhere" if row.wall is None else f"at {'any wall' if row.wall == 'any' else f'the wall {row.wall}'}"
    if row.pose is not None:
        x, y, theta = plain(row.pose[0]), plain(row.pose[1]), plain(degrees(row.pose[2]))
        where = f"its rear at ({x:.4g}, {y:.4g}) m, {theta:.4g} deg"
    order = "in any order" if row.order == "any" else "in this order from the pusher outward"
    together = {"auto": "together where that costs less", "never": "one by one", "always": "all together"}
    return f"{', '.join(row.of)}, {order}, {where}; pushed {together[row.gather]}"


def _check_rearrangement(scenario: Scenario, plot: Path | None, console: Console) -> int:
    """Show what was understood of a scenario of several objects; return the exit code."""
    from pushplan.planners.multi.contact_modes import find_modes
    from pushplan.plans.settings import PlanSettings

    alone = {name: scenario.alone(name) for name in scenario.bodies}
    first = next(iter(alone.values()))
    rows, found = [("file", str(first.path))], []
    for name, one in alone.items():
        with console.working(f"looking at the contacts of {name}"):
            require_pushable(one)
            modes = find_modes(one, PlanSettings().completed(one))
            faces = list(dict.fromkeys(mode.place.face for mode in modes))
        goals = len(scenario.bodies[name].goals)
        aim = f"goes to {'its goal' if goals == 1 else f'one of {goals} goals'}"
        aim = aim if goals else "is moved where it is in the way"
        if scenario.row is not None:
            aim = "goes into the row" if name in scenario.row.of else "stays where it is"
        rows += [*object_rows(one, 0), ("", f"{aim}, can be pushed at {', '.join(faces)}")]
        found.append({**document(one), "goals": goals, "faces": faces})
    rows += [
        ("pusher", pusher_text(first.chain.pusher)),
        ("robot", robot_text(first.chain.pusher)),
        ("workspace", workspace_text(first)),
    ]
    if scenario.row is not None:
        rows.append(("row", _row_text(scenario.row)))
    if plot is not None:
        with console.working(f"drawing {plot}"):
            from pushplan.drawing.plans import plot_scenario

            plot_scenario(scenario, plot)
    console.say((f"{scenario.name}  (rearrangement)", "bold"))
    console.table(rows)
    console.say(("no errors", "green"))
    movable = [name for name in scenario.bodies if name not in scenario.goals and scenario.row is None]
    console.emit({"scenario": scenario.name, "objects": found, "movable": movable})
    return 0
