"""Checks a plan of several objects from its plain data (`Plan.to_dict` and the scenario's document), sharing no code.

A pose is a complex number and a heading, arcs are integrated, and bodies are shapely polygons. Checked is that
segments meet; that held objects keep their place on the plate and all others rest; that robot, plate and held objects
keep away from walls, obstacles and resting objects, but for those that an approach or a close reaches; that the drive
can make every twist; and that the row is flush, or each object at its goal.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from shapely.affinity import affine_transform

Pose = tuple[complex, float]
SAME = 1e-6
"""Poses that differ by less are the same, m and rad."""
THICKNESS, CLEARANCE = 0.03, 0.0005
"""Defaults of a document: thickness of the plate and clearance, m."""
TOLERANCE = (0.01, math.radians(2.0))
"""Default tolerance of a goal, m and rad."""


def pose_of(stated: Sequence[float]) -> Pose:
    return complex(stated[0], stated[1]), stated[2]


def compose(frame: Pose, own: Pose) -> Pose:
    """Return a pose of a frame in the world."""
    return frame[0] + cmath.rect(1.0, frame[1]) * own[0], frame[1] + own[1]


def inside(frame: Pose, other: Pose) -> Pose:
    """Return a pose of the world in a frame."""
    return cmath.rect(1.0, -frame[1]) * (other[0] - frame[0]), other[1] - frame[1]


def moved(pose: Pose, twist: Sequence[float], length: float, aside: float) -> Pose:
    """Return a plate's pose after a length of a twist of the frame at a lateral distance, m, left positive."""
    vx, vy, omega = (value * length for value in twist)
    chord = (cmath.rect(1.0, omega) - 1.0) / (1j * omega) if abs(omega) > 1e-12 else 1.0
    return compose(compose(compose(pose, (1j * aside, 0.0)), (chord * complex(vx, vy), omega)), (-1j * aside, 0.0))


def apart(pose: Pose, other: Pose) -> float:
    """Return the difference of two poses, m or rad."""
    return max(abs(pose[0] - other[0]), abs(math.remainder(pose[1] - other[1], 2.0 * math.pi)))


def put(shape: Any, pose: Pose) -> Any:
    """Return a shape at a pose."""
    turn = cmath.rect(1.0, pose[1])
    return affine_transform(shape, [turn.real, -turn.imag, turn.imag, turn.real, pose[0].real, pose[0].imag])


def box(length: float, width: float) -> Any:
    """Return a box about the origin."""
    return shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)


def violations(document: Mapping[str, Any], plan: Mapping[str, Any], spacing: float = 0.01) -> Iterator[str]:
    """Yield what is wrong with a plan of boxes, in sentences.

    Args:
        document: The scenario.
        plan: Its plan.
        spacing: Largest distance of the checked poses, m of path cost.
    """
    now = {obj["name"]: pose_of(obj["pose"]) for obj in document["objects"]}
    shapes = {obj["name"]: box(*obj["shape"]["box"]) for obj in document["objects"]}
    at = pose_of(document["robot"]["start"])
    for k, segment in enumerate(plan["segments"], start=1):
        where = f"segment {k}, a {segment['kind']}"
        if apart(at, pose_of(segment["robot_before"])) > SAME:
            yield f"{where}: the plate begins elsewhere"
        for name, pose in segment["before"].items():
            if apart(now[name], pose_of(pose)) > SAME:
                yield f"{where}: '{name}' begins elsewhere"
        names, pushes = [link["object"] for link in segment["load"]], segment["kind"] in ("push", "close")
        held = {name: inside(at, now[name]) for name in names} if pushes else {}
        # Arcs of a push are of its contact's frame, which lies beside the plate's if the object stands aside.
        aside = -segment["load"][0]["offset"] if pushes else 0.0
        yield from (f"{where}: {text}" for text in _collisions(document, segment, shapes, now, at, held, spacing))
        for arc in segment["arcs"]:
            at = moved(at, arc["twist"], arc["length"], aside)
        if apart(at, pose_of(segment["robot_after"])) > SAME:
            yield f"{where}: the plate ends elsewhere"
        now |= {name: compose(at, own) for name, own in held.items()}
        for name, pose in segment["after"].items():
            if apart(now[name], pose_of(pose)) > SAME:
                yield f"{where}: '{name}' ends elsewhere"
        onto = segment["onto"]
        if onto and put(shapes[names[-1]], now[names[-1]]).distance(put(shapes[onto], now[onto])) > SAME:
            yield f"{where}: ends away from '{onto}'"
    if "of" in document["goals"].get("row", ()):
        yield from _row(document, shapes, now)
    else:
        yield from _at_goals(document, now)


