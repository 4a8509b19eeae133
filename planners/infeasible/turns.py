"""How tightly stable pushes turn the chain frame's origin at most, in each direction in which it moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray

SECTORS = 64
"""Sectors that the directions of v are put together to, at most."""

SAMPLES = 65
"""Turning rates at which the family of a wheeled drive is looked at."""

SAME_DIRECTION = 1e-9
"""Ends of a segment whose directions (rad) differ by less lie on one meridian."""


class Turns(NamedTuple):
    """What is known of the stable twists.

    Attributes:
        left: (k, 3) sectors of the direction of v in turns to the left: a lower bound on |v| at |omega| = 1 (m), the
            middle of the sector and half its width (rad).
        right: Likewise.
        lean: Least and largest direction of v of any stable twist, rad.
    """

    left: FloatArray
    right: FloatArray
    lean: tuple[float, float]


def turns_of(segments: FloatArray) -> Turns:
    """Return what is known of the twists on segments (k, 6), and between them; see `controls`."""
    first, last = segments[:, :3], segments[:, 3:]
    if np.all(np.abs(se2.wrap_angle(_direction(last) - _direction(first))) < SAME_DIRECTION):
        return _turns_of_meridians(segments)
    return _turns_of_family(segments)


def _direction(twists: FloatArray) -> FloatArray:
    """Directions of v of twists."""
    return np.asarray(np.arctan2(twists[..., 1], twists[..., 0]))


def _turns_of_meridians(segments: FloatArray) -> Turns:
    """Turns of an omnidirectional pusher: each meridian's ends tell the least |v| at |omega| = 1 in its direction."""
    direction = np.unwrap(_direction(segments[:, :3]))
    order = np.argsort(direction)
    direction, segments = direction[order], segments[order]
    steps = np.diff(direction)
    # The set goes on beyond the outermost meridians, by less than to the next one; a drive may have one direction.
    step = (
        float(steps[steps > SAME_DIRECTION].min()) if direction[-1] - direction[0] > SAME_DIRECTION else 0.0
    )
    left, right = (_meridian_sectors(direction, segments, side, step) for side in (1.0, -1.0))
    return Turns(left, right, (float(direction[0]) - step, float(direction[-1]) + step))


def _meridian_sectors(direction: FloatArray, segments: FloatArray, side: float, step: float) -> FloatArray:
    """Sectors between neighbouring meridians, and one beside the outermost ones, of turns to a side."""
    first, last = segments[:, :3], segments[:, 3:]
    ends = np.where((side * first[:, 2] > side * last[:, 2])[:, None], first, last)
    able = side * ends[:, 2] > 0.0
    if not able.any():
        return np.zeros((0, 3))
    direction, ends = direction[able], ends[able]
    bend = np.abs(ends[:, 2]) / np.hypot(ends[:, 0], ends[:, 1])
    direction = np.concatenate([[direction[0] - step], direction, [direction[-1] + step]])
    bend = np.concatenate([bend[:1], bend, bend[-1:]])
    # Between two meridians the boundary may have a corner: it lies below what either side goes on to when drawn out.
    change = np.diff(bend, prepend=bend[0], append=bend[-1])
    most = np.maximum(bend[:-1], bend[1:]) + np.maximum(0.0, np.maximum(change[:-2], -change[2:]))
    half = 0.5 * np.diff(direction)
    return _together(np.column_stack([1.0 / most, direction[:-1] + half, half]))


def _turns_of_family(segments: FloatArray) -> Turns:
    """Turns of a wheeled drive: straight lines of twists, looked at bin by bin."""
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    rows = [(1.0 - share) * row[:3] + share * row[3:] for row in segments]
    left, right = (np.concatenate([_family_sectors(row, side) for row in rows]) for side in (1.0, -1.0))
    direction = np.unwrap(np.concatenate([_direction(row) for row in rows]))
    return Turns(left, right, (float(direction.min()), float(direction.max())))


def _family_sectors(twists: FloatArray, side: float) -> FloatArray:
    """Sectors of turns to a side between neighbours of twists (m, 3) on a straight line."""
    speed, direction = np.hypot(twists[:, 0], twists[:, 1]), np.unwrap(_direction(twists))
    rate = np.maximum(side * twists[:, 2], 0.0)
    most = np.maximum(rate[:-1], rate[1:])
    # Between two of them |v| is not less than the lesser one minus their difference: they lie on a line.
    least = np.minimum(speed[:-1], speed[1:]) - np.abs(np.diff(speed))
    able = most > 0.0
    radius = np.maximum(least, 0.0)[able] / most[able]
    middle, half = 0.5 * (direction[:-1] + direction[1:]), 0.5 * np.abs(np.diff(direction))
    return np.column_stack([radius, middle[able], half[able]])


def _together(sectors: FloatArray) -> FloatArray:
    """Neighbouring sectors (k, 3) as at most SECTORS wider ones, each with the least radius of its own."""
    if len(sectors) <= SECTORS:
        return sectors
    low, high = sectors[:, 1] - sectors[:, 2], sectors[:, 1] + sectors[:, 2]
    firsts = np.unique(np.linspace(0, len(sectors), SECTORS, endpoint=False).astype(int))
    lows, highs = np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)
    radius = np.minimum.reduceat(sectors[:, 0], firsts)
    return np.column_stack([radius, 0.5 * (lows + highs), 0.5 * (highs - lows)])
