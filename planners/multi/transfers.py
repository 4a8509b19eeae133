"""Transfers: one of several bodies is pushed to a goal or out of the way while the others stay."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.mechanics.chain import area_at
from pushplan.planners.multi.graph import PushSequence
from pushplan.planners.multi.multi_push import MultiPushSearch, backed_off, free_goals
from pushplan.planners.multi.room import NOWHERE, TOLERANCE_USED, PushRoom, Query
from pushplan.planners.multi.search import Limits, search
from pushplan.planners.outcome import Segments
from pushplan.plans import segment as plans
from pushplan.scenario.goals import Goal, Poses
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.util.arrays import FloatArray, frozen

SAME = 1e-6
"""Hausdorff distance below which a body covers the same area at two goals, m."""

LEAD = 0.5
"""Length of the straight way, beyond the retreat, that the robot needs free behind a goal, m. With less than it needs
to turn between the goals, the inner ones of a grid would count as open to the last."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A body that can be pushed on its own.

    Attributes:
        name: Name of the object.
        search: Search for several pushes of it, in the room without the other bodies.
        goals: Alternative goals; empty if it moves only when it obstructs.
    """

    name: str
    search: MultiPushSearch
    goals: tuple[Goal, ...]
    _placed: dict[bytes, tuple[PolygonObstacle, ...]] = field(default_factory=dict)

    def is_at_goal(self, pose: FloatArray) -> bool:
        """Return whether the pose (3,) of its frame is at one of its goals."""
        return any(goal.is_reached(pose) for goal in self.goals)

    def obstacles(self, pose: FloatArray) -> tuple[PolygonObstacle, ...]:
        """Return its objects as obstacles, with its frame at a pose (3,); cached by pose."""
        key = pose.tobytes()
        if key not in self._placed:
            objects = self.search.scenario.chain.objects
            outlines = [se2.transform_points(pose, obj.outline_chain) for obj in objects]
            self._placed[key] = tuple(PolygonObstacle(outline) for outline in outlines)
        return self._placed[key]

    def area(self, pose: FloatArray) -> BaseGeometry:
        """Return the area that it covers with its frame at a pose (3,)."""
        return shapely.multipolygons([obstacle.core for obstacle in self.obstacles(pose)])

    def pushed_straight(self, pose: FloatArray, distances: Iterable[float]) -> list[FloatArray]:
        """Return the poses that straight pushes reach from a pose (3,), for each distance (m) in turn."""
        contacts = [contact.packed for contact in self.search.room(0).contacts]
        ahead = np.unique([np.round(se2.rotate(one.contact[2], one.settling[:2]), 9) for one in contacts], axis=0)
        return [se2.compose(pose, [away * x, away * y, 0.0]) for away in distances for x, y in ahead]

    @cached_property
    def goal_areas(self) -> list[BaseGeometry]:
        """Areas that it covers at each of its goals."""
        return [self.area(goal.pose_chain) for goal in self.goals]

    @cached_property
    def only_place(self) -> list[FloatArray]:
        """One of its goals (3,) if it covers the same area at all of them, else empty."""
        away = shapely.hausdorff_distance(self.goal_areas[0], np.array(self.goal_areas))
        return [self.goals[0].pose_chain] if (away < SAME).all() else []

    @cached_property
    def beside(self) -> tuple[FloatArray, float]:
        """Usable tolerance (2,) (m, rad) at its goals, and the distance of other goals that it needs, m."""
        used = TOLERANCE_USED * np.min([(g.position_tolerance, g.angle_tolerance) for g in self.goals], axis=0)
        size = max(float(np.hypot(*corner)) for corner in self.search.scenario.chain.objects[0].outline)
        return used, self.search.scenario.clearance + 2.0 * float(used[0] + used[1] * size)


@dataclass(frozen=True, eq=False)
class Situation:
    """Poses of the robot and all bodies, and the bodies still to deliver.

    Attributes:
        plate: (3,) pose of the plate frame in the world.
        poses: (n, 3) poses of the chain frames of the pieces.
        left: Indices of the pieces still to be brought to a goal.
    """

    plate: FloatArray
    poses: FloatArray
    left: frozenset[int]

    def __post_init__(self) -> None:
        object.__setattr__(self, "plate", frozen(self.plate, (3,), "plate"))
        object.__setattr__(self, "poses", frozen(self.poses, (None, 3), "poses of the pieces"))


@dataclass(frozen=True, eq=False)
class Transfer:
    """A plan that pushes one body to a goal or out of the way while the others stay.

    Attributes:
        piece: Index of the piece.
        search: Search for it among the others, with this transfer's start, goals and robot pose.
        room: Room of the search.
        best: Pushes and transits of the plan.
        lower_bound: Lower bound of the cost, cost to go included, m.
        looked_at: Number of pushes and transits that the search checked.
        delivers: Whether the plan ends at a goal of the piece; else the piece obstructed.
    """

    piece: int
    search: MultiPushSearch
    room: PushRoom
    best: PushSequence
    lower_bound: float
    looked_at: int
    delivers: bool

    @property
    def cost(self) -> float:
        """Cost of the plan, m."""
        return self.best.cost - self.best.cost_to_go

    @property
    def with_cost_to_go(self) -> float:
        """Cost of the plan plus the estimated cost to go, m."""
        return self.best.cost

    @property
    def beyond_bound(self) -> float:
        """Excess of the cost over the lower bound, cost to go included, m."""
        return self.with_cost_to_go - self.lower_bound

    @cached_property
    def end(self) -> FloatArray:
        """(3,) pose of the piece afterwards."""
        return self.best.steps[-1].after

    @property
    def plate(self) -> FloatArray:
        """(3,) pose of the plate frame after the last retreat."""
        mode = self.room.contacts[self.best.steps[-1].contact].packed
        robot = mode.robot_at(self.end, mode.retreat)
        return se2.compose(robot, self.search.scenario.chain.pusher.plate_pose)

    def segments(self, before: plans.Poses) -> Segments:
        """Return the segments of the plan, given the poses of all bodies before it."""
        return self.search.segments(self.room, self.best, before)


def situation_after(pieces: tuple[Piece, ...], one: Transfer, before: Situation) -> Situation:
    """Return the situation after a transfer."""
    poses = np.array(before.poses)
    poses[one.piece] = one.end
    left = before.left - {one.piece}
    if not one.delivers and pieces[one.piece].goals:
        left |= {one.piece}
    return Situation(one.plate, poses, left)


def find_transfer(
    pieces: tuple[Piece, ...],
    now: Situation,
    piece: int,
    limits: Limits,
    seed: int,
    goals: tuple[Goal, ...],
    delivers: bool = True,
    cost_to_go: Callable[[FloatArray], FloatArray] | None = None,
    level: int = 0,
) -> Transfer | None:
    """Return a transfer of one piece to one of several goals or places; None if none was found.

    Args:
        pieces: All pieces.
        now: Current situation.
        piece: Index of the piece.
        limits: Stopping conditions.
        seed: Seed of the random numbers.
        goals: Alternative goals.
        delivers: Whether these are goals of the piece.
        cost_to_go: Returns the cost (k,) after the transfer for plate poses (k, 3), m; None for zero.
        level: Level of the margins; each is lower than the one before.
    """
    scenario = posed(pieces, now, piece, goals)
    try:
        free = free_goals(scenario)
    except PlanningError:
        return None
    searching = pieces[piece].search
    searching.room(level)  # cached in the piece, because it does not depend on the others
    searching = searching.with_obstacles(scenario)
    room = searching.room(level)
    within = _within(pieces, now, piece) if delivers else np.zeros(2)
    after = (
        None if cost_to_go is None else cost_to_go(plates_after(room, free)).reshape(len(room.contacts), len(free))
    )
    query = Query(backed_off(room, scenario), np.array(scenario.start), free, within, after)
    found = search(room, query, limits, seed)
    if found.best is None:
        return None
    return Transfer(piece, searching, room, found.best, found.lower_bound, found.looked_at, delivers)


def posed(pieces: tuple[Piece, ...], now: Situation, piece: int, goals: tuple[Goal, ...]) -> Scenario:
    """Return the problem of a piece, with the others as obstacles at their current poses."""
    own = pieces[piece].search.scenario
    others = (one for k, other in enumerate(pieces) if k != piece for one in other.obstacles(now.poses[k]))
    load = replace(own.load, start=now.poses[piece])
    task = replace(own.transport, loads=(load,), goals=(Poses(load.name, goals),), robot_start=now.plate)
    return replace(own, task=task, obstacles=(*own.obstacles, *others))


def plates_after(room: PushRoom, goals: FloatArray) -> FloatArray:
    """Return the plate poses (m g, 3) after pushes by each of m contacts to each of some goals (g, 3)."""
    modes, plate = [contact.packed for contact in room.contacts], room.scenario.chain.pusher.plate_pose
    return se2.compose(np.array([mode.robot_at(goal, mode.retreat) for mode in modes for goal in goals]), plate)


def depths(pieces: tuple[Piece, ...]) -> list[int]:
    """Return for each piece the number of layers of other delivered pieces that block the robot's access.

    A grid of goals is filled from its middle. Depth 0 means that a goal can be filled last.
    """
    areas = [piece.goal_areas[0] if piece.goals else None for piece in pieces]
    in_the_way: list[list[set[int]]] = []
    for k, piece in enumerate(pieces):
        scenario, modes = piece.search.scenario, [contact.packed for contact in piece.search.room(0).contacts]
        robots = [
            np.concatenate([shapely.get_coordinates(area_at(scenario.chain.carried, mode.robot_at(NOWHERE, back)))
                            for back in (0.0, mode.retreat + LEAD)])
            for mode in modes
        ]  # fmt: skip
        swept = [
            shapely.multipoints(se2.transform_points(goal.pose_chain, robot))
            for goal in piece.goals
            for robot in robots
        ]
        hulls = shapely.convex_hull(np.array(swept))
        close = shapely.dwithin(hulls[:, None], np.array(areas), scenario.clearance)
        in_the_way.append([set(np.flatnonzero(row).tolist()) - {k} for row in close])
    found, left, depth = [0] * len(pieces), {k for k, area in enumerate(areas) if area is not None}, 0
    while left:
        free = {k for k in left if any(not others & left for others in in_the_way[k])} or left
        for k in free:
            found[k] = depth
        left, depth = left - free, depth + 1
    return found


def nudged_goals(pieces: tuple[Piece, ...], now: Situation, piece: int) -> tuple[Goal, ...]:
    """Return poses beside a piece's goals, within tolerance, if other pieces or their goals are close to these.

    A plate wider than the object can touch the neighbours of an exact goal, but not a little short of it.
    """
    own = pieces[piece]
    used, room = own.beside
    others = [other.area(now.poses[k]) for k, other in enumerate(pieces) if k != piece]
    others += [area for k in sorted(now.left - {piece}) for area in pieces[k].goal_areas]
    if not others or (shapely.distance(np.array(own.goal_areas)[:, None], others) > room).all():
        return ()
    steps = used[0] * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    poses = [pose for goal in own.goals for pose in se2.compose(goal.pose_chain, steps)]
    away = shapely.distance(np.array([own.area(pose) for pose in poses])[:, None], others)
    free = np.flatnonzero(np.min(away, axis=1) >= own.search.scenario.clearance)
    return tuple(Goal.of_chain(poses[k], own.goals[0].tolerance) for k in free)


def _within(pieces: tuple[Piece, ...], now: Situation, piece: int) -> FloatArray:
    """Return the distance (m, rad) from its goals at which a piece can end; 0 if goals of others are close."""
    own = pieces[piece]
    used, room = own.beside
    others = [area for k in sorted(now.left - {piece}) for area in pieces[k].goal_areas]
    away = shapely.distance(np.array(own.goal_areas)[:, None], others)
    return np.zeros(2) if (away <= room).any() else used
