"""Random push problems as scenario files: the same text for the same seed.

A chain that can be pushed straight ahead and around to both sides stands in a room with walls and clutter. Start and
goal are free by construction; whether a path leads from one to the other is left to chance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import shapely
import yaml
from shapely.geometry.base import BaseGeometry

from pushplan.bench.schema import ProblemParameters
from pushplan.errors import PushplanError, ScenarioError
from pushplan.geometry.se2 import compose, rotate, transform_points
from pushplan.mechanics.chain import Chain
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.layout import box_outline
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray
from pushplan.util.names import SCENARIO_FORMAT

DRIVES: tuple[Literal["omnidirectional", "differential", "car"], ...] = ("omnidirectional", "differential", "car")

CHAIN_DRAWS = 10
"""Chains that are drawn for one with the turns that are asked for."""

RADII = 2.0 ** (np.arange(13) / 2.0)
"""Radii that are tried, as multiples of the one asked for."""

LEAST_MARGIN = 0.01
"""Margin of the straight push and of the turns."""

SHIFT = 0.2
"""Farthest that contact partners are off each other's middle, as a share of the shorter edge."""

CLEARANCE = 0.02
"""Distance of obstacles and walls from start and goal, m."""

START_TO_GOAL = 0.4
"""Least distance from start to goal, as a share of the workspace's side."""

POSE_DRAWS = 2_000
"""Pairs of start and goal that are drawn before the parameters are given up."""

OBSTACLE_DRAWS = 100
"""Places that are tried for an obstacle."""

WALL = (0.05, 0.15)
"""Thickness of a wall, m."""

ROBOT_DRAWS = 50
"""Places that are tried for the robot."""

ROBOT_LENGTH = 1.2
"""Length of the robot's body over the width of its plate."""

Span = tuple[float, float]
Sections = dict[str, Any]
"""Sections of a scenario file, or a part of one, as plain data."""


class GeneratorError(PushplanError, ValueError):
    """Random problems cannot be made with these parameters."""


# --- a problem --------------------------------------------------------------------------------------------------


