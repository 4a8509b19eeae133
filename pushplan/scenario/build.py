"""Builds the scenario of a document, or reports its errors: a single load, or several separate objects."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, product
from typing import Any

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.polygon import TOUCH, overlap_depth
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.faces import face_pairs
from pushplan.scenario.chain import build_bodies, check_differ, widened
from pushplan.scenario.goals import Poses, Row, TaskGoal
from pushplan.scenario.layout import millimetres, outline_of
from pushplan.scenario.loads import PlacedLoad
from pushplan.scenario.model import Scenario
from pushplan.scenario.one_load import (
    check_pushes,
    check_room_for_inertia,
    one_load,
    shared,
    transport_of,
    turned_goals,
)
from pushplan.scenario.room import Attachments, placed, placement_errors
from pushplan.scenario.schema import GatheringFile, GoalPose, ObjectGoal, RearrangementFile
from pushplan.scenario.source import Place, Source, shorten
from pushplan.scenario.units import highest, lowest
from pushplan.scenario.validation import unknown_object, validate
from pushplan.util.arrays import FloatArray
from pushplan.util.names import PUSHER


def build_scenario(source: Source, attachments: Attachments) -> Scenario | None:
    """Return the scenario of a document, or report all its errors and return None."""
    build = _rearrangement if source.holds(("goals",)) else one_load
    scenario = build(source, attachments)
    return None if source.findings else scenario


def _rearrangement(source: Source, attachments: Attachments) -> Scenario | None:
    for key in ("goal", "start"):
        if source.holds((key,)):
            what = "is not allowed together with goals; each object has its own pose"
            source.error((key,), what, at_key=True)
    of_row = source.holds(("goals", "row", "of"))
    file: RearrangementFile | None = validate(GatheringFile if of_row else RearrangementFile, source)
    if file is None or not _names_are_known(file, source):
        return None
    check_room_for_inertia(file, source)
    common = shared(file, source, attachments)
    found = {obj.name: _placed_object(file, i, attachments, source) for i, obj in enumerate(file.objects)}
    loads = tuple(load for load in found.values() if load is not None)
    if not loads:
        return None
    if isinstance(file, GatheringFile):
        goals: tuple[TaskGoal, ...] = (_in_place(_row(file, source), loads),)
    else:
        goals = _poses(file, loads)
    scenario = Scenario(**common, task=transport_of(file, loads, goals, source))
    for i, name in enumerate(found):
        if found[name] is not None:
            part = _part_of(source, i, name)
            check_pushes(scenario.alone(name), ("goal", "pose"), part)
            source.take(part)
    if not source.findings:
        _check_apart(scenario, source)
        for goal in scenario.task.goals:
            if isinstance(goal, Row):
                _check_row(scenario, goal, source)
    return scenario


def _names_are_known(file: RearrangementFile, source: Source) -> bool:
    """Check that object names differ and that goals name objects; report errors and return False if not."""
    names = [obj.name for obj in file.objects]
    check_differ(names, source)
    row = isinstance(file, GatheringFile)
    aimed = file.goals.row.of if isinstance(file, GatheringFile) else tuple(file.goals)
    for i, name in enumerate(aimed):
        place: Place = ("goals", "row", "of", i) if row else ("goals", name)
        if name not in names:
            source.error(place, unknown_object(str(name), names), at_key=not row)
        elif name in aimed[:i]:
            source.error(place, f"'{name}' is already in the row; allowed: each object once")
    return not source.findings


def _poses(file: RearrangementFile, loads: tuple[PlacedLoad, ...]) -> tuple[TaskGoal, ...]:
    """Return the goals of single objects in a file."""
    found = []
    for load in (load for load in loads if load.name in file.goals):
        stated = _goals_of(file.goals[load.name], load.name)
        found.append(Poses(load.name, tuple(goal for one in stated for goal in turned_goals(one, load.chain))))
    return tuple(found)


def _row(file: GatheringFile, source: Source) -> Row:
    """Return the row of a file and report its errors."""
    stated, friction = file.goals.row, widened(file).contacts.friction
    names = [obj.name for obj in file.objects]
    if friction is None:
        what = "is missing, and the objects of a row touch; needed: a friction coefficient"
        source.error(("contacts", "friction"), what)
        friction = 0.0
    for i, pair in enumerate(file.contacts.between):
        if set(pair.objects) <= set(names):
            what = "is for two objects of a row; allowed: contacts.friction, for all of them"
            source.error(("contacts", "between", i), what)
    if stated.wall is not None and file.workspace is None:
        source.error(("goals", "row", "wall"), "needs a workspace, whose sides are the walls")
    where = ("goals", "row", "placed")
    for i, name in enumerate(stated.placed):
        if name not in stated.of:
            source.error((*where, i), f"'{shorten(str(name))}' is not in the row; allowed: {', '.join(stated.of)}")
    if len(set(stated.placed)) not in (0, *range(len(stated.placed), len(stated.of))):
        source.error(where, "names all objects of the row, or one twice; allowed: some of them, each once")
    if stated.placed and stated.anywhere:
        source.error(where, "is not allowed together with anywhere: such a row has no placed objects")
    front = stated.of[len(stated.of) - len(stated.placed) :]
    if stated.order == "given" and set(front) != set(stated.placed):
        source.error(where, f"is not the front of the given order; allowed: the last objects: {', '.join(front)}")
    if stated.anywhere and file.gather == "never":
        source.error(("gather",), "'never' is not allowed together with anywhere; allowed: auto, always")
    return Row(
        stated.of,
        None if stated.pose is None else np.array(stated.pose),
        stated.wall,
        stated.order,
        file.gather,
        (lowest(friction), highest(friction)),
        (stated.tolerance.position, stated.tolerance.angle),
        stated.placed,
    )


def _in_place(row: Row, loads: tuple[PlacedLoad, ...]) -> Row:
    """Return a row with the objects placed that already stand in their places at its front."""
    by_name = {load.name: load for load in loads}
    if row.pose is None or row.placed or not set(row.of) <= set(by_name):
        return row
    pairs = {name: face_pairs(by_name[name].chain.objects[0].outline) for name in row.of}
    lengths = [{round(float(one.across[0]), 9) for one in each if one.across is not None} for each in pairs.values()]
    best: tuple[str, ...] = ()
    for length in {sum(each) for each in product(*lengths)}:
        front, found = se2.compose(row.pose, [length, 0.0, 0.0]), tuple[str, ...]()
        while len(found) < len(row.of) - 1:
            left = [name for name in row.of if name not in found]
            names = left[-1:] if row.order == "given" else left
            each = [
                (name, se2.compose(by_name[name].pose, one.exit), se2.compose(by_name[name].pose, one.entry))
                for name in names
                for one in pairs[name]
                if one.exit is not None
            ]
            errors = [se2.pose_error(leaves, front) for _, leaves, _ in each]
            near = [
                k for k, (away, turn) in enumerate(errors) if away <= row.tolerance[0] and turn <= row.tolerance[1]
            ]
            if not near:
                break
            name, _, front = each[near[0]]
            found = (name, *found)
        best = max(best, found, key=len)
    return replace(row, placed=best)


def _part_of(source: Source, i: int, name: str) -> Source:

    def moved(place: Place) -> Place:
        match place:
            case ("objects", 0, *rest):
                return ("objects", i, *rest)
            case ("goal", *rest):
                stated = ("goals", name, *rest)
                at = ("goals", name) if source.holds(("goals", name)) else ("objects", i, "pose")
                return stated if source.holds(stated) else at
            case ("start", *_):
                return ("objects", i, "pose")
        return place

    return source.moved(moved)


def _placed_object(file: RearrangementFile, i: int, attachments: Attachments, source: Source) -> PlacedLoad | None:
    obj, part = file.objects[i], _part_of(source, i, file.objects[i].name)
    between = tuple(pair for pair in file.contacts.between if set(pair.objects) == {obj.name, PUSHER})
    pose = _on_the_plate(outline_of(obj.shape))
    if pose is None:
        source.error(("objects", i, "shape"), f"'{obj.name}' has no edge that a plate can lie flat against")
        return None
    alone = {
        "objects": (obj.model_copy(update={"pose": pose if pose[2] else None, "offset": None}),),
        "contacts": file.contacts.model_copy(update={"friction": None, "between": between}),
    }
    bodies = build_bodies(file.model_copy(update=alone), attachments.read, part)
    source.take(part)
    if bodies is None:
        return None
    start = se2.compose(np.array(obj.pose), se2.inverse(bodies.chain.objects[0].pose_chain))
    return PlacedLoad(**{**vars(bodies), "start": start, "stated": {**bodies.stated, "pose": obj.pose}})


def _on_the_plate(outline: FloatArray) -> tuple[float, ...] | None:
    """Return the pose of an object with its rear edge, or else its longest possible edge, flat against the plate."""
    flat = []
    for pair in face_pairs(outline):
        pose = se2.inverse(pair.entry).round(15)
        if se2.transform_points(pose, outline)[:, 0].min() >= -TOUCH:
            flat.append((pose[2] == 0.0, pair.length, tuple(map(float, pose))))
    return max(flat)[2] if flat else None


def _goals_of(stated: Any, name: str) -> tuple[GoalPose, ...]:
    """Return the goals of one object in the form of a file of one load."""
    if isinstance(stated, ObjectGoal):
        return (GoalPose.model_construct(of=name, **dict(stated)),)
    if isinstance(stated[0], float):
        return _goals_of(ObjectGoal.model_construct(pose=stated), name)
    return tuple(goal for one in stated for goal in _goals_of(one, name))


def _check_row(scenario: Scenario, row: Row, source: Source) -> None:
    """Report a row that does not fit at its goal with the robot behind it, in any order and with any faces."""
    if row.pose is None and row.wall is None:
        return
    length, faces, loads = 0.0, scenario.transport.faces, scenario.task.by_name
    for i, name in enumerate(row.of):
        outline = loads[name].chain.objects[0].outline
        depths = [pair.across[0] for pair in face_pairs(outline, faces) if pair.across is not None]
        if not depths:
            what = f"'{name}' cannot stand in a row: no face that the plate may push is parallel to an opposite face"
            source.error(("goals", "row", "of", i), what)
            return
        length += float(min(depths))
    chain = loads[row.of[0]].chain
    plate = float(chain.pusher.plate_pose[0])
    behind = plate - min(float(body.outline[:, 0].min()) for body in chain.carried)
    area = scenario.workspace
    if row.pose is None:
        assert area is not None
        rooms = {"x": area.xmax - area.xmin, "y": area.ymax - area.ymin}
        room = max(rooms.values()) if row.wall == "any" else rooms[str(row.wall)[0]]
        if length + behind > room:
            what = f"a row of at least {length:.3g} m and {behind:.3g} m of robot do not fit into {room:.3g} m"
            source.error(("goals", "row", "wall"), what)
        return
    # Every row is wider than this strip, so an obstacle of the strip is an obstacle of every row.
    narrow = np.array([[0.0, -1e-3], [length, -1e-3], [length, 1e-3], [0.0, 1e-3]])
    robot = placed(chain.carried, se2.compose(row.pose, se2.inverse(chain.pusher.plate_pose)))
    for what in placement_errors(
        "end", [(f"row of {length:.3g} m", se2.transform_points(row.pose, narrow)), *robot], scenario
    ):
        source.error(("goals", "row", "pose"), what)


def _check_apart(scenario: Scenario, source: Source) -> None:
    """Report objects that are too near to each other at the start or at their goals."""
    loads, kept = scenario.task.by_name, scenario.clearance
    names = list(loads)
    standing = {name: _area(load.chain, load.start) for name, load in loads.items()}
    flush = [set(goal.placed) for goal in scenario.task.goals if isinstance(goal, Row)]
    for one, other in combinations(names, 2):
        gap = float(standing[one].distance(standing[other]))
        if gap < kept:
            both = (_outlines(loads[name].chain, loads[name].start) for name in (one, other))
            depth = max(overlap_depth(a, b) for a, b in product(*both))
            if depth <= TOUCH and any({one, other} <= placed for placed in flush):
                continue
            where = f"overlaps '{one}' by {millimetres(depth)}" if depth else f"is {millimetres(gap)} from '{one}'"
            what = f"'{other}' {where}; allowed: at least {millimetres(kept)} apart"
            source.error(("objects", names.index(other), "pose"), what)
    for name, what in overlapping_goals(scenario).items():
        source.error(("goals", name), what)


def overlapping_goals(scenario: Scenario) -> dict[str, str]:
    """Return sentences on pairs of loads with overlapping goals, by the name of the second load."""
    ends, found, kept = dict[str, list[shapely.MultiPolygon]](), dict[str, str](), scenario.clearance
    for name, goals in scenario.goals.items():  # at each goal, and at the start if that reaches a goal
        load = scenario.task.by_name[name]
        poses = [goal.pose_chain for goal in goals]
        poses += [load.start for goal in goals if goal.is_reached(load.start)]
        ends[name] = [_area(load.chain, pose) for pose in poses]
    for one, other in combinations(ends, 2):
        gap = max(float(a.distance(b)) for a in ends[one] for b in ends[other])
        if gap < kept:
            found[other] = (
                f"at their goals, '{one}' and '{other}' are {millimetres(gap)} apart; "
                f"allowed: at least {millimetres(kept)}; for objects that touch, use goals.row"
            )
    return found


def _area(chain: Chain, pose: FloatArray) -> shapely.MultiPolygon:
    """Return the area of the objects with the chain frame at a pose (3,)."""
    return shapely.MultiPolygon([shapely.Polygon(outline) for outline in _outlines(chain, pose)])


def _outlines(chain: Chain, pose: FloatArray) -> list[FloatArray]:
    return [se2.transform_points(pose, obj.outline_chain) for obj in chain.objects]
