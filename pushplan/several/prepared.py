"""What is known of a load and a room is kept between plans: contacts, stable sets, words, ways around the load."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pushplan.errors import EmptyStableSetError
from pushplan.planners.multi.room import PushRoom
from pushplan.scenario.model import Scenario
from pushplan.several.modes import Mode, find_modes


@dataclass(frozen=True, eq=False)
class Prepared:
    """What plans of several pushes rest on, the same for many starts and goals.

    Attributes:
        scenario: Load, room and settings; its start, goals and place of the robot do not matter.
        modes: The contacts.
        levels: How many margins can be tried, one after the other.
    """

    scenario: Scenario
    modes: tuple[Mode, ...]
    _rooms: dict[int, PushRoom] = field(default_factory=dict)

    @classmethod
    def of(cls, scenario: Scenario, stable_set: str | None = None) -> Prepared:
        """Return what plans in a scenario rest on.

        Raises:
            EmptyStableSetError: When no contact can push the load.
        """
        return cls(scenario, find_modes(scenario, stable_set))

    @property
    def levels(self) -> int:
        """How many margins can be tried."""
        return max(len(mode.margins) for mode in self.modes)

    def room(self, level: int) -> PushRoom:
        """Return robot, load and contacts among what stands in the room, with the margins of a level.

        Raises:
            EmptyStableSetError: When no contact can be driven up to and push straight ahead.
        """
        if level not in self._rooms:
            room = PushRoom.of(self.scenario, tuple(mode.contact_mode for mode in self.modes), level)
            if not room.contacts:
                raise EmptyStableSetError(
                    "no contact can be used: the robot touches the load elsewhere when it drives up to a face, or no "
                    "straight push is stable; allowed: other pusher.faces or offsets, a smaller stability.margin"
                )
            self._rooms[level] = room
        return self._rooms[level]

    def with_obstacles(self, scenario: Scenario) -> Prepared:
        """Return it for a scenario that differs in what stands in the room."""
        modes = tuple(
            replace(mode, scenario=replace(mode.scenario, obstacles=scenario.obstacles))
            for mode in self.modes
        )
        rooms = {level: room.with_obstacles(scenario) for level, room in self._rooms.items()}
        return Prepared(scenario, modes, rooms)

    def asked(self, scenario: Scenario) -> Prepared:
        """Return it for a scenario that differs in start, goals and place of the robot only."""
        rooms = {level: replace(room, scenario=scenario) for level, room in self._rooms.items()}
        return Prepared(scenario, self.modes, rooms)

    @property
    def margin_asked(self) -> float:
        """The margin that the twists of all contacts have to exceed at first."""
        return float(np.min([mode.margins[0] for mode in self.modes]))
