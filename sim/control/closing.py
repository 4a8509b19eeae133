"""What contacts are like where objects were measured, and short pushes that close those that are open.

Pushes are chosen with the simulator, and proven by it over what is not known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.geometry.se2 import compose, exp, inverse, relative
from pushplan.mechanics.chain import Chain
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.report import contact_motion
from pushplan.sim.slip.simulator import SlipSimulator
from pushplan.sim.world import World
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


@dataclass(frozen=True, eq=False)
class Spread:
    """What is not known of a world with open contacts.

    Attributes:
        friction: Share by which frictions may be off.
        position: Standard deviation of the measured places, m.
        angle: Likewise, rad.
    """

    friction: float
    position: float
    angle: float

    @classmethod
    def of(cls, settings: ControlSettings, noise: FloatArray) -> Spread:
        """Return what a controller knows after a look at measurements with standard deviations (2,), m and rad."""
        return cls(settings.friction, *(float(one) for one in noise / np.sqrt(settings.looks)))


def closing_push(
    world: World, plate: FloatArray, object_poses: FloatArray, twists: FloatArray, spread: Spread
) -> ClosingPush | str:
    """Return the shortest push that closes every contact in all worlds that are tried, or why there is none.

    Args:
        world: As it is believed to be, its chain with all contacts closed.
        plate: (3,) pose of the chain frame in the world.
        object_poses: (n, 3) where the objects are.
        twists: (k, 3) that the pusher can make and that hold the closed chain, scaled to a cost rate of 1.
        spread: What is not known.
    """
    believed = SlipSimulator(world, plate)
    closed = np.array([_closes_after(believed, plate, object_poses, twist) for twist in twists])
    found: list[ClosingPush] = []
    for k in np.argsort(closed)[:BEST]:
        if not np.isfinite(closed[k]):
            break
        longest = max(closed[k], *_in_other_worlds(world, plate, object_poses, twists[k], spread))
        if np.isfinite(longest):
            found.append(ClosingPush(twists[k], float(longest) + RESERVE))
    if found:
        return min(found, key=lambda push: push.length)
    if np.isfinite(closed).any():
        return "a push closes the contacts if all is as believed, but not if friction or places are a little off"
    return f"no push of up to {1e3 * LONGEST:.0f} mm closes the contacts"


def _in_other_worlds(
    world: World, plate: FloatArray, object_poses: FloatArray, twist: FloatArray, spread: Spread
) -> list[float]:
    """Return after what length a push closes the contacts in each of the worlds that it is proven in."""
    random, found = np.random.default_rng(1), []
    for _ in range(PROOFS):
        factor = 1.0 + spread.friction * random.choice([-1.0, 1.0])
        other = world.with_contact_friction(factor)
        off = random.normal(size=object_poses.shape) * [spread.position, spread.position, spread.angle]
        found.append(_closes_after(SlipSimulator(other, plate), plate, object_poses + off, twist))
        if not np.isfinite(found[-1]):
            break
    return found


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
        """Return the push that comes next, or why there is none; see `closing_push` and `Spread.of`."""
        push: ClosingPush | str = f"{MOST} pushes did not close the contacts"
        if self._count < MOST:
            push = closing_push(self._world, plate, object_poses, twists, Spread.of(self._settings, noise))
        self._count += isinstance(push, ClosingPush)
        return push

    def change_nothing(self, contacts: Contacts, gap: float, turn: float) -> bool:
        """Tell whether contacts are as open, to a gap (m) and a turn (rad), as they were before the last push."""
        before, self._before = self._before, contacts
        if before is None or self._count == 0:
            return False
        same = np.abs(contacts.opening - before.opening) <= gap
        return bool((same & (np.abs(contacts.rotation - before.rotation) <= turn)).all())
