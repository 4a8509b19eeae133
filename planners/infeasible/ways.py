"""Where the centre of a disc inside the chain can be, its ways around the obstacles, and cuts that they all cross.

Cuts are straight, across the room. The start is on one side of a cut and the goal on the other; and each lies, as far
as ways that are short enough can cross it, on the start's side of the next. So whoever comes to a cut for the first
time has yet to cross all later ones. A known path tells where cuts are worth most: where it comes near to what stands
in the room, along the shortest line to that. What is proven with cuts does not rest on it.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pushplan.geometry import se2
from pushplan.geometry.convex import convex_pieces
from pushplan.geometry.polygon import outward_normals
from pushplan.mechanics.chain import SEAM, Body, as_one
from pushplan.plans.path import PushPath
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

ARC_SEGMENTS = 8
"""Segments per quarter of a round corner, all inside it: what is blocked is never overestimated."""


_AROUND = 10.0
"""Room left around everything where there is no workspace, m: way enough around it all."""


class Disc(NamedTuple):
    """A disc inside the chain: centre (2,) in the chain frame, and radius, m."""

    center: FloatArray
    radius: float

    def at(self, pose: FloatArray) -> shapely.Point:
        """Return the centre with the chain frame at a pose (3,)."""
        return shapely.Point(se2.transform_points(pose, self.center))


def largest_disc(bodies: Iterable[Body]) -> Disc:
    """Return the largest disc inside bodies of a chain."""
    shape = as_one(bodies)
    return _disc_at(shape, shapely.get_coordinates(shapely.maximum_inscribed_circle([shape]))[0])


def disc_at(bodies: Iterable[Body], center: FloatArray) -> Disc:
    """Return the largest disc inside bodies around a point (2,) of the chain frame; its radius is 0 outside."""
    return _disc_at(as_one(bodies), center)


def _disc_at(shape: BaseGeometry, center: FloatArray) -> Disc:
    point = shapely.Point(center)
    radius = float(shape.boundary.distance(point)) if shape.contains(point) else 0.0
    return Disc(np.asarray(center, dtype=np.float64), max(0.0, radius - 10.0 * SEAM))


def blocked(obstacles: Sequence[Obstacle], radius: float) -> BaseGeometry:
    """Return where the centre of a disc cannot be for the obstacles."""
    return shapely.disjoint_subset_union_all(
        grown(obstacles, radius)
    )  # a quarter of the time of `union_all` where most are apart


def grown(obstacles: Sequence[Obstacle], radius: float) -> NDArray[np.object_]:
    """Return where the centre of a disc cannot be for each of the obstacles."""
    radii = np.array([o.radius for o in obstacles]) + radius
    return np.asarray(shapely.buffer([o.core for o in obstacles], radii, quad_segs=ARC_SEGMENTS))


def reached(free: BaseGeometry, place: BaseGeometry, within: float) -> BaseGeometry:
    """Return the parts of a region that a place is in, or no farther away from than `within` (m)."""
    parts = shapely.get_parts(free)
    return shapely.union_all(parts[shapely.distance(parts, place) <= within])


def between(grown_obstacles: NDArray[np.object_], one: BaseGeometry, other: BaseGeometry) -> tuple[int, ...]:
    """Return the indices of the obstacles, grown, that bound two regions."""
    near = [shapely.distance(grown_obstacles, side) <= TOUCH for side in (one, other)]
    return tuple(np.flatnonzero(near[0] & near[1]).tolist())


def near_to(obstacles: Sequence[Obstacle], areas: Sequence[BaseGeometry], within: float) -> tuple[int, ...]:
    """Return the indices of the obstacles that are within a distance (m) of any of the areas."""
    taken = shapely.union_all(areas)
    return tuple(k for k, shape in enumerate(grown(obstacles, 0.0)) if shape.distance(taken) <= within)


def room(scenario: Scenario, radius: float) -> BaseGeometry:
    """Return where the centre of a disc can be: inside the workspace and away from the obstacles.

    Without a workspace it is cut off where nothing is in the way any more.
    """
    return shapely.difference(_floor(scenario, radius), blocked(scenario.obstacles, radius))


def _floor(scenario: Scenario, radius: float) -> BaseGeometry:
    area = scenario.workspace
    if area is not None:
        corners = area.xmin + radius, area.ymin + radius, area.xmax - radius, area.ymax - radius
        empty = corners[0] >= corners[2] or corners[1] >= corners[3]
        return shapely.Polygon() if empty else shapely.box(*corners)
    points = [scenario.start[:2], scenario.goal.pose_chain[:2]]
    points += [corner for obstacle in scenario.obstacles for corner in obstacle.box]
    return shapely.MultiPoint(np.array(points)).envelope.buffer(_AROUND + 4.0 * radius, join_style="mitre")


TOUCH = 1e-7
"""Ways may cut into what is blocked by so much (m): they run along its edges."""

STRAIGHT = 1e-12
"""What edges are on two sides of a line counts as rounding, m^4."""

MOST_SIGHTS = 10_000
"""Lines of sight looked at, at most; the bound found until then is returned."""


def way_around(scenario: Scenario, disc: Disc, most: float) -> float:
    """Length of the shortest way of a disc's centre from start to goal, or a lower bound of it, m (A*)."""
    start, goal = disc.at(scenario.start), disc.at(scenario.goal.pose_chain)
    length = float(_ways(scenario, disc, shapely.get_coordinates([start, goal]), most)[1])
    return length if math.isfinite(length) else float(start.distance(goal))


