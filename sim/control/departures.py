"""Detection of objects that have left their places on the plate.

An object is **away** if the mean of a few measurements differs from the pose that the estimator expects.

**Slides** along contacts are found by likelihood ratios against constant errors of sensors and wheels. A constant
explains an error that is there from the beginning, but not one that begins later. Steps and ramps along each contact
are tried from several moments on, for the object that is pushed through it alone or with all that it carries. A slide
is accepted if it is large enough to matter and

    2 (log L1 - log L0) > ln N + 10,

with the constants fitted again in both cases.

A ramp of all objects that the plate pushes is the hardest to distinguish from errors of wheels: all objects move as
if the plate were elsewhere. On an arc, a ramp of 10 mm a metre of a single box gains 20 +- 9 over 8 mm. Such ramps
are few, and long ones differ little from one another. Errors are seldom mistaken for them, so less gain is required.
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
"""Smallest deviation of an object in standard deviations: of the mean of many measurements, of the mean of two, and
of the expected pose."""
UNSETTLED = 1.5e-3, math.radians(0.4)
"""Typical initial opening of contacts (m, rad)."""
LEAST = 0.7
"""Smallest size of a slide as a share of the slack; its size is known more accurately than a single deviation."""
FEWEST = 16
"""Smallest number of samples."""
LATEST = 5
"""Smallest number of samples after the beginning of a slide."""
SURELY, LONG, ENOUGH = 2e-3, 5e-3, 9.0
"""Ramps of all objects: size (m) up to which they need the usual gain, size from which they need `ENOUGH`, and that
gain. In 38 runs without a slide (seeds 1 to 3) no ramp of 5 mm or more gained above 6.3."""
RAMPS = np.linspace(0.1, 0.9, 9)
"""Tried beginnings of ramps, as shares of the samples."""
STEPS = (6, 9, 13, 18, 24, 30)
"""Tried positions of steps, in samples before the last one."""


@dataclass(frozen=True, eq=False)
class Slide:
    """Slide of an object along a contact.

    Attributes:
        contact: Index of the contact.
        size: Length, m, left positive.
        since: Time of its beginning, s.
    """

    contact: int
    size: float
    since: float


def off_place(estimator: Estimator, recent: list[Sample], names: Sequence[str], settled: bool) -> str:
    """Return a text with the object that has left its place and its deviation; empty if none has.

    The mean error of half or three quarters of the measurements of a look shows a slow departure, that of two
    measurements a quick one.

    Args:
        estimator: Estimator with the expected poses.
        recent: Last measurements, up to three quarters of those of a look.
        names: Names of the objects.
        settled: Whether initially open contacts have closed.
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
    """Return the most likely slide; None if constants explain the measurements.

    Args:
        estimator: Estimator of the constants.
        chain: Chain with the current places of its objects.
        after: Earliest time of its beginning, s.
    """
    if estimator.count < FEWEST:
        return None
    # Student's weights treat a fifth of a slide as outliers; weights without this gave false alarms in 2 of 60 runs.
    linear = estimator.linear()
    shapes, begins, rises = _shapes(estimator.ways(linear.samples))
    late = np.array([linear.samples[begin].time > after for begin in begins])
    if not late.any():
        return None
    shapes, begins, rises = shapes[:, late], begins[late], rises[late]
    moves, which = _moves(linear, chain)
    # Sums over the m measurements for each pair of a move (r) and a shape (s).
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
    required = _required_gain(far, np.outer(of_all, rises).ravel(), np.log(3.0 * len(along)) + 10.0)
    beyond = np.where(far < LEAST * estimator.settings.position_slack, -np.inf, gain - required)
    best = int(np.argmax(beyond))
    if beyond[best] <= 0.0:
        return None
    move, shape = divmod(best, len(begins))
    since = linear.samples[begins[shape]].time
    return Slide(which[move], float(size[best]), since)


def _required_gain(far: FloatArray, ramps_of_all: BoolArray, usual: float) -> FloatArray:
    """Return the required gain of slides (q,) with sizes `far`, m; it is lower for ramps of all objects."""
    lower = (usual - ENOUGH) * np.clip((far - SURELY) / (LONG - SURELY), 0.0, 1.0)
    return np.asarray(usual - np.where(ramps_of_all, lower, 0.0))


def _shapes(ways: FloatArray) -> tuple[FloatArray, IntArray, BoolArray]:
    """Return the shapes of slides (k, s), the samples (s,) at which they begin, and whether they are ramps (s,).

    Ramps grow with the driven distance, m; steps have a height of 1.
    """
    count = len(ways)
    ramps = sorted({int(share * count) for share in RAMPS} - set(range(count - LATEST, count)))
    steps = [count - back for back in STEPS if back <= count - LATEST]
    begins, rises = np.array([*ramps, *steps]), np.arange(len(ramps) + len(steps)) < len(ramps)
    rising, jumped = np.maximum(ways[:, None] - ways[begins], 0.0), np.arange(count)[:, None] >= begins
    return np.where(rises, rising, jumped), begins, rises


def _moves(linear: Linear, chain: Chain) -> tuple[FloatArray, list[int]]:
    """Return the change of the errors (m, 3, r) by 1 m along each contact, and the contact of each of the r moves."""
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
