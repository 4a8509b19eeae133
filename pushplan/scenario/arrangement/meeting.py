"""Sentences about bodies that overlap or fail to touch, with the numbers that put it right."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.contact_segments import TOUCH, find_touch
from pushplan.geometry.penetration import exit_distance, overlap_depth
from pushplan.util.arrays import FloatArray

Named = tuple[str, FloatArray]
"""What a message calls a body, and its outline (v, 2) in the chain frame."""

Way = tuple[str, int, float]
"""How a message asks for a coordinate of a pose, its index, and the sense in which it is moved."""

AWAY: tuple[Way, ...] = (("x >=", 0, 1.0), ("y >=", 1, 1.0), ("y <=", 1, -1.0))
BACK: tuple[Way, ...] = (("x <=", 0, -1.0),)
"""The ways out of an overlap for what is pushed, and for what pushes."""

NEARLY = 1e-3
"""Gap below which bodies that do not touch are too near to be told apart from bodies that do, m."""

_SNAPS = (5, 10, 20)
"""Tolerances that messages propose, mm: the least that is well above the gap."""

_SNAP_TURN = math.radians(2.0)


def millimetres(length: float) -> str:
    """Return a length (m) as people read it, in mm."""
    value = 1e3 * length
    return f"{value:.3g} mm" if abs(value) < 1000.0 else f"{value:.0f} mm"


def describe_overlap(fixed: Named, moving: Named, pose: FloatArray, ways: Sequence[Way] = AWAY) -> str | None:
    """Return how far `moving`, at `pose` (3,), overlaps `fixed` and where it would not; None when it does not."""
    depth = overlap_depth(fixed[1], moving[1])
    if depth == 0.0:
        return None
    shifts = [exit_distance(fixed[1], moving[1], sign * np.eye(2)[axis]) for _, axis, sign in ways]
    best = int(np.argmin(shifts))
    words, axis, sign = ways[best]
    # Rounded outward to whole micrometres, within which bodies still touch.
    limit = sign * math.ceil((sign * pose[axis] + shifts[best]) * 1e6 - 1e-3) * 1e-6
    return f"'{moving[0]}' overlaps {fixed[0]} by {millimetres(depth)}; move it to {words} {limit:.6g}"


def describe_gap(fixed: Named, moving: Named, pose: FloatArray) -> str:
    """Return how far `moving`, at `pose` (3,), is from touching `fixed` along a line, and what would help."""
    line = shapely.shortest_line(shapely.Polygon(moving[1]), shapely.Polygon(fixed[1]))
    begin, end = shapely.get_coordinates(line)
    step = (end - begin).round(9)
    gap = float(np.linalg.norm(step))
    state = f"the gap is {millimetres(gap)}" if gap > TOUCH else "they meet at a point"
    text = f"'{moving[0]}' and {fixed[0]} do not touch along a line: {state}"
    touch = find_touch(fixed[1], moving[1] + step)
    if touch is not None and len(touch):
        x, y, theta = pose + np.append(step, 0.0)
        return f"{text}; write pose: [{x:.6g}, {y:.6g}, {theta:.6g}]{_or_snap(gap)}"
    turn = _smallest_turn(fixed[1], moving[1])
    if abs(turn) > 1e-9:
        return f"{text}; turn it by {math.degrees(turn):.3g} deg so that an edge lies on an edge{_or_snap(gap, turn)}"
    return f"{text}; move it until an edge lies on an edge"


def describe_nearness(first: str, second: str, gap: float) -> str:
    """Return what is wrong with two bodies that nearly touch, and that each touch something else."""
    return (
        f"{first} and {second} do not touch, but are only {millimetres(gap)} apart: the least error makes a contact "
        f"of it; allowed: at least {millimetres(NEARLY)}, or a contact, onto which snap moves measured poses"
    )


def _or_snap(gap: float, turn: float = 0.0) -> str:
    """Return the proposal to snap what is not far (m, rad) from a contact."""
    enough = [size for size in _SNAPS if 2.5e3 * gap <= size]
    near = enough and abs(turn) <= _SNAP_TURN and (gap > TOUCH or turn != 0.0)
    return f", or state snap: {enough[0]} mm" if near else ""


def _smallest_turn(fixed: FloatArray, moving: FloatArray) -> float:
    """Return the turn (rad) of `moving` that lays one of its edges against an edge of `fixed`."""
    first, second = (np.roll(outline, -1, axis=0) - outline for outline in (fixed, moving))
    facing = np.arctan2(-first[:, 1], -first[:, 0])
    turns = se2.wrap_angle(facing[:, None] - np.arctan2(second[:, 1], second[:, 0]))
    return float(turns.flat[np.abs(turns).argmin()])
