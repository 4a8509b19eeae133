"""One body of several is brought somewhere while the others stand."""

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
"""Goals at which a body covers the same, but for so much, are one place, m."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A body that can be pushed on its own.

    Attributes:
        name: Of the object.
        search: For several pushes of it, in the room without the other bodies.
        goals: Any of which will do; none where it is moved only when it is in the way.
    """

    name: str
    search: MultiPushSearch
    goals: tuple[Goal, ...]
    _placed: dict[bytes, tuple[PolygonObstacle, ...]] = field(default_factory=dict)

    def is_at_goal(self, pose: FloatArray) -> bool:
        """Tell whether its frame (3,) is at one of its goals."""
        return any(goal.is_reached(pose) for goal in self.goals)

    def obstacles(self, pose: FloatArray) -> tuple[PolygonObstacle, ...]:
        """Return its objects as what stands in the room, its frame being at a pose (3,); made once for each pose."""
        key = pose.tobytes()
        if key not in self._placed:
            objects = self.search.scenario.chain.objects
            outlines = [se2.transform_points(pose, obj.outline_chain) for obj in objects]
            self._placed[key] = tuple(PolygonObstacle(outline) for outline in outlines)
        return self._placed[key]

    def area(self, pose: FloatArray) -> BaseGeometry:
        """Return what it covers, its frame being at a pose (3,)."""
        return shapely.multipolygons([obstacle.core for obstacle in self.obstacles(pose)])

    def pushed_straight(self, pose: FloatArray, distances: Iterable[float]) -> list[FloatArray]:
        """Return where straight pushes by its contacts lead from a pose (3,), by one distance (m) after the other."""
        contacts = [contact.packed for contact in self.search.room(0).contacts]
        ahead = np.unique([np.round(se2.rotate(one.contact[2], one.settling[:2]), 9) for one in contacts], axis=0)
        return [se2.compose(pose, [away * x, away * y, 0.0]) for away in distances for x, y in ahead]

    @cached_property
    def goal_areas(self) -> list[BaseGeometry]:
        """What it covers at each of its goals."""
        return [self.area(goal.pose_chain) for goal in self.goals]

    @cached_property
    def only_place(self) -> list[FloatArray]:
        """One of its goals (3,) where it covers the same at all of them, else none."""
        away = shapely.hausdorff_distance(self.goal_areas[0], np.array(self.goal_areas))
        return [self.goals[0].pose_chain] if (away < SAME).all() else []

    @cached_property
    def beside(self) -> tuple[FloatArray, float]:
        """How far (m, rad) it may end beside its goals, (2,), and what other goals keep from these then, m."""
        used = TOLERANCE_USED * np.min([(g.position_tolerance, g.angle_tolerance) for g in self.goals], axis=0)
        size = max(float(np.hypot(*corner)) for corner in self.search.scenario.chain.objects[0].outline)
        return used, self.search.scenario.clearance + 2.0 * float(used[0] + used[1] * size)


@dataclass(frozen=True, eq=False)
class Situation:
    """Where everything is.

    Attributes:
        plate: (3,) pose of the plate frame in the world.
        poses: (n, 3) poses of the chain frames of the pieces.
        left: Indices of the pieces that have to be brought to a goal yet.
    """

    plate: FloatArray
    poses: FloatArray
    left: frozenset[int]

    def __post_init__(self) -> None:
        object.__setattr__(self, "plate", frozen(self.plate, (3,), "plate"))
        object.__setattr__(self, "poses", frozen(self.poses, (None, 3), "poses of the pieces"))