def ways_over(scenario: Scenario, disc: Disc, points: FloatArray, most: float) -> FloatArray:
    """Lengths (k,) of the shortest ways of a disc's centre from start to goal over points (k, 2), or lower bounds, m.

    Those longer than `most` may be infinite.
    """
    ends = shapely.get_coordinates([disc.at(scenario.start), disc.at(scenario.goal.pose_chain)])
    from_start, from_goal = (
        _ways(scenario, disc, np.concatenate([order, points]), most) for order in (ends, ends[::-1])
    )
    return np.asarray(from_start[2:] + from_goal[2:])


def _ways(scenario: Scenario, disc: Disc, points: FloatArray, most: float) -> FloatArray:
    """Lengths (k,) of the shortest ways from the first of points (k, 2), of which the second is the other end."""
    shape = blocked(scenario.obstacles, disc.radius + scenario.clearance - CLEARANCE_ROOM)
    corners, edges = _corners(shape, points[:2], most)
    inside = shape.buffer(-TOUCH, join_style="mitre")
    shapely.prepare(inside)
    edges = np.concatenate([np.zeros((len(points), 2, 2)), edges])
    return _shortest(np.concatenate([points, corners]), edges, len(points), inside, most)[: len(points)]


def _shortest(points: FloatArray, edges: FloatArray, ends: int, inside: BaseGeometry, most: float) -> FloatArray:
    """Lengths (k,) of the shortest ways from the first of points (k, 2) along lines that miss a shape, or less.

    They end in one of the first points, `ends` of them, or bend: then both edges (k, 2, 2) that leave a point are on
    one side of them. From where it is farther than `most` to the second point, no way is looked for.
    """
    ahead = np.linalg.norm(points - points[1], axis=1)
    so_far = np.where(np.arange(len(points)) == 0, 0.0, np.inf)
    queue, done, sights = [(float(ahead[0]), 0)], np.zeros(len(points), dtype=bool), 0
    while queue:
        through, here = heapq.heappop(queue)
        if through > most or sights > MOST_SIGHTS or (here == 1 and ends == 2):
            return np.asarray(np.minimum(so_far, np.maximum(through - ahead, 0.0)))
        if done[here] or 0 < here < ends:
            continue
        done[here] = True
        away = points - points[here]
        steps = so_far[here] + np.hypot(*away.T)
        sides = away[:, None, 0] * edges[..., 1] - away[:, None, 1] * edges[..., 0]
        better = np.flatnonzero((steps < so_far) & (sides[:, 0] * sides[:, 1] > -STRAIGHT))
        sights += len(better)
        lines = np.stack([np.broadcast_to(points[here], (len(better), 2)), points[better]], axis=1)
        for there in better[~shapely.intersects(inside, shapely.linestrings(lines))]:
            so_far[there] = steps[there]
            heapq.heappush(queue, (float(steps[there] + ahead[there]), int(there)))
    return so_far


