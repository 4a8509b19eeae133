"""Whether objects have left their places on the plate, as measurements have it.

**Away** is an object where the mean of a few measurements is off what was expected before, from all that was learned.

**Slides** along contacts are found by likelihood ratios against constant errors of sensors and wheels: a constant
explains what has been so from the beginning, not what begins later. Steps and ramps along each contact, of the object
that is pushed through it alone or with all that it carries, are tried from several moments on. One is accepted where

    2 (log L1 - log L0) > ln N + 10,

the constants being fitted once more in both cases, and where it is far enough to matter.

A ramp of all that the plate pushes is the hardest to tell from errors of wheels: all objects move on the plate as if
that were elsewhere. On an arc, 8 mm of a ramp of 10 mm a metre of a single box gain 20 on average, give or take 9.
Such ramps are few, and long ones differ little from one another. So errors are seldom taken for them, and less is
asked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pushplan.mechanics.chain import PLATE, Chain
from pushplan.mechanics.contacts import carried_objects
from pushplan.sim.control.estimator import Estimator, Linear, Sample
from pushplan.sim.control.settings import words
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

SLOW, QUICK, UNSURE = 4.0, 5.0, 3.0
"""Standard deviations of the mean of many measurements, of two, and of what is expected, by which an object has to be
off."""
UNSETTLED = 1.5e-3, math.radians(0.4)
"""By what contacts that were open at first may have been (m, rad)."""
LEAST = 0.7
"""Share of the slack that a slide has to have, whose size is known better than that."""
FEWEST = 16
"""Samples that it takes."""
LATEST = 5
"""Samples that have to be behind the beginning of a slide."""
SURELY, LONG, ENOUGH = 2e-3, 5e-3, 9.0
"""Ramps of all that the plate pushes: up to which size (m) as much gain is asked of them as of others, and from which
size on so little. In 38 runs without a slide (seeds 1 to 3) none of 5 mm or more gained above 6.3."""
RAMPS = np.linspace(0.1, 0.9, 9)
"""Shares of the samples after which ramps are tried."""
STEPS = (6, 9, 13, 18, 24, 30)
"""Samples before the last one at which steps are tried."""


@dataclass(frozen=True, eq=False)
class Slide:
    """A slide.

    Attributes:
        contact: Number of the contact.
        size: How far, m; to the left is positive.
        since: When it began, s.
    """

    contact: int
    size: float
    since: float


def off_place(estimator: Estimator, recent: list[Sample], names: Sequence[str], settled: bool) -> str:
    """Return which object has left its place and by how much; empty if none has.

    Three quarters of the measurements of a look, or half of them, tell of a slow departure, two of a quick one:
    the mean of what they are off what was expected from all that was learned before.

    Args:
        estimator: Of what is expected.
        recent: The last measurements, up to three quarters of those of a look.
        names: Of the objects.
        settled: Whether contacts that were open at first have closed.
    """
    if len(recent) < 2:
        return ""
    settings, gaps = estimator.settings, UNSURE * np.array(UNSETTLED)
    slack, off = np.array([settings.position_slack, settings.angle_slack]), estimator.residuals(recent)
    noise = estimator.noise(recent)[-1]
    for i, name in enumerate(names):
        own = off[~np.isnan(off[:, i, 0]), i]
        many = max(2, 3 * settings.looks // 4)
        for last, sigmas in ((many, SLOW), (settings.looks // 2, SLOW), (2, QUICK)):
            if len(own) < last:
                continue
            mean = own[-last:].mean(axis=0)
            apart = np.array([np.hypot(mean[0], mean[1]), abs(mean[2])])
            most = np.maximum(slack, sigmas / math.sqrt(last) * noise)
            if (apart > most).any():
                spread = UNSURE * estimator.spread(recent[-1])[i]
                most = most + (spread if settled else np.hypot(spread, gaps))
            if (apart > most).any():
                return f"{name} is {words(*apart)} away from its pose in the plan"
    return ""


def find_slide(estimator: Estimator, chain: Chain, after: float) -> Slide | None:
    """Return the most likely slide; None where constants explain what was measured.

    Args:
        estimator: Of the constants.
        chain: As its objects stand in the samples to come.
        after: It began after that time, s.
    """
    if estimator.count < FEWEST:
        return None
    # Student's weights take a fifth of a slide for outliers; weights that spare it stop for nothing in 2 of 60.
    linear = estimator.linear()
    shapes, begins, rises = _shapes(estimator.ways(linear.samples))
    late = np.array([linear.samples[begin].time > after for begin in begins])
    if not late.any():
        return None
    shapes, begins, rises = shapes[:, late], begins[late], rises[late]
    moves, which = _moves(linear, chain)
    # Sums over the m measurements, for every move (r) with every shape (s).
    along = shapes[np.nonzero(linear.seen)[0]]
    weighted = linear.weights[:, None, None] * moves
    own = ((along**2).T @ (weighted * moves).sum(axis=1)).T.ravel()
    slope = (along.T @ (weighted * linear.errors[..., None]).sum(axis=1)).T.ravel()
    by_values = np.matmul(weighted.transpose(0, 2, 1), linear.jacobian)
    shared = np.tensordot(along, by_values, axes=(0, 0)).transpose(1, 0, 2).reshape(len(own), -1)
    solved = np.linalg.solve(linear.hessian, np.column_stack([linear.gradient, shared.T]))
    left = own - (shared.T * solved[:, 1:]).sum(axis=0)
    slope = slope - shared @ solved[:, 0]
    gain = np.where(left > 1e-6 * own + 1e-12, slope**2 / np.maximum(left, 1e-12), 0.0)
    size = slope / np.maximum(left, 1e-12) * np.tile(shapes[-1], moves.shape[-1])
    far = np.abs(size)
    of_all = [r < len(chain.objects) and chain.contacts[k].pusher == PLATE for r, k in enumerate(which)]
    asked = _asked(far, np.outer(of_all, rises).ravel(), np.log(3.0 * len(along)) + 10.0)
    beyond = np.where(far < LEAST * estimator.settings.position_slack, -np.inf, gain - asked)
    best = int(np.argmax(beyond))
    if beyond[best] <= 0.0:
        return None
    move, shape = divmod(best, len(begins))
    since = linear.samples[begins[shape]].time
    return Slide(which[move], float(size[best]), since)


def _asked(far: FloatArray, ramps_of_all: BoolArray, usual: float) -> FloatArray:
    """Return the gain that is asked of slides (q,) that go so far, in m, some being ramps of all that is pushed."""
    lower = (usual - ENOUGH) * np.clip((far - SURELY) / (LONG - SURELY), 0.0, 1.0)
    return np.asarray(usual - np.where(ramps_of_all, lower, 0.0))


def _shapes(ways: FloatArray) -> tuple[FloatArray, IntArray, BoolArray]:
    """Return how slides go on (k, s), the samples (s,) at which they begin, and which of them (s,) are ramps.

    Ramps go on with the way, in m; steps are by 1.
    """
    count = len(ways)
    ramps = sorted({int(share * count) for share in RAMPS} - set(range(count - LATEST, count)))
    steps = [count - back for back in STEPS if back <= count - LATEST]
    begins, rises = np.array([*ramps, *steps]), np.arange(len(ramps) + len(steps)) < len(ramps)
    rising, jumped = np.maximum(ways[:, None] - ways[begins], 0.0), np.arange(count)[:, None] >= begins
    return np.where(rises, rising, jumped), begins, rises


def _moves(linear: Linear, chain: Chain) -> tuple[FloatArray, list[int]]:
    """Return what 1 m along each contact makes of the errors (m, 3, r), and the contact of each of the r moves."""
    carried, alone = carried_objects(chain), np.eye(len(chain.objects), dtype=np.bool_)
    which: list[tuple[int, BoolArray]] = [(k, row) for k, row in enumerate(carried)]
    which += [(k, alone[k]) for k in range(len(alone)) if not np.array_equal(alone[k], carried[k])]
    rows, objects = np.nonzero(linear.seen)
    headings = np.array([sample.places[:, 2] for sample in linear.samples])[rows, objects]
    moves = np.zeros((len(rows), 3, len(which)))
    for r, (k, moved) in enumerate(which):
        tangent = chain.contacts[k].tangent
        along = np.arctan2(tangent[1], tangent[0]) - headings
        moves[:, 0, r], moves[:, 1, r] = moved[objects] * np.cos(along), moved[objects] * np.sin(along)
    return moves / linear.sigma[..., None], [k for k, _ in which]
