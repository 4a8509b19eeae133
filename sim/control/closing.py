"""Gaps of contacts at measured poses, and short pushes that close open contacts.

The simulator selects the pushes and tests them in samples of the uncertainty. A straight push of this kind ends each
approach: the contact that closes reveals the pose of the plate.
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

LONGEST, SHARE = 0.05, 0.06
"""Longest tried push: a length (m), or a share of the chain's reach if that is longer. A cart of 0.8 m that turns by
3 deg opens its contact by 32 mm, and a push of 66 mm closes it."""
STEP = 1e-3
"""Length of a simulated step, m."""
RESERVE = 2e-3
"""Extra length of a push beyond its simulated length, m."""
GAP, ANGLE = 2e-4, 1e-3
"""Largest gap (m) and turn (rad) of a closed simulated contact."""
PROOFS = 6
"""Number of samples in which a push is tested, beside the nominal world."""
MOST = 3
"""Largest number of successive pushes that fail to close contacts."""
BEST = 3
"""Largest number of pushes that are tested, shortest first."""
ASIDE = (1e-3, np.radians(0.3))
"""Smallest error (m, rad) of the plate at a load for which another approach can do better."""
FOUND = 3.0
"""Largest error of the plate at an approach, in standard deviations of `approach_error`."""
MET = 0.25
"""Smallest share of the straight push by which the plate moves a load that it has met. 5 of 20 mm make a box flush
that is 15 cm wide and turned by 2 deg."""
TRIES = 3
"""Largest number of straight pushes in search of a load."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Differences between measured contacts and those of a chain.

    Attributes:
        slide: Slide of the midpoint of each segment on the pushing body, m, left positive, (..., n).
        opening: The wider of the gaps at the two ends, m, (..., n).
        rotation: Rotation of the pushed relative to the pushing body, rad, (..., n).
    """

    slide: FloatArray
    opening: FloatArray
    rotation: FloatArray

    def flush(self, gap: float, angle: float) -> BoolArray:
        """Return whether all contacts are closed within a gap (m) and an angle (rad)."""
        closed = (self.opening <= gap) & (np.abs(self.rotation) <= angle)
        return np.asarray(closed.all(axis=-1))


def contacts_at(chain: Chain, places: FloatArray) -> Contacts:
    """Return the contacts of a chain with its objects at poses (..., n, 3) in the chain frame."""
    many = places.reshape(-1, len(chain.objects), 3)
    motions = compose(many, inverse(chain.places))
    plate = np.zeros((len(many), 1, 3))
    found = contact_motion(chain, np.concatenate([motions, plate], axis=1), None)
    return Contacts(*(values.reshape(places.shape[:-1]) for values in found))


@dataclass(frozen=True, eq=False)
class ClosingPush:
    """A push along one twist.

    Attributes:
        twist: Body twist scaled to a cost rate of 1, (3,).
        length: Length, m of path cost.
    """

    twist: FloatArray
    length: float


class Closings:
    """Successive pushes that close contacts.

    Args:
        world: Nominal world; all contacts of its chain are closed.
        settings: Settings of the controller.

    Attributes:
        longest: Longest tried push, m.
    """

    def __init__(self, world: World, settings: ControlSettings) -> None:
        self._world, self._settings = world, settings
        self.longest = max(LONGEST, SHARE * world.chain.reach)
        self.restart()

    def restart(self) -> None:
        """Assume closed contacts and reset the count of pushes."""
        self._count = 0
        self._before: Contacts | None = None

    def next(
        self, plate: FloatArray, object_poses: FloatArray, twists: FloatArray, noise: FloatArray
    ) -> ClosingPush | str:
        """Return the shortest push that closes every contact, if possible in all samples.

        If none closes them, return the reason.

        Args:
            plate: Pose of the chain frame in the world, (3,).
            object_poses: Mean measured poses of the objects, (n, 3).
            twists: Twists of the pusher that are stable for the closed chain, scaled to a cost rate of 1, (k, 3).
            noise: Standard deviations of measurements, m and rad, (2,).
        """
        if self._count >= MOST:
            return f"{MOST} pushes did not close the contacts"
        believed = SlipSimulator(self._world, plate)
        closed = np.array([_closes_after(believed, plate, object_poses, twist, self.longest) for twist in twists])
        found: list[tuple[bool, ClosingPush]] = []
        for k in np.argsort(closed)[:BEST]:
            if not np.isfinite(closed[k]):
                break
            lengths = np.array([closed[k], *self._in_other_worlds(plate, object_poses, twists[k], noise)])
            proven = bool(np.isfinite(lengths).all())
            longest = float(lengths[np.isfinite(lengths)].max())
            found.append((not proven, ClosingPush(twists[k], longest + RESERVE)))
        if not found:
            return f"no push of up to {1e3 * self.longest:.0f} mm closes the contacts"
        self._count += 1
        # A push that closes them only in the nominal world is the last resort; its result is measured again.
        return min(found, key=lambda one: (one[0], one[1].length))[1]

    def _in_other_worlds(
        self, plate: FloatArray, object_poses: FloatArray, twist: FloatArray, noise: FloatArray
    ) -> list[float]:
        """Return the length after which a push closes the contacts, for each sample up to the first failure."""
        random, found = np.random.default_rng(1), []
        spread = (noise / np.sqrt(self._settings.looks))[[0, 0, 1]]
        for _ in range(PROOFS):
            factor = 1.0 + self._settings.friction * random.choice([-1.0, 1.0])
            other = self._world.with_contact_friction(factor)
            off = random.normal(size=object_poses.shape) * spread
            found.append(_closes_after(SlipSimulator(other, plate), plate, object_poses + off, twist, self.longest))
            if not np.isfinite(found[-1]):
                break
        return found

    def change_nothing(self, contacts: Contacts, gap: float, turn: float) -> bool:
        """Return whether contacts are as open as before the last push, within a gap (m) and a turn (rad)."""
        before, self._before = self._before, contacts
        if before is None or self._count == 0:
            return False
        same = np.abs(contacts.opening - before.opening) <= gap
        return bool((same & (np.abs(contacts.rotation - before.rotation) <= turn)).all())


def _closes_after(
    simulator: SlipSimulator, plate: FloatArray, object_poses: FloatArray, twist: FloatArray, longest: float
) -> float:
    """Return the length (m of path cost) after which all contacts stay closed; infinite if they do not."""
    count = round(longest / STEP)
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
    """Return the pose error of the plate as a body motion (3,), given that its first object is flush.

    The error along the contact is unknown and set to 0.

    Args:
        chain: Chain with all contacts closed.
        plate: Believed pose of the chain frame in the world, (3,).
        object_poses: Measured poses of the objects, (n, 3).
    """
    k = chain.first_pushed
    contact = chain.contacts[k]
    carried = relative(plate, compose(object_poses[k], inverse(chain.places[k])))
    middle, turned = 0.5 * (contact.right + contact.left), float(wrap_angle(carried[2]))
    there = transform_points(carried, middle[None])[0]
    slide = float(rotate(-turned, there - middle) @ contact.tangent)
    return np.append(there - rotate(turned, middle + slide * contact.tangent), turned)


class Touch:
    """Straight push that brings the plate into contact with a load.

    Args:
        chain: Chain of the load.
        length: Length of the push, m; 0 if the plate is in contact.
        straight: Whether the load is already in contact, and the push closes it onto an object.
        settings: Settings of the controller.

    Attributes:
        length: Length of the next straight push, m.
        over: Whether the plate has met the load.
    """

    def __init__(self, chain: Chain, length: float, straight: bool, settings: ControlSettings) -> None:
        self.length, self.over = length, length == 0.0
        self._chain, self._straight = chain, straight
        self._most = FOUND * np.array(settings.approach_error)
        self._tries, self._off = 1, (0.0, 0.0)

    @property
    def aside(self) -> bool:
        """Whether the pose error of the plate was so large that another approach can do better."""
        return self._off[0] > ASIDE[0] or self._off[1] > ASIDE[1]

    def told(self, plate: FloatArray, object_poses: FloatArray, sure: bool = False) -> tuple[FloatArray, str] | None:
        """Return the pose error of the plate as a body motion (3,), and a text about it.

        The first pushed object, at rest after the push, is assumed to be flush; see `shift_at_contact`. If the push
        has hardly moved it, another push follows before `over`.

        Args:
            plate: Believed pose of the chain frame in the world, (3,).
            object_poses: Measured poses of the objects, (n, 3).
            sure: Whether the object is certainly flush. Otherwise an implausible error returns None.
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
        return shift, f"{first} shows that the plate is {words(*off)} off"
