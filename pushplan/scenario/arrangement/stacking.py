"""Stack objects flush: a rear edge (outward normal -x in its own frame) on the front edge (+x) of what is before.

Nothing is turned: the stacked object's frame is parallel to the frame of what it stands on.
"""

from __future__ import annotations

import numpy as np

from pushplan.errors import ChainError
from pushplan.geometry.contact_segments import SHORTEST_CONTACT, TOUCH
from pushplan.scenario.arrangement.meeting import millimetres
from pushplan.util.arrays import FloatArray


def box_outline(length: float, width: float) -> FloatArray:
    """Return the corners (4, 2) of a box about the origin, counter-clockwise."""
    x, y = 0.5 * length, 0.5 * width
    return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


def plate_outline(width: float, thickness: float, middle: float = 0.0) -> FloatArray:
    """Return the plate's corners (4, 2) with its front on x = 0 and its middle at y = `middle`."""
    corners = box_outline(thickness, width)
    corners += [-0.5 * thickness, middle]
    return corners


def flush_pose(base: FloatArray, outline: FloatArray, offset: float, names: tuple[str, str]) -> FloatArray:
    """Return the pose (3,), in the frame of `base`, of an object stacked on it.

    Args:
        base: (v, 2) outline of what the object stands on, in its own frame.
        outline: (w, 2) outline of the object, in its own frame.
        offset: y of the object's frame, m.
        names: What messages call the two.

    Raises:
        ChainError: When one has no such edge, or the edges do not meet along a line.
    """
    front, rear = _edge_span(base, +1), _edge_span(outline, -1)
    for span, name, edge, side in ((front, names[0], "front", "+x"), (rear, names[1], "rear", "-x")):
        if span is None:
            raise ChainError(
                f"{names[1]} cannot be stacked: {name} has no {edge} edge, only a corner is outermost towards "
                f"{side}; state a pose"
            )
    assert front is not None
    assert rear is not None
    low, high = front[1] - rear[2], front[2] - rear[1]
    if not low + SHORTEST_CONTACT < offset < high - SHORTEST_CONTACT:
        gap = max(low - offset, offset - high, 0.0)
        raise ChainError(
            f"{names[1]} and {names[0]} do not touch along a line: the gap is {millimetres(gap)}; "
            f"allowed: an offset between {low:.6g} and {high:.6g}"
        )
    return np.array([front[0] - rear[0], offset, 0.0])


def _edge_span(outline: FloatArray, side: int) -> tuple[float, float, float] | None:
    """Return x, lowest and highest y of the edges farthest towards `side` (+1: +x, -1: -x), or None."""
    x = side * outline[:, 0]
    on = x >= x.max() - TOUCH
    begins = on & np.roll(on, -1)
    ends = np.concatenate([outline[begins], outline[np.roll(begins, 1)]])
    if len(ends) == 0 or float(np.ptp(ends[:, 1])) <= SHORTEST_CONTACT:
        return None
    return float(side * x.max()), float(ends[:, 1].min()), float(ends[:, 1].max())
