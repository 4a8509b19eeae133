"""Poses of plate and objects in the chain frame: stacked from the plate outward, given, or snapped.

Stacking puts an object's rear edge (outward normal -x in its own frame) flush on the front edge (+x) of the previous
body, without turning it. Snapping moves measured poses onto the edges that they nearly touch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.geometry.polygon import SHORTEST_CONTACT, TOUCH, find_touch, overlap_depth, simple_polygon
from pushplan.scenario.bodies import BoxShape, PolygonShape
from pushplan.scenario.loads import Snapped, Snapping
from pushplan.scenario.schema import Snap
from pushplan.scenario.source import Source
from pushplan.util.arrays import FloatArray

Named = tuple[str, FloatArray]
"""Name of a body for messages, and its outline (v, 2) in the chain frame."""

_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Part:
    """Shape and placement of one object in the file.

    Attributes:
        name: Name for messages.
        outline: Outline (v, 2) in its own frame, m, counter-clockwise.
        offset: y of its frame in the frame of the previous object, m; for the first object, from the plate's middle.
        pose: Pose (3,) in the chain frame; None for stacking.
    """

    name: str
    outline: FloatArray
    offset: float | None = None
    pose: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Layout:
    """Placement of plate and objects.

    Attributes:
        plate: Outline (4, 2) of the plate in the chain frame, m.
        poses: Poses (n, 3) of the objects in the chain frame.
        outlines: Outlines (v, 2) of the objects in the chain frame, m.
        snapping: Motions of the measured poses; None if they are used unchanged.
    """

    plate: FloatArray
    poses: FloatArray
    outlines: tuple[FloatArray, ...]
    snapping: Snapping | None = None

    @property
    def plate_pose(self) -> FloatArray:
        """Pose (3,) of the plate's frame in the chain frame: the middle of its front edge, +x along the push."""
        return np.array([self.plate[:, 0].max(), self.plate[:, 1].mean(), 0.0])


def millimetres(length: float) -> str:
    """Return a length (m) as text in mm."""
    value = 1e3 * length
    return f"{value:.3g} mm" if abs(value) < 1000.0 else f"{value:.0f} mm"


def box_outline(length: float, width: float) -> FloatArray:
    """Return the corners (4, 2) of a box about the origin, counter-clockwise."""
    x, y = 0.5 * length, 0.5 * width
    return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


def outline_of(stated: BoxShape | PolygonShape) -> FloatArray:
    """Return the counter-clockwise outline (v, 2) of a shape in its own frame, m."""
    return box_outline(*stated.box) if isinstance(stated, BoxShape) else simple_polygon(stated.polygon, "outline")


def lay_out(
    parts: Sequence[Part], width: float, thickness: float, source: Source, within: Snap | None = None
) -> Layout | None:
    """Place the plate and all parts, or report errors and return None.

    The chain frame's origin is the midpoint of the plate's contact with the first part. If that part has a pose, the
    plate's middle is at the origin, or at the pose's y minus the offset if there is one. With `within`, given poses
    are moved onto contacts within this distance, from the plate outward. If the midpoint of the plate's contact is
    then beside the origin, the frame is moved there.
    """
    first, middle = parts[0], 0.0
    if first.pose is not None and first.offset is not None:
        middle = float(first.pose[1]) - first.offset
    bodies: list[Named] = [("the plate", box_outline(thickness, width) + np.array([-0.5 * thickness, middle]))]
    poses: list[FloatArray] = []
    moved: list[Snapped] = []
    sideways = 0.0
    for i, part in enumerate(parts):
        if i > 0 and part.pose is not None and part.offset is not None:
            source.error(("objects", i, "offset"), "is not allowed together with pose; keep one of them", at_key=True)
        if part.pose is None:
            before = parts[i - 1].outline if i else bodies[0][1]
            try:
                pose = flush_pose(before, part.outline, part.offset or 0.0, (bodies[-1][0], f"'{part.name}'"))
            except ChainError as error:
                source.error(("objects", i), str(error))
                return None
            pose = se2.compose(poses[-1], pose) if i else pose
        elif within is None:
            pose = part.pose
        else:
            pose, snapped = snap(bodies, part, part.pose - [0.0, sideways, 0.0], within)
            moved.append(snapped)
            if _is_too_far(i, snapped, within, source):
                return None
        if i == 0:
            origin = _origin(bodies[0], part, pose, source, within)
            if origin is None:
                return None
            bodies, pose = [(bodies[0][0], bodies[0][1] - origin)], pose - [*origin, 0.0]
            sideways = 0.0 if part.pose is None else float(origin[1])
        poses.append(pose)
        bodies.append((f"'{part.name}'", se2.transform_points(pose, part.outline)))
    snapping = None if within is None else Snapping(tuple(moved), sideways)
    (_, plate), *others = bodies
    return Layout(plate, np.array(poses), tuple(outline for _, outline in others), snapping)


