"""What a plan needs at each of its times: twists that keep the contacts, and objects at their places."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from pushplan.mechanics.body import Body
from pushplan.plans.result import PlanResult
from pushplan.plans.segment import Segment
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import BoolArray, FloatArray
from pushplan.util.names import RETREAT

SHARE = 0.5
"""Of its margin that a plan keeps while errors are corrected."""


class Contacts(ABC):
    """What touches what, at each time of a plan."""

    @abstractmethod
    def keep(self, twists: FloatArray, time: float) -> BoolArray:
        """Tell which twists (k, 3) of the robot's frame keep the contacts that there are at a time."""

    @abstractmethod
    def load_pose(self, robot_pose: FloatArray, time: float) -> FloatArray:
        """Return the pose (3,) of the objects' frame with the robot's frame at a pose (3,)."""

    @property
    @abstractmethod
    def carried(self) -> tuple[Body, ...]:
        """What is fixed to the robot's frame all the time."""


class OnePush(Contacts):
    """The plate never leaves the chain; the robot's frame is the chain frame.

    Args:
        scenario: The problem.
        plan: Its plan.
        stable: The set of the plan.
    """

    def __init__(self, scenario: Scenario, plan: PlanResult, stable: StableSet) -> None:
        self._stable, self._bodies = stable, scenario.chain.bodies
        self._margin = SHARE * max(0.0, plan.min_margin or 0.0)

    def keep(self, twists: FloatArray, time: float) -> BoolArray:
        """See `Contacts`."""
        return keeping(self._stable, twists, self._margin)

    def load_pose(self, robot_pose: FloatArray, time: float) -> FloatArray:
        """See `Contacts`."""
        return robot_pose

    @property
    def carried(self) -> tuple[Body, ...]:
        """See `Contacts`."""
        return self._bodies


class SeveralPushes(Contacts):
    """The plate comes and goes: each push has a contact, with a stable set of its own.

    Args:
        scenario: The problem.
        segments: Of its plan, timed.
        stable_set: Name of the plan's stable set.
    """

    def __init__(self, scenario: Scenario, segments: Sequence[Segment], stable_set: str) -> None:
        from pushplan.several.modes import find_modes
        from pushplan.several.segments import mode_of

        modes = find_modes(scenario, stable_set)
        self._segments, self._chain = tuple(segments), scenario.chain
        self._ends = np.array([segment.t1 for segment in segments])
        self._sets = [mode_of(segment, modes).stable if segment.pushes else None for segment in segments]

    def keep(self, twists: FloatArray, time: float) -> BoolArray:
        """See `Contacts`; alone the robot may move as it likes, but for backing off a load that it touches."""
        i = self._at(time)
        segment, stable = self._segments[i], self._sets[i]
        if stable is None:
            return np.full(len(twists), segment.kind != RETREAT)
        return keeping(stable, segment.of_path(twists), SHARE * segment.margin)

    def load_pose(self, robot_pose: FloatArray, time: float) -> FloatArray:
        """See `Contacts`."""
        (pose,) = self._segments[self._at(time)].load_at(robot_pose[None])
        return np.asarray(pose)

    @property
    def carried(self) -> tuple[Body, ...]:
        """See `Contacts`."""
        return self._chain.carried

    def _at(self, time: float) -> int:
        return min(int(np.searchsorted(self._ends, time, side="right")), len(self._segments) - 1)


def keeping(stable: StableSet, twists: FloatArray, margin: float) -> BoolArray:
    """Tell which twists (k, 3) have at least a margin; what rests keeps everything."""
    fine = np.ones(len(twists), dtype=bool)
    moving = np.abs(twists).max(axis=1) > 0.0
    fine[moving] = stable.margin(twists[moving]) >= margin
    return fine
