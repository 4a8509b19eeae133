"""Contact modes: the contacts at which the plate can push a load. Each has its own problem and stable set."""

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
        place: Place of the plate on the load.
        load: The load as it is pushed here. The origin of its chain frame is the middle of this contact.
        stable: Stable set of this contact, in that chain frame.
        margins: Margins to plan with, in the order in which they are tried.
        robot: (3,) pose of the robot's frame in that chain frame. The robot's frame is the chain frame of the
            scenario for a push at the nominal contact. The two frames differ only in y.
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
            ChainError: If the robot cannot be there.
            EmptyStableSetError: If no twist is stable there.
        """
        chain = pushed_from(scenario.chain, place)
        load = Load.pushed_from(scenario, chain, place.face, place.offset)
        stable = load.stable_set(settings.set_name)
        robot = se2.compose(chain.pusher.plate_pose, se2.inverse(scenario.chain.pusher.plate_pose))
        mode = cls(place, load, stable, margins_to_try(load.problem, stable), robot)
        mode.controls(mode.margins[-1])
        return mode

    def of_twin(self, scenario: Scenario) -> ContactMode:
        """Return the mode for a load that differs only in name and pose."""
        return replace(self, load=self.load.of_twin(scenario))

    def margin(self, level: int) -> float:
        """Return the margin after `level` larger margins were tried."""
        return self.margins[min(level, len(self.margins) - 1)]

    def controls(self, margin: float) -> Controls:
        """Return the robot's controls for a margin; cached.

        Raises:
            EmptyStableSetError: If no twist is stable for its drive.
        """
        return self.posing.controls(self.load.problem.with_margin(margin), self.stable)

    def settling(self, margin: float) -> FloatArray | None:
        """Return the twist (3,) of the straight push that begins every push; None if no straight push is stable."""
        straight = straight_pushes(self.controls(margin).segments)
        if not len(straight):
            return None
        if self._holds_ahead(margin):
            return np.array([1.0, 0.0, 0.0])
        return np.append(straight[np.argmax(straight[:, 0])], 0.0)

    def _holds_ahead(self, margin: float) -> bool:
        """Return whether the push along the contact normal is stable and feasible for the drive."""
        axle = self.load.chain.pusher.drive.axle
        able = axle is None or abs(np.sin(axle[2])) < 1e-12
        return able and float(self.stable.margin(np.array([[1.0, 0.0, 0.0]]))[0]) > margin


def find_modes(scenario: Scenario, settings: PlanSettings) -> tuple[ContactMode, ...]:
    """Return the allowed contacts that can push the load.

    Raises:
        EmptyStableSetError: If there are none.
    """
    found, why = [], []
    for place in places(scenario.chain, scenario.transport.faces, scenario.transport.offsets):
        try:
            found.append(ContactMode.of(scenario, place, settings))
        except (EmptyStableSetError, ChainError, TippingError) as error:
            why.append(f"{place.face}: {error}")
    if not found:
        reason = "; ".join(why) or "the plate fits on none of the allowed faces"
        raise EmptyStableSetError(f"no contact can push the load: {reason}")
    return tuple(found)