def _corners(shape: BaseGeometry, ends: FloatArray, most: float) -> tuple[FloatArray, FloatArray]:
    """Return the corners (k, 2) of a shape that ways of at most `most` between ends (2, 2) can pass.

    Also the edges (k, 2, 2) that go from each to its neighbours.
    """
    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(shape)), return_index=True)
    begins = np.flatnonzero(np.diff(ring, prepend=-1))
    forth = np.roll(corners, -1, axis=0) - corners
    back = np.roll(corners, 1, axis=0) - corners
    back[begins] = back[np.roll(begins, -1) - 1]  # a ring ends with its first corner
    through = np.linalg.norm(corners - ends[0], axis=1) + np.linalg.norm(corners - ends[1], axis=1)
    kept = (np.diff(ring, append=-1) == 0) & (through <= most + TOUCH)
    return corners[kept], np.stack([back, forth], axis=1)[kept]


CUTS, PLACES, APART = 8, 64, 3
"""Cuts, at most; places on the known path for them, and how many of these they are apart."""

PIECES = 12
"""Of every section of a cut: each is left out where ways over it are too long."""

FAR = 1e6
"""Beyond all that is looked at, m."""

SAME = 1e-9
"""Lengths and costs (m), headings (rad), directions and slopes that differ by less are the same."""


class Cut(NamedTuple):
    """A straight line n . x = level across the room.

    Attributes:
        place: Of the known path through which it goes.
        normal: (2,) n, toward the goal.
        level: m.
        sections: (m, 2) offsets along it between which the centre of a disc can be, m.
    """

    place: int
    normal: FloatArray
    level: float
    sections: FloatArray

    @property
    def along(self) -> FloatArray:
        """Direction (2,) of offsets."""
        return np.array([-self.normal[1], self.normal[0]])

    def at(self, offsets: FloatArray) -> FloatArray:
        """Return points (k, 2) of offsets (k,)."""
        return np.asarray(self.level * self.normal + offsets[:, None] * self.along)

    def before(self, other: Cut) -> bool:
        """Tell whether it lies on the start's side of another one."""
        return bool((self.at(self.sections.ravel()) @ other.normal <= other.level).all())


def find_cuts(scenario: Scenario, path: PushPath, most: float) -> list[Cut]:
    """Return cuts that every path crosses whose chain frame's origin has a way of at most `most` (m)."""
    disc = disc_at(scenario.chain.bodies, np.zeros(2))
    start, goal = scenario.start[:2], scenario.goal.pose_chain[:2]
    region = _region(scenario, disc, most)
    poses = path.poses_at(np.linspace(0.0, path.cost, PLACES + 2)[1:-1])
    nearest_first, contact_normals = _nearest_first(poses, scenario)
    found: list[Cut] = []
    for place in nearest_first:
        before = [cut for cut in found if cut.place < place][-1:]
        after = [cut for cut in found if cut.place > place][:1]
        if len(found) == CUTS or any(abs(cut.place - place) < APART for cut in before + after):
            continue
        # Where it would cross a neighbour, a line between both may do, or a parallel one.
        others = [cut.normal for cut in before + after]
        for direction in (contact_normals[place], sum(others, start=np.zeros(2)), *others):
            normal = direction / max(float(np.linalg.norm(direction)), SAME)
            level = float(poses[place, :2] @ normal)
            if not start @ normal < level < goal @ normal:
                continue
            cut = Cut(place, normal, level, _sections(region, Cut(place, normal, level, np.zeros((0, 2)))))
            if all(other.before(cut) for other in before) and all(cut.before(other) for other in after):
                found = sorted([*found, cut], key=lambda cut: cut.place)
                break
    return _shortened(scenario, disc, found, most) if found else []


