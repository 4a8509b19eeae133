"""Random surroundings of a chain: workspace, start, goal, walls with gaps, and clutter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.bench.random_problems.parameters import GeneratorError, ProblemParameters
from pushplan.bench.random_problems.shapes import random_polygon, rounded
from pushplan.geometry.se2 import compose, rotate, transform_points
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray

CLEARANCE = 0.02
"""Distance of obstacles and walls from start and goal, m."""

SHORTEST_WAY = 0.4
"""Least distance from start to goal, as a share of the workspace's side."""

MOST_DRAWS = 2_000
"""Pairs of start and goal that are drawn before the parameters are given up."""

MOST_PLACES = 100
"""Places that are tried for an obstacle."""

WALL = (0.05, 0.15)
"""Thickness of a wall, m."""

Stated = dict[str, object]
"""An obstacle as a scenario file states it."""


@dataclass(frozen=True, eq=False)
class Wall:
    """A wall across the workspace, with a gap.

    Attributes:
        sides: The pieces on both sides of the gap, as corners (4, 2), m.
        axis: 0 when the wall stands across x, 1 when across y.
        at: Coordinate of its middle on that axis, m.
        passage: What stays free on both sides of the gap.
    """

    sides: tuple[FloatArray, FloatArray]
    axis: int
    at: float
    passage: BaseGeometry


@dataclass(frozen=True, eq=False)
class World:
    """What surrounds a chain.

    Attributes:
        side: Of the square workspace, whose corner is the origin, m.
        start: (3,) pose of the chain frame.
        goal: (3,) pose of the chain frame.
        obstacles: As a scenario file states them.
    """

    side: float
    start: FloatArray
    goal: FloatArray
    obstacles: list[Stated]


def random_world(rng: np.random.Generator, chain: Chain, parameters: ProblemParameters) -> World:
    """Draw surroundings in which start and goal are free.

    Raises:
        GeneratorError: When start and goal find no place.
    """
    side = rounded(rng.uniform(*parameters.workspace))
    body = np.concatenate([moving.outline for moving in chain.bodies])
    wall = None if parameters.gap is None else _wall(rng, body, side, parameters)
    start, goal = _ends(rng, body, side, wall, parameters.room)
    kept = [
        _kept(body, start, parameters.room, +1.0),
        _kept(body, goal, parameters.room, -1.0),
        *([] if wall is None else [wall.passage]),
    ]
    obstacles = [] if wall is None else [_stated(piece) for piece in wall.sides]
    free = shapely.union_all(kept).buffer(CLEARANCE)
    return World(side, start, goal, obstacles + _clutter(rng, side, free, parameters))


def _wall(rng: np.random.Generator, body: FloatArray, side: float, parameters: ProblemParameters) -> Wall:
    assert parameters.gap is not None
    length, width = np.ptp(body, axis=0)
    gap, thick = width * rng.uniform(*parameters.gap), rng.uniform(*WALL)
    at, middle = side * rng.uniform(0.45, 0.55), side * rng.uniform(0.25, 0.75)
    low, high = max(middle - 0.5 * gap, 0.0), min(middle + 0.5 * gap, side)
    axis, reach = int(rng.integers(0, 2)), 0.5 * thick + length + parameters.room
    x = at - 0.5 * thick, at + 0.5 * thick
    sides = _rectangle(x, (-0.1, low), axis), _rectangle(x, (high, side + 0.1), axis)
    passage = _rectangle((at - reach, at + reach), (low, high), axis)
    return Wall(sides, axis, float(at), shapely.Polygon(passage))


def _rectangle(x: tuple[float, float], y: tuple[float, float], axis: int) -> FloatArray:
    """Return corners (4, 2), counter-clockwise, with x and y exchanged when the axis is 1."""
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])
    return np.round(corners if axis == 0 else corners[::-1, ::-1], 4)


