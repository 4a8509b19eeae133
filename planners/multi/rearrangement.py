"""Several objects, each to a goal of its own: in which order, and which of them have to make room first.

At first the nearest body that has a plan is brought to its goal, then the next one. Where that leaves some without a
plan, situations are searched depth first, from there and then from the beginning: a body is brought to its goal only
where every other one that is left keeps a plan of its own (or waits for another body to leave its goal); where none
can be, one that is in the way is put somewhere from where the rest goes on, and has to be brought to its goal
afterwards, also where it stood there before. As few are moved as possible. What is spent on each transfer grows while
there is no order. With the time that is left other orders, and each goal of a body by itself, are tried in beams, and
every transfer is searched for again.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.infeasible.reaching import beyond_reach
from pushplan.planners.multi.multi_push import MultiPushSearch, backed_off, free_goals, plan_cost
from pushplan.planners.multi.room import PushRoom, Question
from pushplan.planners.multi.search import Found, Limits, search
from pushplan.planners.outcome import Improvements, Outcome, Segments
from pushplan.plans.plan import Diagnosis, Nearest, Poses
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.build import overlapping_goals
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import TOLERANCE_USED, Goal, PolygonObstacle, Workspace
from pushplan.util.arrays import FloatArray, frozen

STAGES = (
    (1, 0, False),
    (1, 1, False),
    (4, 1, False),
    (1, 0, True),
    (1, 1, True),
    (16, 1, False),
    (4, 1, True),
    (16, 1, True),
    (4, 2, True),
    (16, 2, True),
    (16, 3, True),
    (64, 3, True),
    (256, 6, True),
)
"""How many batches of poses the search for one transfer may take, how often bodies are put out of the way in all, at
most, and whether all is looked through from the beginning or from where the nearest ones were brought to their goals:
one after the other while there is no order.

Batches, not seconds: the same seed finds the same order, however busy the machine is.
"""

PLACES = 4
"""Places that are tried for a body that is in the way."""

NEAR = 0.8
"""A body nearer than this (m) to another, or to its goal, may be in its way."""

AWAY = np.concatenate([np.arange(0.1, 1.05, 0.1), np.arange(1.25, 3.1, 0.25)])
"""How far straight pushes lead to where a body may be put out of the way, m."""

SCATTERED = 60
"""Places around a body that may be used likewise."""

MOST_PLACES = 24
"""Places that are offered, the nearest ones."""

ROOM = 0.05
"""What such a place keeps from other bodies and from goals, beside the clearance, m."""

OTHER_ORDERS = 0.5
"""Share of the time that is left after the first order in which others are tried."""

BEAMS = ((1, 1), (1, 2), (2, 3), (4, 4), (8, 4), (16, 6), (32, 6), (64, 8))
"""Situations that are kept then after each transfer, and pieces that may be next, the nearest ones: one beam after
the other."""

GAIN = 1e-6
"""Smallest saving that counts, m."""


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

    def is_at_goal(self, pose: FloatArray) -> bool:
        """Tell whether its frame (3,) is at one of its goals."""
        return any(goal.is_reached(pose) for goal in self.goals)

    def outlines(self, pose: FloatArray) -> list[FloatArray]:
        """Return the outlines of its objects in the world, its frame being at a pose (3,)."""
        chain = self.search.scenario.chain
        return [se2.transform_points(pose, obj.outline_chain) for obj in chain.objects]

    def area(self, pose: FloatArray) -> shapely.MultiPolygon:
        """Return what it covers, its frame being at a pose (3,)."""
        return shapely.MultiPolygon([shapely.Polygon(outline) for outline in self.outlines(pose)])


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
        found: What the search came to; it has a plan.
        delivers: It ends at a goal of the piece; else the piece was in the way.
    """

    piece: int
    search: MultiPushSearch
    room: PushRoom
    found: Found
    delivers: bool

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
        """(3,) pose of the plate frame after the last retreat."""
        assert self.found.best is not None
        mode = self.room.contacts[self.found.best.steps[-1].contact].packed
        robot = mode.robot_at(self.end, mode.retreat)
        return se2.compose(robot, self.search.scenario.chain.pusher.plate_pose)

    def segments(self, before: Poses) -> Segments:
        """Return its segments with all bodies where they are before it."""
        assert self.found.best is not None
        return self.search.segments(self.room, self.found.best, before)


