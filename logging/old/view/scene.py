"""The world of a run as a viewer draws it: every shape once, fixed to its frame; `/tf` moves the frames.

Layers are a millimetre or less apart in height, so that they do not flicker.
"""

from __future__ import annotations

from collections.abc import Iterator

from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.drawing import palette
from pushplan.geometry import se2
from pushplan.logging.old.view.shapes import Paint, circle, filled, line, loop
from pushplan.mechanics.chain import Chain
from pushplan.plans.result import PlanResult
from pushplan.scenario.model import CircleObstacle, Obstacle, PolygonObstacle, Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import PUSHER, ROBOT

WORLD, CHAIN = "world", "chain"
"""Frames of every run, beside the plate's, `PUSHER`; each object adds one of its own name."""

PATH_SPACING = 0.02
"""Distance of the points of a path in pictures, m of path cost."""

_SAME = 6
"""Digits of a metre in which outlines are compared."""

_Z_WORKSPACE, _Z_TREE, _Z_GHOST, _Z_OBSTACLE, _Z_ROBOT, _Z_BODY = 0.0, 0.0002, 0.0004, 0.001, 0.0015, 0.002

_WALL = Paint(0.55, 0.57, 0.60)
_OBSTACLE, _UNKNOWN = Paint(0.36, 0.38, 0.42), Paint(0.36, 0.38, 0.42, 0.35)
_START, _GOAL = Paint(0.55, 0.57, 0.60, 0.9), Paint.of(palette.GOAL, 0.9)
_NEAREST = Paint.of(palette.NEAREST)
_TREE = Paint(0.25, 0.45, 0.85, 0.35)
_EDGE = Paint(0.10, 0.10, 0.12)


def scene(scenario: Scenario) -> SceneUpdate:
    """Return everything that a viewer has to draw for the scenario."""
    moving = [
        entity for entity in _moving(scenario.chain) if scenario.pushes is None or entity.id != "contacts"
    ]
    return SceneUpdate(entities=[*_standing(scenario), *moving])


def nothing() -> SceneUpdate:
    """Return that everything drawn so far goes."""
    return SceneUpdate(deletions=[SceneEntityDeletion(type=SceneEntityDeletion.ALL)])


def tree(branches: FloatArray) -> SceneUpdate:
    """Return the search tree, branches (q, 2, 3) in the world frame, as lines."""
    entity = _entity("tree", WORLD)
    entity.lines.append(line(branches[:, :, :2].reshape(-1, 2), _Z_TREE, _TREE, LinePrimitive.LINE_LIST))
    return SceneUpdate(entities=[entity])


def nearest(chain: Chain, plan: PlanResult) -> SceneUpdate:
    """Return the path that comes nearest and a ghost of the chain at its end, where there is none to the goal."""
    path = plan.approximate_path
    if plan.path is not None or path is None:
        return SceneUpdate()
    ghost = _ghost("nearest", chain, path.end, _NEAREST)
    ghost.lines.append(line(path.sampled(PATH_SPACING)[:, :2], _Z_GHOST, _NEAREST))
    return SceneUpdate(entities=[ghost])


def _standing(scenario: Scenario) -> Iterator[SceneEntity]:
    if scenario.workspace is not None:
        walls = _entity("workspace", WORLD)
        walls.lines.append(loop(scenario.workspace.outline, _Z_WORKSPACE, _WALL))
        yield walls
    for i, obstacle in enumerate(scenario.obstacles):
        unknown = isinstance(obstacle, PolygonObstacle) and obstacle.unknown
        paint = _UNKNOWN if unknown else _OBSTACLE
        yield _body(f"obstacle/{i}", WORLD, obstacle_outline(obstacle), _Z_OBSTACLE, paint)
    for name, outlines in ghosts(scenario).items():
        entity = _entity(name, WORLD)
        for outline in outlines:
            entity.lines.append(loop(outline, _Z_GHOST, _START if name == "start" else _GOAL))
        yield entity


def ghosts(scenario: Scenario) -> dict[str, list[FloatArray]]:
    """Return the world outlines of what stands at start and goals, the robot at the goal of one push only."""
    chain, pushes = scenario.chain, scenario.pushes
    if pushes is None:
        ends = {"start": scenario.start, "goal": scenario.goal.pose_chain}
        return {name: chain.outlines_at(pose) for name, pose in ends.items()}
    goals = [
        se2.transform_points(goal.pose_chain, obj.outline_chain)
        for goal in pushes.goals
        for obj in chain.objects
        if obj.name in goal.objects or not goal.objects
    ]
    # Turned by its symmetry an object covers itself: once is enough, dashes over dashes make a line.
    different = {frozenset(map(tuple, outline.round(_SAME))): outline for outline in goals}
    return {
        "start": chain.outlines_at(scenario.robot_start, scenario.start),
        "goal": list(different.values()),
    }


def _ghost(name: str, chain: Chain, pose: FloatArray, paint: Paint) -> SceneEntity:
    """Outlines of all bodies at `pose` (3,) of the chain frame in the world."""
    entity = _entity(name, WORLD)
    for outline in chain.outlines_at(pose):
        entity.lines.append(loop(outline, _Z_GHOST, paint))
    return entity


def obstacle_outline(obstacle: Obstacle) -> FloatArray:
    """Return the polygon (v, 2), world frame, that stands for an obstacle in pictures."""
    if isinstance(obstacle, CircleObstacle):
        return circle(obstacle.center, obstacle.radius)
    return obstacle.outline


def _moving(chain: Chain) -> Iterator[SceneEntity]:
    if chain.pusher.footprint:
        robot = _entity(ROBOT, PUSHER)
        for part in chain.pusher.footprint:
            _add_body(robot, part, _Z_ROBOT, Paint.of(palette.ROBOT))
        yield robot
    yield _body("pusher", PUSHER, chain.pusher.outline, _Z_BODY, Paint.of(palette.PLATE))
    for obj, colour in zip(
        chain.objects, palette.object_colours([obj.name for obj in chain.objects]), strict=True
    ):
        yield _body(f"object/{obj.name}", obj.name, obj.outline, _Z_BODY, Paint.of(colour))


def _body(name: str, frame: str, outline: FloatArray, z: float, paint: Paint) -> SceneEntity:
    entity = _entity(name, frame)
    _add_body(entity, outline, z, paint)
    return entity


def _add_body(entity: SceneEntity, outline: FloatArray, z: float, paint: Paint) -> None:
    """Add a filled outline with its edge."""
    entity.lines.append(loop(outline, z, _EDGE))
    entity.triangles.append(filled(outline, z, paint))


def _entity(name: str, frame: str) -> SceneEntity:
    """Return an entity that stays until the end and moves with `frame`."""
    return SceneEntity(id=name, frame_id=frame, frame_locked=True, timestamp=Timestamp())
