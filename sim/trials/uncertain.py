"""What is not known about the world that a plan is tried in, and worlds drawn from it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, rotate
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.mechanics.support import FeetSupport
from pushplan.scenario.model import Scenario
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True)
class TrialUncertainty:
    """By how much sampled worlds differ; every number is drawn evenly from its interval, each on its own.

    Attributes:
        contact_friction: Share by which every contact's coefficient may be off, below 1.
        floor_friction: The same of every object's coefficient with the floor.
        mass: The same of every object's mass.
        load: Largest share by which the outermost pressure under an object is off: its load leans to a random side.
        position: How far an object may stand aside along its contact, m.
        angle: How far an object may be turned so that one end of its contact still touches, rad.
    """

    contact_friction: float = 0.2
    floor_friction: float = 0.2
    mass: float = 0.0
    load: float = 0.1
    position: float = 1e-3
    angle: float = 0.005

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            most = np.inf if field.name == "position" else 1.0
            if not 0.0 <= value < most:
                allowed = ">= 0 and finite" if field.name == "position" else "from 0 to below 1"
                raise PushplanError(
                    f"{field.name} of the trials' uncertainty is {value}; it must be {allowed}"
                )

    @property
    def words(self) -> str:
        """The intervals for people."""
        return (
            f"contact friction ±{100 * self.contact_friction:.3g} %, "
            f"floor friction ±{100 * self.floor_friction:.3g} %, "
            f"mass ±{100 * self.mass:.3g} %, load ±{100 * self.load:.3g} %, "
            f"objects aside ±{1e3 * self.position:.3g} mm and turned ±{np.degrees(self.angle):.3g} deg"
        )


def sampled_world(
    scenario: Scenario, uncertainty: TrialUncertainty | None, rng: np.random.Generator
) -> World:
    """Draw a world.

    Args:
        scenario: What the plan believes.
        uncertainty: By how much that may be off. None takes the intervals of the scenario where it states any, and
            the defaults of `TrialUncertainty` for the rest.
        rng: Where the random numbers come from.

    Raises:
        SupportError: When the load under an object is not known.
    """
    world = World.from_scenario(scenario)
    off = uncertainty or TrialUncertainty()
    if uncertainty is None and scenario.interval is not None:
        world = _within_intervals(world, scenario, rng)
    else:
        world = _within_shares(world, off, rng)
    return replace(world, offsets=_offsets(world.chain, off, rng))


def _within_shares(world: World, off: TrialUncertainty, rng: np.random.Generator) -> World:
    for obj in world.chain.objects:
        world = world.with_contact_friction(_factor(off.contact_friction, rng), obj.name)
        world = world.with_floor_friction(_factor(off.floor_friction, rng), obj.name)
        world = world.with_mass(_factor(off.mass, rng), obj.name)
        world = _leaning(world, obj.name, off.load, rng)
    return world


def _within_intervals(world: World, scenario: Scenario, rng: np.random.Generator) -> World:
    """Draw what the scenario states as intervals from them; everything else stays."""
    interval = scenario.interval
    assert interval is not None
    chain = interval.chain
    contacts = list(chain.contacts)
    if scenario.contact_friction is not None:
        drawn = _between(scenario.contact_friction, rng)
        contacts = [replace(contact, friction=float(mu)) for contact, mu in zip(contacts, drawn, strict=True)]
    objects = []
    masses, frictions = _between(interval.mass, rng), _between(interval.floor_friction, rng)
    for i, obj in enumerate(chain.objects):
        support = obj.support
        if i in interval.fractions and isinstance(support, FeetSupport):
            fractions = _between(interval.fractions[i], rng)
            support = FeetSupport(support.positions, fractions / fractions.sum())
        objects.append(
            replace(obj, mass=float(masses[i]), floor_friction=float(frictions[i]), support=support)
        )
    world = replace(world, chain=replace(chain, objects=tuple(objects), contacts=tuple(contacts)))
    for i, share in interval.pressures.items():
        world = _leaning(world, chain.objects[i].name, share, rng)
    return world


def _between(spans: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw a number from each of the intervals (k, 2)."""
    return np.asarray(rng.uniform(spans[:, 0], spans[:, 1]))


def _factor(share: float, rng: np.random.Generator) -> float:
    return float(1.0 + share * rng.uniform(-1.0, 1.0))


def _leaning(world: World, name: str, share: float, rng: np.random.Generator) -> World:
    angle, part = rng.uniform(-np.pi, np.pi), share * rng.uniform()
    if part == 0.0:
        return world
    direction, obj = np.array([np.cos(angle), np.sin(angle)]), world.chain.objects[world.chain.index_of(name)]
    most = obj.support.most_lean(rotate(-float(obj.pose_chain[2]), direction))
    # A pressure that leans already is 0 at its lightest corner for less than the share.
    return world.with_load_shifted(direction, min(part, most * (1.0 - 1e-9)), name)


def _offsets(chain: Chain, off: TrialUncertainty, rng: np.random.Generator) -> FloatArray:
    """Draw how the objects stand off their places (n, 3): each aside and turned on the one that pushes it."""
    motions = {PLATE: np.zeros(3)}
    offsets = np.zeros((len(chain.objects), 3))
    for i, contact in enumerate(chain.contacts):
        aside, turn = off.position * rng.uniform(-1.0, 1.0), off.angle * rng.uniform(-1.0, 1.0)
        motions[i] = compose(motions[contact.pusher], _local_motion(contact, aside, turn))
        place = chain.objects[i].pose_chain
        offsets[i] = compose(motions[i], place) - place
    return offsets


def _local_motion(contact: Contact, aside: float, turn: float) -> FloatArray:
    """Return the motion (3,) that shifts along a contact and turns about the end that keeps touching."""
    pivot = contact.left if turn > 0.0 else contact.right
    shift = pivot + aside * contact.tangent - rotate(turn, pivot)
    return np.append(shift, turn)