class RearrangementSearch:
    """Searches for an order of several objects; what is known of each of them is kept.

    Args:
        scenario: With `bodies`.
        pieces: All of them.
    """

    def __init__(self, scenario: Scenario, pieces: tuple[Piece, ...]) -> None:
        self.scenario, self.pieces = scenario, pieces

    @classmethod
    def of(cls, scenario: Scenario, settings: PlanSettings) -> RearrangementSearch:
        """Return the search in a scenario.

        Raises:
            PlanningError: When two bodies cannot be at their goals together.
            EmptyStableSetError: When no contact can push one of the bodies.
        """
        wrong = overlapping_goals({name: scenario.alone(name) for name in scenario.goals})
        if wrong:
            raise PlanningError("; ".join(wrong.values()))
        pieces = tuple(
            Piece(name, MultiPushSearch.of(scenario.alone(name), settings), body.goals)
            for name, body in scenario.bodies.items()
        )
        return cls(scenario, pieces)

    def with_obstacles(self, scenario: Scenario) -> RearrangementSearch:
        """Return it for a scenario that differs in what stands in the room."""
        return RearrangementSearch(
            scenario,
            tuple(
                replace(piece, search=piece.search.with_obstacles(scenario.alone(piece.name)))
                for piece in self.pieces
            ),
        )

    def search(self, settings: PlanSettings, began: float) -> Outcome:
        """Return the best plan that was found.

        Args:
            settings: Complete.
            began: `time.perf_counter` from which the time limit counts.

        Raises:
            PlanningError: When every object is at its goal already.
        """
        scenario, seed, limit = self.scenario, settings.seed, settings.time_limit
        assert scenario.pushes is not None
        assert seed is not None
        assert limit is not None
        poses = np.array([scenario.bodies[piece.name].start for piece in self.pieces])
        left = frozenset(
            k for k, piece in enumerate(self.pieces) if piece.goals and not piece.is_at_goal(poses[k])
        )
        if not left:
            raise PlanningError("every object is at a goal already: there is nothing to push")
        now, until = Situation(scenario.pushes.robot_start, poses, left), began + limit
        margin = min(mode.margin(0) for piece in self.pieces for mode in piece.search.modes)
        proof = self._proof(now)
        if proof is not None:
            return Outcome.without_plan(proof, margin)
        improvements = Improvements(settings.observer, began)
        order = _Order(self.pieces, settings, until)
        transfers = order.find(now)
        candidates: tuple[Segments, ...] = ()
        if transfers is not None:
            candidates = (self._take(transfers, order.looked_at, improvements),)
            if not settings.first:
                half = time.perf_counter() + OTHER_ORDERS * max(0.0, until - time.perf_counter())
                cheaper = order.cheaper(now, transfers, half)
                if cheaper is not transfers:
                    transfers = cheaper
                    candidates = (self._take(transfers, order.looked_at, improvements), *candidates)
                better = self._better(now, transfers, until, settings)
                if better is not None:
                    candidates = (self._take(better, order.looked_at, improvements), *candidates)
        return Outcome(
            candidates[:1],
            margin,
            margin,
            order.looked_at,
            tuple(improvements.found),
            lambda segments: plan_cost(scenario, segments),
            explain=lambda: self._explanation(now, limit),
        )

    def _proof(self, now: Situation) -> Diagnosis | None:
        """Return the proof that the robot reaches no object, or not one that has to be moved."""
        pieces = dict(zip((piece.name for piece in self.pieces), self.pieces, strict=True))
        poses = dict(zip(pieces, now.poses, strict=True))
        outlines = {name: piece.outlines(poses[name]) for name, piece in pieces.items()}
        faces = {name: piece.search.plates_before(poses[name]) for name, piece in pieces.items()}
        needed = [self.pieces[k].name for k in sorted(now.left)]
        return beyond_reach(self.pieces[0].search.scenario, outlines, faces, needed)

    def _take(self, transfers: tuple[Transfer, ...], looked_at: int, improvements: Improvements) -> Segments:
        """Return the segments of transfers, one after the other."""
        found: Segments = ()
        before: Poses = self.scenario.poses
        for transfer in transfers:
            found = (*found, *transfer.segments(before))
            before = found[-1].after
        improvements.add(plan_cost(self.scenario, found), looked_at, found)
        return found

    def _better(
        self, now: Situation, transfers: tuple[Transfer, ...], until: float, settings: PlanSettings
    ) -> tuple[Transfer, ...] | None:
        """Return the same transfers with better plans, each searched from where the last ends, or None."""
        found: list[Transfer] = []
        assert settings.seed is not None
        for k, one in enumerate(transfers):
            share = (until - time.perf_counter()) / (len(transfers) - k)
            limits = Limits(time.perf_counter() + max(share, 0.0), stop=settings.observer.cancelled)
            goals = (self._aim(one),)
            again = _transfer(self.pieces, now, one.piece, limits, settings.seed, goals, one.delivers)
            if again is None:
                return None
            found.append(again)
            now = _after(self.pieces, again, now)
        saved = sum(one.cost for one in transfers) - sum(one.cost for one in found)
        return tuple(found) if saved > GAIN else None

    def _aim(self, one: Transfer) -> Goal:
        """Return the goal that a transfer brings a piece to, or where it puts one that is in the way, as a goal."""
        piece = self.pieces[one.piece]
        if one.delivers:
            return min(piece.goals, key=lambda goal: max(se2.pose_error(one.end, goal.pose_chain)))
        stated = piece.search.scenario.goal
        return replace(stated, pose=one.end, of=None, pose_chain=one.end)

    def _explanation(self, now: Situation, limit: float) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
        names = ", ".join(f"'{self.pieces[k].name}'" for k in sorted(now.left))
        reason = (
            f"no order was found within the time limit of {limit:g} s in which {names} get to their goals, with what "
            "is in the way moved first"
        )
        return reason, (Diagnosis("order", reason, False),), None


