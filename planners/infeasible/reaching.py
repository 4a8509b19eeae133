"""What the robot cannot come up to: a disc that fits into it goes wherever the robot goes.

Nothing moves before the robot has come up to something. So where obstacles, walls and all objects as they stand,
grown by the disc's radius, part the robot from every face that it may push, it is boxed in. And an object from all
faces of which obstacles and walls alone part it stays where it is, whatever else is moved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.geometry import se2
from pushplan.planners.infeasible.bounds import between, grown, largest_disc, reached, room
from pushplan.plans.plan import Diagnosis
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

WITHIN = 1e-6
"""Places may be so far (m) outside of a region: they lie on its edge."""


def beyond_reach(
    scenario: Scenario,
    outlines: Mapping[str, Sequence[FloatArray]],
    faces: Mapping[str, FloatArray],
    needed: Sequence[str] = (),
) -> Diagnosis | None:
    """Return the proof that the robot reaches no object, or not one that has to be moved; None where there is none.

    Args:
        scenario: Of one of the objects alone, with the robot's start and all that is fixed.
        outlines: (v, 2) of the parts of each object, in the world.
        faces: (k, 3) poses of the plate before each face that it may come up to, by object; in the world.
        needed: Names of the objects that have to be moved.
    """
    disc = largest_disc(scenario.chain.carried)
    into = se2.inverse(scenario.chain.pusher.plate_pose)
    start = disc.at(se2.compose(scenario.plate_start, into))
    radius = disc.radius + scenario.clearance - CLEARANCE_ROOM
    free = room(scenario, radius)
    alone = reached(free, start, WITHIN)
    standing = [PolygonObstacle(outline) for parts in outlines.values() for outline in parts]
    # What the robot starts close to does not keep it there: it backs off.
    covered = [shape for shape in grown(standing, disc.radius) if not shape.intersects(start)]
    open_floor = shapely.difference(free, shapely.union_all(covered))
    among = reached(open_floor, start, WITHIN)
    if among.is_empty:
        return None
    centers = {name: [disc.at(se2.compose(pose, into)) for pose in poses] for name, poses in faces.items()}
    if not any(_any_in(among, points) for points in centers.values()):
        every = [point for points in centers.values() for point in points]
        text = "the robot is boxed in: it has no way to any face of an object that it may push"
        if not _any_in(open_floor, every):
            text = "the robot has no room before any face of an object that it may push"
        return Diagnosis("boxed in", text, True, blocking=_parting(scenario, radius, free, among, every))
    for name in needed:
        if not _any_in(alone, centers[name]):
            text = f"'{name}' cannot be reached: walls and obstacles leave the robot no way to any of its faces"
            parting = _parting(scenario, radius, free, alone, centers[name])
            return Diagnosis("boxed in", text, True, blocking=parting)
    return None


def _any_in(region: BaseGeometry, points: Sequence[shapely.Point]) -> bool:
    return bool((shapely.distance(region, points) <= WITHIN).any())


def _parting(
    scenario: Scenario,
    radius: float,
    free: BaseGeometry,
    region: BaseGeometry,
    points: Sequence[shapely.Point],
) -> tuple[int, ...]:
    """Return the obstacles that, grown, bound a region and cover points beyond it, or bound where these are."""
    beyond = shapely.union_all([*points, *(reached(free, point, WITHIN) for point in points)])
    return between(grown(scenario.obstacles, radius), region, beyond)
