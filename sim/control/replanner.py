"""Plans from where the objects are: for the chain as it is believed to be, within a time limit."""

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
"""Shares of what frictions may be off, of the room beside obstacles, and of the margin, that a plan is made for."""
BOLD: Caution = (0.0, 0.0, 1.0)
CAUTION: tuple[Caution, ...] = ((1.0, 0.4, 1.0), (0.5, 0.2, 1.0), BOLD)
"""What plans on the way are made for, one after the other until there is one."""
WARY: tuple[Caution, ...] = ((1.0, 0.4, 1.0), (1.0, 0.2, 1.0), (1.0, 0.0, 1.0))
"""What they are made for where contacts have slid again and again, and the plate may push from elsewhere."""
OFTEN = 2
"""So often an object has slid where its contact is taken to grip less than the plan believes, and not to be hit."""
LOWER = tuple((friction, room, margin) for friction, room, _ in CAUTION for margin in (0.5, 0.25))
"""What plans to the goal itself are made for where all others fail and a margin may be lowered."""
NEARBY = tuple((friction, room, margin) for friction, room, _ in CAUTION for margin in (1.0, 0.5, 0.25))
"""What plans that end beside the goal are made for: an automatic margin is halved as that of a first plan is."""
FIRST: Caution = (1.0, 1.0, 1.0)
"""What the plan to begin with is made for before these; on the way, a load may be nearer to an obstacle than that."""
MERIDIANS = 96
"""Meridians of the stable set that controls are taken from: plans without haste take five times as many."""
BETTER, STOP = 0.1, 0.1
"""Share of a path's cost, and way (m) that a stop is worth, by which another way has to be shorter."""
ITERATIONS = 10_000
"""Of the search of a plan, a few hundredths of a second: where they, not the time limit, end it, runs repeat."""
SAME = 5e-4
"""Slide (m) up to which it is the same chain: another one meets obstacles elsewhere. Its planners take 0.01 s."""
ATTEMPTS = 24
"""Replans in a row that may find nothing."""
BARELY = 0.9
"""Share of the tolerances by which a plan beside the goal is to end within them: the rest is for what is off then."""
CLEARLY = 0.8
"""Share of the tolerances up to which nothing need be better."""
GAIN = 0.2
"""Share of the tolerances that a plan which does not reach the goal has to come nearer to it by."""
INTERVAL_SETS = ("ecof", "robust")
"""Stable sets that hold for intervals of floor friction."""


@dataclass(frozen=True)
class Near:
    """What will do where no path reaches the goal.

    Attributes:
        travel: Of the plate, m, at most.
        share: Of the tolerances that is left, at most.
    """

    travel: float
    share: float


