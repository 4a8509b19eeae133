"""Several pushes in a scenario file: goals, where the robot starts, and what is wrong with either."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from pushplan.geometry import se2
from pushplan.geometry.penetration import overlap_depth
from pushplan.mechanics.body import Body, BodyKind
from pushplan.mechanics.chain import Chain
from pushplan.scenario.arrangement.meeting import millimetres
from pushplan.scenario.arrangement.placement import Surroundings, placement_troubles
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Goal, Pushes
from pushplan.scenario.schema.scenario import GoalPose, PushChoice, ScenarioFile, StatedRoom
from pushplan.scenario.yaml.node import Place
from pushplan.scenario.yaml.report import Report
from pushplan.util.arrays import FloatArray
from pushplan.util.names import DEFAULT_PLANNER, RANKED_BY, TRANSIT_CLEARANCE

NEAREST = 1e-3
"""What an approach begins, and a retreat ends, farther from the objects than the clearance, m."""


BEARS_ON_SEVERAL = {"name", "cost", "time_limit", "seed", "gap"}
"""Keys of `planner` that bear on several pushes."""

_NOT_FOR_SEVERAL = "is for a single push; several pushes (robot.start) are weighed by what 'pushes' says"


def stated_goals(file: ScenarioFile) -> tuple[tuple[Place, GoalPose], ...]:
    """Return the goals of a file and where each stands."""
    if isinstance(file.goal, GoalPose):
        return ((("goal",), file.goal),)
    return tuple((("goal", i), goal) for i, goal in enumerate(file.goal))


def make_goals(stated: Iterable[GoalPose], chain: Chain) -> tuple[Goal, ...]:
    """Return all goals, one for each turn that an object's symmetry allows."""
    return tuple(goal for one in stated for goal in _turned(one, chain))


def _turned(stated: GoalPose, chain: Chain) -> Iterator[Goal]:
    known = [obj.name for obj in chain.objects]
    inner = np.zeros(3) if stated.of not in known else chain.objects[chain.index_of(stated.of)].pose_chain
    for k in range(stated.symmetry):
        turn = se2.wrap_angle(stated.pose[2] + 2.0 * np.pi * k / stated.symmetry) if k else stated.pose[2]
        pose = np.array([*stated.pose[:2], turn])
        pose_chain = pose if stated.of not in known else se2.compose(pose, se2.inverse(inner))
        yield Goal(pose, stated.of, pose_chain, stated.tolerance.position, stated.tolerance.angle)


def report_meaningless(file: ScenarioFile, report: Report) -> None:
    """Report what bears on several pushes only, where one is asked for."""
    for place in _meaningless(file) if file.robot.start is None else ():
        report.add(
            place, "is for several pushes: it needs a robot.start, the plate's pose in the world", at_key=True
        )


def make_pushes(file: StatedRoom, goals: tuple[Goal, ...], report: Report) -> Pushes | None:
    """Return what several pushes start from and may choose, or None where one push is asked for."""
    start = file.robot.start
    if start is None:
        return None
    for name in sorted(file.planner.model_fields_set - BEARS_ON_SEVERAL):
        report.add(("planner", name), _NOT_FOR_SEVERAL, at_key=True)
    for name, only in (("name", DEFAULT_PLANNER), ("cost", RANKED_BY)):
        if name in file.planner.model_fields_set and getattr(file.planner, name) != only:
            report.add(("planner", name), f"is for a single push; several pushes have {only} only")
    plate, choice = file.pusher, file.pushes or PushChoice()
    faces = None if plate.faces in (None, "all") else tuple(plate.faces)
    return Pushes(np.array(start), goals, faces, plate.offsets or (0.0,), **choice.model_dump())


def _meaningless(file: ScenarioFile) -> Iterator[Place]:
    """Yield the places of what says nothing of one push with the plate in contact."""
    if not isinstance(file.goal, GoalPose):
        yield ("goal",)
    elif file.goal.symmetry > 1:
        yield ("goal", "symmetry")
    for name in ("faces", "offsets"):
        if getattr(file.pusher, name) is not None:
            yield ("pusher", name)
    if file.pushes is not None:
        yield ("pushes",)


def check_places(scenario: Scenario, goal: Place, report: Report) -> None:
    """Report what cannot be several pushes: short ways, what is not free at first, or at any goal, for the first."""
    pushes = scenario.pushes
    assert pushes is not None
    for name in ("approach", "retreat"):
        kept = max(scenario.clearance, TRANSIT_CLEARANCE)
        least = kept + NEAREST
        if getattr(pushes, name) < least:
            why = f"the robot keeps {kept:.6g} m from the objects when it drives on"
            what = f"is {getattr(pushes, name):.6g} m, and {why}; allowed: at least {least:.6g}"
            report.add(("pushes", name), what)
    for place, what in troubles_at_first(scenario):
        report.add(place, what)
    taken = [list(troubles_at(scenario, one.pose_chain, "goal")) for one in pushes.goals]
    if all(taken):
        for what in taken[0]:
            report.add(goal, what)


def troubles_at_first(scenario: Scenario) -> Iterator[tuple[Place, str]]:
    """Yield the place in a file and a sentence for objects, and parts of the robot, that are not free at first."""
    chain = scenario.chain
    for what in troubles_at(scenario, scenario.start, "start"):
        yield ("start",), what
    robot = _placed(chain.carried, scenario.robot_start)
    for what in placement_troubles("robot's start", robot, _surroundings(scenario)):
        yield ("robot", "start"), what
    for name, outline in robot:
        for other, standing in _placed(_objects(chain), scenario.start):
            depth = overlap_depth(standing, outline)
            if depth > 0.0:
                what = f"at the robot's start, '{name}' overlaps '{other}' by {millimetres(depth)}"
                yield ("robot", "start"), what


def troubles_at(scenario: Scenario, load: FloatArray, what: str) -> Iterator[str]:
    """Yield a sentence for each object that is not free with the load at a pose (3,), its `start` or a `goal`."""
    return placement_troubles(what, _placed(_objects(scenario.chain), load), _surroundings(scenario))


def _surroundings(scenario: Scenario) -> Surroundings:
    return Surroundings(scenario.workspace, scenario.obstacles, scenario.clearance)


def _objects(chain: Chain) -> list[Body]:
    return [body for body in chain.bodies if body.kind is BodyKind.OBJECT]


def _placed(bodies: Iterable[Body], pose: FloatArray) -> list[tuple[str, FloatArray]]:
    return [(body.name, se2.transform_points(pose, body.outline)) for body in bodies]
