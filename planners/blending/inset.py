"""Corners at which the straight way from one twist to the next leaves the stable set, led round through the inside.

Stable sets are nearly convex, not quite: between two twists on the boundary the margin may dip below the
minimum. There, the end of the one arc and the beginning of the next are driven with twists moved inward, so
that the twist goes inward, across, and outward again.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pushplan.planners.blending.parts import passing_speeds, step_windows
from pushplan.planners.problem.controls import most_stable_twist
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.plans.path import PushPath, cost_rate
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, IntArray

SHARES = 2.0 ** np.arange(-12.0, -1.0)
"""How far twists are moved inward: shares of the way to the path's most stable twist, or the set's."""

SAFETY = 2.0
"""Multiple of the smallest share that helps: on its way in and out the twist is moved by a part of it only."""

SAMPLES = 65
"""Twists looked at between two."""

MOST = 1.0 / 3.0
"""Share of an arc that may be driven with another twist at either end."""


class Inset(NamedTuple):
    """A path with more arcs, and (k,) the arc of the given path that each of its arcs belongs to."""

    path: PushPath
    owner: IntArray


def inset_path(path: PushPath, stable: StableSet, minimum: float, bounds: Bounds) -> Inset:
    """Return the path with twists moved inward near the corners where the margin would dip.

    It does not quite end where the given path does. A corner where no share helps stays as it is.

    Args:
        path: Constant-twist arcs, each with more than the minimum margin.
        stable: The set.
        minimum: The margin has to exceed it.
        bounds: What limits the motion, for the time that a step takes.
    """
    arcs = np.flatnonzero(path.lengths > 0.0).tolist()
    inside = _most_stable(path, stable)
    deepest: FloatArray | None = None
    rest = path.lengths.copy()
    heads: dict[int, FloatArray] = {}
    tails: dict[int, FloatArray] = {}
    for i, j in pairwise(arcs):
        pair = path.twists[[i, j]]
        if _holds(pair[0], pair[1], stable, minimum):
            continue
        towards, share = inside, _share(pair, inside, stable, minimum)
        if share == 0.0:
            if deepest is None:  # a thousand margins, for the few paths that lie on a concave side of the set
                deepest = most_stable_twist(stable, stable.chain.pusher.drive)
            towards, share = deepest, _share(pair, deepest, stable, minimum)
        if share > 0.0:
            spent = _spent(path, [i, j], bounds)
            moved = _moved(pair, towards, share)
            tails[i], heads[j] = np.append(moved[0], spent[0]), np.append(moved[1], spent[1])
            rest[[i, j]] -= spent
    made = [
        (row, i)
        for i in arcs
        for row in (heads.get(i), np.append(path.twists[i], rest[i]), tails.get(i))
        if row is not None
    ]
    rows = np.array([row for row, _ in made]).reshape(-1, 4)
    return Inset(
        PushPath(path.start, rows[:, :3], rows[:, 3]), np.array([i for _, i in made], dtype=np.int64)
    )


def _most_stable(path: PushPath, stable: StableSet) -> FloatArray:
    """The most stable of the path's twists and their mean: one that the pusher's drive can make, too."""
    tried = np.concatenate([path.twists, path.twists.mean(axis=0, keepdims=True)])
    return np.asarray(tried[np.argmax(stable.margin(tried))])


def _moved(twists: FloatArray, inside: FloatArray, share: float) -> FloatArray:
    """Twists (k, 3) moved inward, scaled to a cost rate of 1."""
    mixed = (1.0 - share) * twists + share * inside
    return np.asarray(mixed / cost_rate(mixed)[:, None])


def _holds(a: FloatArray, b: FloatArray, stable: StableSet, minimum: float) -> bool:
    """Whether the margin stays above the minimum on the straight way from one twist (3,) to another."""
    mix = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    return bool((stable.margin((1.0 - mix) * a + mix * b) > minimum).all())


def _share(pair: FloatArray, inside: FloatArray, stable: StableSet, minimum: float) -> float:
    """How far two twists (2, 3) have to be moved inward; 0 if nothing helps."""

    def holds(a: FloatArray, b: FloatArray) -> bool:
        return _holds(a, b, stable, minimum)

    for share in SHARES:
        a, b = _moved(pair, inside, SAFETY * share)
        if holds(*_moved(pair, inside, share)) and holds(a, b) and holds(pair[0], a) and holds(b, pair[1]):
            return float(SAFETY * share)
    return 0.0


def _spent(path: PushPath, pair: list[int], bounds: Bounds) -> FloatArray:
    """Lengths (2,) of two neighbouring arcs that are driven within half a step's time of the corner."""
    twists, lengths = path.twists[pair], path.lengths[pair]
    speeds = passing_speeds(twists, lengths, bounds)
    time = step_windows(twists * speeds[:, None], bounds.limits).sum()
    return np.asarray(np.minimum(speeds * time / 2.0, MOST * lengths))
