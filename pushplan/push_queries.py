"""Many questions about several pushes of one load in one room: what is known of them is kept."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PlanningError
from pushplan.plan import settled
from pushplan.plans.result import PlanResult
from pushplan.scenario.build import troubles_at_first
from pushplan.scenario.model import Goal, Obstacle, Scenario
from pushplan.several.plan import Asked, plan_pushes
from pushplan.several.prepared import Prepared
from pushplan.several.warm import warm_up_several
from pushplan.util.arrays import FloatArray
from pushplan.util.stopwatch import Stopwatch


class PushQueries:
    """Plans of several pushes between many places of one load and one robot in one room.

    Contacts, stable sets, scenes and ways around the load are kept from one question to the next.

    Args:
        scenario: With a `robot.start`: load, room and settings. Its start, goals and place of the robot do not
            matter.
        margin: What the twists' margins have to exceed; None stands for that of the scenario.
        tell: Called with sentences for the user about what takes long.

    Attributes:
        scenario: With which the questions are asked.

    Raises:
        PlanningError: When the scenario asks for a single push.
        EmptyStableSetError: When no contact can push the load.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        margin: float | Literal["auto"] | None = None,
        tell: Callable[[str], None] | None = None,
    ) -> None:
        if scenario.pushes is None:
            raise PlanningError(
                "the scenario asks for a single push: it has no robot.start; allowed: Queries"
            )
        warm_up_several(tell, scenario.stability.set, scenario.interval is not None)
        self.scenario = settled(scenario, None, margin)
        self._prepared = Prepared.of(self.scenario)
        self._prepared.room(0)

    def plan(
        self,
        robot: ArrayLike,
        start: ArrayLike,
        goals: ArrayLike,
        *,
        first: bool = True,
        seed: int | None = None,
        time_limit: float | None = None,
    ) -> PlanResult:
        """Return a plan of several pushes, timed, executed and checked.

        Args:
            robot: (3,) pose of the plate's frame in the world.
            start: (3,) pose of the chain frame of the load.
            goals: (g, 3) likewise, any of which will do.
            first: Stop at the first plan.
            seed: Of the random numbers; None stands for that of the scenario.
            time_limit: Seconds; None stands for that of the scenario.

        Raises:
            PlanningError: When robot or load are not free where they are, no goal is, or poses are none.
        """
        began = time.perf_counter()
        pushes, stated = self.scenario.pushes, self.scenario.goal
        assert pushes is not None
        tolerance = (stated.position_tolerance, stated.angle_tolerance)
        asked = replace(
            self.scenario,
            start=_poses(start, "start")[0],
            pushes=replace(
                pushes,
                robot_start=_poses(robot, "robot")[0],
                goals=tuple(Goal(pose, None, pose, *tolerance) for pose in _poses(goals, "goals")),
            ),
        )
        wrong = [text for _, text in troubles_at_first(asked)]
        if wrong:
            raise PlanningError("; ".join(wrong))
        return plan_pushes(self._prepared.asked(asked), Asked(seed, time_limit, first), Stopwatch(), began)

    def with_obstacles(self, obstacles: Iterable[Obstacle]) -> PushQueries:
        """Return queries with other obstacles; what does not depend on them is kept."""
        other: PushQueries = object.__new__(PushQueries)
        other.scenario = replace(self.scenario, obstacles=tuple(obstacles))
        other._prepared = self._prepared.with_obstacles(other.scenario)
        return other


def _poses(poses: ArrayLike, what: str) -> FloatArray:
    """Return poses as (k, 3) numbers."""
    array = np.array(poses, dtype=np.float64, ndmin=2)
    if array.ndim != 2 or array.shape[1] != 3 or not len(array) or not np.isfinite(array).all():
        raise PlanningError(f"{what} have the shape {array.shape}; allowed: finite poses (k, 3)")
    return array