def _after(pieces: tuple[Piece, ...], one: Transfer, before: Situation) -> Situation:
    """Return where everything is after a transfer."""
    poses = np.array(before.poses)
    poses[one.piece] = one.end
    left = before.left - {one.piece}
    if not one.delivers and pieces[one.piece].goals:
        left |= {one.piece}
    return Situation(one.plate, poses, left)


def _transfer(
    pieces: tuple[Piece, ...],
    now: Situation,
    piece: int,
    limits: Limits,
    seed: int,
    goals: tuple[Goal, ...],
    delivers: bool = True,
) -> Transfer | None:
    """Return a transfer of one piece to one of some goals, or to places out of the way; None where none was found."""
    own = pieces[piece].search.scenario
    assert own.pushes is not None
    others = tuple(
        PolygonObstacle(outline)
        for k, other in enumerate(pieces)
        if k != piece
        for outline in other.outlines(now.poses[k])
    )
    scenario = replace(
        own,
        start=now.poses[piece],
        goal=goals[0],
        obstacles=(*own.obstacles, *others),
        pushes=replace(own.pushes, robot_start=now.plate, goals=goals),
    )
    try:
        free = free_goals(scenario)
    except PlanningError:
        return None
    searching = pieces[piece].search
    searching.room(0)  # kept with the piece: what does not depend on the others is made once
    searching = searching.with_obstacles(scenario)
    room = searching.room(0)
    within = _within(pieces, now, piece) if delivers else np.zeros(2)
    question = Question(backed_off(room, scenario), np.array(scenario.start), free, within)
    found = search(room, question, limits, seed)
    return None if found.best is None else Transfer(piece, searching, room, found, delivers)


def _within(pieces: tuple[Piece, ...], now: Situation, piece: int) -> FloatArray:
    """Return how far (m, rad) a piece may end beside its goals; 0 where goals of others are close to these."""
    own = pieces[piece]
    used = TOLERANCE_USED * np.min([(g.position_tolerance, g.angle_tolerance) for g in own.goals], axis=0)
    size = max(float(np.hypot(*corner)) for corner in own.search.scenario.chain.objects[0].outline)
    room = own.search.scenario.clearance + 2.0 * float(used[0] + used[1] * size)
    others = [pieces[k].area(goal.pose_chain) for k in now.left - {piece} for goal in pieces[k].goals]
    taken = shapely.union_all(others).buffer(room)
    near = any(taken.intersects(own.area(goal.pose_chain)) for goal in own.goals)
    return np.zeros(2) if near else np.asarray(used)