def _origin(plate: Named, part: Part, pose: FloatArray, source: Source, within: Snap | None) -> FloatArray | None:
    """Return the new position (2,) of the chain frame's origin, or report why the first part cannot be pushed."""
    body = part.name, se2.transform_points(pose, part.outline)
    error, touch = describe_overlap(plate, body), find_touch(plate[1], body[1])
    if error is not None or touch is None or len(touch) == 0:
        source.error(("objects", 0), error or describe_gap(plate, body))
        return None
    origin = touch[0].mean(axis=0).round(15)  # to keep symmetry exact
    away = float(np.linalg.norm(origin))
    if part.pose is None or (within is not None and TOUCH < away <= within.position):
        return np.asarray(origin)
    if away <= TOUCH:
        return np.zeros(2)
    offset = round(float(pose[1] - plate[1][:, 1].mean()), 12) + 0.0
    source.error(
        ("objects", 0, "pose"),
        f"the midpoint of the plate's contact with '{part.name}' is at ({origin[0]:.6g}, {origin[1]:.6g}), but must "
        f"be the chain frame's origin; move the pose, and add an offset of {offset:.6g}",
    )
    return None


def flush_pose(base: FloatArray, outline: FloatArray, offset: float, names: tuple[str, str]) -> FloatArray:
    """Return the pose (3,) of an object stacked on a base, in the frame of the base.

    Args:
        base: Outline (v, 2) of the base in its own frame.
        outline: Outline (w, 2) of the object in its own frame.
        offset: y of the object's frame in the frame of the base, m.
        names: Names of base and object for messages.

    Raises:
        ChainError: If the base has no front edge, the object has no rear edge, or the edges do not meet along a line.
    """
    front, rear = _edge_span(base, +1), _edge_span(outline, -1)
    if front is None or rear is None:
        name, edge, side = (names[0], "front", "+x") if front is None else (names[1], "rear", "-x")
        raise ChainError(
            f"{names[1]} cannot be stacked: {name} has no {edge} edge, its outermost point in {side} is a corner; "
            "give the object a pose"
        )
    low, high = front[1] - rear[2], front[2] - rear[1]
    if not low + SHORTEST_CONTACT < offset < high - SHORTEST_CONTACT:
        gap = max(low - offset, offset - high, 0.0)
        raise ChainError(
            f"{names[1]} and {names[0]} do not touch along a line: the gap is {millimetres(gap)}; "
            f"allowed: an offset between {low:.6g} and {high:.6g}"
        )
    return np.array([front[0] - rear[0], offset, 0.0])


def _edge_span(outline: FloatArray, side: int) -> tuple[float, float, float] | None:
    """Return x, lowest and highest y of the outermost edges on a side (+1: +x, -1: -x); None without edges."""
    x = side * outline[:, 0]
    on = x >= x.max() - TOUCH
    begins = on & np.roll(on, -1)
    ends = np.concatenate([outline[begins], outline[np.roll(begins, 1)]])
    if len(ends) == 0 or float(np.ptp(ends[:, 1])) <= SHORTEST_CONTACT:
        return None
    return float(side * x.max()), float(ends[:, 1].min()), float(ends[:, 1].max())


