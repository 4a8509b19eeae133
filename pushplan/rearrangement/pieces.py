"""Objects that stand apart in a room: where they are and may go, and one errand of the robot with one of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.multi.room import PushRoom, Question, robot_at
from pushplan.planners.multi.search import Found, Limits, search
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Goal, PolygonObstacle
from pushplan.several.plan import backed_off, free_goals
from pushplan.several.prepared import Prepared
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class Piece:
    """An object, or a row that stays together, that can be pushed on its own.

    Attributes:
        name: For people.
        prepared: It in the room without the other pieces; its scenario has its goals.
        wanted: It has to be brought to one of its goals; others are moved only where they are in the way.
    """

    name: str
    prepared: Prepared
    wanted: bool

    @property
    def goals(self) -> tuple[Goal, ...]:
        """Any of which will do."""
        pushes = self.prepared.scenario.pushes
        assert pushes is not None
        return pushes.goals if self.wanted else ()

    def is_at_goal(self, pose: FloatArray) -> bool:
        """Tell whether it is at one of its goals, its frame being at a pose (3,)."""
        return any(goal.is_reached(pose) for goal in self.goals)

    def outlines(self, pose: FloatArray) -> list[FloatArray]:
        """Return the outlines of its objects in the world, its frame being at a pose (3,)."""
        chain = self.prepared.scenario.chain
        return [se2.transform_points(pose, obj.outline_chain) for obj in chain.objects]

    def area(self, pose: FloatArray) -> shapely.MultiPolygon:
        """Return what it covers, its frame being at a pose (3,)."""
        return shapely.MultiPolygon([shapely.Polygon(outline) for outline in self.outlines(pose)])


@dataclass(frozen=True, eq=False)
class Situation:
    """Where everything is.

    Attributes:
        plate: (3,) pose of the plate's frame in the world.
        poses: (n, 3) poses of the frames of the pieces.
        left: Indices of the pieces that are not at a goal yet.
    """

    plate: FloatArray
    poses: FloatArray
    left: frozenset[int]

    def __post_init__(self) -> None:
        object.__setattr__(self, "plate", frozen(self.plate, (3,), "plate"))
        object.__setattr__(self, "poses", frozen(self.poses, (None, 3), "poses of the pieces"))


@dataclass(frozen=True, eq=False)
class Errand:
    """One piece is brought somewhere while the others stand.

    Attributes:
        piece: Its index.
        prepared: The piece among the others, with this errand's start, goals and place of the robot.
        room: The same for the search.
        question: From where to where.
        found: What the search came to; it has a plan.
        delivers: It ends at a goal of the piece.
        wanted: The piece has goals: put out of the way, from one of them too, it has to be brought to one later.
    """

    piece: int
    prepared: Prepared
    room: PushRoom
    question: Question
    found: Found
    delivers: bool
    wanted: bool

    @property
    def cost(self) -> float:
        """Of its plan, m."""
        assert self.found.best is not None
        return self.found.best.cost

    @cached_property
    def end(self) -> FloatArray:
        """(3,) where the piece is afterwards."""
        assert self.found.best is not None
        return self.found.best.steps[-1].after

    @property
    def plate(self) -> FloatArray:
        """(3,) pose of the plate's frame after the last retreat."""
        assert self.found.best is not None
        mode = self.room.contacts[self.found.best.steps[-1].contact].packed
        return se2.compose(
            robot_at(mode, self.end, mode.retreat), self.prepared.scenario.chain.pusher.plate_pose
        )

    def after(self, before: Situation) -> Situation:
        """Return where everything is afterwards."""
        poses = np.array(before.poses)
        poses[self.piece] = self.end
        left = before.left - {self.piece}
        return Situation(self.plate, poses, left if self.delivers or not self.wanted else left | {self.piece})


def posed(pieces: tuple[Piece, ...], now: Situation, piece: int, goals: tuple[Goal, ...]) -> Scenario:
    """Return the scenario of bringing one piece to any of some goals while the others stand."""
    own = pieces[piece].prepared.scenario
    others = tuple(
        PolygonObstacle(outline)
        for k, other in enumerate(pieces)
        if k != piece
        for outline in other.outlines(now.poses[k])
    )
    assert own.pushes is not None
    return replace(
        own,
        start=now.poses[piece],
        goal=goals[0],
        obstacles=(*own.obstacles, *others),
        pushes=replace(own.pushes, robot_start=now.plate, goals=goals),
    )


def errand(
    pieces: tuple[Piece, ...],
    now: Situation,
    piece: int,
    limits: Limits,
    seed: int,
    places: tuple[Goal, ...] = (),
) -> Errand | None:
    """Return an errand with one piece to one of its goals, or of other places; None where none was found."""
    scenario = posed(pieces, now, piece, places or pieces[piece].goals)
    try:
        free = free_goals(scenario)
    except PlanningError:
        return None
    prepared = pieces[piece].prepared.with_obstacles(scenario)
    room = prepared.room(0)
    question = Question(backed_off(room, scenario), np.array(scenario.start), free)
    found = search(room, question, limits, seed)
    wanted = pieces[piece].wanted
    return None if found.best is None else Errand(piece, prepared, room, question, found, not places, wanted)
