"""Places for a row of objects, and the pose at which a row with placed objects continues."""

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
"""Distance of a row's front from a wall, in addition to the clearance, m."""

ALONG_A_WALL = 0.25
"""Distance between candidate places along a wall, m, and their maximum number."""
MOST_ALONG = 16

AT_PLACE = 1e-6
"""Position error up to which a row counts as fitting its specified place, m."""

ASKEW = math.radians(15.0)
"""Maximum angle between a placed object and the row's direction, rad."""


@dataclass(frozen=True, eq=False)
class RowPlace:
    """A place for the row: poses (3,) of its front and, if specified, of its rear, with +x along the push."""

    front: FloatArray
    rear: FloatArray | None


def row_places(scenario: Scenario, hands: Hands) -> tuple[RowPlace, ...]:
    """Return the possible places of the row; empty if it can stand anywhere."""
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
    """Return the rear pose (3,) of the objects placed in the row, +x along the row, and the rearmost one's name.

    Raises:
        PlanningError: If the rearmost object has no usable face on that side.
    """
    row, poses, loads = scenario.transport.row, scenario.poses, scenario.task.by_name
    heading = _heading(scenario)
    last = next(name for name in row.order_at(loads, poses, heading) if name in row.placed)
    rears = [se2.compose(poses[last], way.entry) for (name, _), way in hands.ways.items() if name == last]
    off = [abs(float(se2.wrap_angle(rear[2] - heading))) for rear in rears]
    if not off or min(off) > ASKEW:
        what = (
            "it has no allowed face on that side" if not off else f"it is turned by {math.degrees(min(off)):.1f} deg"
        )
        raise PlanningError(f"no object can be pushed flush onto '{last}', which stands in the row: {what}")
    return rears[int(np.argmin(off))], last


def _heading(scenario: Scenario) -> float:
    """Return the direction of a row with placed objects, rad: towards the wall nearest to them."""
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
    """Return the lines for a row's front along walls: both ends (2,) and the heading towards the wall, rad."""
    row, area = scenario.transport.row, scenario.workspace
    if row.wall is None or area is None:
        return []
    distance = scenario.clearance + BESIDE_A_WALL
    sides = {
        "xmin": ([area.xmin + distance, area.ymin], [area.xmin + distance, area.ymax], math.pi),
        "xmax": ([area.xmax - distance, area.ymin], [area.xmax - distance, area.ymax], 0.0),
        "ymin": ([area.xmin, area.ymin + distance], [area.xmax, area.ymin + distance], -0.5 * math.pi),
        "ymax": ([area.xmin, area.ymax - distance], [area.xmax, area.ymax - distance], 0.5 * math.pi),
    }
    return [
        (np.array(begin), np.array(end), heading)
        for name, (begin, end, heading) in sides.items()
        if row.wall in (name, "any")
    ]


def _lengths(names: tuple[str, ...], hands: Hands) -> set[float]:
    """Return the possible lengths of a row of all objects, each pushed through two opposite faces, m."""
    found = {0.0}
    for name in names:
        own = set()
        for (other, _), way in hands.ways.items():
            if other == name and way.across is not None and abs(way.across[1]) < AT_PLACE:
                own.add(round(float(way.across[0]), 9))
        found = {round(sofar + length, 9) for sofar in found for length in own}
    return found