def snap(bodies: Sequence[Named], part: Part, pose: FloatArray, within: Snap) -> tuple[FloatArray, Snapped]:
    """Return the pose (3,) with an edge of the object on the nearest edge of another body, and its motion.

    The object turns about the centroid of its outline, which then moves along the other edge's normal; its position
    along that edge is kept. The nearest edge needs the smallest share of the tolerances `within`, which have no other
    use here.
    """
    found = [
        (effort, name, gap, turn, normal)
        for name, outline in bodies
        for effort, gap, turn, normal in _candidates(outline, part.outline, pose, within)
    ]
    if not found:
        return pose, Snapped(part.name, "", math.inf, math.inf)
    _, onto, gap, turn, normal = min(found, key=lambda one: one[0])
    if abs(gap) <= _ROUNDING and abs(turn) <= _ROUNDING:
        return pose, Snapped(part.name, onto, 0.0, 0.0)
    turned = _turned(part.outline, pose, turn)
    return turned - [*(gap * normal), 0.0], Snapped(part.name, onto, gap, turn)


def _is_too_far(i: int, moved: Snapped, within: Snap, source: Source) -> bool:
    """Report an object that is farther from its contact than `snap` allows, and return whether it is."""
    if abs(moved.gap) <= within.position and abs(moved.turn) <= within.angle:
        return False
    allowed = f"snap allows {millimetres(within.position)} and {math.degrees(within.angle):.3g} deg"
    if math.isfinite(moved.gap):
        gap, turn = millimetres(round(abs(moved.gap), 9)), math.degrees(round(abs(moved.turn), 9))
        what = f"is {gap} and {turn:.3g} deg from a flush contact with {moved.onto}"
    else:
        what = "faces no edge of an earlier body"
    source.error(("objects", i, "pose"), f"'{moved.name}' {what}; {allowed}: move it, or give a larger snap")
    return True


def _candidates(
    fixed: FloatArray, outline: FloatArray, pose: FloatArray, within: Snap
) -> list[tuple[float, float, float, FloatArray]]:
    """Return effort, gap (m), turn (rad) and normal (2,) for every edge of `fixed` that can be a contact."""
    own = np.roll(outline, -1, axis=0) - outline
    steps = np.roll(fixed, -1, axis=0) - fixed
    facing = np.arctan2(-steps[:, 1], -steps[:, 0])
    headings = np.arctan2(own[:, 1], own[:, 0]) + pose[2]
    turns = se2.wrap_angle(facing[:, None] - headings)
    found = []
    for e, f in np.argwhere(np.abs(turns) < math.radians(45.0)):
        corners = se2.transform_points(_turned(outline, pose, turns[e, f]), outline[[f, (f + 1) % len(outline)]])
        length = float(np.linalg.norm(steps[e]))
        along = steps[e] / length
        normal = np.array([along[1], -along[0]])
        places = np.sort((corners - fixed[e]) @ along)
        if min(places[1], length) - max(places[0], 0.0) <= SHORTEST_CONTACT:
            continue
        gap, turn = float((corners[0] - fixed[e]) @ normal), float(turns[e, f])
        effort = max(abs(gap) / within.position, abs(turn) / max(within.angle, _ROUNDING))
        found.append((effort, gap, turn, normal))
    return found


def _turned(outline: FloatArray, pose: FloatArray, turn: float) -> FloatArray:
    """Return the pose (3,) after a turn about the centroid of the outline (v, 2)."""
    center = shapely.get_coordinates(shapely.Polygon(outline).centroid)[0]
    place = se2.transform_points(pose, center[None])[0]
    turned = np.array([0.0, 0.0, pose[2] + turn])
    return np.array([*(place - se2.transform_points(turned, center[None])[0]), turned[2]])


def describe_overlap(fixed: Named, moving: Named) -> str | None:
    """Return a sentence on the overlap of two bodies; None without overlap."""
    depth = overlap_depth(fixed[1], moving[1])
    return f"'{moving[0]}' overlaps {fixed[0]} by {millimetres(depth)}; move them apart" if depth else None


def describe_gap(fixed: Named, moving: Named) -> str:
    """Return a sentence on the gap between two bodies that do not touch along a line."""
    gap = float(shapely.distance(shapely.Polygon(moving[1]), shapely.Polygon(fixed[1])))
    state = f"the gap is {millimetres(gap)}" if gap > TOUCH else "they meet at a point"
    return (
        f"'{moving[0]}' and {fixed[0]} do not touch along a line: {state}; move an edge onto an edge, "
        "or use snap for measured poses"
    )
