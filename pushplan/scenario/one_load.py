"""Builds the scenario of a document with one load, for one push or several, or reports its errors.

The parts that files of several objects share are built and checked here, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pushplan.geometry import se2
from pushplan.geometry.polygon import overlap_depth
from pushplan.mechanics.chain import Body, BodyKind, Chain
from pushplan.scenario import schema
from pushplan.scenario.chain import build_bodies
from pushplan.scenario.goals import Goal, Poses, TaskGoal
from pushplan.scenario.layout import millimetres
from pushplan.scenario.loads import PlacedLoad
from pushplan.scenario.model import Scenario
from pushplan.scenario.room import Attachments, build_surroundings, placed, placement_errors
from pushplan.scenario.schema import GoalPose, RearrangementFile, RoomFile, ScenarioFile
from pushplan.scenario.source import Place, Source
from pushplan.scenario.task import Push, Transport
from pushplan.scenario.validation import salvage, unknown_object, validate
from pushplan.util.arrays import FloatArray
from pushplan.util.names import DEFAULT_PLANNER, RANKED_BY, TRANSIT_CLEARANCE

_NEAREST = 1e-3
"""Smallest distance beyond the clearance at the start of an approach and at the end of a retreat, m."""

_OF_SEVERAL = {"name", "cost", "time_limit", "seed", "gap"}
"""Keys of `planner` that apply to multi-push plans."""


def shared(file: RoomFile, source: Source, attachments: Attachments) -> dict[str, Any]:
    """Return the arguments that all kinds of scenarios share, and report errors of the room."""
    workspace, obstacles = build_surroundings(file, attachments, source)
    planner = file.planner if file.robot.start is None else file.planner.model_copy(update={"cost": RANKED_BY})
    return {
        "name": file.name or source.path.stem,
        "path": source.path,
        "source": source.data,
        "origin": source,
        "floor_friction": file.floor.friction,
        "workspace": workspace,
        "obstacles": obstacles,
        "clearance": file.clearance,
        "stability": file.stability,
        "planner": planner,
        "trajectory": file.trajectory,
        "attachments": attachments.contents,
        "uncertainty": file.uncertainty,
    }


def check_room_for_inertia(file: RoomFile, source: Source) -> None:
    """Report dynamic contact limits without a margin."""
    if file.pusher.limits.contact == "dynamic" and file.stability.margin == 0.0:
        source.error(
            ("pusher", "limits", "contact"),
            "'dynamic', the default, needs a stability.margin above 0, because a contact at its limit has no reserve "
            "for inertia; allowed: a stability.margin such as auto or 0.05, or quasi-static",
        )


def one_load(source: Source, attachments: Attachments) -> Scenario | None:
    """Return the scenario of a document with one load; None if its errors do not allow one."""
    file, doubtful = validate(ScenarioFile, source), set[str]()
    if file is None:
        mended = salvage(source)
        if mended is None:
            return None
        file, doubtful = mended
    part = source.moved(lambda place: place)
    bodies = build_bodies(file, attachments.read, part)
    source.take(part, *doubtful)  # without errors that follow from stand-ins
    stated = _stated_goals(file)
    if not _goals_exist(file, stated, source):
        doubtful.add("goal")
    if bodies is None:
        return None
    check_room_for_inertia(file, source)
    _check_for_several_only(file, source)
    load = PlacedLoad(start=np.array(file.start), **vars(bodies))
    goals = tuple(goal for one in stated.values() for goal in turned_goals(one, bodies.chain))
    several = file.robot.start is not None
    goal = Poses(load.name, goals)
    task = transport_of(file, (load,), (goal,), source) if several else Push((load,), (goal,))
    scenario = Scenario(**shared(file, source, attachments), task=task)
    if doubtful & {"workspace", "obstacles", "clearance"}:
        return None
    if not several:
        for what, place, pose in (
            ("start", ("start",), scenario.start),
            ("goal", ("goal", "pose"), scenario.goal.pose_chain),
        ):
            if what not in doubtful:
                for error in placement_errors(what, placed(scenario.chain.bodies, pose), scenario):
                    source.error(place, error)
    elif not doubtful & {"start", "goal", "robot"}:
        check_pushes(scenario, (*next(iter(stated)), "pose"), source)
    return scenario


def _stated_goals(file: ScenarioFile) -> dict[Place, GoalPose]:
    """Return the goals of a file by their places; a bare pose is a goal of the chain frame."""
    stated: Any = file.goal
    several = isinstance(stated, tuple) and not isinstance(stated[0], float)
    each = {("goal", i): goal for i, goal in enumerate(stated)} if several else {("goal",): stated}
    return {
        place: goal if isinstance(goal, GoalPose) else GoalPose.model_construct(pose=goal)
        for place, goal in each.items()
    }


def _goals_exist(file: ScenarioFile, stated: Mapping[Place, GoalPose], source: Source) -> bool:
    """Return whether the object of each goal exists, and report the first one that does not."""
    known = [obj.name for obj in file.objects]
    for place, goal in stated.items():
        if goal.of is not None and goal.of not in known:
            source.error((*place, "of"), unknown_object(goal.of, known))
            return False
    return True


def turned_goals(stated: GoalPose, chain: Chain) -> Iterator[Goal]:
    """Yield a goal for each turn that the object's symmetry allows."""
    known = [obj.name for obj in chain.objects]
    for k in range(stated.symmetry):
        turn = se2.wrap_angle(stated.pose[2] + 2.0 * np.pi * k / stated.symmetry) if k else stated.pose[2]
        pose = pose_chain = np.array([*stated.pose[:2], turn])
        if stated.of in known:
            inner = chain.objects[chain.index_of(stated.of)].pose_chain
            pose_chain = se2.compose(pose, se2.inverse(inner))
        yield Goal(pose, stated.of, pose_chain, stated.tolerance.position, stated.tolerance.angle)


