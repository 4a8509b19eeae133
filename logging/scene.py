"""Scene of a run for viewers: every shape is sent once, fixed to its frame, and `/tf` moves the frames.

Layers are at most a millimetre apart in height, which avoids flicker. Messages of every sample (`contact_messages`,
`frame_messages`) are built once and then changed in place, because only numbers and time stamps differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
import shapely
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.drawing import palette
from pushplan.drawing.scene import Scene
from pushplan.geometry import se2
from pushplan.logging.shown import CHAIN, WORLD, ContactShapes
from pushplan.mechanics.chain import BodyKind
from pushplan.plans.plan import Plan
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import PUSHER, ROBOT

_Z_WORKSPACE, _Z_TREE, _Z_GHOST, _Z_OBSTACLE, _Z_ROBOT, _Z_BODY = 0.0, 0.0002, 0.0004, 0.001, 0.0015, 0.002
_Z_CONE, _Z_SEGMENT, _Z_ARROW = 0.003, 0.004, 0.005
"""Heights of the layers, m."""

_PIXELS, _SEGMENT_PIXELS, _SHAFT_PIXELS, _CONE_OPACITY = 2.0, 4.0, 3.0, 0.3

NANO = 1_000_000_000

Primitive = TypeVar("Primitive", LinePrimitive, TriangleListPrimitive)


def _colour(colour: str, opacity: float = 1.0) -> Color:
    """Return the message of a colour `#rrggbb`."""
    r, g, b = (part / 255.0 for part in palette.red_green_blue(colour))
    return Color(r=r, g=g, b=b, a=opacity)


_WALL, _EDGE = _colour(palette.WALL), _colour(palette.INK)
_START, _GOAL = _colour(palette.FAINT, 0.9), _colour(palette.GOAL, 0.9)
_NEAREST, _TREE = _colour(palette.NEAREST), _colour(palette.TREE, 0.35)
_UNKNOWN_OPACITY = 0.35
"""Opacity of unknown areas of a map, because viewers have no hatching."""


def scene(scenario: Scenario) -> SceneUpdate:
    """Return the scene of a scenario."""
    drawn = Scene.of(scenario)
    return SceneUpdate(entities=[*_standing(drawn), *_moving(drawn)])


def tree(branches: FloatArray) -> SceneUpdate:
    """Return the search tree, with branches (q, 2, 3) in the world frame, as lines."""
    entity = _entity("tree", WORLD)
    entity.lines.append(_line(branches[:, :, :2].reshape(-1, 2), _Z_TREE, _TREE, LinePrimitive.LINE_LIST))
    return SceneUpdate(entities=[entity])


def nearest(scenario: Scenario, plan: Plan) -> SceneUpdate:
    """Return the path that comes nearest to the goal, with all bodies at its end; empty if there is a plan."""
    if plan.segments or plan.nearest is None:
        return SceneUpdate()
    drawn, ghost = Scene.of(scenario, plan), _entity("nearest", WORLD)
    for outline in () if drawn.nearest_poses is None else drawn.outlines(drawn.nearest_poses):
        ghost.lines.append(_loop(outline, _Z_GHOST, _NEAREST))
    for line in drawn.nearest:
        ghost.lines.append(_line(line.points, _Z_GHOST, _NEAREST))
    return SceneUpdate(entities=[ghost] if ghost.lines else [])


def _standing(drawn: Scene) -> Iterator[SceneEntity]:
    if drawn.walls is not None:
        walls = _entity("workspace", WORLD)
        walls.lines.append(_loop(drawn.walls, _Z_WORKSPACE, _WALL))
        yield walls
    for i, obstacle in enumerate(drawn.obstacles):
        paint = _colour(obstacle.colour, _UNKNOWN_OPACITY if obstacle.unknown else 1.0)
        yield _body(f"obstacle/{i}", WORLD, obstacle.outline, _Z_OBSTACLE, paint)
    start, goal = _entity("start", WORLD), _entity("goal", WORLD)
    for outline in drawn.outlines(drawn.start):
        start.lines.append(_loop(outline, _Z_GHOST, _START))
    for one in drawn.goals:
        goal.lines.append(_loop(one.outline, _Z_GHOST, _GOAL))
    yield from (start, goal)


def _moving(drawn: Scene) -> Iterator[SceneEntity]:
    robot = _entity(ROBOT, PUSHER)
    for body in drawn.bodies:
        if body.kind is BodyKind.ROBOT:
            _add_body(robot, body.outline, _Z_ROBOT, _colour(body.colour))
        elif body.kind is BodyKind.PLATE:
            yield from [robot] if robot.lines else []
            yield _body("pusher", PUSHER, body.outline, _Z_BODY, _colour(body.colour))
        else:
            yield _body(f"object/{body.name}", body.name, body.outline, _Z_BODY, _colour(body.colour))


def _body(name: str, frame: str, outline: FloatArray, z: float, paint: Color) -> SceneEntity:
    entity = _entity(name, frame)
    _add_body(entity, outline, z, paint)
    return entity


def _add_body(entity: SceneEntity, outline: FloatArray, z: float, paint: Color) -> None:
    """Add the area of a simple polygon (v, 2) as triangles, and its edge."""
    entity.lines.append(_loop(outline, z, _EDGE))
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)
    filled = TriangleListPrimitive(pose=_identity(), color=paint)
    entity.triangles.append(_with_points(filled, rings[:, :3].reshape(-1, 2), z))


def _entity(name: str, frame: str) -> SceneEntity:
    """Return an entity without an end time that moves with `frame`."""
    return SceneEntity(id=name, frame_id=frame, frame_locked=True, timestamp=Timestamp())


def _loop(outline: FloatArray, z: float, paint: Color) -> LinePrimitive:
    """Return the closed line around a polygon (v, 2)."""
    return _line(outline, z, paint, LinePrimitive.LINE_LOOP)


def _line(
    points: FloatArray, z: float, paint: Color, kind: int = LinePrimitive.LINE_STRIP, pixels: float = _PIXELS
) -> LinePrimitive:
    """Return a line through points (k, 2) at height `z`, m, with the same width at every zoom."""
    primitive = LinePrimitive(
        type=kind,  # type: ignore[arg-type]
        pose=_identity(),
        thickness=pixels,
        scale_invariant=True,
        color=paint,
    )
    return _with_points(primitive, points, z)


def _with_points(primitive: Primitive, points: FloatArray, z: float) -> Primitive:
    """Add points (k, 2) at height `z` to a primitive and return it."""
    primitive.points.extend([Point3(x=x, y=y, z=z) for x, y in points.tolist()])
    return primitive


def _identity() -> Pose:
    """Return the identity pose."""
    return Pose(position=Vector3(), orientation=Quaternion(w=1.0))


def contact_messages(shapes: Sequence[ContactShapes], count: int, instants: IntArray) -> Iterator[bytes]:
    """Yield a serialised `SceneUpdate` of the contacts for each instant.

    Each contact is an entity that replaces its predecessor; the first message removes all others.

    Args:
        shapes: Shapes of the pushed contacts.
        count: Number of all contacts of the run, for their colours.
        instants: Times, ns, (n,).
    """
    colours = palette.contact_colours(count)
    update = SceneUpdate(deletions=[SceneEntityDeletion(type=SceneEntityDeletion.ALL)])
    points: list[Point3] = []
    rows: list[FloatArray] = []
    for one in shapes:
        _add_contact(update, one, colours[one.column])
        entity, cones = update.entities[-1], one.cones.shape[1]
        moving: list[Any] = [*entity.triangles[:cones], *entity.lines[1:], *entity.triangles[cones:]]
        points += [point for primitive in moving for point in primitive.points]
        parts = [part for part in (one.cones, one.shafts, one.heads) if part is not None]
        rows += [part.reshape(len(part), -1, 2) for part in parts]
    places = np.concatenate(rows, axis=1).tolist() if rows else [[] for _ in instants]
    stamps = [entity.timestamp for entity in update.entities]
    for instant, corners in zip(instants.tolist(), places, strict=True):
        for point, (x, y) in zip(points, corners, strict=True):
            point.x, point.y = x, y
        seconds, nanos = divmod(instant, NANO)
        for stamp in stamps:
            stamp.seconds, stamp.nanos = seconds, nanos
        yield update.SerializeToString(deterministic=True)
        del update.deletions[:]


def _add_contact(update: SceneUpdate, shapes: ContactShapes, colour: str) -> None:
    """Add an entity with cones, segment, and shaft and head of the arrow at the first instant."""
    entity, paint = _entity(f"contact/{shapes.name}", PUSHER), _colour(colour)
    for corners in shapes.cones[0]:
        cone = TriangleListPrimitive(pose=_identity(), color=_colour(colour, _CONE_OPACITY))
        entity.triangles.append(_with_points(cone, corners, _Z_CONE))
    entity.lines.append(_line(shapes.segment, _Z_SEGMENT, paint, pixels=_SEGMENT_PIXELS))
    if shapes.shafts is not None and shapes.heads is not None:
        entity.lines.append(_line(shapes.shafts[0], _Z_ARROW, paint, pixels=_SHAFT_PIXELS))
        head = TriangleListPrimitive(pose=_identity(), color=paint)
        entity.triangles.append(_with_points(head, shapes.heads[0], _Z_ARROW))
    update.entities.append(entity)


def placed(poses: FloatArray) -> FloatArray:
    """Return planar poses (..., 3) as x, y, and z and w of a quaternion, (..., 4)."""
    half = 0.5 * poses[..., 2]
    return np.stack([poses[..., 0], poses[..., 1], np.sin(half), np.cos(half)], axis=-1)


def frame_messages(
    scenario: Scenario, plates: FloatArray, objects: FloatArray, instants: IntArray
) -> Iterator[bytes]:
    """Yield a serialised `FrameTransforms` of all frames for each instant.

    Every message has all frames, so that a single one is enough to place everything. Constant ones keep the time
    stamp 0 and need almost no space after compression.

    Args:
        scenario: Scenario of the run.
        plates: Poses of the plate frame in the world, (n, 3).
        objects: Poses of all objects in the world, in the order of the scenario, (n, k, 3).
        instants: Times, ns, (n,).
    """
    message = FrameTransforms()
    moving = [_transform(message, WORLD, name, np.zeros(3)) for name in (PUSHER, *scenario.poses)]
    for load in scenario.task.held:
        _transform(message, PUSHER, CHAIN, se2.inverse(load.chain.pusher.plate_pose))
    rows = np.concatenate([placed(plates)[:, None], placed(objects)], axis=1)
    for instant, places in zip(instants.tolist(), rows.tolist(), strict=True):
        seconds, nanos = divmod(instant, NANO)
        for transform, (x, y, z, w) in zip(moving, places, strict=True):
            transform.timestamp.seconds, transform.timestamp.nanos = seconds, nanos
            transform.translation.x, transform.translation.y = x, y
            transform.rotation.z, transform.rotation.w = z, w
        yield message.SerializeToString(deterministic=True)


def _transform(message: FrameTransforms, parent: str, child: str, pose: FloatArray) -> Any:
    x, y, z, w = placed(pose).tolist()
    return message.transforms.add(
        timestamp=Timestamp(),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=Vector3(x=x, y=y),
        rotation=Quaternion(z=z, w=w),
    )