class _Order:
    """The search for an order.

    Args:
        pieces: All that can be pushed.
        settings: Complete.
        until: `time.perf_counter` at which it is over.

    Attributes:
        looked_at: Transfers that were searched for.
    """

    def __init__(self, pieces: tuple[Piece, ...], settings: PlanSettings, until: float) -> None:
        assert settings.seed is not None
        self._pieces, self._seed, self._until = pieces, settings.seed, until
        self._cancelled, self._most = settings.observer.cancelled, settings.iterations or math.inf
        self._random = np.random.default_rng(self._seed)
        self._patience = STAGES[0][0]
        self._known: dict[tuple[object, ...], Transfer | None] = {}
        self.looked_at = 0

    def find(self, now: Situation) -> tuple[Transfer, ...] | None:
        """Return transfers that bring every piece that is left to a goal, None where none were found in time."""
        for self._patience, relocations, again in STAGES:
            self._known = {key: one for key, one in self._known.items() if one is not None}
            steps, here = ((), now) if again else self._nearest_brought(now)
            rest = self._go_on(here, relocations)
            if rest is not None:
                return (*steps, *rest)
            if self._over():
                break
        return None

    def _nearest_brought(self, now: Situation) -> tuple[tuple[Transfer, ...], Situation]:
        """Return transfers, each of the nearest piece that has a plan, and where everything is when none has."""
        steps: list[Transfer] = []
        while now.left:
            found = (self._delivery(now, piece) for piece in self._nearest_first(now))
            step = next((one for one in found if one is not None), None)
            if step is None or self._over():
                break
            steps.append(step)
            now = _after(self._pieces, step, now)
        return tuple(steps), now

    def cheaper(self, now: Situation, best: tuple[Transfer, ...], until: float) -> tuple[Transfer, ...]:
        """Return transfers in another order, or to other goals, that cost less; the same ones where there are none.

        A beam search: of all that were brought to a goal as often, the best situations go on. Where something is put
        out of the way, other places for that are tried.
        """
        self._until, whole = until, self._until
        if not all(step.delivers for step in best):
            best = self._elsewhere(now, best)
        for width, most in BEAMS if all(step.delivers for step in best) else ():
            found, cut = self._beam(now, width, most, sum(step.cost for step in best) - GAIN)
            best = best if found is None else found
            if self._over() or not cut:
                break
        self._until = whole
        return best

    def _beam(
        self, now: Situation, width: int, most: int, below: float
    ) -> tuple[tuple[Transfer, ...] | None, bool]:
        """Return transfers that cost less than `below` (m), None where there are none, and whether any were left out.

        Args:
            now: Where everything is.
            width: So many situations are kept.
            most: So many pieces may be next.
            below: See above.
        """
        kept: list[tuple[float, tuple[Transfer, ...], Situation]] = [(0.0, (), now)]
        cut = False
        for _ in now.left:
            chances: list[tuple[float, float, tuple[Transfer, ...], Situation]] = []
            for cost, steps, here in kept:
                pieces = self._nearest_first(here)
                cut = cut or len(pieces) > most
                for piece in pieces[:most]:
                    for goal in self._pieces[piece].goals:
                        step = self._delivery(here, piece, goal)
                        if self._over():
                            return None, True
                        if step is None:
                            continue
                        after = _after(self._pieces, step, here)
                        least = cost + step.cost + self._rest(after)
                        if least < below:
                            chances.append((least, cost + step.cost, (*steps, step), after))
            chances.sort(key=lambda chance: chance[0])
            cut = cut or len(chances) > width
            kept = [(cost, steps, here) for _, cost, steps, here in chances[:width]]
        return (kept[0][1] if kept else None), cut

    def _rest(self, now: Situation) -> float:
        """Return what the rest costs at least, about: straight pushes, and a way from the nearest end of another."""
        ends = [now.plate[:2]]
        ends += [goal.pose_chain[:2] for k in now.left for goal in self._pieces[k].goals[:1]]
        rest = 0.0
        for k in now.left:
            own, start = self._pieces[k], now.poses[k][:2]
            assert own.search.scenario.pushes is not None
            weight = own.search.scenario.pushes.transit_weight
            goal = min(own.goals, key=lambda goal: math.dist(goal.pose_chain[:2], start))
            others = [end for end in ends if end is not goal.pose_chain]
            rest += math.dist(goal.pose_chain[:2], start) + weight * min(
                math.dist(end, start) for end in others
            )
        return rest

    def _elsewhere(self, now: Situation, best: tuple[Transfer, ...]) -> tuple[Transfer, ...]:
        """Return the same transfers with the cheapest places for what is in the way that were drawn in time."""
        cost = sum(step.cost for step in best)
        while not self._over():
            steps, here = [], now
            for one in best:
                step = (
                    self._delivery(here, one.piece) if one.delivers else self._put_somewhere(here, one.piece)
                )
                if step is None:
                    break
                steps.append(step)
                here = _after(self._pieces, step, here)
            spent = sum(step.cost for step in steps)
            if len(steps) == len(best) and spent < cost - GAIN:
                best, cost = tuple(steps), spent
        return best

    def _put_somewhere(self, now: Situation, piece: int) -> Transfer | None:
        places = self._parking(now, piece)
        if not places:
            return None
        chosen = self._random.choice(len(places), min(PLACES, len(places)), replace=False)
        return self._search(now, piece, tuple(places[k] for k in chosen), delivers=False)

    def _over(self) -> bool:
        spent = self.looked_at >= self._most
        return spent or time.perf_counter() >= self._until or self._cancelled()

    def _go_on(self, now: Situation, relocations: int) -> tuple[Transfer, ...] | None:
        if not now.left:
            return ()
        for piece in self._nearest_first(now):
            step = self._delivery(now, piece)
            if self._over():
                return None
            if step is None:
                continue
            after = _after(self._pieces, step, now)
            if all(self._is_open(after, k) for k in after.left):
                rest = self._go_on(after, relocations)
                if rest is not None:
                    return (step, *rest)
        return self._make_way(now, relocations) if relocations else None

    def _nearest_first(self, now: Situation) -> list[int]:
        """Return the pieces that are left, those first that the robot drives to and pushes the shortest way."""

        def way(piece: int) -> float:
            own = self._pieces[piece]
            pushes, start = own.search.scenario.pushes, now.poses[piece]
            assert pushes is not None
            push = min(math.hypot(*(goal.pose_chain - start)[:2]) for goal in own.goals)
            return pushes.transit_weight * math.hypot(*(start - now.plate)[:2]) + push

        return sorted(sorted(now.left), key=way)

    def _delivery(self, now: Situation, piece: int, goal: Goal | None = None) -> Transfer | None:
        """Return the transfer of a piece to a goal, any of its goals without one; None where none was found."""
        key = (
            piece,
            now.plate.tobytes(),
            now.poses.tobytes(),
            None if goal is None else goal.pose_chain.tobytes(),
        )
        if key not in self._known:
            goals = self._pieces[piece].goals if goal is None else (goal,)
            self._known[key] = self._search(now, piece, goals)
        return self._known[key]

    def _search(
        self, now: Situation, piece: int, goals: tuple[Goal, ...], delivers: bool = True
    ) -> Transfer | None:
        self.looked_at += 1
        limits = Limits(self._until, first=True, iterations=self._patience, stop=self._cancelled)
        return _transfer(self._pieces, now, piece, limits, self._seed, goals, delivers)

    def _is_open(self, now: Situation, piece: int) -> bool:
        """Tell whether a piece has a plan, or only waits for others that are left to leave all its goals."""
        return self._waits(now, piece) or self._delivery(now, piece) is not None

    def _waits(self, now: Situation, piece: int) -> bool:
        return all(
            self._on_goal(now, piece, goal) & now.left for goal in range(len(self._pieces[piece].goals))
        )

    def _on_goal(self, now: Situation, piece: int, goal: int) -> frozenset[int]:
        """Return the pieces that stand on a goal of another."""
        own = self._pieces[piece]
        area = own.area(own.goals[goal].pose_chain).buffer(own.search.scenario.clearance)
        others = (k for k in range(len(self._pieces)) if k != piece)
        return frozenset(k for k in others if self._pieces[k].area(now.poses[k]).intersects(area))

    def _make_way(self, now: Situation, relocations: int) -> tuple[Transfer, ...] | None:
        """Put a piece that is in the way somewhere else, and go on from there."""
        for piece in self._in_the_way(now):
            places = self._parking(now, piece)
            for _ in range(PLACES):
                step = self._search(now, piece, places, delivers=False) if places else None
                if step is None or self._over():
                    break
                after = _after(self._pieces, step, now)
                if relocations > 1 or any(self._delivery(after, k) is not None for k in after.left):
                    rest = self._go_on(after, relocations - 1)
                    if rest is not None:
                        return (step, *rest)
                reached = step.end
                places = tuple(p for p in places if np.hypot(*(p.pose_chain - reached)[:2]) > 0.2)
        return None

    def _in_the_way(self, now: Situation) -> Iterator[int]:
        """Yield the pieces that may be in the way: those on goals first, then those near, then what is shut in."""
        on_goals = [
            k
            for piece in sorted(now.left)
            for goal in range(len(self._pieces[piece].goals))
            for k in sorted(self._on_goal(now, piece, goal))
        ]
        near = [k for piece in sorted(now.left) for k in self._near(now, piece)]
        yield from dict.fromkeys([*on_goals, *near, *sorted(now.left)])

    def _near(self, now: Situation, piece: int) -> list[int]:
        """Return the pieces near another or its goals, nearest first."""
        spots = np.array([now.poses[piece], *(goal.pose_chain for goal in self._pieces[piece].goals)])[:, :2]
        away = [float(np.linalg.norm(spots - pose[:2], axis=1).min()) for pose in now.poses]
        return [int(k) for k in np.argsort(away) if k != piece and away[k] < NEAR]

    def _parking(self, now: Situation, piece: int) -> tuple[Goal, ...]:
        """Return places for a piece that no goal needs, nearest first: along straight pushes, and around it."""
        own, pose = self._pieces[piece], now.poses[piece]
        taken = self._taken(now, piece)
        tolerance = own.search.scenario.goal
        places = [p for p in (*_straight(own, pose), *self._scattered(pose)) if _is_free(own, p, taken)]
        nearest = sorted(places, key=lambda p: math.hypot(*(p - pose)[:2]))[:MOST_PLACES]
        return tuple(
            Goal(p, None, p, tolerance.position_tolerance, tolerance.angle_tolerance) for p in nearest
        )

    def _taken(self, now: Situation, piece: int) -> BaseGeometry:
        """What other pieces cover, where they are and where those that are left shall go."""
        pieces = self._pieces
        kept = pieces[piece].search.scenario.clearance + ROOM
        areas = [other.area(now.poses[k]) for k, other in enumerate(pieces) if k != piece]
        areas += [pieces[k].area(goal.pose_chain) for k in now.left if k != piece for goal in pieces[k].goals]
        return shapely.union_all(areas).buffer(kept)

    def _scattered(self, pose: FloatArray) -> Iterator[FloatArray]:
        for _ in range(SCATTERED):
            away, way = self._random.uniform(AWAY[0], AWAY[-1]), self._random.uniform(-np.pi, np.pi)
            turn = self._random.uniform(-np.pi, np.pi)
            yield pose + np.array([away * math.cos(way), away * math.sin(way), turn])


def _straight(piece: Piece, pose: FloatArray) -> Iterator[FloatArray]:
    for contact in piece.search.room(0).contacts:
        ahead = se2.rotate(contact.packed.contact[2], contact.packed.settling[:2])
        for away in AWAY:
            yield se2.compose(pose, np.append(away * ahead, 0.0))


def _is_free(piece: Piece, pose: FloatArray, taken: BaseGeometry) -> bool:
    area = piece.area(pose)
    return _is_inside(area, piece.search.scenario.workspace) and not taken.intersects(area)


def _is_inside(area: BaseGeometry, workspace: Workspace | None) -> bool:
    if workspace is None:
        return True
    x0, y0, x1, y1 = area.bounds
    return bool(
        workspace.xmin + ROOM < x0
        and x1 < workspace.xmax - ROOM
        and workspace.ymin + ROOM < y0
        and y1 < workspace.ymax - ROOM
    )
