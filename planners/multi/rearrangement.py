"""Search for plans that push several objects to goals of their own.

`order` finds a feasible order first and uses the remaining time to find cheaper ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pushplan.errors import PlanningError
from pushplan.planners.infeasible.diagnosis import Passages, beyond_reach
from pushplan.planners.multi.multi_push import MultiPushSearch, least_margins, plan_cost
from pushplan.planners.multi.order import Order
from pushplan.planners.multi.transfers import Piece, Situation, Transfer
from pushplan.planners.outcome import Budget, Improvements, Outcome, Question, Segments, TaskSearch
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.plan import Nearest
from pushplan.plans.segment import Poses
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.scenario.build import overlapping_goals
from pushplan.scenario.model import Scenario


class RearrangementSearch(TaskSearch):
    """Search for an order of several objects. Data about each object are cached.

    Args:
        scenario: Scenario with goals for some or all loads.
        pieces: All bodies that can be pushed.
    """

    def __init__(self, scenario: Scenario, pieces: tuple[Piece, ...]) -> None:
        self.scenario, self.pieces = scenario, pieces

    @property
    def set_name(self) -> str:
        """Name of the stable set."""
        return self.pieces[0].search.set_name

    @classmethod
    def of(cls, scenario: Scenario, settings: PlanSettings) -> RearrangementSearch:
        """Return the search for a scenario.

        Raises:
            PlanningError: If the goals of two bodies overlap.
            EmptyStableSetError: If no contact can push one of the bodies.
        """
        wrong = overlapping_goals(scenario)
        if wrong:
            raise PlanningError("; ".join(wrong.values()))
        pieces, by_kind = [], dict[str, MultiPushSearch]()
        for load in scenario.loads:
            alone, twin = scenario.alone(load.name), by_kind.get(load.kind)
            search = MultiPushSearch.of(alone, settings) if twin is None else twin.of_twin(alone)
            by_kind.setdefault(load.kind, search)
            pieces.append(Piece(load.name, search, scenario.goals.get(load.name, ())))
        return cls(scenario, tuple(pieces))

    def with_obstacles(self, scenario: Scenario) -> RearrangementSearch:
        """Return the search for a scenario that differs only in its obstacles."""
        return RearrangementSearch(
            scenario,
            tuple(
                replace(piece, search=piece.search.with_obstacles(scenario.alone(piece.name)))
                for piece in self.pieces
            ),
        )

    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """Return the best plan found; see `TaskSearch.search`."""
        scenario = self.scenario
        poses = np.array([scenario.task.by_name[piece.name].start for piece in self.pieces])
        left = frozenset(k for k, piece in enumerate(self.pieces) if piece.goals and not piece.is_at_goal(poses[k]))
        if not left:
            raise PlanningError("every object is at a goal already: there is nothing to push")
        now = Situation(scenario.transport.robot_start, poses, left)
        modes = [mode for piece in self.pieces for mode in piece.search.modes]
        proofs = self._proofs(now)
        apart = {k: proofs[piece.name].text for k, piece in enumerate(self.pieces) if piece.name in proofs}
        if "" in proofs or apart.keys() == left:
            return Outcome.without_plan(next(iter(proofs.values())), min(mode.margin(0) for mode in modes))
        improvements = Improvements(observer, budget.began)
        order = Order(self.pieces, budget, observer)
        found = order.find(replace(now, left=left.difference(apart)))
        candidates: tuple[Segments, ...] = ()
        if found.steps:
            candidates = (self._take(found.steps, order.looked_at, improvements),)
            if not budget.first and not found.here.left:
                cheaper = order.cheaper(now, found.steps)
                if cheaper is not found.steps:
                    candidates = (self._take(cheaper, order.looked_at, improvements),)
        return Outcome(
            candidates,
            *least_margins(modes, candidates, 0),
            order.looked_at,
            tuple(improvements.found),
            lambda segments: plan_cost(scenario, segments),
            explain=lambda: self._explanation(now, budget.time_limit),
            undelivered={
                self.pieces[k].name: apart.get(k) or order.why_not(found.here, k)
                for k in sorted(found.here.left | apart.keys())
            },
            proofs=tuple(proofs.values()),
        )

    def _proofs(self, now: Situation) -> dict[str, Diagnosis]:
        """Return proofs that a needed object cannot be reached or brought to its goal, by name.

        The name "" stands for a proof that the robot cannot reach any object at all.
        """
        pieces = dict(zip((piece.name for piece in self.pieces), self.pieces, strict=True))
        poses = dict(zip(pieces, now.poses, strict=True))
        outlines = {name: [one.outline for one in piece.obstacles(poses[name])] for name, piece in pieces.items()}
        faces = {name: piece.search.plates_before(poses[name]) for name, piece in pieces.items()}
        needed = [self.pieces[k].name for k in sorted(now.left)]
        scenario = self.pieces[0].search.scenario
        found, passages = beyond_reach(scenario, outlines, faces, needed), Passages(scenario)
        cut_off = {name: pieces[name].search.cut_off(passages) for name in needed if not found.keys() & {"", name}}
        return found | {name: fault for name, fault in cut_off.items() if fault is not None}

    def _take(self, transfers: tuple[Transfer, ...], looked_at: int, improvements: Improvements) -> Segments:
        """Return the segments of some transfers in order."""
        found: Segments = ()
        before: Poses = self.scenario.poses
        for transfer in transfers:
            found = (*found, *transfer.segments(before))
            before = found[-1].after
        improvements.add(plan_cost(self.scenario, found), looked_at, found)
        return found

    def _explanation(self, now: Situation, limit: float) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
        names = ", ".join(f"'{self.pieces[k].name}'" for k in sorted(now.left))
        reason = (
            f"no order found within the time limit of {limit:g} s that brings {names} to their goals, even with "
            "obstructing objects moved first"
        )
        return reason, (Diagnosis("order", reason, False),), None