def _nearest_first(poses: FloatArray, scenario: Scenario) -> tuple[list[int], FloatArray]:
    """Return the order of poses (k, 3), nearest to what stands there first, and normals (k, 2) of cuts."""
    ahead = np.gradient(poses[:, :2], axis=0)
    things = standing(scenario)
    if not things:
        return [], ahead
    shape = as_one(scenario.chain.bodies)
    shapes = np.array([shapely.transform(shape, partial(se2.transform_points, pose)) for pose in poses])
    lines = shapely.shortest_line(shapes, np.array(things)[shapely.STRtree(things).nearest(shapes)])
    x, y = np.diff(shapely.get_coordinates(lines).reshape(-1, 2, 2), axis=1)[:, 0].T
    normals = np.column_stack([y, -x])
    normals *= np.where(np.sum(normals * ahead, axis=1) < 0.0, -1.0, 1.0)[:, None]
    return np.argsort(np.hypot(x, y), kind="stable").tolist(), normals


def _region(scenario: Scenario, disc: Disc, most: float) -> BaseGeometry:
    """Return where a disc around the chain frame's origin can be on ways of at most `most` (m) past obstacles."""
    start, goal = scenario.start[:2], scenario.goal.pose_chain[:2]
    x, y = goal - start
    circle = shapely.Point(0.0, 0.0).buffer(0.5 / math.cos(math.pi / 64.0), quad_segs=16)  # the circle is within it
    axes = np.array([most, math.sqrt(max(most**2 - x**2 - y**2, 0.0))])
    ellipse: BaseGeometry = shapely.transform(
        circle, lambda c: 0.5 * (start + goal) + se2.rotate(math.atan2(y, x), c * axes)
    )
    if scenario.workspace is not None:
        area = scenario.workspace
        ellipse = shapely.intersection(ellipse, shapely.box(area.xmin, area.ymin, area.xmax, area.ymax))
    return shapely.difference(ellipse, blocked(scenario.obstacles, disc.radius + scenario.clearance - CLEARANCE_ROOM))


def _sections(region: BaseGeometry, cut: Cut) -> FloatArray:
    """Return the sections (m, 2) of a cut with a region."""
    parts = shapely.get_parts(shapely.intersection(region, shapely.LineString(cut.at(np.array([-FAR, FAR])))))
    offsets = [shapely.get_coordinates(part) @ cut.along for part in parts]
    return np.array([[y.min() - TOUCH, y.max() + TOUCH] for y in offsets]).reshape(-1, 2)


def _shortened(scenario: Scenario, disc: Disc, cuts: list[Cut], most: float) -> list[Cut]:
    """Return cuts without the pieces of their sections over which every way of a disc is too long."""
    ends = [y[:, :1] + np.diff(y) * np.linspace(0.0, 1.0, PIECES + 1) for y in (cut.sections for cut in cuts)]
    pieces = [np.column_stack([y[:, :-1].ravel(), y[:, 1:].ravel()]) for y in ends]
    middles = [cut.at(y.mean(axis=1)) for cut, y in zip(cuts, pieces, strict=True)]
    over = ways_over(scenario, disc, np.concatenate([np.zeros((0, 2)), *middles]), most)
    ways = np.split(over, np.cumsum([len(y) for y in pieces])[:-1])
    return [
        cut._replace(sections=y[way <= most + y[:, 1] - y[:, 0]])
        for cut, y, way in zip(cuts, pieces, ways, strict=True)
    ]


