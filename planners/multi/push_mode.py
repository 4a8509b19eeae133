"""What a contact of the plate can do, as the search needs to know it."""

from __future__ import annotations

from dataclasses import dataclass

from pushplan.mechanics.faces import Place
from pushplan.planners.problem.posing import Controls
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PushMode:
    """A contact and what the robot can do with it, keeping a margin.

    Attributes:
        place: Of the plate.
        scenario: The push problem with this contact, its margin a number.
        stable: Its stable set.
        controls: Of the planner.
        robot: (3,) pose of the robot's frame in the contact's chain frame: beside it by y only.
        settling: (3,) twist of the straight push with which every push begins, with a cost rate of 1.
    """

    place: Place
    scenario: Scenario
    stable: StableSet
    controls: Controls
    robot: FloatArray
    settling: FloatArray
