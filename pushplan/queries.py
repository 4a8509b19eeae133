"""Many questions about one chain in one room: what does not depend on start and goal is made once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pushplan.compiled.announcement import announced
from pushplan.errors import PlanningError
from pushplan.kernels import warm_up
from pushplan.plan import settled
from pushplan.planned import Means, Wanted, means_for, planned
from pushplan.planners.ompl.auto import Auto
from pushplan.planners.problem.controls import MERIDIANS
from pushplan.planners.problem.problem import Posing, open_scene
from pushplan.planners.problem.reach import reach as costs_of_words
from pushplan.planners.problem.reach import rejoin
from pushplan.planners.validation.clearance import Room
from pushplan.plans.path import PushPath
from pushplan.plans.result import PlanResult
from pushplan.plans.trajectory import SAMPLE_RATE
from pushplan.scenario.model import Goal, Obstacle, Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.stopwatch import Stopwatch


class Queries:
    """Plans and distances between many poses of one chain in one room.

    Stable set, controls, collision scene and compiled code are kept from one question to the next.

    Args:
        scenario: Chain, room and settings; its start and goal do not matter.
        margin: What the twists' margins have to exceed; None stands for that of the scenario.
        tell: Called with sentences for the user about what takes long.
        meridians: How finely an omnidirectional pusher's controls are taken from the stable set; half as many take
            half the time to make.
        rate: Samples per second of trajectories, at which they are executed and checked.

    Attributes:
        scenario: With which the questions are asked.

    Raises:
        EmptyStableSetError: When no pusher twist keeps every contact.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        margin: float | Literal["auto"] | None = None,
        tell: Callable[[str], None] | None = None,
        meridians: int = MERIDIANS,
        rate: float = SAMPLE_RATE,
    ) -> None:
        self._tell = tell
        warm_up(Auto.name, tell, scenario.stability.set, scenario.interval is not None)
        self.scenario = settled(scenario, None, margin)
        means = means_for(self.scenario, pose=Posing(meridians=meridians))
        self._keep(replace(means, rate=rate))

    def plan(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        *,
        timed: bool = True,
        seed: int | None = None,
        time_limit: float | None = None,
        iterations: int | None = None,
        previous: PushPath | None = None,
        explain: bool = True,
    ) -> PlanResult:
        """Return the first path from one pose to another, checked like every plan.

        Args:
            start: (3,) pose of the chain frame in the world.
            goal: Likewise.
            timed: Make, execute and check the trajectory, as `pushplan.plan` does. Without it the path alone is
                checked, which takes a tenth of the time; `trajectory`, `execution` and `robustness` are None.
            seed: Of the random numbers; None stands for that of the scenario.
            time_limit: Seconds; None stands for that of the scenario.
            iterations: See `pushplan.plan`.
            previous: An earlier path; a way onto it and along its rest, moved so that it ends at the goal, is the
                first candidate, so that a plan that is still good is kept.
            explain: Find out why there is no path where none is found, which takes longer than some searches.

        Raises:
            PlanningError: When a pose is none, too near to something, or both are the same.
        """
        began = time.perf_counter()
        pose = _pose(goal, "goal")
        target = Goal(
            pose, None, pose, self.scenario.goal.position_tolerance, self.scenario.goal.angle_tolerance
        )
        asked = replace(self.scenario, start=_pose(start, "start"), goal=target)
        known = None if previous is None else self._rest(previous, asked)
        wanted = Wanted(
            Auto.name, Auto, seed, time_limit, first=True, iterations=iterations, known=known, explain=explain
        )
        return planned(asked, replace(self._means, timed=timed), wanted, Stopwatch(), began)

    def reach(self, starts: ArrayLike, goals: ArrayLike) -> FloatArray:
        """Return the costs (n, m) of the cheapest exact free words from starts (n, 3) to goals (m, 3), m.

        A word is three stable arcs with the margin that is asked for first. It is inf where none is free, which does
        not say that there is no path; `plan` searches for one.

        Raises:
            PlanningError: When poses are not finite or not (k, 3).
        """
        both = (_poses(starts, "starts"), _poses(goals, "goals"))
        with announced(self._tell):  # plans do without: it is compiled by the first who asks for it
            return np.asarray(costs_of_words(self._scene, self._families, *both, self.scenario.clearance))

    connect = reach
    """The same, by the word of those who build roadmaps."""

    def with_obstacles(self, obstacles: Iterable[Obstacle]) -> Queries:
        """Return queries with other obstacles; the stable set and its controls are kept."""
        other: Queries = object.__new__(Queries)
        other._tell = self._tell
        other.scenario = replace(self.scenario, obstacles=tuple(obstacles))
        pose = self._means.pose.in_room(open_scene(other.scenario))
        other._keep(replace(self._means, room=Room.of(other.scenario), pose=pose))
        return other

    @property
    def stable(self) -> StableSet:
        """The set that questions are planned in."""
        return self._means.stable

    @property
    def margin(self) -> float:
        """The margin that is planned with first."""
        return self._means.margins[0]

    @property
    def twists(self) -> FloatArray:
        """(k, 3) stable twists that words are made of, with the first margin, scaled to a cost rate of 1."""
        twists = np.unique(self._families.reshape(-1, 3), axis=0)
        return np.asarray(twists[np.abs(twists).max(axis=1) > 0.0])

    def _rest(self, previous: PushPath, asked: Scenario) -> FloatArray | None:
        """Return the arcs of a way onto an earlier path and along its rest, None where none is free and stable."""
        stable, least = self._means.stable, self._means.margins[0]
        with announced(self._tell):  # like `reach`
            return rejoin(
                self._scene,
                self._families,
                asked.clearance,
                lambda twists: stable.margin(twists) > least,
                previous,
                asked.start,
                asked.goal.pose_chain,
            )

    def _keep(self, means: Means) -> None:
        """Take over what planning rests on, and make what the first margin needs."""
        asked = self.scenario.with_margin(means.margins[0])
        self._means = means
        self._scene = means.pose.scene(asked)
        self._families = means.pose.controls(asked, means.stable).families


def _pose(pose: ArrayLike, what: str) -> FloatArray:
    return np.asarray(_poses(np.asarray(pose, dtype=np.float64)[None], what)[0])


def _poses(poses: ArrayLike, what: str) -> FloatArray:
    """Return poses as (k, 3) numbers."""
    array = np.array(poses, dtype=np.float64, ndmin=2)
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise PlanningError(f"{what} have the shape {array.shape}; allowed: finite poses (k, 3)")
    return array
