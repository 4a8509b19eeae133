"""Several objects to goals of their own: the order, then every errand timed, executed and checked."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pushplan.errors import PlanningError
from pushplan.planners.multi.search import Limits
from pushplan.plans.result import PlanResult, ProgressPoint
from pushplan.rearrangement.order import Order
from pushplan.rearrangement.pieces import Errand, Piece, Situation, errand
from pushplan.scenario.build import overlapping_goals
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Goal
from pushplan.several.plan import Asked, Outcome, checked
from pushplan.several.prepared import Prepared
from pushplan.several.warm import warm_up_several
from pushplan.util.stopwatch import Stopwatch

GAIN = 1e-6
"""Smallest saving that counts, m."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One piece is brought somewhere while the others stand: a plan of several pushes.

    Attributes:
        name: Of the piece.
        delivers: It ends at a goal of the piece; else the piece was in the way.
        scenario: The piece, where it and the robot are at first, and the other pieces among the obstacles.
        plan: Its result.
    """

    name: str
    delivers: bool
    scenario: Scenario
    plan: PlanResult


@dataclass(frozen=True, eq=False)
class Rearrangement:
    """What planning for several objects came to.

    Attributes:
        legs: One after the other; empty where there is no plan.
        reason: Why there is none.
        first_solution_s: Wall-clock seconds to the first order, None without any.
        planning_s: Of the whole search.
        looked_at: Errands that were searched for.
    """

    legs: tuple[Leg, ...]
    reason: str
    first_solution_s: float | None
    planning_s: float
    looked_at: int

    @property
    def solved(self) -> bool:
        """Whether every object gets to a goal."""
        return not self.reason

    @property
    def relocations(self) -> int:
        """How often an object is put out of the way."""
        return sum(not leg.delivers for leg in self.legs)

    @property
    def cost(self) -> float:
        """Of all legs, m."""
        return sum(leg.plan.objective_cost or 0.0 for leg in self.legs)


@dataclass(frozen=True, eq=False)
class Rearranging:
    """Several objects in a room, each of which can be pushed; what is known of them is kept between questions.

    Attributes:
        pieces: All of them.
        now: Where they and the robot are.
    """

    pieces: tuple[Piece, ...]
    now: Situation

    @classmethod
    def of(cls, scenarios: Mapping[str, Scenario], movable: Iterable[str] = ()) -> Rearranging:
        """Return the problem that scenarios state, each for one piece alone in the same room.

        Compiled code is made ready where it is missing.

        Args:
            scenarios: By name; where the robot starts is that of the first.
            movable: Names of those that have no goal: they are moved where they are in the way.

        Raises:
            PlanningError: When there are none, one asks for a single push, or goals of two of them overlap.
                EmptyStableSetError: When no contact can push a piece.
        """
        if not scenarios:
            raise PlanningError("there is no object to push")
        first = next(iter(scenarios.values()))
        if any(scenario.pushes is None for scenario in scenarios.values()) or first.pushes is None:
            raise PlanningError("several objects need a robot.start, the plate's pose in the world")
        unwanted = set(movable)
        for what in overlapping_goals(
            {name: scenario for name, scenario in scenarios.items() if name not in unwanted}
        ).values():
            raise PlanningError(what)
        warm_up_several(None, first.stability.set, first.interval is not None)
        pieces = tuple(
            Piece(name, Prepared.of(scenario), name not in unwanted) for name, scenario in scenarios.items()
        )
        poses = np.array([scenario.start for scenario in scenarios.values()])
        left = frozenset(
            k for k, piece in enumerate(pieces) if piece.wanted and not piece.is_at_goal(poses[k])
        )
        return cls(pieces, Situation(first.pushes.robot_start, poses, left))

    def plan(
        self,
        *,
        seed: int = 1,
        time_limit: float = 2.0,
        first: bool = False,
        stop: Callable[[], bool] | None = None,
    ) -> Rearrangement:
        """Return the errands that bring every wanted piece to a goal.

        Args:
            seed: Of the random numbers.
            time_limit: Seconds of search, at most.
            first: Do not look for better ones.
            stop: Asked whether to end at once.
        """
        began = time.perf_counter()
        until = began + time_limit
        order = Order(self.pieces, seed, until, stop)
        errands = order.find(self.now)
        if errands is None:
            return Rearrangement((), self._why(), None, time.perf_counter() - began, order.looked_at)
        soon = time.perf_counter() - began
        if not first:
            errands = self._better(errands, until, seed, stop)
        spent = time.perf_counter() - began
        legs = tuple(leg_of(self.pieces, one, seed) for one in errands)
        faults = [f"{leg.name}: {leg.plan.reason}" for leg in legs if not leg.plan.solved]
        wrong = "; ".join(faults or self._not_at_goals(legs))
        return Rearrangement(() if wrong else legs, wrong, soon, spent, order.looked_at)

    def _not_at_goals(self, legs: tuple[Leg, ...]) -> list[str]:
        """Return which of all pieces with goals are not at one of them after the last leg, in words."""
        ends = {piece.name: pose for piece, pose in zip(self.pieces, self.now.poses, strict=True)}
        ends |= {leg.name: leg.plan.segments[-1].load_after for leg in legs}
        return [
            f"{piece.name}: ends {min(goal.errors(ends[piece.name])[0] for goal in piece.goals):.3f} m from its goal"
            for piece in self.pieces
            if piece.wanted and not piece.is_at_goal(ends[piece.name])
        ]

    def _better(
        self, errands: tuple[Errand, ...], until: float, seed: int, stop: Callable[[], bool] | None
    ) -> tuple[Errand, ...]:
        """Return the same errands with better plans: each is searched for anew from where the one before ends."""
        now, found = self.now, []
        for k, one in enumerate(errands):
            share = (until - time.perf_counter()) / (len(errands) - k)
            limits = Limits(time.perf_counter() + max(share, 0.0), stop=stop)
            places = () if one.delivers else (self._put(one),)
            again = errand(self.pieces, now, one.piece, limits, seed, places)
            if again is None:
                return errands
            found.append(again)
            now = again.after(now)
        saved = sum(one.cost for one in errands) - sum(one.cost for one in found)
        return tuple(found) if saved > GAIN else errands

    def _put(self, one: Errand) -> Goal:
        """Return where an errand puts a piece that is in the way."""
        stated = self.pieces[one.piece].prepared.scenario.goal
        return replace(stated, pose=one.end, of=None, pose_chain=one.end)

    def _why(self) -> str:
        """Return what is known of why there is no order."""
        names = ", ".join(f"'{self.pieces[k].name}'" for k in sorted(self.now.left))
        return f"no order was found in time in which {names} get to their goals, with what is in the way moved first"


def leg_of(pieces: tuple[Piece, ...], one: Errand, seed: int) -> Leg:
    """Return an errand timed, executed and checked."""
    spent = one.found.seconds or 0.0
    first = ProgressPoint(spent, one.cost, one.found.looked_at)
    outcome = Outcome(one.room, one.question, one.found, 0, spent, (first,))
    plan = checked(one.prepared, outcome, Asked(seed), Stopwatch())
    return Leg(pieces[one.piece].name, one.delivers, _standalone(one.prepared.scenario), plan)


def _standalone(scenario: Scenario) -> Scenario:
    """Return the scenario of a leg as a file of its own would state it: so it can be recorded, and read again."""
    stated = scenario.resolved()
    assert scenario.pushes is not None
    stated["robot"] = {**stated.get("robot", {}), "start": scenario.pushes.robot_start.tolist()}
    return scenario_from_document(stated, scenario.path, scenario.attachments)
