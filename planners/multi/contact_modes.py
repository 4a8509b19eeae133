"""Contact modes: where the plate can push a load from, each a push problem of its own with its own stable set."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pushplan.errors import ChainError, EmptyStableSetError, TippingError
from pushplan.geometry import se2
from pushplan.mechanics.faces import Place, places, pushed_from
from pushplan.planners.controls import margins_to_try, straight_pushes
from pushplan.planners.problem import Controls, Posing
from pushplan.plans.load import Load
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ContactMode:
    """A contact of the plate with a load, kept during a push.

    Attributes:
        place: Of the plate on the load.
        load: Pushed from there: the chain frame of its problem has its origin at this contact's middle.
        stable: The set of twists that keep every contact, by that frame.
        margins: To plan with, one after the other until there is a plan.
        robot: (3,) pose in that frame of the robot's frame: the chain frame of the scenario while the plate pushes
            the load as stated there. It lies beside by y only.
    """

    place: Place
    load: Load
    stable: StableSet
    margins: tuple[float, ...]
    robot: FloatArray
    posing: Posing = field(default_factory=Posing)

    @classmethod
    def of(cls, scenario: Scenario, place: Place, settings: PlanSettings) -> ContactMode:
        """Return the mode of a place of the plate.

        Raises:
            ChainError: When the robot cannot be there.
            EmptyStableSetError: When no twist is stable there.
        """
        chain = pushed_from(scenario.chain, place)
        load = Load.pushed_from(scenario, chain, place.face, place.offset)
        stable = load.stable_set(settings.set_name)
        robot = se2.compose(chain.pusher.plate_pose, se2.inverse(scenario.chain.pusher.plate_pose))
        mode = cls(place, load, stable, margins_to_try(load.problem, stable), robot)
        mode.controls(mode.margins[-1])
        return mode

    def of_twin(self, scenario: Scenario) -> ContactMode:
        """Return the same of a load that differs in name and place only."""
        return replace(self, load=self.load.of_twin(scenario))

    def margin(self, level: int) -> float:
        """Return the margin of a level, which counts what was tried before."""
        return self.margins[min(level, len(self.margins) - 1)]

    def controls(self, margin: float) -> Controls:
        """Return what the robot can do with a margin; made once.

        Raises:
            EmptyStableSetError: When no twist is stable for its drive.
        """
        return self.posing.controls(self.load.problem.with_margin(margin), self.stable)

    def settling(self, margin: float) -> FloatArray | None:
        """Return the twist (3,) of the straight push that every push begins with; None where none is stable."""
        straight = straight_pushes(self.controls(margin).segments)
        if not len(straight):
            return None
        if self._holds_ahead(margin):
            return np.array([1.0, 0.0, 0.0])
        return np.append(straight[np.argmax(straight[:, 0])], 0.0)

    def _holds_ahead(self, margin: float) -> bool:
        """Tell whether the push along the normal is stable, and one that the drive can make."""
        axle = self.load.chain.pusher.drive.axle
        able = axle is None or abs(np.sin(axle[2])) < 1e-12
        return able and float(self.stable.margin(np.array([[1.0, 0.0, 0.0]]))[0]) > margin


def find_modes(scenario: Scenario, settings: PlanSettings) -> tuple[ContactMode, ...]:
    """Return the contacts that the plate may take and that can push the load at all.

    Raises:
        EmptyStableSetError: When there are none.
    """
    found, why = [], []
    for place in places(scenario.chain, scenario.transport.faces, scenario.transport.offsets):
        try:
            found.append(ContactMode.of(scenario, place, settings))
        except (EmptyStableSetError, ChainError, TippingError) as error:
            why.append(f"{place.face}: {error}")
    if not found:
        reason = "; ".join(why) or "the plate fits on none of the faces that it may choose"
        raise EmptyStableSetError(f"no contact can push the load: {reason}")
    return tuple(found)
