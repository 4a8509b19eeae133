"""Objects with measured poses, moved onto the edges that they nearly lie on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.contact_segments import SHORTEST_CONTACT
from pushplan.scenario.arrangement.meeting import Named, millimetres
from pushplan.scenario.parts import Snapped
from pushplan.util.arrays import FloatArray

_ROUNDING = 1e-12


@dataclass(frozen=True)
class SnapTolerance:
    """How far an object may be from the contact that it is moved onto: m along the normal, rad."""

    position: float
    angle: float


def snap(
    bodies: Sequence[Named], moving: Named, pose: FloatArray, within: SnapTolerance
) -> tuple[FloatArray, Snapped]:
    """Return the pose (3,) that lays an edge of an object on the nearest edge of another body, and how it was moved.

    The object turns about the centroid of its outline, which then moves along the other edge's normal: sideways its
    place is kept. Nearest is what needs the least of the tolerances.

    Args:
        bodies: What it may lie on: names, and outlines in the chain frame.
        moving: The object's name, and its outline (v, 2) in its own frame.
        pose: Measured, in the chain frame.
        within: Tolerances; they are not looked at but to weigh gap and turn.

    Returns:
        Where it lies on the nearest edge, however far that is; the caller judges.
    """
    found = [
        (effort, name, gap, turn, normal)
        for name, outline in bodies
        for effort, gap, turn, normal in _candidates(outline, moving[1], pose, within)
    ]
    if not found:
        return pose, Snapped(moving[0], "", math.inf, math.inf)
    _, onto, gap, turn, normal = min(found, key=lambda one: one[0])
    if abs(gap) <= _ROUNDING and abs(turn) <= _ROUNDING:
        return pose, Snapped(moving[0], onto, 0.0, 0.0)
    turned = _turned(moving[1], pose, turn)
    return turned - [*(gap * normal), 0.0], Snapped(moving[0], onto, gap, turn)


def too_far(moved: Snapped, within: SnapTolerance) -> str | None:
    """Return the sentence on an object that is farther from its contact than `snap` allows, or None."""
    if abs(moved.gap) <= within.position and abs(moved.turn) <= within.angle:
        return None
    allowed = f"snap allows {millimetres(within.position)} and {_degrees(within.angle)}"
    if not math.isfinite(moved.gap):
        return f"'{moved.name}' faces no edge of a body before it; {allowed}: move it, or stack it without a pose"
    return (
        f"'{moved.name}' is {millimetres(round(abs(moved.gap), 9))} and {_degrees(round(abs(moved.turn), 9))} from "
        f"lying on {moved.onto}; {allowed}: move it, or state a larger snap"
    )


def _candidates(
    fixed: FloatArray, outline: FloatArray, pose: FloatArray, within: SnapTolerance
) -> list[tuple[float, float, float, FloatArray]]:
    """Return effort, gap (m), turn (rad) and normal (2,) of every edge of `fixed` that an edge could lie on."""
    own = np.roll(outline, -1, axis=0) - outline
    steps = np.roll(fixed, -1, axis=0) - fixed
    facing = np.arctan2(-steps[:, 1], -steps[:, 0])
    headings = np.arctan2(own[:, 1], own[:, 0]) + pose[2]
    turns = se2.wrap_angle(facing[:, None] - headings)
    found = []
    for e, f in np.argwhere(np.abs(turns) < math.radians(45.0)):
        corners = se2.transform_points(
            _turned(outline, pose, turns[e, f]), outline[[f, (f + 1) % len(outline)]]
        )
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


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.3g} deg"
