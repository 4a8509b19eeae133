"""Plans from where the objects are: for the chain as it is believed to be, within a time limit."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import pose_error
from pushplan.mechanics.perturb import slid
from pushplan.plan import plan
from pushplan.planners.validation.clearance import find_collision
from pushplan.plans.events import Replan
from pushplan.plans.path import PushPath
from pushplan.plans.result import PlanResult
from pushplan.queries import Queries
from pushplan.scenario.model import Obstacle, Scenario
from pushplan.sim.control.aims import Aim
from pushplan.sim.control.caution import cautious, with_chain
from pushplan.sim.control.settings import ControlSettings
from pushplan.util.arrays import FloatArray

DETOUR = 0.05
"""Way (m of path cost) that going to the exact goal may be longer than going somewhere within the tolerances."""
CAUTION = (1.0, 0.5, 0.0)
"""Shares of what may be off, friction and places, that plans are made for, one after the other until there is one."""
MERIDIANS = 96
"""Meridians of the stable set that controls are taken from: plans without haste take five times as many."""
BETTER, STOP = 0.1, 0.1
"""Share of a path's cost, and way (m) that a stop is worth, by which another way has to be shorter."""
ITERATIONS = 10_000
"""Of the search of a plan, a few hundredths of a second: where they, not the time limit, end it, runs repeat."""
SAME = 0.03
"""Share of a contact's length up to which a slide does not make it another chain."""


class Replanner:
    """Plans for a chain whose objects slide and whose friction is known roughly.

    Args:
        scenario: What the chain is believed to be at first, the room, and the goal.
        settings: See there.
        tell: Takes sentences about what takes long.

    Attributes:
        aim: What counts as the goal.
        chain: As it is believed to be, with the objects where they have slid to.
    """

    def __init__(
        self, scenario: Scenario, settings: ControlSettings, tell: Callable[[str], None] | None = None
    ) -> None:
        self._scenario, self._settings, self._tell = scenario, settings, tell
        self.aim = Aim.of(
            scenario.goal, scenario.chain, settings.position_tolerance, settings.angle_tolerance
        )
        self.chain, self._slides = scenario.chain, np.zeros(len(scenario.chain.contacts))
        self._queries: dict[float, Queries] = {}
        self._margins: dict[float, float] = {}
        for level in CAUTION:  # so that the first replan does not wait for it
            with suppress(PushplanError):
                self.queries(level)

    def first(self) -> PlanResult:
        """Return the plan to begin with, made as `pushplan.plan` does: the most cautious there is."""
        found = None
        for level in CAUTION:
            try:
                found = plan(self._careful(level), tell=self._tell)
            except PushplanError:
                if level == CAUTION[-1]:
                    raise
            else:
                if found.solved:
                    break
        assert found is not None
        return found

    def rehearse(self, path: PushPath) -> None:
        """Plan once from the middle of a path, so that compiled code is there when time counts."""
        self.replan(0.0, path.poses_at([0.5 * path.cost])[0], path, self._slides)

    def queries(self, level: float) -> Queries:
        """Return what answers questions about the chain, with a share of the friction's uncertainty.

        Raises:
            EmptyStableSetError: When no twist keeps every contact.
        """
        if level not in self._queries:
            scenario = replace(self._careful(level), trajectory="exact")
            margin = self._margins.get(
                level
            )  # what `auto` comes to is not worked out again for a chain that slid
            made = Queries(
                scenario, margin=margin, tell=self._tell, meridians=MERIDIANS, rate=self._settings.rate
            )
            self._queries[level], self._margins[level] = made, made.margin
        return self._queries[level]

    def _careful(self, level: float) -> Scenario:
        settings = self._settings
        scenario = with_chain(self._scenario, self.chain)
        return cautious(scenario, level * settings.friction, level * settings.position_slack)

    def take_obstacles(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Take over what is in the way now; stable sets and controls are kept."""
        self._scenario = replace(self._scenario, obstacles=obstacles)
        self._queries = {level: queries.with_obstacles(obstacles) for level, queries in self._queries.items()}

    def reason_to_replan(self, poses: FloatArray, rest: float) -> str:
        """Return why the rest of a plan is not to be driven on; empty if it is.

        Args:
            poses: (m, 3) of the chain frame in the world, from where it is to the end.
            rest: What is left of the path's cost, m.
        """
        hit = find_collision(with_chain(self._scenario, self.chain), poses)
        if hit is not None:
            return f"the way is not free any more: {hit}"
        goals = self.aim.exact(self.chain)[None]
        shortest = min(float(queries.reach(poses[0], goals)[0, 0]) for queries in self._queries.values())
        if shortest < (1.0 - BETTER) * rest - STOP:
            return f"there is a way of {shortest:.2f} m now instead of {rest:.2f} m"
        return ""

    def believe(self, slides: FloatArray) -> None:
        """Take over how far objects have slid (n,), m.

        Raises:
            ChainError: When one has slid off.
        """
        lengths = np.array([contact.length for contact in self._scenario.chain.contacts])
        chain = slid(self._scenario.chain, slides)
        if (np.abs(slides - self._slides) > SAME * lengths).any():
            self._slides, self._queries = slides, {}
        self.chain = chain

    def replan(
        self, now: float, start: FloatArray, previous: PushPath | None, slides: FloatArray, attempt: int = 0
    ) -> Replan:
        """Return a plan from a pose (3,) of the chain frame to the goal, or within its tolerances if that is far.

        Trajectories stop at every corner, which takes half as long to work out as blending it.

        Args:
            now: For the record.
            start: Where the plate is.
            previous: The rest of it is the first candidate.
            slides: (n,) how far the objects have slid, m.
            attempt: Number of attempts from here so far: every one has another caution and, in the end, seed.
        """
        began = time.process_time()
        reason, result = "", None
        try:
            self.believe(slides)
            result = self._planned(start, previous, attempt)
            reason = result.reason
        except PushplanError as error:
            reason = str(error)
        return Replan(now, result, reason, time.process_time() - began)

    def _planned(self, start: FloatArray, previous: PushPath | None, attempt: int) -> PlanResult:
        queries = self.queries(CAUTION[attempt % len(CAUTION)])
        return queries.plan(
            start,
            self._goal(queries, start),
            seed=1 + attempt // len(CAUTION),
            time_limit=self._settings.time_limit,
            iterations=ITERATIONS,
            previous=previous,
            explain=False,
        )

    def _goal(self, queries: Queries, start: FloatArray) -> FloatArray:
        """Return the exact goal, or the one within the tolerances that is the least way away if that is far less."""
        goals = self.aim.candidates(self.chain)
        goals = goals[[max(pose_error(goal, start)) > 1e-6 for goal in goals]]
        ways = queries.reach(start, goals)[0]
        nearest = int(np.argmin(ways))
        if not np.isfinite(ways[nearest]) or ways[0] <= ways[nearest] + DETOUR:
            return np.asarray(goals[0])
        return np.asarray(goals[nearest])