def _ends(
    rng: np.random.Generator, body: FloatArray, side: float, wall: Wall | None, room: float
) -> tuple[FloatArray, FloatArray]:
    """Draw start and goal, far enough from each other and on different sides of the wall."""
    inside = shapely.box(0.0, 0.0, side, side).buffer(-CLEARANCE)
    pieces = [] if wall is None else [shapely.Polygon(piece) for piece in wall.sides]
    walls = shapely.MultiPolygon(pieces).buffer(CLEARANCE)
    for _ in range(MOST_DRAWS):
        start, goal = (np.round([*rng.uniform(0.0, side, 2), rng.uniform(-np.pi, np.pi)], 4) for _ in "sg")
        apart = np.linalg.norm(goal[:2] - start[:2]) >= SHORTEST_WAY * side
        if not apart or (
            wall is not None and (start[wall.axis] - wall.at) * (goal[wall.axis] - wall.at) > 0.0
        ):
            continue
        kept = [_kept(body, start, room, +1.0), _kept(body, goal, room, -1.0)]
        if all(area.within(inside) and not area.intersects(walls) for area in kept):
            return start, goal
    raise GeneratorError(
        f"start and goal find no place in a workspace of {side:g} m; allowed: a larger workspace, "
        "fewer or smaller objects, less room"
    )


def _kept(body: FloatArray, pose: FloatArray, room: float, sense: float) -> BaseGeometry:
    """Return what a body covers at a pose and on a straight way of length `room` ahead of (+1) or behind it (-1)."""
    other = compose(pose, np.array([sense * room, 0.0, 0.0]))
    corners = np.concatenate([transform_points(pose, body), transform_points(other, body)])
    return shapely.MultiPoint(corners).convex_hull


def _clutter(
    rng: np.random.Generator, side: float, free: BaseGeometry, parameters: ProblemParameters
) -> list[Stated]:
    """Draw obstacles that leave `free` free, until there are enough or they cover enough."""
    count = int(rng.integers(parameters.obstacles[0], parameters.obstacles[1] + 1))
    most = np.inf if parameters.density is None else side * side * rng.uniform(*parameters.density)
    placed: list[Stated] = []
    covered: BaseGeometry = shapely.MultiPolygon()
    shapely.prepare(free)
    while len(placed) < count and covered.area < most:
        found = _obstacle(rng, side, free, parameters)
        if found is None:
            break
        placed.append(found[0])
        covered = covered.union(found[1])
    return placed


def _obstacle(
    rng: np.random.Generator, side: float, free: BaseGeometry, parameters: ProblemParameters
) -> tuple[Stated, BaseGeometry] | None:
    """Draw an obstacle until it has a place; None when there is hardly any."""
    for _ in range(MOST_PLACES):
        stated, area = _shape(rng, side, parameters)
        if not area.intersects(free):
            return stated, area
    return None


def _shape(
    rng: np.random.Generator, side: float, parameters: ProblemParameters
) -> tuple[Stated, BaseGeometry]:
    kind = str(rng.choice(parameters.obstacle_shapes))
    center = np.round(rng.uniform(0.0, side, 2), 4)
    length, width = (rounded(size) for size in rng.uniform(*parameters.obstacle_size, 2))
    turn = rounded(rng.uniform(-np.pi, np.pi))
    if kind == "circle":
        radius = rounded(0.5 * length)
        return {"circle": radius, "center": center.tolist()}, shapely.Point(center).buffer(radius)
    if kind == "box":
        area = shapely.Polygon(_box(length, width, turn) + center)
        return {"box": [length, width], "pose": [*center.tolist(), turn]}, area
    corners = np.round(rotate(turn, random_polygon(rng, length, width)) + center, 4)
    return _stated(corners), shapely.Polygon(corners)


def _box(length: float, width: float, turn: float) -> FloatArray:
    corners = 0.5 * np.array([[-length, -width], [length, -width], [length, width], [-length, width]])
    return rotate(turn, corners)


def _stated(corners: FloatArray) -> Stated:
    return {"polygon": corners.tolist()}