def generate(parameters: ProblemParameters, seed: int) -> str:
    """Return the text of a scenario file with a random problem.

    Args:
        parameters: What the problem is like.
        seed: Of the random numbers, >= 0.

    Raises:
        GeneratorError: When the parameters leave no room for a problem.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    sections, chain, radius = random_chain(rng, parameters)
    factor = max(1.0, radius / parameters.turning_radius)  # by which its turns are wider than asked for
    room = {name: tuple(factor * end for end in getattr(parameters, name)) for name in ("workspace", "obstacle_size")}
    world = random_world(rng, chain, parameters.model_copy(update=room))
    stated = {"name": f"random {seed}", **sections, **world}
    if parameters.robot is not None:
        stated["robot"] = _robot_beside(rng, stated, chain, parameters.robot)
    about = f"{len(chain.objects)} objects, {len(world['obstacles'])} obstacles, {chain.pusher.drive.kind}"
    return f"# {about}; seed {seed}\n{scenario_yaml(stated)}"


def scenario_yaml(sections: Mapping[str, object]) -> str:
    """Return the text of a scenario file with the given sections, in their order."""
    document = {"format": SCENARIO_FORMAT, **sections}
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)


def _round(value: float) -> float:
    """Return a length in tenths of a millimetre, as generated files have it."""
    return round(float(value), 4)


# --- the chain --------------------------------------------------------------------------------------------------


def random_chain(rng: np.random.Generator, parameters: ProblemParameters) -> tuple[Sections, Chain, float]:
    """Draw chains of one number of objects and one drive until one turns as tightly as asked for.

    When none of `CHAIN_DRAWS` chains does, the one that turns most tightly is taken: long chains before wheels cannot
    turn as tightly as short ones.

    Returns:
        The sections of a scenario file that state the chain, the chain, and how tightly it turns, m.

    Raises:
        GeneratorError: When none of the chains can be pushed straight ahead and around to both sides.
    """
    count = int(rng.integers(parameters.objects[0], parameters.objects[1] + 1))
    kind = str(rng.choice(parameters.drives))
    axle = {"axle": [_round(-rng.uniform(0.1, 0.3)), 0.0, 0.0]}
    least = _round(parameters.turning_radius * rng.uniform(0.2, 0.8))
    drives = {"differential": {"differential": axle}, "car": {"car": {**axle, "min_radius": least}}}
    drive: Sections = {"drive": drives[kind]} if kind in drives else {}
    drawn: list[tuple[float, Sections, Chain]] = []
    for _ in range(CHAIN_DRAWS):
        sections = _chain_sections(rng, parameters, count, drive)
        chain = scenario_from_text(scenario_yaml({**sections, "goal": {"pose": [1.0, 0.0, 0.0]}})).chain
        drawn.append((tightest_turn(chain, parameters.turning_radius), sections, chain))
        if drawn[-1][0] <= parameters.turning_radius:
            break
    radius, sections, chain = min(drawn, key=lambda found: found[0])
    if radius == np.inf:
        raise GeneratorError(
            f"none of {CHAIN_DRAWS} random chains can be pushed ahead and around to its left and right; "
            "allowed: more friction at the contacts, fewer objects, a larger turning_radius"
        )
    return sections, chain, radius


def tightest_turn(chain: Chain, radius: float) -> float:
    """Return the first of `RADII` times `radius` at which turns to both sides are stable, or infinity.

    A radius is here the distance of the turn's centre (x, y) from the chain frame's x axis, m; the twist about it is
    omega (y, -x, 1). The centre lies on the axle's line of a pusher with wheels. A chain that cannot be pushed
    straight ahead has no such turn.
    """
    stable, drive = stable_set(chain, "ecof"), chain.pusher.drive
    if stable.margin([[1.0, 0.0, 0.0]])[0] <= LEAST_MARGIN:
        return np.inf
    x = np.linspace(-1.0, 1.0, 41) * chain.characteristic_length if drive.axle is None else drive.axle[:1]
    for distance in radius * RADII:
        turns = [[abs(y), -np.sign(y) * at, np.sign(y)] for y in (distance, -distance) for at in x]
        if (stable.margin(turns).reshape(2, -1).max(axis=1) > LEAST_MARGIN).all():
            return float(distance)
    return np.inf


def _chain_sections(rng: np.random.Generator, parameters: ProblemParameters, count: int, drive: Sections) -> Sections:
    shapes = [_object_shape(rng, parameters) for _ in range(count)]
    plate = _round((shapes[0].rear[1] - shapes[0].rear[0]) * rng.uniform(0.9, 1.4))
    fronts = [(-0.5 * plate, 0.5 * plate), *(shape.front for shape in shapes)]
    names = [f"object{i + 1}" for i in range(count)]
    objects = [
        _object(rng, parameters, name, shape, front)
        for name, shape, front in zip(names, shapes, fronts, strict=False)
    ]
    between = [
        {"objects": [first, second], "friction": _round(rng.uniform(*parameters.contact_friction))}
        for first, second in pairwise(names)
    ]
    return {
        "floor": {"friction": _round(rng.uniform(*parameters.floor_friction))},
        "objects": objects,
        **({"contacts": {"between": between}} if between else {}),
        "pusher": {"width": plate, "friction": _round(rng.uniform(*parameters.pusher_friction)), **drive},
    }


@dataclass(frozen=True, eq=False)
class ObjectShape:
    """A convex outline (v, 2) in the object's frame, m, counter-clockwise, with flush edges in front and behind.

    `rear` and `front` are the lowest and highest y of these edges; `stated` is what a scenario file says.
    """

    outline: FloatArray
    rear: Span
    front: Span
    stated: Sections


def _object_shape(rng: np.random.Generator, parameters: ProblemParameters) -> ObjectShape:
    """Draw a box, or a polygon with up to two corners on either side."""
    box = rng.choice(parameters.shapes) == "box"
    length, width = (_round(rng.uniform(*parameters.size)) for _ in range(2))
    outline = box_outline(length, width)
    if not box:
        x, y = 0.5 * length, 0.5 * width
        corners = [(end, sign * rng.uniform(0.5, 0.9) * y) for end in (-x, x) for sign in (-1.0, 1.0)]
        for sign in (-1.0, 1.0):
            bulge = rng.uniform([-0.7, 0.9], [0.7, 1.0], (int(rng.integers(0, 3)), 2))
            corners += [(at * x, sign * out * y) for at, out in bulge]
        outline = _hull(np.array(corners))
    ends = outline[:, 0].min(), outline[:, 0].max()
    edges = (outline[outline[:, 0] == end, 1] for end in ends)
    rear, front = ((float(edge.min()), float(edge.max())) for edge in edges)
    return ObjectShape(outline, rear, front, {"box": [length, width]} if box else {"polygon": outline.tolist()})


def _object(
    rng: np.random.Generator, parameters: ProblemParameters, name: str, shape: ObjectShape, front: Span
) -> Sections:
    """Return an object that stands roughly in the middle of the front edge before it."""
    support = rng.choice(parameters.supports)
    mass = _round(rng.uniform(*parameters.mass))
    shorter = min(front[1] - front[0], shape.rear[1] - shape.rear[0])
    middle = 0.5 * (front[0] + front[1] - shape.rear[0] - shape.rear[1])
    offset = _round(middle + rng.uniform(-SHIFT, SHIFT) * shorter)
    stated = {"name": name, "shape": shape.stated, "mass": mass, "offset": offset}
    if support == "feet":  # one near each corner
        loads = np.round(rng.dirichlet(np.full(len(shape.outline), 8.0)), 6)
        loads[0] = round(1.0 - float(loads[1:].sum()), 6)
        spots = np.round(0.85 * shape.outline + 0.15 * shape.outline.mean(axis=0), 4)
        stated["support"] = {"feet": np.column_stack([spots, loads]).tolist()}
    return stated


# --- what surrounds it ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Wall:
    """A wall across the room with a gap.

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


