"""Random push problems as scenario files; the same seed gives the same text.

Each chain can be pushed straight ahead and turned to both sides, in a room with walls and clutter. Start and goal are
collision-free by construction; a path between them need not exist.
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
"""Largest number of random chains until one turns tightly enough."""

RADII = 2.0 ** (np.arange(13) / 2.0)
"""Tried turning radii, as multiples of the requested one."""

LEAST_MARGIN = 0.01
"""Smallest margin of the straight push and of the turns."""

SHIFT = 0.2
"""Largest offset between the middles of touching edges, as a share of the shorter edge."""

CLEARANCE = 0.02
"""Distance of obstacles and walls from start and goal, m."""

START_TO_GOAL = 0.4
"""Smallest distance from start to goal, as a share of the workspace's side."""

POSE_DRAWS = 2_000
"""Largest number of tried pairs of start and goal."""

OBSTACLE_DRAWS = 100
"""Largest number of tried poses of an obstacle."""

WALL = (0.05, 0.15)
"""Thickness of a wall, m."""

ROBOT_DRAWS = 50
"""Largest number of tried poses of the robot."""

ROBOT_LENGTH = 1.2
"""Ratio of the length of the robot's body to the width of its plate."""

Span = tuple[float, float]
Sections = dict[str, Any]
"""Sections of a scenario file, or a part of one, as plain data."""


class GeneratorError(PushplanError, ValueError):
    """These parameters allow no random problem."""


# --- a problem --------------------------------------------------------------------------------------------------


def generate(parameters: ProblemParameters, seed: int) -> str:
    """Return the text of a scenario file with a random problem.

    Args:
        parameters: Parameters of the problem.
        seed: Seed of the random numbers, >= 0.

    Raises:
        GeneratorError: If these parameters allow no problem.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    sections, chain, radius = random_chain(rng, parameters)
    factor = max(1.0, radius / parameters.turning_radius)  # scales the room if the turns are wider than requested
    room = {name: tuple(factor * end for end in getattr(parameters, name)) for name in ("workspace", "obstacle_size")}
    world = random_world(rng, chain, parameters.model_copy(update=room))
    stated = {"name": f"random {seed}", **sections, **world}
    if parameters.robot is not None:
        stated["robot"] = _robot_beside(rng, stated, chain, parameters.robot)
    about = f"{len(chain.objects)} objects, {len(world['obstacles'])} obstacles, {chain.pusher.drive.kind}"
    return f"# {about}; seed {seed}\n{scenario_yaml(stated)}"


def scenario_yaml(sections: Mapping[str, object]) -> str:
    """Return the text of a scenario file with sections in the given order."""
    document = {"format": SCENARIO_FORMAT, **sections}
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)


def _round(value: float) -> float:
    """Return a length rounded to 0.1 mm, as in generated files."""
    return round(float(value), 4)


# --- the chain --------------------------------------------------------------------------------------------------


def random_chain(rng: np.random.Generator, parameters: ProblemParameters) -> tuple[Sections, Chain, float]:
    """Draw random chains until one has the requested turning radius.

    If none of `CHAIN_DRAWS` chains has it, the chain with the smallest radius is used: long chains and wheeled drives
    cannot turn tightly. All drawn chains have the same number of objects and the same drive.

    Returns:
        Sections of a scenario file for the chain, the chain, and its turning radius, m.

    Raises:
        GeneratorError: If none of the chains can be pushed straight ahead and turned to both sides.
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
            f"none of {CHAIN_DRAWS} random chains can be pushed straight ahead and turned to the left and right; "
            "use more contact friction, fewer objects or a larger turning_radius"
        )
    return sections, chain, radius


def tightest_turn(chain: Chain, radius: float) -> float:
    """Return the first of `RADII` times `radius` at which turns to both sides are stable, m; else infinity.

    The radius is the distance of the turning centre (x, y) from the chain frame's x axis, and its twist is
    omega (y, -x, 1). With wheels, the centre lies on the axle's line. A chain that cannot be pushed straight ahead
    has no turn here.
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
    """A convex outline with a front and a rear edge across the push.

    Attributes:
        outline: (v, 2) in the object's frame, counter-clockwise, m.
        rear: Lowest and highest y of the rear edge, m.
        front: Lowest and highest y of the front edge, m.
        stated: Shape for the scenario file.
    """

    outline: FloatArray
    rear: Span
    front: Span
    stated: Sections


def _object_shape(rng: np.random.Generator, parameters: ProblemParameters) -> ObjectShape:
    """Draw a random box, or a polygon with up to two more corners on each side."""
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
    """Return a random object near the middle of the front edge that pushes it."""
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


# --- the room ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Wall:
    """A wall across the room with a gap.

    Attributes:
        sides: Corners (4, 2) of the two pieces beside the gap, m.
        axis: 0 for a wall across x, 1 for a wall across y.
        at: Coordinate of its middle on that axis, m.
        passage: Area through the gap that stays free.
    """

    sides: tuple[FloatArray, FloatArray]
    axis: int
    at: float
    passage: BaseGeometry


def random_world(rng: np.random.Generator, chain: Chain, parameters: ProblemParameters) -> Sections:
    """Draw a random workspace with obstacles and collision-free start and goal, as sections of a scenario file.

    Raises:
        GeneratorError: If there is no free start and goal.
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
    """Return corners (4, 2), counter-clockwise, with x and y exchanged for axis 1."""
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])
    return np.round(corners if axis == 0 else corners[::-1, ::-1], 4)


def _start_and_goal(
    rng: np.random.Generator, body: FloatArray, side: float, wall: Wall | None, room: float
) -> tuple[FloatArray, FloatArray, list[BaseGeometry]]:
    """Return a random start and goal, far apart and on different sides of the wall, and the areas to keep free."""
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
        f"found no free start and goal in a workspace of {side:g} m; use a larger workspace, fewer or smaller "
        "objects, or less room"
    )


def _swept(body: FloatArray, pose: FloatArray, length: float) -> BaseGeometry:
    """Return the area that a body sweeps on a straight path ahead of a pose, or behind it for a negative length."""
    ends = pose, compose(pose, np.array([length, 0.0, 0.0]))
    corners = np.concatenate([transform_points(end, body) for end in ends])
    return shapely.MultiPoint(corners).convex_hull


def _clutter(
    rng: np.random.Generator, side: float, free: BaseGeometry, parameters: ProblemParameters
) -> list[Sections]:
    """Draw random obstacles outside `free`, up to the count and density, or until one finds no free pose."""
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
    """Return a random convex polygon (v, 2) around the origin, its corners on an ellipse."""
    count = int(rng.integers(3, 8))
    angle = 2.0 * np.pi * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    return _hull(0.5 * np.stack([length * np.cos(angle), width * np.sin(angle)], axis=1))


def _hull(corners: FloatArray) -> FloatArray:
    """Return the convex hull (v, 2), rounded, counter-clockwise."""
    hull = shapely.MultiPoint(np.round(corners, 4)).convex_hull
    return np.round(shapely.get_coordinates(shapely.orient_polygons(hull))[:-1], 4)


def _robot_beside(rng: np.random.Generator, stated: Sections, chain: Chain, away: Span) -> Sections:
    """Return the section `robot` of a problem: a body behind the plate, and a free pose at a distance from the start.

    Raises:
        GeneratorError: If no tried pose is free.
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
        f"none of {ROBOT_DRAWS} poses of the robot is free; use a larger workspace or a larger robot distance"
    )
