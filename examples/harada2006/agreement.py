"""Predicted against simulated: does a push move a contact exactly when the contact conditions say so?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike
from pushes import simulate_twist

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts import contact_state
from pushplan.mechanics.sphere import angles_of, checked_twists, twists_at
from pushplan.sets.stable_set import StableSet
from pushplan.sim.physics.engine import PhysicsSettings
from pushplan.util.arrays import BoolArray, FloatArray, frozen

FINE, MOVED = PhysicsSettings(indentation=5e-6), 1e-4
"""Hard contacts, which count as moved from a ten-thousandth of the segment on: slips soon get there, holds never."""
_NOWHERE = -1e3
"""Stands for a force that is parallel to the segment: it passes nowhere near it."""


_NEAR = 0.05
"""How far from the boundary a push near it may be, rad on the twist sphere."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """Pushes with known loads, predicted by the conditions on the exact friction wrench, and simulated.

    Attributes:
        twists: (k, 3) body twists in the chain frame.
        angle: (k,) smallest angle from a contact's force to the edge of its friction cone, rad; negative outside.
        inset: (k,) smallest distance from where a contact's force passes to the end of its segment, over the length
            of the segment; negative outside.
        displacement: (k,) largest slide or opening of a contact in the simulation, over the length of its segment.
        footprint: (k,) whether the centre of rotation lies under an object.
    """

    twists: FloatArray
    angle: FloatArray
    inset: FloatArray
    displacement: FloatArray
    footprint: BoolArray

    def __post_init__(self) -> None:
        for name in ("angle", "inset", "displacement"):
            object.__setattr__(self, name, frozen(getattr(self, name), (len(self.twists),), name))

    @property
    def predicted(self) -> BoolArray:
        """(k,) whether every contact should hold."""
        return np.asarray((self.angle > 0.0) & (self.inset > 0.0))

    @property
    def kept(self) -> BoolArray:
        """(k,) whether every contact held in the simulation."""
        return np.asarray(self.displacement <= MOVED)

    @property
    def agreed(self) -> BoolArray:
        """(k,) whether simulation and prediction say the same."""
        return np.asarray(self.predicted == self.kept)

    def depth(self, angle: float, inset: float) -> FloatArray:
        """Return (k,) how deep each push is in the stable set, in half widths of a band; negative outside.

        Args:
            angle: Half width of the band in the friction cones, rad.
            inset: Half width of the band at the ends of the segments, over their length.
        """
        return np.minimum(self.angle / angle, self.inset / inset)

    def confusion(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return counts: ((stable and held, stable but moved), (unstable but held, unstable and moved))."""
        held, said = self.kept, self.predicted
        return (
            (int((said & held).sum()), int((said & ~held).sum())),
            (int((~said & held).sum()), int((~said & ~held).sum())),
        )

    def joined(self, other: Agreement) -> Agreement:
        """Return the pushes of both."""
        names = ("twists", "angle", "inset", "displacement", "footprint")
        parts = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names}
        return Agreement(**parts)


def compare(chain: Chain, twists: ArrayLike, settings: PhysicsSettings = FINE) -> Agreement:
    """Predict and simulate constant twists (k, 3) of a chain.

    Args:
        chain: Objects with known loads.
        twists: Only their directions matter.
        settings: Of the simulation.

    Raises:
        MissingExtraError: When the physics engine is not installed.
        PushplanError: As `simulate_twist`.
    """
    checked = checked_twists(twists)
    state = contact_state(chain, checked)
    inset = np.minimum(state.lambdas, 1.0 - state.lambdas)
    moved = [float(simulate_twist(chain, twist, settings=settings).displacement.max()) for twist in checked]
    return Agreement(
        twists=checked,
        angle=state.friction_margins.min(axis=1),
        inset=np.where(np.isfinite(inset), inset, _NOWHERE).min(axis=1),
        displacement=np.array(moved),
        footprint=under_objects(chain, checked),
    )


def under_objects(chain: Chain, twists: FloatArray) -> BoolArray:
    """Return (k,) whether the centres of rotation of twists (k, 3) lie under an object."""
    omega = np.where(twists[:, 2] == 0.0, np.nan, twists[:, 2])
    cors = np.stack([-twists[:, 1], twists[:, 0]], axis=1) / omega[:, None]
    ground = shapely.union_all([shapely.Polygon(obj.outline_chain) for obj in chain.objects])
    known: BoolArray = np.asarray(np.isfinite(cors).all(axis=1))
    x, y = np.ascontiguousarray(np.where(known[:, None], cors, 0.0).T)
    return known & np.asarray(shapely.contains_xy(ground, x, y), dtype=np.bool_)


def sample_pushes(stable: StableSet, count: int, rng: np.random.Generator) -> FloatArray:
    """Return twists (count, 3): a third stable, a third unstable, a third near the boundary of the set.

    All of them push forward. Where nothing is stable, or everything is, the others fill up.
    """
    length = stable.chain.characteristic_length
    forward = rng.normal(size=(20_000, 3))
    forward[:, 0] = np.abs(forward[:, 0])
    lon, lat = angles_of(forward, 1.0)
    twists = twists_at(lon, lat, length)
    inside = stable.contains(twists)
    good, bad = twists[inside], twists[~inside]
    third = count // 3
    if not len(good) or not len(bad):
        return np.asarray(twists[:count])
    near = _near_boundary(stable, rng.permutation(good)[:third], rng.permutation(bad)[:third], rng)
    parts = np.concatenate([near, good[:third], bad])
    return np.asarray(parts[:count])


def _near_boundary(stable: StableSet, good: FloatArray, bad: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return twists (m, 3) on lines between stable and unstable ones, where these cross the boundary or near it."""
    pairs = min(len(good), len(bad))
    inside, outside = good[:pairs].copy(), bad[:pairs].copy()
    step = outside - inside
    for _ in range(50):
        middle = 0.5 * (inside + outside)
        keeps = stable.contains(middle)[:, None]
        inside, outside = np.where(keeps, middle, inside), np.where(keeps, outside, middle)
    scale = np.array([1.0, 1.0, stable.chain.characteristic_length])
    away = step / np.linalg.norm(step * scale, axis=1)[:, None]
    return np.asarray(inside + rng.uniform(-_NEAR, _NEAR, (pairs, 1)) * away)