def random_world(rng: np.random.Generator, chain: Chain, parameters: ProblemParameters) -> Sections:
    """Draw start, goal, workspace and obstacles, as a scenario file states them; start and goal are free.

    Raises:
        GeneratorError: When start and goal find no place.
    """
    side = _round(rng.uniform(*parameters.workspace))
    body = np.concatenate([moving.outline for moving in chain.bodies])
    wall = None if parameters.gap is None else _wall(rng, body, side, parameters)
    start, goal, kept = _start_and_goal(rng, body, side, wall, parameters.room)
    walls = [] if wall is None else [{"polygon": piece.tolist()} for piece in wall.sides]
    free = shapely.union_all(kept if wall is None else [*kept, wall.passage]).buffer(CLEARANCE)
    return {
        "start": start.tolist(),
        "goal": {"pose": goal.tolist()},
        "workspace": {"x": [0.0, side], "y": [0.0, side]},
        "obstacles": walls + _clutter(rng, side, free, parameters),
    }


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


def _rectangle(x: Span, y: Span, axis: int) -> FloatArray:
    """Return corners (4, 2), counter-clockwise, with x and y exchanged when the axis is 1."""
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])
    return np.round(corners if axis == 0 else corners[::-1, ::-1], 4)


def _start_and_goal(
    rng: np.random.Generator, body: FloatArray, side: float, wall: Wall | None, room: float
) -> tuple[FloatArray, FloatArray, list[BaseGeometry]]:
    """Draw start and goal, far enough from each other and on different sides of the wall, and what they keep free."""
    inside = shapely.box(0.0, 0.0, side, side).buffer(-CLEARANCE)
    pieces = [] if wall is None else [shapely.Polygon(piece) for piece in wall.sides]
    walls = shapely.MultiPolygon(pieces).buffer(CLEARANCE)
    for _ in range(POSE_DRAWS):
        start, goal = (np.round([*rng.uniform(0.0, side, 2), rng.uniform(-np.pi, np.pi)], 4) for _ in "sg")
        if np.linalg.norm(goal[:2] - start[:2]) < START_TO_GOAL * side:
            continue
        if wall is not None and (start[wall.axis] - wall.at) * (goal[wall.axis] - wall.at) > 0.0:
            continue
        kept = [_swept(body, start, room), _swept(body, goal, -room)]
        if all(area.within(inside) and not area.intersects(walls) for area in kept):
            return start, goal, kept
    raise GeneratorError(
        f"start and goal find no place in a workspace of {side:g} m; allowed: a larger workspace, "
        "fewer or smaller objects, less room"
    )


