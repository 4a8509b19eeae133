"""What was understood of a scenario: bodies, weights, contacts, and the room at start and goal."""

from __future__ import annotations

from math import atan, degrees, isfinite

import numpy as np
import shapely

from pushplan.arrays import FloatArray
from pushplan.commands.numbers import counted
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, PLATE, PushedObject, Pusher
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
from pushplan.scenario import CircleObstacle, Obstacle, Scenario


def rows(scenario: Scenario) -> list[tuple[str, str]]:
    """Return label and value of everything that a user should recognise."""
    chain, area = scenario.chain, scenario.workspace
    space = (
        "unlimited"
        if area is None
        else f"x {area.xmin:g} to {area.xmax:g} m, y {area.ymin:g} to {area.ymax:g} m"
    )
    return [
        ("file", str(scenario.path)),
        ("pusher", pusher_text(chain.pusher)),
        ("robot", robot_text(chain.pusher)),
        *(row for i in range(len(chain.objects)) for row in _object_rows(scenario, i)),
        *(
            (
                f"contact {chain.contact_name(k)}",
                f"{contact.length:.3f} m long, {friction_text(contact.friction)}",
            )
            for k, contact in enumerate(chain.contacts)
        ),
        ("workspace", f"{space}, {counted(len(scenario.obstacles), 'obstacle')}"),
        ("start", _place_text(scenario, scenario.start)),
        ("goal", _place_text(scenario, scenario.goal.pose_chain)),
    ]


def document(scenario: Scenario) -> dict[str, object]:
    """Return the same as an object for JSON."""
    chain = scenario.chain
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
                "pose": obj.pose_chain,
            }
            for i, obj in enumerate(chain.objects)
        ],
        "contacts": [
            {
                "pushed": chain.objects[contact.pushed].name,
                "pusher": None if contact.pusher == PLATE else chain.objects[contact.pusher].name,
                "length": contact.length,
                "friction": contact.friction,
            }
            for contact in chain.contacts
        ],
        "start": _place(scenario, scenario.start),
        "goal": _place(scenario, scenario.goal.pose_chain),
    }


def pusher_text(pusher: Pusher) -> str:
    """Return the pusher in words."""
    thickness, width = np.ptp(pusher.outline, axis=0)
    height = f", pushing {pusher.contact_height:.3f} m above the floor" if pusher.contact_height else ""
    return f"{width:.3f} m wide, {thickness:.3f} m thick, drive {pusher.drive.kind}{height}"


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


def _range_text(value: float | list[float], form: str) -> str:
    return " to ".join(format(end, form) for end in (value if isinstance(value, list) else [value]))


def _object_rows(scenario: Scenario, i: int) -> list[tuple[str, str]]:
    obj = scenario.chain.objects[i]
    length, width = np.ptp(obj.outline, axis=0)
    shape = f"{length:.3f} x {width:.3f} m, {len(obj.outline)} corners"
    mass = _range_text(_stated(scenario, i, "mass"), "g")
    weight = _range_text(_stated(scenario, i, "mass", GRAVITY), ".1f")
    friction = _range_text(_stated(scenario, i, "floor_friction"), ".3g")
    load = support_text(obj)
    if scenario.interval is not None and i in scenario.interval.fractions:
        load = load.replace("known loads", "loads in intervals")
    return [(f"object {obj.name}", f"{shape}, {mass} kg ({weight} N), floor friction {friction}"), ("", load)]


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


def friction_text(friction: float) -> str:
    """Return a friction coefficient and its angle."""
    return f"friction {friction:.3g} ({degrees(atan(friction)):.1f} deg)"


def room(scenario: Scenario, pose: FloatArray) -> float:
    """Return the distance of the chain at `pose` to the nearest obstacle or wall, m; infinite without any."""
    corners = [transform_points(pose, body.outline) for body in scenario.chain.bodies]
    bodies = shapely.MultiPolygon([shapely.Polygon(outline) for outline in corners])
    distances = [_distance(bodies, obstacle) for obstacle in scenario.obstacles]
    area = scenario.workspace
    if area is not None:
        walls = np.array([area.xmin, area.ymin, -area.xmax, -area.ymax])
        points = np.concatenate(corners)
        distances.append(float((np.hstack([points, -points]) - walls).min()))
    return min(distances, default=np.inf)


def _distance(bodies: shapely.MultiPolygon, obstacle: Obstacle) -> float:
    if isinstance(obstacle, CircleObstacle):
        return float(shapely.distance(bodies, shapely.Point(obstacle.center))) - obstacle.radius
    return float(shapely.distance(bodies, shapely.Polygon(obstacle.outline)))


def _place(scenario: Scenario, pose: FloatArray) -> dict[str, object]:
    free = room(scenario, pose)
    return {"pose": pose, "room": free if isfinite(free) else None}


def _place_text(scenario: Scenario, pose: FloatArray) -> str:
    free = room(scenario, pose)
    text = f"chain frame at ({pose[0]:.4g}, {pose[1]:.4g}) m, {degrees(pose[2]):.4g} deg"
    return (
        f"{text}; nothing in the way"
        if not isfinite(free)
        else f"{text}; {free:.3f} m from the nearest thing"
    )