class Replanner:
    """Plans for a chain whose objects slide and whose friction is known roughly.

    Args:
        scenario: What the chain is believed to be at first, the room, and the goal.
        settings: See there.
        observer: Takes messages about what takes long.
        lowers: Whether planners chose the scenario's margin, and may lower it where there is no other plan.

    Attributes:
        wary: Whether plans are made for the least friction only.
        aim: What counts as the goal.
        chain: As it is believed to be, with the objects where they have slid to.
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
        for level in CAUTION:  # so that the first replan does not wait for it
            with suppress(PushplanError):
                self.planner(level)

    def first(self) -> Plan:
        """Return the plan to begin with, made as `pushplan.plan` does: the most cautious there is."""
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
        """Plan once from the middle of a path, so that planners are prepared when time counts."""
        self.replan(0.0, path.poses_at([0.5 * path.cost])[0], path, self._slides)

    def planner(self, level: Caution) -> Planner:
        """Return a planner for the chain.

        Raises:
            EmptyStableSetError: When no twist keeps every contact.
        """
        if level not in self._planners:
            scenario = replace(self._careful(level), trajectory="exact")
            # What `auto` comes to is not worked out again for a chain that slid.
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
        """Take over what is in the way now; stable sets and controls are kept."""
        self._scenario = replace(self._scenario, obstacles=obstacles)
        self._planners = {level: planner.with_obstacles(obstacles) for level, planner in self._planners.items()}

    def reason_to_replan(self, poses: FloatArray, rest: float) -> str:
        """Return why the rest of a plan is not to be driven on; empty if it is.

        Args:
            poses: (m, 3) of the chain frame in the world, from where it is to the end.
            rest: What is left of the path's cost, m.
        """
        if len(poses) < 2:
            return ""
        hit = find_collision(with_chain(self._scenario, self.chain), poses)
        if hit is not None:
            return f"the way is not free any more: {hit}"
        goals = self.aim.exact(self.chain)[None]
        planners = [planner for level, planner in self._planners.items() if level in CAUTION]
        shortest = min(float(planner.reach(poses[0], goals)[0, 0]) for planner in planners)
        if shortest < (1.0 - BETTER) * rest - STOP:
            return f"there is a way of {shortest:.2f} m now instead of {rest:.2f} m"
        return ""

    def believe(self, slides: FloatArray) -> None:
        """Take over how far objects have slid (n,), m.

        Raises:
            ChainError: When one has slid off.
        """
        chain = slid(self._scenario.chain, slides)
        if (np.abs(slides - self._slides) > SAME).any():
            self._slides, self._planners = slides, {}
        self.chain = chain

    def could_be_nearer(self, poses: FloatArray, slides: FloatArray) -> bool:
        """Tell whether objects that have slid (n,), m, could stand much nearer to the goal than at poses (n, 3)."""
        try:
            best = self.aim.best(slid(self._scenario.chain, slides))
        except ChainError:
            return True
        return bool(self.aim.share(poses) - best > 1.0 - CLEARLY)

    def best(
        self, now: float, start: FloatArray, previous: PushPath | None, slides: FloatArray, most: float, left: float
    ) -> list[Replan]:
        """Return attempts to plan, of which the last one counts.

        It is the most cautious plan that reaches the goal with no more travel than it may take; or where there is
        none, the one that comes nearest with so much; or the shortest.

        Args:
            now: See `replan`, as of the next three.
            start: See there.
            previous: See there.
            slides: See there.
            most: Travel that a plan may take, m.
            left: Share of the tolerances that a plan may leave where none reaches the goal.
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
        # Contacts are risked where nothing else brings the objects within the tolerances.
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
        """Return a plan from a pose (3,) of the chain frame to the goal, or within its tolerances if that is far.

        Trajectories stop at every corner, which takes half as long to work out as blending it.

        Args:
            now: For the record.
            start: Where the plate is.
            previous: The rest of it is the first candidate.
            slides: (n,) how far the objects have slid, m.
            level: What it is made for.
            near: What will do in place of the goal: the plan ends as near to that as a steering path leads.
            seed: Of the search.
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
        """Return the exact goal, or the one within the tolerances that is the least way away if that is far less."""
        goals = self.aim.candidates(self.chain)
        goals = goals[[max(pose_error(goal, start)) > 1e-6 for goal in goals]]
        ways = planner.reach(start, goals)[0]
        nearest = int(np.argmin(ways))
        if not np.isfinite(ways[nearest]) or ways[0] <= ways[nearest] + DETOUR:
            return np.asarray(goals[0])
        return np.asarray(goals[nearest])

    def _beside(self, planner: Planner, start: FloatArray, near: Near) -> FloatArray:
        """Return the pose nearest to the goal that a steering path leads to.

        Raises:
            PlanningError: When that leaves too much.
        """

        def reach(goals: FloatArray) -> FloatArray:
            ways = planner.reach(start, goals)[0]
            return np.where(ways <= near.travel, ways, np.inf)

        found = self.aim.nearest(self.chain, reach)
        if found is None or self.aim.share(compose(found, self.chain.places)) > near.share:
            raise PlanningError("no plan was found in time, and no path leads near enough to the goal")
        return found


def cautious(scenario: Scenario, share: float, room: float = 0.0) -> Scenario:
    """Return the scenario with every coefficient of friction off by up to a share; one with intervals keeps them.

    Of objects that stand apart and of a row it is the least friction of contacts.

    Args:
        scenario: What is believed.
        share: From 0 to below 1.
        room: Clearance to keep at least, m.
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
    """Return the scenario with another chain; where it states intervals, they hold for that."""
    interval = None if scenario.interval is None else replace(scenario.interval, chain=chain)
    return scenario.with_load(chain=chain, interval=interval)


def planned_for_least(scenario: Scenario, friction: float, make: Callable[[Scenario], Plan]) -> Plan:
    """Return a plan of several pushes that is made for a friction of contacts that is less by a share.

    Its loads and its scenario are those that are believed: what follows it plans with caution of its own.
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
    """Tell whether contacts hold in all pushes of a plan with a friction that is less by a share."""
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
    """Return a plan of several pushes: for the least friction if there is one that brings as many objects."""
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
    """Return the plan to begin with, the given one or one that is made, and what replans a single push.

    Raises:
        PlanningError: When there is no plan.
        SupportError: When the load under an object is not known.
    """
    SlipSimulator(World.from_scenario(scenario))  # before anything takes long: loads have to be known
    replanner = Replanner(scenario, settings, observer) if scenario.task.held else None
    found = given
    if found is None:
        found = first_of_several(scenario, settings, observer) if replanner is None else replanner.first()
    if found.trajectory is None:
        raise PlanningError(f"there is no plan to begin with: {found.reason}")
    if replanner is not None and found.path is not None:
        replanner.rehearse(found.path)
    return found, replanner
