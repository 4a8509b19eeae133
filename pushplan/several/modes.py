"""The ways to push a load: each contact of the plate is a push problem of its own, with its own stable set."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pushplan.errors import EmptyStableSetError, ScenarioError
from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.mechanics.faces import Place, carried_from, places
from pushplan.planners.multi.push_mode import PushMode
from pushplan.planners.problem.controls import straight_pushes
from pushplan.planners.problem.margins import margins_to_try
from pushplan.planners.problem.posing import Controls, Posing
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.sim.judging import planning_set
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
        except (EmptyStableSetError, ScenarioError) as error:
            troubles.append(f"{place.face}: {error}")
    if not found:
        why = "; ".join(troubles) or "the plate fits on none of the faces that it may choose"
        raise EmptyStableSetError(f"no contact can push the load: {why}")
    return tuple(found)


def _mode(scenario: Scenario, place: Place, stable_set: str | None) -> Mode:
    order = carried_from(scenario.chain, place.touched)
    document = _document(scenario, place, order)
    pushed = scenario_from_document(document, scenario.path, scenario.attachments)
    # The document has no room: whether a contact is free there depends on where the load is.
    pushed = replace(
        pushed,
        path=scenario.path,
        workspace=scenario.workspace,
        obstacles=scenario.obstacles,
        clearance=scenario.clearance,
        planner=scenario.planner,
    )
    stable = planning_set(pushed, stable_set)
    robot = se2.compose(pushed.chain.pusher.plate_pose, se2.inverse(scenario.chain.pusher.plate_pose))
    return Mode(place, pushed, stable, margins_to_try(pushed, stable), tuple(order), scenario.chain, robot)


def push_modes_with(modes: tuple[Mode, ...], level: int) -> Iterator[PushMode]:
    """Yield what each mode can do with its `level`-th margin; a mode that cannot push straight then is left out."""
    for mode in modes:
        margin = mode.margin(level)
        scenario = mode.scenario.with_margin(margin)
        try:
            controls = mode.controls(margin)
        except EmptyStableSetError:
            continue
        straight = straight_pushes(controls.segments)
        if len(straight):
            ahead = straight[np.argmax(straight[:, 0])]
            if _holds_ahead(mode, margin):
                ahead = np.array([1.0, 0.0])
            yield PushMode(mode.place, scenario, mode.stable, controls, mode.robot, np.append(ahead, 0.0))


def _holds_ahead(mode: Mode, margin: float) -> bool:
    """Tell whether the push along the normal is stable, and one that the drive can make."""
    axle = mode.scenario.chain.pusher.drive.axle
    able = axle is None or abs(np.sin(axle[2])) < 1e-12
    return able and float(mode.stable.margin(np.array([[1.0, 0.0, 0.0]]))[0]) > margin


def _document(scenario: Scenario, place: Place, order: list[int]) -> dict[str, Any]:
    """Return the push problem with another contact as a scenario file has it, without a room."""
    stated, chain = scenario.resolved(), scenario.chain
    left_out = ("goal", "pushes", "workspace", "obstacles", "snap")
    document = {key: value for key, value in stated.items() if key not in left_out}
    into = se2.inverse(place.contact)
    objects = []
    for i in order:
        kept = {key: value for key, value in stated["objects"][i].items() if key != "offset"}
        objects.append(kept | {"pose": se2.compose(into, chain.objects[i].pose_chain).tolist()})
    plate = se2.compose(into, place.plate)
    objects[0]["offset"] = objects[0]["pose"][1] - float(plate[1])
    pusher = {
        key: value for key, value in stated["pusher"].items() if key not in ("faces", "offsets", "drive")
    }
    robot = {"drive": _drive(scenario)}
    if "footprint" in stated.get("robot", {}):
        robot["footprint"] = stated["robot"]["footprint"]
    document |= {"objects": objects, "pusher": pusher, "robot": robot}
    return document | {"start": [0.0, 0.0, 0.0], "goal": {"pose": [1.0, 0.0, 0.0]}}


def _drive(scenario: Scenario) -> Any:
    """Return the drive as it is stated in the plate's frame."""
    drive = scenario.chain.pusher.drive
    if drive.axle is None:
        return "omnidirectional"
    axle = se2.relative(scenario.chain.pusher.plate_pose, drive.axle).tolist()
    if drive.kind == "car":
        return {"car": {"axle": axle, "min_radius": drive.min_radius}}
    return {"differential": {"axle": axle}}
