"""Where a row of objects may stand, and where it goes on from those that stand in it already."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.multi.hands import Hands
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

BESIDE_A_WALL = 1e-3
"""What a row's front keeps from a wall beside the clearance, m."""

ALONG_A_WALL = 0.25
"""Distance between places along a wall that are offered to a row, m, and so many of them at most."""
MOST_ALONG = 16

AT_PLACE = 1e-6
"""A row that is made up of other lengths than its stated place is for misses it by more, m."""

ASKEW = math.radians(15.0)
"""Up to so far those that are placed may be turned from the row's direction, rad."""


@dataclass(frozen=True, eq=False)
class RowPlace:
    """A place for the row: (3,) pose of its front, +x along the push; and of its rear where that is stated."""

    front: FloatArray
    rear: FloatArray | None


def row_places(scenario: Scenario, hands: Hands) -> tuple[RowPlace, ...]:
    """Return the places that the row may have; none where it may stand anywhere."""
    row = scenario.transport.row
    if row.pose is not None:
        return tuple(
            RowPlace(se2.compose(row.pose, [length, 0.0, 0.0]), np.asarray(row.pose))
            for length in sorted(_lengths(row.of, hands))
        )
    found = []
    for begin, end, heading in _walls(scenario):
        length = float(np.linalg.norm(np.subtract(end, begin)))
        count = max(1, min(MOST_ALONG, int(length / ALONG_A_WALL)))
        shares = (np.arange(count) + 0.5) / count
        middles = np.add(begin, shares[:, None] * np.subtract(end, begin))
        found += [RowPlace(np.append(middle, heading), None) for middle in middles]
    return tuple(found)


def front_of_placed(scenario: Scenario, hands: Hands) -> tuple[FloatArray, str]:
    """Return where those that are placed in the row go on: (3,) pose of the rear, +x along the row, and whose it is.

    Raises:
        PlanningError: When the rearmost one has no face to be pushed at on that side.
    """
    row, poses, loads = scenario.transport.row, scenario.poses, scenario.task.by_name
    heading = _heading(scenario)
    last = next(name for name in row.order_at(loads, poses, heading) if name in row.placed)
    rears = [se2.compose(poses[last], way.entry) for (name, _), way in hands.ways.items() if name == last]
    off = [abs(float(se2.wrap_angle(rear[2] - heading))) for rear in rears]
    if not off or min(off) > ASKEW:
        what = "no face there that may be pushed" if not off else f"it is turned by {math.degrees(min(off)):.1f} deg"
        raise PlanningError(f"nothing can be pushed flush onto '{last}', which stands in the row: {what}")
    return rears[int(np.argmin(off))], last


def _heading(scenario: Scenario) -> float:
    """Return the direction of a row of which some are placed, rad: towards the wall that they are nearest to."""
    row = scenario.transport.row
    if row.pose is not None:
        return float(row.pose[2])
    there = np.array([scenario.poses[name][:2] for name in row.placed])
    away = {}
    for begin, _, heading in _walls(scenario):
        normal = np.array([math.cos(heading), math.sin(heading)])
        away[heading] = float(((begin - there) @ normal).min())
    return min(away, key=lambda heading: away[heading])


def _walls(scenario: Scenario) -> list[tuple[FloatArray, FloatArray, float]]:
    """Return the lines on which a row's front may be at a wall: both ends (2,), and the heading towards it, rad."""
    row, area = scenario.transport.row, scenario.workspace
    if row.wall is None or area is None:
        return []
    kept = scenario.clearance + BESIDE_A_WALL
    sides = {
        "xmin": ([area.xmin + kept, area.ymin], [area.xmin + kept, area.ymax], math.pi),
        "xmax": ([area.xmax - kept, area.ymin], [area.xmax - kept, area.ymax], 0.0),
        "ymin": ([area.xmin, area.ymin + kept], [area.xmax, area.ymin + kept], -0.5 * math.pi),
        "ymax": ([area.xmin, area.ymax - kept], [area.xmax, area.ymax - kept], 0.5 * math.pi),
    }
    return [
        (np.array(begin), np.array(end), heading)
        for name, (begin, end, heading) in sides.items()
        if row.wall in (name, "any")
    ]


def _lengths(names: tuple[str, ...], hands: Hands) -> set[float]:
    """Return how long a row of all the objects may be, each pushed through a face straight in front of another."""
    found = {0.0}
    for name in names:
        own = set()
        for (other, _), way in hands.ways.items():
            if other == name and way.across is not None and abs(way.across[1]) < AT_PLACE:
                own.add(round(float(way.across[0]), 9))
        found = {round(sofar + length, 9) for sofar in found for length in own}
    return found
