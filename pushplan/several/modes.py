"""The ways to push a load: each contact of the plate is a push problem of its own, with its own stable set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pushplan.errors import ChainError, EmptyStableSetError
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.mechanics.faces import Place, carried_from, places
from pushplan.planners.multi.contact_modes import ContactMode
from pushplan.planners.problem.problem import Controls, Posing
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Mode:
    """A contact of the plate with the load, kept during a push.

    Attributes:
        place: Of the plate.
        scenario: The push problem with this contact: its chain frame has its origin at this contact's middle.
        stable: The set of twists that keep every contact, by that chain frame.
        margins: To plan with, one after the other until there is a plan.
        order: For each object of this chain its index in the scenario's.
        stated: The scenario's own chain.
        robot: (3,) pose in this chain frame of the robot's frame (see `plans.segment`): beside it by y only.
    """

    place: Place
    scenario: Scenario
    stable: StableSet
    margins: tuple[float, ...]
    order: tuple[int, ...]
    stated: Chain
    robot: FloatArray
    contact_mode: ContactMode
    _posing: Posing = field(default_factory=Posing)

    def margin(self, level: int) -> float:
        """Return the margin of a level, which counts what was tried before."""
        return self.margins[min(level, len(self.margins) - 1)]

    @property
    def contact_order(self) -> list[int]:
        """For each contact of the scenario's chain, as it is stated there, its index in this chain.

        Contacts between two objects are the same ones, whoever pushes; the plate's own stands for the plate's.
        """
        stated = self.stated.contacts
        own = [self._between(contact, self.order) for contact in self.scenario.chain.contacts]
        return [own.index(self._between(contact, range(len(self.order)))) for contact in stated]

    def _between(self, contact: Contact, order: Sequence[int]) -> frozenset[int]:
        """The scenario's indices of the objects that a contact lies between; the plate's own: those of the stack."""
        if contact.pusher == PLATE:
            return frozenset(carried_from(self.stated, (order[contact.pushed],)))
        return frozenset({order[contact.pushed], order[contact.pusher]})

    def controls(self, margin: float) -> Controls:
        """Return what the robot can do with a margin; made once.

        Raises:
            EmptyStableSetError: When no twist is stable for its drive.
        """
        return self._posing.controls(self.scenario.with_margin(margin), self.stable)


def find_modes(scenario: Scenario, stable_set: str | None = None) -> tuple[Mode, ...]:
    """Return the contacts that the plate may take and that can push the load at all.

    Raises:
        EmptyStableSetError: When there are none.
    """
    assert scenario.pushes is not None
    found, troubles = [], []
    for place in places(scenario.chain, scenario.pushes.faces, scenario.pushes.offsets):
        try:
            mode = _mode(scenario, place, stable_set)
            mode.controls(mode.margins[-1])
            found.append(mode)
        except (EmptyStableSetError, ChainError) as error:
            troubles.append(f"{place.face}: {error}")
    if not found:
        why = "; ".join(troubles) or "the plate fits on none of the faces that it may choose"
        raise EmptyStableSetError(f"no contact can push the load: {why}")
    return tuple(found)


def _mode(scenario: Scenario, place: Place, stable_set: str | None) -> Mode:
    contact = ContactMode.of(scenario, place, PlanSettings(stable_set=stable_set))
    order = tuple(carried_from(scenario.chain, place.touched))
    return Mode(
        place,
        contact.load.problem,
        contact.stable,
        contact.margins,
        order,
        scenario.chain,
        contact.robot,
        contact,
        contact.posing,
    )
