"""Checks a plan of several objects from its plain data (`Plan.to_dict` and the scenario's document), sharing no code.

Poses are integrated from the arcs, bodies are shapely polygons. Looked at: that segments meet; that what is held
keeps its place in the plate's frame and all else rests; that robot, plate and what is held keep away from walls,
obstacles and all that rests, but for what the robot comes up to or a close ends at; that the drive can make every
twist; and that the row is flush where it shall be, or each object at its goal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from shapely.affinity import affine_transform

Pose = tuple[float, float, float]

SAME = 1e-6
"""Poses that differ by less are the same, m and rad."""


THICKNESS, CLEARANCE = 0.03, 0.0005
"""Of the plate, and what is kept from everything, m, where a document does not state them."""

TOLERANCE = (0.01, math.radians(2.0))
"""How far from its goal an object may end, m and rad, likewise."""


def after(pose: Pose, twist: Sequence[float], length: float) -> Pose:
    """Return the pose after a body twist of a length."""
    vx, vy, omega = (value * length for value in twist)
    if abs(omega) < 1e-12:
        dx, dy = vx, vy
    else:
        s, c = math.sin(omega) / omega, (1.0 - math.cos(omega)) / omega
        dx, dy = s * vx - c * vy, c * vx + s * vy
    x, y, theta = pose
    co, si = math.cos(theta), math.sin(theta)
    return x + co * dx - si * dy, y + si * dx + co * dy, theta + omega


def inside(pose: Pose, other: Pose) -> Pose:
    """Return a pose of the world in the frame of another."""
    dx, dy, theta = other[0] - pose[0], other[1] - pose[1], pose[2]
    c, s = math.cos(theta), math.sin(theta)
    return c * dx + s * dy, c * dy - s * dx, other[2] - theta


def apart(pose: Pose, other: Pose) -> float:
    """Return the difference of two poses, m or rad."""
    turn = (pose[2] - other[2] + math.pi) % (2.0 * math.pi) - math.pi
    return max(math.hypot(pose[0] - other[0], pose[1] - other[1]), abs(turn))


def put(shape: shapely.Geometry, pose: Sequence[float]) -> shapely.Geometry:
    """Return a shape at a pose."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return affine_transform(shape, [c, -s, s, c, pose[0], pose[1]])


def box(length: float, width: float) -> shapely.Geometry:
    """Return a box about the origin."""
    return shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)


def violations(document: Mapping[str, Any], plan: Mapping[str, Any], spacing: float = 0.01) -> Iterator[str]:
    """Yield what is wrong with a plan of boxes, in sentences.

    Args:
        document: The scenario.
        plan: Its plan.
        spacing: Poses that are looked at are no farther apart, m of path cost.
    """
    shapes = {obj["name"]: box(*obj["shape"]["box"]) for obj in document["objects"]}
    now: dict[str, Pose] = {obj["name"]: tuple(obj["pose"]) for obj in document["objects"]}
    room = document["workspace"]
    walls = shapely.box(room["x"][0], room["y"][0], room["x"][1], room["y"][1])
    obstacles = [put(box(*one["box"]), one["pose"]) for one in document.get("obstacles", ())]
    part = document["robot"]["footprint"]
    thickness, half = document["pusher"].get("thickness", THICKNESS), 0.5 * document["pusher"]["width"]
    plate = shapely.box(-thickness, -half, 0.0, half)
    robot = [plate, put(box(*part["box"]), part["pose"])]
    drive = document["robot"].get("drive", "omnidirectional")
    clearance = document.get("clearance", CLEARANCE)
    at: Pose = tuple(document["robot"]["start"])
    held: dict[str, Pose] = {}
    for k, segment in enumerate(plan["segments"], start=1):
        where = f"segment {k}, a {segment['kind']}"
        if apart(at, segment["robot_before"]) > SAME:
            yield f"{where}: the plate begins elsewhere"
        for name, pose in segment["before"].items():
            if apart(now[name], pose) > SAME:
                yield f"{where}: '{name}' begins elsewhere"
        names = [link["object"] for link in segment["load"]]
        pushes = segment["kind"] in ("push", "close")
        held = {name: inside(at, now[name]) for name in names} if pushes else {}
        # Arcs of a push are of its contact's frame, which lies beside the plate's where the object stands aside.
        aside = -segment["load"][0]["offset"] if pushes else 0.0
        near = set(names) if segment["kind"] in ("approach", "retreat") else set()
        near |= {segment["onto"]} - {None}
        rest = [put(shapes[name], now[name]) for name in now if name not in held and name not in near]
        closed = [put(shapes[name], now[name]) for name in near]
        standing = shapely.union_all([*rest, *obstacles])
        for arc in segment["arcs"]:
            vx, vy, omega = arc["twist"]
            if not _drives(drive, (vx + omega * aside, vy, omega)):
                yield f"{where}: the drive cannot make {arc['twist']}"
            count = max(1, math.ceil(arc["length"] / spacing))
            for i in range(count + 1):
                pose = _moved(at, arc["twist"], arc["length"] * i / count, aside)
                moving = [put(one, pose) for one in robot]
                moving += [put(put(shapes[name], own), pose) for name, own in held.items()]
                bodies = shapely.union_all(moving)
                gap = min(bodies.distance(standing), bodies.distance(walls.boundary))
                if not walls.contains(bodies) or gap < clearance - 1e-4:
                    yield f"{where}: {1e3 * gap:.2f} mm from something"
                    break
                if any(bodies.intersection(one).area > 1e-6 for one in closed):
                    yield f"{where}: overlaps what it comes up to"
                    break
            at = _moved(at, arc["twist"], arc["length"], aside)
        if apart(at, segment["robot_after"]) > SAME:
            yield f"{where}: the plate ends elsewhere"
        for name, own in held.items():
            now[name] = _put_pose(at, own)
        for name, pose in segment["after"].items():
            if apart(now[name], pose) > SAME:
                yield f"{where}: '{name}' ends elsewhere"
        if (
            segment["onto"]
            and put(shapes[names[-1]], now[names[-1]]).distance(put(shapes[segment["onto"]], now[segment["onto"]]))
            > SAME
        ):
            yield f"{where}: ends away from '{segment['onto']}'"
    yield from (_row if "of" in document["goals"].get("row", ()) else _at_goals)(document, shapes, now)


