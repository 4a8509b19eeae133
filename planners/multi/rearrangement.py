"""Several objects, each to a goal of its own.

An order is searched for first (`order`). With the time that is left cheaper ones are, and then every transfer is
searched for again from where the one before ends.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.infeasible.diagnosis import beyond_reach
from pushplan.planners.multi.multi_push import MultiPushSearch, plan_cost
from pushplan.planners.multi.order import GAIN, Order
from pushplan.planners.multi.search import Limits
from pushplan.planners.multi.transfers import Piece, Situation, Transfer, find_transfer, situation_after
from pushplan.planners.outcome import Improvements, Outcome, Segments
from pushplan.plans.plan import Diagnosis, Nearest
from pushplan.plans.segment import Poses
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.build import overlapping_goals
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Goal

OTHER_ORDERS = 0.8
"""Share of the time that is left after the first order in which others are tried."""


class RearrangementSearch:
    """Searches for an order of several objects; what is known of each of them is kept.

    Args:
        scenario: With `bodies`.
        pieces: All of them.
    """

    def __init__(self, scenario: Scenario, pieces: tuple[Piece, ...]) -> None:
        self.scenario, self.pieces = scenario, pieces

    @property
    def set_name(self) -> str:
        """Name of the set that is planned in."""
        return self.pieces[0].search.set_name

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
        pieces, known = [], dict[str, MultiPushSearch]()
        for name, body in scenario.bodies.items():
            alone, twin = scenario.alone(name), known.get(body.kind)
            search = MultiPushSearch.of(alone, settings) if twin is None else twin.of_twin(alone)
            known.setdefault(body.kind, search)
            pieces.append(Piece(name, search, body.goals))
        return cls(scenario, tuple(pieces))

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
        left = frozenset(k for k, piece in enumerate(self.pieces) if piece.goals and not piece.is_at_goal(poses[k]))
        if not left:
            raise PlanningError("every object is at a goal already: there is nothing to push")
        now, until = Situation(scenario.pushes.robot_start, poses, left), began + limit
        margin = min(mode.margin(0) for piece in self.pieces for mode in piece.search.modes)
        proof = self._proof(now)
        if proof is not None:
            return Outcome.without_plan(proof, margin)
        improvements = Improvements(settings.observer, began)
        order = Order(self.pieces, settings, until)
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
                better = self._better(now, transfers, order, until, settings)
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
        outlines = {name: [one.outline for one in piece.obstacles(poses[name])] for name, piece in pieces.items()}
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
        self, now: Situation, transfers: tuple[Transfer, ...], order: Order, until: float, settings: PlanSettings
    ) -> tuple[Transfer, ...] | None:
        """Return the same transfers with better plans, each searched from where the last ends, or None.

        Most of the time is for those that cost most beyond what is proven to be needed.
        """
        found: list[Transfer] = []
        assert settings.seed is not None
        for k, one in enumerate(transfers):
            spare = [step.beyond_bound for step in transfers[k:]]
            left = max(until - time.perf_counter(), 0.0)
            limits = Limits(
                time.perf_counter() + left * spare[0] / max(sum(spare), GAIN), stop=settings.observer.cancelled
            )
            goals, cost_to_go = (self._aim(one),), order.cost_to_go(now, one.piece) if one.delivers else None
            again = find_transfer(self.pieces, now, one.piece, limits, settings.seed, goals, one.delivers, cost_to_go)
            if again is None:
                return None
            found.append(again)
            now = situation_after(self.pieces, again, now)
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