def _check_for_several_only(file: ScenarioFile, source: Source) -> None:
    """Report keys that have no meaning for a single push."""
    if file.robot.start is not None:
        return
    meaningless: dict[Place, bool] = {
        ("goal",): ("goal",) not in _stated_goals(file),
        ("goal", "symmetry"): isinstance(file.goal, GoalPose) and file.goal.symmetry > 1,
        ("pusher", "faces"): file.pusher.faces is not None,
        ("pusher", "offsets"): file.pusher.offsets is not None,
        ("pushes",): file.pushes is not None,
    }
    for place in (place for place, stated in meaningless.items() if stated):
        what = "is for multi-push plans only: it needs a robot.start, the plate's pose in the world"
        source.error(place, what, at_key=True)


def transport_of(
    file: RoomFile, loads: tuple[PlacedLoad, ...], goals: tuple[TaskGoal, ...], source: Source
) -> Transport:
    """Return the transport of loads, with the start of the robot and the allowed contacts."""
    assert file.robot.start is not None  # a file of several objects has one
    for name in sorted(file.planner.model_fields_set - _OF_SEVERAL):
        what = "is only for a single push; for multi-push plans (robot.start), 'pushes' holds the costs"
        source.error(("planner", name), what, at_key=True)
    for name, only in (("name", DEFAULT_PLANNER), ("cost", RANKED_BY)):
        if name in file.planner.model_fields_set and getattr(file.planner, name) != only:
            source.error(("planner", name), f"is only for a single push; allowed for multi-push plans: {only}")
    plate, choice = file.pusher, file.pushes or schema.PushChoice()
    if isinstance(file, RearrangementFile) and "transit_weight" not in choice.model_fields_set:
        choice = choice.model_copy(update={"transit_weight": 1.0})  # transits are half of the path
    least = max(file.clearance, TRANSIT_CLEARANCE) + _NEAREST
    longer = {name: max(getattr(choice, name), least) for name in ("approach", "retreat")}
    choice = choice.model_copy(update={k: v for k, v in longer.items() if k not in choice.model_fields_set})
    faces = None if plate.faces in (None, "all") else tuple(plate.faces)
    contacts = file.contacts.model_dump(exclude_none=True)
    offsets = plate.offsets or (0.0,)
    return Transport(loads, goals, np.array(file.robot.start), contacts, faces, offsets, **choice.model_dump())


def check_pushes(scenario: Scenario, goal: Place, source: Source) -> None:
    """Report errors of a multi-push problem: short approaches, and collisions at the start or at all goals."""
    task = scenario.transport
    for name in ("approach", "retreat"):
        kept = max(scenario.clearance, TRANSIT_CLEARANCE)
        least = kept + _NEAREST  # defaults are never shorter
        if getattr(task, name) < least:
            why = f"the robot keeps {kept:.6g} m from the objects in transit"
            what = f"is {getattr(task, name):.6g} m, but {why}; allowed: at least {least:.6g}"
            source.error(("pushes", name), what)
    for place, what in start_errors(scenario):
        source.error(place, what)
    taken = [list(load_errors(scenario, one.pose_chain, "goal")) for one in scenario.goals[scenario.load.name]]
    if all(taken):
        for what in taken[0]:
            source.error(goal, what)


def start_errors(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Yield a place in the file and a sentence for every object and robot part in collision at the start."""
    chain = scenario.chain
    for what in load_errors(scenario, scenario.start, "start"):
        yield ("start",), what
    robot = placed(chain.carried, scenario.robot_start)
    for what in placement_errors("robot's start", robot, scenario):
        yield ("robot", "start"), what
    for name, outline in robot:
        for other, standing in placed(_objects(chain), scenario.start):
            depth = overlap_depth(standing, outline)
            if depth > 0.0:
                what = f"at the robot's start, '{name}' overlaps '{other}' by {millimetres(depth)}"
                yield ("robot", "start"), what


def load_errors(scenario: Scenario, load: FloatArray, what: str) -> Iterator[str]:
    """Yield a sentence for each object in collision with the load at a pose (3,): its `start` or a `goal`."""
    return placement_errors(what, placed(_objects(scenario.chain), load), scenario)


def _objects(chain: Chain) -> list[Body]:
    return [body for body in chain.bodies if body.kind is BodyKind.OBJECT]
