"""What contacts are like where objects were measured, and short pushes that close those that are open.

Pushes are chosen with the simulator, and proven by it over what is not known. With one of them the plate comes up to
a load: straight ahead until the contact that closes tells where the plate is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.geometry.se2 import compose, exp, inverse, relative, rotate, transform_points, wrap_angle
from pushplan.mechanics.chain import Chain
from pushplan.sim.control.settings import ControlSettings, words
from pushplan.sim.report import contact_motion
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import BoolArray, FloatArray

LONGEST = 0.05
"""Longest push that is tried, m."""
STEP = 1e-3
"""Length of a simulated step, m."""
RESERVE = 2e-3
"""How much farther is pushed than it takes, m."""
GAP, ANGLE = 2e-4, 1e-3
"""Gap (m) and turn (rad) up to which a simulated contact is closed."""
PROOFS = 6
"""Worlds that a push is proven in, beside the one that is believed."""
MOST = 3
"""Pushes in a row that may fail to close contacts."""
BEST = 3
"""Pushes that are proven, shortest first, until one is."""
ASIDE = (1e-3, np.radians(0.3))
"""By how much (m, rad) the plate has to have met a load aside so that another approach may do better."""
FOUND = 3.0
"""A contact that is found by approach is off where it is believed to be by so many times what is likely, at most."""
MET = 0.25
"""Share of the straight push by which the plate has to have moved a load that it has met: 5 of 20 mm make boxes flush
that are 15 cm wide and turned by 2 deg."""
TRIES = 3
"""Straight pushes in search of a load, at most."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """What contacts are like against those of a chain.

    Attributes:
        slide: (..., n) how far the middle of each segment has slid on the pushing body, m; to the left is positive.
        opening: (..., n) the wider of the gaps at the two ends, m.
        rotation: (..., n) turn of the pushed against the pushing body, rad.
    """

    slide: FloatArray
    opening: FloatArray
    rotation: FloatArray

    def flush(self, gap: float, angle: float) -> BoolArray:
        """Return whether all contacts are closed, to a gap (m) and an angle (rad)."""
        closed = (self.opening <= gap) & (np.abs(self.rotation) <= angle)
        return np.asarray(closed.all(axis=-1))


def contacts_at(chain: Chain, places: FloatArray) -> Contacts:
    """Return what the contacts are like with the objects at poses (..., n, 3) in the chain frame."""
    many = places.reshape(-1, len(chain.objects), 3)
    motions = compose(many, inverse(chain.places))
    plate = np.zeros((len(many), 1, 3))
    found = contact_motion(chain, np.concatenate([motions, plate], axis=1), None)
    return Contacts(*(values.reshape(places.shape[:-1]) for values in found))


@dataclass(frozen=True, eq=False)
class ClosingPush:
    """A push along one twist.

    Attributes:
        twist: (3,) body twist scaled to a cost rate of 1.
        length: m of path cost.
    """

    twist: FloatArray
    length: float


class Closings:
    """Pushes in a row that close contacts.

    Args:
        world: As it is believed to be, its chain with all contacts closed.
        settings: See there.
    """

    def __init__(self, world: World, settings: ControlSettings) -> None:
        self._world, self._settings = world, settings
        self.restart()

    def restart(self) -> None:
        """Take contacts for closed."""
        self._count = 0
        self._before: Contacts | None = None

    def next(
        self, plate: FloatArray, object_poses: FloatArray, twists: FloatArray, noise: FloatArray
    ) -> ClosingPush | str:
        """Return the shortest push that closes every contact, if possible in all worlds that are tried.

        Or why none does.

        Args:
            plate: (3,) pose of the chain frame in the world.
            object_poses: (n, 3) where the objects are, the mean of a look.
            twists: (k, 3) that the pusher can make and that hold the closed chain, scaled to a cost rate of 1.
            noise: (2,) standard deviations of measurements, m and rad.
        """
        if self._count >= MOST:
            return f"{MOST} pushes did not close the contacts"
        believed = SlipSimulator(self._world, plate)
        closed = np.array([_closes_after(believed, plate, object_poses, twist) for twist in twists])
        found: list[tuple[bool, ClosingPush]] = []
        for k in np.argsort(closed)[:BEST]:
            if not np.isfinite(closed[k]):
                break
            lengths = np.array([closed[k], *self._in_other_worlds(plate, object_poses, twists[k], noise)])
            proven = bool(np.isfinite(lengths).all())
            longest = float(lengths[np.isfinite(lengths)].max())
            found.append((not proven, ClosingPush(twists[k], longest + RESERVE)))
        if not found:
            return f"no push of up to {1e3 * LONGEST:.0f} mm closes the contacts"
        self._count += 1
        # What closes them only if all is as believed is tried where nothing else does: then it is looked at again.
        return min(found, key=lambda one: (one[0], one[1].length))[1]

    def _in_other_worlds(
        self, plate: FloatArray, object_poses: FloatArray, twist: FloatArray, noise: FloatArray
    ) -> list[float]:
        """Return after what length a push closes the contacts in each of the worlds that it is proven in."""
        random, found = np.random.default_rng(1), []
        spread = (noise / np.sqrt(self._settings.looks))[[0, 0, 1]]
        for _ in range(PROOFS):
            factor = 1.0 + self._settings.friction * random.choice([-1.0, 1.0])
            other = self._world.with_contact_friction(factor)
            off = random.normal(size=object_poses.shape) * spread
            found.append(_closes_after(SlipSimulator(other, plate), plate, object_poses + off, twist))
            if not np.isfinite(found[-1]):
                break
        return found

    def change_nothing(self, contacts: Contacts, gap: float, turn: float) -> bool:
        """Tell whether contacts are as open, to a gap (m) and a turn (rad), as they were before the last push."""
        before, self._before = self._before, contacts
        if before is None or self._count == 0:
            return False
        same = np.abs(contacts.opening - before.opening) <= gap
        return bool((same & (np.abs(contacts.rotation - before.rotation) <= turn)).all())


def _closes_after(simulator: SlipSimulator, plate: FloatArray, object_poses: FloatArray, twist: FloatArray) -> float:
    """Return the length (m of path cost) after which all contacts are closed and stay so; infinite if none is."""
    count = round(LONGEST / STEP)
    simulator.place(object_poses, plate)
    trace = simulator.follow(np.tile(twist * STEP, (count, 1)))
    if simulator.jammed:
        return np.inf
    plates = compose(plate, exp(twist * (STEP * np.arange(1, count + 1))[:, None]))
    places = relative(plates[:, None], trace.poses)
    flush = contacts_at(simulator.world.chain, places).flush(GAP, ANGLE)
    if not flush[-1]:
        return np.inf
    open_until = np.flatnonzero(~flush)
    return STEP * (1.0 if len(open_until) == 0 else float(open_until[-1]) + 2.0)


def shift_at_contact(chain: Chain, plate: FloatArray, object_poses: FloatArray) -> FloatArray:
    """Return by what body motion (3,) the plate is off if the first object that it pushes is flush.

    Along the contact, where that cannot be told, the plate is where it is believed to be.

    Args:
        chain: With all contacts closed.
        plate: (3,) pose of the chain frame in the world, as believed.
        object_poses: (n, 3) as measured.
    """
    k = chain.first_pushed
    contact = chain.contacts[k]
    carried = relative(plate, compose(object_poses[k], inverse(chain.places[k])))
    middle, turned = 0.5 * (contact.right + contact.left), float(wrap_angle(carried[2]))
    there = transform_points(carried, middle[None])[0]
    slide = float(rotate(-turned, there - middle) @ contact.tangent)
    return np.append(there - rotate(turned, middle + slide * contact.tangent), turned)


class Touch:
    """The straight push with which the plate comes up to a load.

    Args:
        chain: The load.
        length: Of the push, m; 0 where the plate is in contact.
        straight: The load is in contact, and closes onto an object by that push.
        settings: See there.

    Attributes:
        length: Of the next straight push, m.
        over: Whether the load was met, and tells where the plate is.
    """

    def __init__(self, chain: Chain, length: float, straight: bool, settings: ControlSettings) -> None:
        self.length, self.over = length, length == 0.0
        self._chain, self._straight = chain, straight
        self._most = FOUND * np.array(settings.approach_error)
        self._tries, self._off = 1, (0.0, 0.0)

    @property
    def aside(self) -> bool:
        """Whether the plate was elsewhere than believed, so that another approach may do better."""
        return self._off[0] > ASIDE[0] or self._off[1] > ASIDE[1]

    def told(self, plate: FloatArray, object_poses: FloatArray, sure: bool = False) -> tuple[FloatArray, str] | None:
        """Return by what body motion (3,) the plate is off where it is believed to be, and words for that.

        The first object that the plate pushes, at rest after the push, is taken for flush; along it, what was
        believed holds. Bodies do not overlap: one that stands where the plate is believed to be was not moved as far
        as that has gone. Where it was hardly moved, the push is `over` only after another one.

        Args:
            plate: (3,) pose of the chain frame in the world, as believed.
            object_poses: (n, 3) as measured.
            sure: Whether the object is flush for sure. None is returned where it is not, and far ahead of the plate.
        """
        shift = shift_at_contact(self._chain, plate, object_poses)
        first, behind = self._chain.objects[self._chain.first_pushed].name, -float(shift[0])
        if not (sure or self._straight or self._tries == TRIES or self.length - behind > MET * self.length):
            self._tries, self.length = self._tries + 1, behind
            text = f"{first} was not met: the plate is {1e3 * behind:.1f} mm behind"
            return np.array([-behind, 0.0, 0.0]), text
        self.over = True
        off = float(np.hypot(shift[0], shift[1])), abs(float(shift[2]))
        far = off[0] if self._straight else -behind
        if not sure and (far > self._most[0] or off[1] > self._most[1]):
            return None
        self._off = off
        return shift, f"{first} tells that the plate is {words(*off)} off"
