"""Pushes worth simulating: stable ones, unstable ones, and many close to the boundary between them."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.sphere import angles_of, twists_at
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

_NEAR = 0.05
"""How far from the boundary a push near it may be, rad on the twist sphere."""


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


def _near_boundary(
    stable: StableSet, good: FloatArray, bad: FloatArray, rng: np.random.Generator
) -> FloatArray:
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