def _collisions(
    document: Mapping[str, Any],
    segment: Mapping[str, Any],
    shapes: Mapping[str, Any],
    now: Mapping[str, Pose],
    at: Pose,
    held: Mapping[str, Pose],
    spacing: float,
) -> Iterator[str]:
    """Yield collisions along the arcs of a segment, and twists that the drive cannot make."""
    (x0, x1), (y0, y1) = document["workspace"]["x"], document["workspace"]["y"]
    walls, footprint = shapely.box(x0, y0, x1, y1), document["robot"]["footprint"]
    thickness, half = document["pusher"].get("thickness", THICKNESS), 0.5 * document["pusher"]["width"]
    body = [shapely.box(-thickness, -half, 0.0, half), put(box(*footprint["box"]), pose_of(footprint["pose"]))]
    body = shapely.union_all([*body, *(put(shapes[name], own) for name, own in held.items())])
    names = {link["object"] for link in segment["load"]} if segment["kind"] in ("approach", "retreat") else set()
    near = names | {segment["onto"]} - {None}
    closed = [put(shapes[name], now[name]) for name in near]
    rest = [put(shapes[name], now[name]) for name in now if name not in held and name not in near]
    rest += [put(box(*one["box"]), pose_of(one["pose"])) for one in document.get("obstacles", ())]
    standing, clearance = shapely.union_all(rest), document.get("clearance", CLEARANCE)
    aside = -segment["load"][0]["offset"] if held else 0.0
    for arc in segment["arcs"]:
        vx, vy, omega = arc["twist"]
        if not _drives(document["robot"].get("drive", "omnidirectional"), vx + omega * aside, vy, omega):
            yield f"the drive cannot make {arc['twist']}"
        count = max(1, math.ceil(arc["length"] / spacing))
        for i in range(count + 1):
            moving = put(body, moved(at, arc["twist"], arc["length"] * i / count, aside))
            gap = min(moving.distance(standing), moving.distance(walls.boundary))
            if not walls.contains(moving) or gap < clearance - 1e-4:
                yield f"{1e3 * gap:.2f} mm from something"
                break
            if any(moving.intersection(one).area > 1e-6 for one in closed):
                yield "overlaps what it comes up to"
                break
        at = moved(at, arc["twist"], arc["length"], aside)


def _drives(drive: Any, vx: float, vy: float, omega: float) -> bool:
    """Return whether a drive can execute a twist of the plate."""
    if not isinstance(drive, Mapping):
        return True
    x, y, _ = drive["car"]["axle"]
    ahead, aside = vx - omega * y, vy + omega * x
    return bool(abs(aside) < 1e-6 and abs(omega) * drive["car"]["min_radius"] <= abs(ahead) + 1e-6)


def _at_goals(document: Mapping[str, Any], now: Mapping[str, Pose]) -> Iterator[str]:
    """Yield the objects that do not end at their goals, in any of the equivalent orientations."""
    for name, goal in document["goals"].items():
        off, turn = inside(pose_of(goal["pose"]), now[name])
        turn = abs(math.remainder(turn, 2.0 * math.pi / goal.get("symmetry", 1)))
        if abs(off) > TOLERANCE[0] + SAME or turn > TOLERANCE[1] + SAME:
            yield f"'{name}' is {1e3 * abs(off):.2f} mm and {math.degrees(turn):.2f} deg off its goal"


def _row(document: Mapping[str, Any], shapes: Mapping[str, Any], now: Mapping[str, Pose]) -> Iterator[str]:
    """Yield the final errors of the row."""
    row = document["goals"]["row"]
    bodies = [put(shapes[name], now[name]) for name in row["of"]]
    together = shapely.union_all([body.buffer(1e-5, join_style="mitre") for body in bodies])
    if together.geom_type != "Polygon":
        yield "the objects do not stand in one row"
    if sum(body.area for body in bodies) - shapely.union_all(bodies).area > 1e-6:
        yield "objects of the row overlap"
    if "pose" in row:
        line = pose_of(row["pose"])
        own = np.array([inside(line, (complex(body.centroid.x, body.centroid.y), 0.0))[0] for body in bodies])
        if np.abs(own.imag).max() > 1e-5 or own.real.min() < 0.0:
            yield "the row is not on its line"
        if together.distance(shapely.Point(row["pose"][:2])) > 2e-5:
            yield "the row's rear is elsewhere"