def _swept(body: FloatArray, pose: FloatArray, length: float) -> BaseGeometry:
    """Return what a body covers on a straight path of some length ahead of a pose; behind it where negative."""
    ends = pose, compose(pose, np.array([length, 0.0, 0.0]))
    corners = np.concatenate([transform_points(end, body) for end in ends])
    return shapely.MultiPoint(corners).convex_hull


def _clutter(
    rng: np.random.Generator, side: float, free: BaseGeometry, parameters: ProblemParameters
) -> list[Sections]:
    """Draw obstacles that leave `free` free, until there are enough, they cover enough, or one finds no place."""
    count = int(rng.integers(parameters.obstacles[0], parameters.obstacles[1] + 1))
    most = np.inf if parameters.density is None else side * side * rng.uniform(*parameters.density)
    placed: list[Sections] = []
    covered: BaseGeometry = shapely.MultiPolygon()
    shapely.prepare(free)
    while len(placed) < count and covered.area < most:
        for _ in range(OBSTACLE_DRAWS):
            stated, area = _obstacle(rng, side, parameters)
            if not area.intersects(free):
                break
        else:
            break
        placed.append(stated)
        covered = covered.union(area)
    return placed


def _obstacle(rng: np.random.Generator, side: float, parameters: ProblemParameters) -> tuple[Sections, BaseGeometry]:
    kind = str(rng.choice(parameters.obstacle_shapes))
    center = np.round(rng.uniform(0.0, side, 2), 4)
    length, width = (_round(size) for size in rng.uniform(*parameters.obstacle_size, 2))
    turn = _round(rng.uniform(-np.pi, np.pi))
    if kind == "circle":
        radius = _round(0.5 * length)
        return {"circle": radius, "center": center.tolist()}, shapely.Point(center).buffer(radius)
    if kind == "box":
        area = shapely.Polygon(rotate(turn, box_outline(length, width)) + center)
        return {"box": [length, width], "pose": [*center.tolist(), turn]}, area
    corners = np.round(rotate(turn, random_polygon(rng, length, width)) + center, 4)
    return {"polygon": corners.tolist()}, shapely.Polygon(corners)


def random_polygon(rng: np.random.Generator, length: float, width: float) -> FloatArray:
    """Return a convex polygon (v, 2) about the origin that fits into a box, corners on an ellipse."""
    count = int(rng.integers(3, 8))
    angle = 2.0 * np.pi * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    return _hull(0.5 * np.stack([length * np.cos(angle), width * np.sin(angle)], axis=1))


def _hull(corners: FloatArray) -> FloatArray:
    """Return the convex hull (v, 2), rounded, counter-clockwise."""
    hull = shapely.MultiPoint(np.round(corners, 4)).convex_hull
    return np.round(shapely.get_coordinates(shapely.orient_polygons(hull))[:-1], 4)


def _robot_beside(rng: np.random.Generator, stated: Sections, chain: Chain, away: Span) -> Sections:
    """Return the section `robot` of a problem: a body behind the plate, and a free place that far from the start.

    Raises:
        GeneratorError: When no place is free.
    """
    thick, width = np.ptp(chain.pusher.outline, axis=0)
    length = _round(ROBOT_LENGTH * width)
    footprint = {"box": [length, _round(width)], "pose": [-_round(0.5 * length + thick), 0.0, 0.0]}
    for _ in range(ROBOT_DRAWS):
        bearing, heading = rng.uniform(-np.pi, np.pi, 2)
        place = stated["start"][:2] + rng.uniform(*away) * np.array([np.cos(bearing), np.sin(bearing)])
        robot = {"footprint": footprint, "start": np.round([*place, heading], 4).tolist()}
        try:
            scenario_from_text(scenario_yaml({**stated, "robot": robot}))
        except ScenarioError:
            continue
        return robot
    raise GeneratorError(
        f"none of {ROBOT_DRAWS} places for the robot is free; allowed: a larger workspace or robot distance"
    )
