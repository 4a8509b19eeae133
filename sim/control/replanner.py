"""Replans of a push from the current poses of the believed chain, within a time limit."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pushplan.errors import ChainError, EmptyStableSetError, PlanningError, PushplanError
from pushplan.geometry.se2 import compose, pose_error
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.perturb import slid, with_contact_friction
from pushplan.planner import Planner, plan
from pushplan.planners.clearance import find_collision
from pushplan.planners.multi.room import DETOUR
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.run import Replan
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.sim.control.aim import Aim
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.robustness import least_robustness
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO

Caution = tuple[float, float, float]
"""Caution of a plan: shares of the friction error, of the clearance from obstacles, and of the margin."""
BOLD: Caution = (0.0, 0.0, 1.0)
CAUTION: tuple[Caution, ...] = ((1.0, 0.4, 1.0), (0.5, 0.2, 1.0), BOLD)
"""Caution of replans, tried in this order."""
WARY: tuple[Caution, ...] = ((1.0, 0.4, 1.0), (1.0, 0.2, 1.0), (1.0, 0.0, 1.0))
"""Caution of replans after repeated slides, if the plate can push from elsewhere."""
OFTEN = 2
"""Number of slides of an object after which its contact is assumed to have the least friction."""
LOWER = tuple((friction, room, margin) for friction, room, _ in CAUTION for margin in (0.5, 0.25))
"""Caution of replans to the exact goal with a lower margin, if all others fail and the margin is automatic."""
NEARBY = tuple((friction, room, margin) for friction, room, _ in CAUTION for margin in (1.0, 0.5, 0.25))
"""Caution of replans that end near the goal; an automatic margin is halved as in a first plan."""
FIRST: Caution = (1.0, 1.0, 1.0)
"""Caution of the first plan, tried before the others; later, a load can be nearer to an obstacle than this allows."""
MERIDIANS = 96
"""Number of meridians of the stable set for controls; plans without a time limit use five times as many."""
BETTER, STOP = 0.1, 0.1
"""Reduction of the path cost that is worth a replan: a share of the cost, plus the cost of a stop (m)."""
ITERATIONS = 10_000
"""Iterations of a search, a few hundredths of a second; if they end it before the time limit, runs are repeatable."""
SAME = 5e-4
"""Largest change of slides (m) for which planners are reused; new planners take 0.01 s."""
ATTEMPTS = 24
"""Largest number of successive replans without a result."""
BARELY = 0.9
"""Share of the tolerances within which a plan near the goal must end; the rest is for errors of its execution."""
CLEARLY = 0.8
"""Share of the tolerances up to which an error needs no improvement."""
GAIN = 0.2
"""Smallest improvement by a plan that does not reach the goal, as a share of the tolerances."""
INTERVAL_SETS = ("ecof", "robust")
"""Stable sets that hold for intervals of floor friction."""


@dataclass(frozen=True)
class Near:
    """Limits of a plan that ends near the goal because no path reaches it.

    Attributes:
        travel: Largest travel of the plate, m.
        share: Largest remaining error as a share of the tolerances.
    """

    travel: float
    share: float


class Replanner:
    """Replans for a chain whose objects slide and whose friction is known roughly.

    Args:
        scenario: Scenario with the initial chain, the room, and the goal.
        settings: Settings of the controller.
        observer: Receiver of messages about slow steps.
        lowers: Whether the scenario's margin is automatic, so that it can be lowered if there is no other plan.

    Attributes:
        wary: Whether all plans assume the least friction.
        aim: Goal poses and tolerances.
        chain: Believed chain with the current slides.
    """

    def __init__(
        self, scenario: Scenario, settings: ControlSettings, observer: Observer, lowers: bool = False
    ) -> None:
        self._scenario, self._settings, self._observer = scenario, settings, observer
        self._lowers, self.wary = lowers, False
        self.aim = Aim.of(scenario.goal, scenario.chain, settings.position_tolerance, settings.angle_tolerance)
        self.chain, self._slides = scenario.chain, np.zeros(len(scenario.chain.contacts))
        self._planners: dict[Caution, Planner] = {}
        self._margins: dict[Caution, float] = {}
        for level in CAUTION:  # prepare the planners now, so that the first replan is fast
            with suppress(PushplanError):
                self.planner(level)

    def first(self) -> Plan:
        """Return the first plan from `pushplan.plan`: the most cautious one that exists."""
        found = None
        for level in (FIRST, *CAUTION):
            try:
                found = plan(self._careful(level), observer=self._observer)
            except PushplanError:
                if level == CAUTION[-1]:
                    raise
            else:
                if found.solved:
                    break
        assert found is not None
        return found

    def rehearse(self, path: PushPath) -> None:
        """Plan once from the middle of a path, to prepare the planners before time counts."""
        self.replan(0.0, path.poses_at([0.5 * path.cost])[0], path, self._slides)

    def planner(self, level: Caution) -> Planner:
        """Return the planner for the chain with a level of caution.

        Raises:
            EmptyStableSetError: If no twist keeps every contact.
        """
        if level not in self._planners:
            scenario = replace(self._careful(level), trajectory="exact")
            # Reuse the automatic margin after slides of the chain.
            margin = self._margins.get(level)
            if margin is None and level[2] < 1.0:
                margin = level[2] * self.planner((*level[:2], 1.0)).margin
            wanted = PlanSettings(margin=margin, observer=self._observer)
            made = Planner(scenario, settings=wanted, meridians=MERIDIANS, rate=self._settings.rate)
            self._planners[level], self._margins[level] = made, made.margin
        return self._planners[level]

    def _careful(self, level: Caution) -> Scenario:
        settings = self._settings
        scenario = with_chain(self._scenario, self.chain)
        return cautious(scenario, level[0] * settings.friction, level[1] * settings.room)

    def take_obstacles(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Set the obstacles; stable sets and controls are reused."""
        self._scenario = replace(self._scenario, obstacles=obstacles)
        self._planners = {level: planner.with_obstacles(obstacles) for level, planner in self._planners.items()}

    def reason_to_replan(self, poses: FloatArray, rest: float) -> str:
        """Return the reason to leave the rest of a plan; empty without one.

        Args:
            poses: Poses of the chain frame in the world on the rest of the path, (m, 3).
            rest: Cost of the rest of the path, m.
        """
        if len(poses) < 2:
            return ""
        hit = find_collision(with_chain(self._scenario, self.chain), poses)
        if hit is not None:
            return f"the path is blocked: {hit}"
        goals = self.aim.exact(self.chain)[None]
        planners = [planner for level, planner in self._planners.items() if level in CAUTION]
        shortest = min(float(planner.reach(poses[0], goals)[0, 0]) for planner in planners)
        if shortest < (1.0 - BETTER) * rest - STOP:
            return f"there is now a path of {shortest:.2f} m instead of {rest:.2f} m"
        return ""

    def believe(self, slides: FloatArray) -> None:
        """Set the slides of the objects (n,), m.

        Raises:
            ChainError: If an object has slid off.
        """
        chain = slid(self._scenario.chain, slides)
        if (np.abs(slides - self._slides) > SAME).any():
            self._slides, self._planners = slides, {}
        self.chain = chain

    def could_be_nearer(self, poses: FloatArray, slides: FloatArray) -> bool:
        """Return whether objects with slides (n,), m, could be much nearer to the goal than at poses (n, 3)."""
        try:
            best = self.aim.best(slid(self._scenario.chain, slides))
        except ChainError:
            return True
        return bool(self.aim.share(poses) - best > 1.0 - CLEARLY)

    def best(
        self, now: float, start: FloatArray, previous: PushPath | None, slides: FloatArray, most: float, left: float
    ) -> list[Replan]:
        """Return the attempts to plan; the last one is the result.

        It is the most cautious plan that reaches the goal within the largest travel. Without one, it is the plan that
        comes nearest within this travel, or else the shortest.

        Args:
            now: Time of the record, s.
            start: Pose of the chain frame, (3,).
            previous: Current path; its rest is the first candidate.
            slides: Slides of the objects, m, (n,).
            most: Largest travel, m.
            left: Largest remaining error, as a share of the tolerances, if no plan reaches the goal.
        """
        missed: list[Replan] = []
        solved: list[tuple[float, Replan]] = []
        levels = WARY if self.wary else CAUTION
        for attempt in range(ATTEMPTS):
            level = levels[attempt % len(levels)]
            replan = self.replan(now, start, previous, slides, level, seed=1 + attempt // len(levels))
            if replan.result is None or replan.result.path is None:
                missed.append(replan)
            else:
                solved.append((replan.result.segments[0].path.travel, replan))
            if solved and (solved[-1][0] <= most or attempt >= len(levels) - 1):
                break
        shortest = min(solved, key=lambda one: one[0], default=None)
        if shortest is not None and shortest[0] <= most:
            return [*missed, next(replan for travel, replan in solved if travel <= most)]
        here = float(self.aim.share(compose(start, self.chain.places)))
        near, beside = Near(most, min(left, here - GAIN)), list[tuple[float, Replan]]()
        # Lower the margin only if nothing else brings the objects within the tolerances.
        risks = here > 1.0 and left > 1.0 and self._scenario.stability.margin == AUTO
        for level in NEARBY if risks else levels:
            replan = self.replan(now, start, previous, slides, level, near)
            if replan.result is None or replan.result.path is None:
                missed.append(replan)
                continue
            end = compose(replan.result.path.end, self.chain.places)
            beside.append((float(self.aim.share(end)), replan))
            if beside[-1][0] <= BARELY:
                break
        if self._lowers and not solved and min((left for left, _ in beside), default=np.inf) > 1.0:
            for level in LOWER:
                replan = self.replan(now, start, previous, slides, level)
                if replan.result is not None and replan.result.path is not None:
                    return [*missed, replan]
                missed.append(replan)
        if beside:  # the most cautious that ends within the tolerances, or else the nearest
            return [*missed, min(beside, key=lambda one: one[0])[1]]
        return missed if shortest is None else [*missed, shortest[1]]

    def replan(
        self,
        now: float,
        start: FloatArray,
        previous: PushPath | None,
        slides: FloatArray,
        level: Caution = CAUTION[0],
        near: Near | None = None,
        seed: int = 1,
    ) -> Replan:
        """Return a plan from a pose (3,) of the chain frame to the goal, or to a pose within its tolerances.

        Trajectories stop at every corner, which halves the computing time compared with blends.

        Args:
            now: Time of the record, s.
            start: Pose of the chain frame, (3,).
            previous: Current path; its rest is the first candidate.
            slides: Slides of the objects, m, (n,).
            level: Caution of the plan.
            near: Limits of a plan that ends as near to the goal as a steering path leads; None for the goal itself.
            seed: Seed of the search.
        """
        began = time.process_time()
        reason, result = "", None
        try:
            self.believe(slides)
            planner = self.planner(level)
            result = planner.plan(
                start,
                self._goal(planner, start) if near is None else self._beside(planner, start, near),
                seed=seed,
                time_limit=self._settings.time_limit,
                iterations=ITERATIONS,
                previous=previous,
                explain=False,
            )
            reason = result.reason
        except PushplanError as error:
            reason = str(error)
        return Replan(now, result, reason, time.process_time() - began)

    def _goal(self, planner: Planner, start: FloatArray) -> FloatArray:
        """Return the exact goal, or the nearest pose within the tolerances if its path is much shorter."""
        goals = self.aim.candidates(self.chain)
        goals = goals[[max(pose_error(goal, start)) > 1e-6 for goal in goals]]
        ways = planner.reach(start, goals)[0]
        nearest = int(np.argmin(ways))
        if not np.isfinite(ways[nearest]) or ways[0] <= ways[nearest] + DETOUR:
            return np.asarray(goals[0])
        return np.asarray(goals[nearest])

    def _beside(self, planner: Planner, start: FloatArray, near: Near) -> FloatArray:
        """Return the pose nearest to the goal that a steering path reaches.

        Raises:
            PlanningError: If the remaining error is too large.
        """

        def reach(goals: FloatArray) -> FloatArray:
            ways = planner.reach(start, goals)[0]
            return np.where(ways <= near.travel, ways, np.inf)

        found = self.aim.nearest(self.chain, reach)
        if found is None or self.aim.share(compose(found, self.chain.places)) > near.share:
            raise PlanningError("no plan was found in time, and no path leads near enough to the goal")
        return found


def cautious(scenario: Scenario, share: float, room: float = 0.0) -> Scenario:
    """Return the scenario with a relative error of all friction coefficients; intervals of the scenario are kept.

    A multi-push scenario gets the lowest contact friction.

    Args:
        scenario: Believed scenario.
        share: Relative error, from 0 to below 1.
        room: Smallest clearance, m.
    """
    scenario = replace(scenario, clearance=max(scenario.clearance, room))
    least = 1.0 - share
    loads = tuple(
        load if load.interval is not None else replace(load, chain=with_contact_friction(load.chain, least))
        for load in scenario.loads
    )
    goals = tuple(goal.with_friction(least) for goal in scenario.task.goals)
    less = scenario if share == 0.0 else scenario.with_task(loads=loads, goals=goals)
    if share == 0.0 or len(loads) > 1 or scenario.interval is not None or scenario.stability.set not in INTERVAL_SETS:
        return less
    chain = less.chain
    spans = {
        obj.name: ((1.0 - share) * obj.floor_friction, (1.0 + share) * obj.floor_friction) for obj in chain.objects
    }
    return less.with_load(interval=IntervalChain.from_ranges(chain, floor_friction=spans))


def with_chain(scenario: Scenario, chain: Chain) -> Scenario:
    """Return the scenario with another chain, which also gets its intervals."""
    interval = None if scenario.interval is None else replace(scenario.interval, chain=chain)
    return scenario.with_load(chain=chain, interval=interval)


def planned_for_least(scenario: Scenario, friction: float, make: Callable[[Scenario], Plan]) -> Plan:
    """Return a multi-push plan that is made for a contact friction lower by a share.

    Its loads and its scenario have the nominal friction, because the controller adds its own caution.
    """
    made = make(cautious(scenario, friction))
    if friction == 0.0 or any(load.interval is not None for load in scenario.loads):
        return made
    loads = {id(s.load): s.load for s in made.segments if s.load is not None}
    believed: dict[int, Load | None] = {id(None): None}
    for key, load in loads.items():
        chain = with_contact_friction(load.chain, 1.0 / (1.0 - friction))
        believed[key] = Load(load.links, load.problem.with_load(chain=chain, interval=None))
    segments = []
    for segment in made.segments:
        own, least = believed[id(segment.load)], None
        if segment.pushes and segment.min_margin is not None and own is not None:
            least = float(own.stable_set(made.stable_set).margin(segment.contact_path.twists).min())
        segments.append(replace(segment, load=own, min_margin=least))
    robustness = None if made.robustness is None else least_robustness(segments)
    return replace(made, scenario=scenario, segments=tuple(segments), robustness=robustness)


def bears(plan: Plan, friction: float) -> bool:
    """Return whether the contacts hold in all pushes of a plan with a friction lower by a share."""
    for push in plan.pushes:
        problem = push.pushed_load.problem
        less = problem.with_load(chain=with_contact_friction(problem.chain, 1.0 - friction), interval=None)
        try:
            if less.stable_set().margin(push.contact_path.twists).min() <= 0.0:
                return False
        except EmptyStableSetError:
            return False
    return True


def first_of_several(scenario: Scenario, settings: ControlSettings, observer: Observer) -> Plan:
    """Return a multi-push plan, made for the least friction if such a plan delivers as many objects."""
    found = plan(scenario, observer=observer)
    if settings.friction > 0.0 and found.segments:
        with suppress(PushplanError):
            careful = planned_for_least(scenario, settings.friction, partial(plan, observer=observer))
            if careful.segments and len(careful.undelivered) <= len(found.undelivered):
                return careful
    return found


def first_plan(
    scenario: Scenario, given: Plan | None, settings: ControlSettings, observer: Observer
) -> tuple[Plan, Replanner | None]:
    """Return the first plan, given or new, and for a single push its replanner.

    Raises:
        PlanningError: If there is no plan.
        SupportError: If the load under an object is not known.
    """
    SlipSimulator(World.from_scenario(scenario))  # fails early if a load is not known
    replanner = Replanner(scenario, settings, observer) if scenario.task.held else None
    found = given
    if found is None:
        found = first_of_several(scenario, settings, observer) if replanner is None else replanner.first()
    if found.trajectory is None:
        raise PlanningError(f"there is no first plan: {found.reason}")
    if replanner is not None and found.path is not None:
        replanner.rehearse(found.path)
    return found, replanner