@dataclass(frozen=True, eq=False)
class Transfer:
    """One body is brought somewhere while the others stand.

    Attributes:
        piece: Its index.
        search: For it among the others, with this transfer's start, goals and place of the robot.
        room: That was searched in.
        best: The pushes and transits of its plan.
        lower_bound: What no plan of the transfer, with what comes after it, costs less than, m.
        looked_at: Pushes and transits that the search looked at.
        delivers: It ends at a goal of the piece; else the piece was in the way.
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
        """Of its plan, m."""
        return self.best.cost - self.best.cost_to_go

    @property
    def with_cost_to_go(self) -> float:
        """Cost of its plan and, about, of what comes after it, m."""
        return self.best.cost

    @property
    def beyond_bound(self) -> float:
        """What its plan, with what comes after it, costs beyond what none costs less than, m."""
        return self.with_cost_to_go - self.lower_bound

    @cached_property
    def end(self) -> FloatArray:
        """(3,) where the piece is afterwards."""
        return self.best.steps[-1].after

    @property
    def plate(self) -> FloatArray:
        """(3,) pose of the plate frame after the last retreat."""
        mode = self.room.contacts[self.best.steps[-1].contact].packed
        robot = mode.robot_at(self.end, mode.retreat)
        return se2.compose(robot, self.search.scenario.chain.pusher.plate_pose)

    def segments(self, before: plans.Poses) -> Segments:
        """Return its segments with all bodies where they are before it."""
        return self.search.segments(self.room, self.best, before)


def situation_after(pieces: tuple[Piece, ...], one: Transfer, before: Situation) -> Situation:
    """Return where everything is after a transfer."""
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
    """Return a transfer of one piece to one of some goals, or to places out of the way; None where none was found.

    Args:
        pieces: All of them.
        now: Where everything is.
        piece: Which of them.
        limits: When the search ends.
        seed: Of the random numbers.
        goals: Any of which will do.
        delivers: They are goals of the piece.
        cost_to_go: Returns what comes after it costs, m, (k,) for poses (k, 3) of the plate; None: nothing.
        level: Of the margins, each lower than the one before.
    """
    scenario = posed(pieces, now, piece, goals)
    try:
        free = free_goals(scenario)
    except PlanningError:
        return None
    searching = pieces[piece].search
    searching.room(level)  # kept with the piece: what does not depend on the others is made once
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
    """Return the problem of a piece with the others as obstacles where they are."""
    own = pieces[piece].search.scenario
    others = (one for k, other in enumerate(pieces) if k != piece for one in other.obstacles(now.poses[k]))
    load = replace(own.load, start=now.poses[piece])
    task = replace(own.transport, loads=(load,), goals=(Poses(load.name, goals),), robot_start=now.plate)
    return replace(own, task=task, obstacles=(*own.obstacles, *others))


def plates_after(room: PushRoom, goals: FloatArray) -> FloatArray:
    """Return where the plate is after pushes by each contact to each of some goals (g, 3), (m g, 3)."""
    modes, plate = [contact.packed for contact in room.contacts], room.scenario.chain.pusher.plate_pose
    return se2.compose(np.array([mode.robot_at(goal, mode.retreat) for mode in modes for goal in goals]), plate)


def depths(pieces: tuple[Piece, ...]) -> list[int]:
    """Return how many layers of pieces at their goals have to be taken away before the robot gets to each piece.

    A grid of goals is filled from its middle: 0 is for the goals that can be left to the end.
    """
    areas = [piece.goal_areas[0] if piece.goals else None for piece in pieces]
    in_the_way: list[list[set[int]]] = []
    for k, piece in enumerate(pieces):
        scenario, modes = piece.search.scenario, [contact.packed for contact in piece.search.room(0).contacts]
        robots = [
            np.concatenate([shapely.get_coordinates(area_at(scenario.chain.carried, mode.robot_at(NOWHERE, back)))
                            for back in (0.0, mode.retreat)])
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
    """Return poses beside the goals of a piece, within their tolerance, where others stand or shall stand close.

    A plate that is wider than the object touches the neighbours of an exact goal; a little short of it, it does not.
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
    """Return how far (m, rad) a piece may end beside its goals; 0 where goals of others are close to these."""
    own = pieces[piece]
    used, room = own.beside
    others = [area for k in sorted(now.left - {piece}) for area in pieces[k].goal_areas]
    away = shapely.distance(np.array(own.goal_areas)[:, None], others)
    return np.zeros(2) if (away <= room).any() else used