def standing(scenario: Scenario) -> list[BaseGeometry]:
    """Return convex polygons that the chain keeps off, walls among them, in the world."""
    clearance, area = scenario.clearance - CLEARANCE_ROOM, scenario.workspace
    corners = [shapely.get_coordinates(obstacle.core)[:-1] for obstacle in scenario.obstacles if not obstacle.radius]
    pieces = [shapely.Polygon(piece) for piece in convex_pieces(corners)]
    if area is not None:
        pieces += [
            shapely.box(-FAR, -FAR, area.xmin, FAR),
            shapely.box(area.xmax, -FAR, FAR, FAR),
            shapely.box(-FAR, -FAR, FAR, area.ymin),
            shapely.box(-FAR, area.ymax, FAR, FAR),
        ]
    kept_off = [*shapely.buffer(pieces, clearance, quad_segs=ARC_SEGMENTS)]
    kept_off += [*grown([obstacle for obstacle in scenario.obstacles if obstacle.radius], clearance)]
    return [polygon for polygon in shapely.orient_polygons(kept_off) if not polygon.is_empty]


def free_sections(
    cut: Cut, bodies: list[FloatArray], reach: float, slack: float, things: list[BaseGeometry]
) -> FloatArray:
    """Return (b, g, 2) offsets on a cut between which convex bodies are free; `NONE` where they are not.

    Args:
        cut: The cut.
        bodies: Their corners (b, v, 2), counter-clockwise, the chain frame's origin at 0, for b headings.
        reach: From the origin to the farthest corner, m.
        slack: By so much they may cut into what stands there, m.
        things: Convex polygons, counter-clockwise.
    """
    count = len(bodies[0])
    outside = np.column_stack([[-FAR, *cut.sections[:, 1]], [*cut.sections[:, 0], FAR]])
    taken = [np.broadcast_to(outside, (count, *outside.shape))]
    across = shapely.multilinestrings([cut.at(y) for y in cut.sections])
    near = [shapely.get_coordinates(thing)[:-1] for thing in things if thing.distance(across) <= reach]
    for corners in bodies:
        normals = outward_normals(corners)
        for thing in near:
            # The origin is kept out of the thing less the body: a convex polygon with the edges of both.
            own = outward_normals(thing)
            of_thing = np.sum(thing * own, axis=1) - (corners @ own.T).min(axis=1)
            of_body = np.sum(corners * normals, axis=2) - (normals @ thing.T).min(axis=2)
            sides = np.concatenate([np.broadcast_to(own, (count, *own.shape)), -normals], axis=1)
            slope = sides @ cut.along
            rest = np.concatenate([of_thing, of_body], axis=1) - slack - cut.level * (sides @ cut.normal)
            flat = np.abs(slope) < SAME
            y = rest / np.where(flat, 1.0, slope)
            low = np.max(y, axis=1, where=~flat & (slope < 0.0), initial=-FAR)
            high = np.min(y, axis=1, where=~flat & (slope > 0.0), initial=FAR)
            missed = (flat & (rest < 0.0)).any(axis=1) | (low >= high)
            taken.append(np.where(missed[:, None], FAR, np.column_stack([low, high]))[:, None])
    low, high = np.moveaxis(np.concatenate(taken, axis=1), -1, 0)
    order = np.argsort(low, axis=1)
    begin = np.maximum.accumulate(np.take_along_axis(high, order, axis=1), axis=1)[:, :-1]
    return or_none(np.stack([begin, np.take_along_axis(low, order, axis=1)[:, 1:]], axis=-1))


NONE = (math.inf, -math.inf)
"""Ends of a section that is empty."""


def or_none(sections: FloatArray) -> FloatArray:
    """Return sections (..., 2), with `NONE` for those that are empty."""
    return np.where((sections[..., 0] < sections[..., 1])[..., None], sections, NONE)