def _put_pose(frame: Pose, own: Pose) -> Pose:
    x, y, theta = frame
    c, s = math.cos(theta), math.sin(theta)
    return x + c * own[0] - s * own[1], y + s * own[0] + c * own[1], theta + own[2]


def _moved(at: Pose, twist: Sequence[float], length: float, aside: float) -> Pose:
    """Return a plate's pose after an arc of the frame at a lateral distance, m, left positive."""
    return _put_pose(after(_put_pose(at, (0.0, aside, 0.0)), twist, length), (0.0, -aside, 0.0))


def _drives(drive: Any, twist: Sequence[float]) -> bool:
    """Return whether a drive can execute a twist of the plate."""
    if not isinstance(drive, Mapping):
        return True
    car = drive["car"]
    x, y, _ = car["axle"]
    vx, vy, omega = twist
    ahead, aside = vx - omega * y, vy + omega * x
    return abs(aside) < 1e-6 and abs(omega) * car["min_radius"] <= abs(ahead) + 1e-6


def _at_goals(
    document: Mapping[str, Any], shapes: Mapping[str, shapely.Geometry], now: Mapping[str, Pose]
) -> Iterator[str]:
    """Yield the objects that do not end at their goals, in any of the equivalent orientations."""
    del shapes
    for name, goal in document["goals"].items():
        x, y, theta = inside(tuple(goal["pose"]), now[name])
        period = 2.0 * math.pi / goal.get("symmetry", 1)
        turn = abs((theta + 0.5 * period) % period - 0.5 * period)
        if math.hypot(x, y) > TOLERANCE[0] + SAME or turn > TOLERANCE[1] + SAME:
            yield f"'{name}' is {1e3 * math.hypot(x, y):.2f} mm and {math.degrees(turn):.2f} deg off its goal"


def _row(
    document: Mapping[str, Any], shapes: Mapping[str, shapely.Geometry], now: Mapping[str, Pose]
) -> Iterator[str]:
    """Yield the final errors of the row."""
    row = document["goals"]["row"]
    bodies = [put(shapes[name], now[name]) for name in row["of"]]
    together = shapely.union_all([body.buffer(1e-5, join_style="mitre") for body in bodies])
    if together.geom_type != "Polygon":
        yield "the objects do not stand in one row"
    if sum(body.area for body in bodies) - shapely.union_all(bodies).area > 1e-6:
        yield "objects of the row overlap"
    if "pose" in row:
        line = np.array([body.centroid.coords[0] for body in bodies])
        own = np.array([inside(tuple(row["pose"]), (x, y, 0.0))[:2] for x, y in line])
        if np.abs(own[:, 1]).max() > 1e-5 or own[:, 0].min() < 0.0:
            yield "the row is not on its line"
        if abs(put(together, (0, 0, 0)).distance(shapely.Point(row["pose"][:2]))) > 2e-5:
            yield "the row's rear is elsewhere"
