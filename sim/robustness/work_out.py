"""Work out what a plan can bear, by root finding on the contacts' margins with inertia along its trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.plans.plan import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.robustness.changes import Change, FloorChange, LoadChange, Shift, Turn
from pushplan.sim.robustness.instants import thinned_instants
from pushplan.sim.robustness.model import Model
from pushplan.sim.robustness.roots import first_loss, least_polynomial_root
from pushplan.sim.robustness.tolerance import MOST_ANGLE, MOST_SHARE, Tolerance
from pushplan.util.arrays import FloatArray

SENSES = (1.0, -1.0)
USED_UP = Tolerance(contact_friction=1.0, floor_friction=0.0, load=0.0, position=0.0, angle=0.0)
"""What a plan bears on which a contact does not hold as stated."""


def tolerance_of(chain: Chain, trajectory: Trajectory) -> Tolerance:
    """Return what `trajectory` can bear when `chain` is pushed along it.

    Looked at are the trajectory's samples, those that an execution checks, with the twist and the twist rate as
    commanded; where the pusher rests, the direction that comes next.

    Args:
        chain: The objects, their contacts on edges of both bodies.
        trajectory: As commanded.

    Returns:
        The tolerance, its numbers None where a load is not known.

    Raises:
        ChainError: When a contact does not lie on an edge of both bodies.
        SupportError: When a push at the pusher's contact height could lift a part of an object.
    """
    if not chain.loads_known:
        return Tolerance()
    twists, rates = trajectory.directions, trajectory.rates_at(trajectory.t)
    return tolerance_along(chain, twists, rates)


def least_tolerance(segments: Sequence[Segment]) -> Tolerance:
    """Return what all pushes among the segments of a plan can bear."""
    each = [
        tolerance_of(push.load.chain, push.contact_trajectory)
        for push in segments
        if push.pushes and push.load is not None
    ]
    if not all(one.known for one in each):
        return Tolerance()
    # A contact friction is the factor down to which it may go; all others are what may be off.
    numbers = {field.name: [getattr(one, field.name) for one in each] for field in fields(Tolerance)}
    return Tolerance(
        **{name: (max if name == "contact_friction" else min)(found) for name, found in numbers.items()}
    )


def tolerance_along(chain: Chain, twists: FloatArray, rates: FloatArray) -> Tolerance:
    """Return what a motion with body twists (m, 3), none zero, and rates (m, 3) can bear; see `tolerance_of`."""
    model = Model(chain, thinned_instants(twists, rates, chain.characteristic_length))
    if not model.values.min() > 0.0:
        return USED_UP
    everyone = range(len(chain.objects))
    floor = [FloorChange(model, i, sense) for i in everyone for sense in SENSES]
    lean = [LoadChange(model, i, sense, axis) for i in everyone for axis in (0, 1) for sense in SENSES]
    aside = [Shift(model, i, sense) for i in everyone for sense in SENSES]
    turned = [Turn(model, i, sense) for i in everyone for sense in SENSES]
    return Tolerance(
        contact_friction=_contact_friction(model.values),
        floor_friction=_least(floor, MOST_SHARE),
        load=_least([change for change in lean if change.lean is not None], MOST_SHARE),
        position=_least(aside, max(change.most for change in aside)),
        angle=_least(turned, MOST_ANGLE),
    )


def _contact_friction(values: FloatArray) -> float:
    """Return the largest |f_t| / (mu f_n): the first two facets are mu f_n - f_t and mu f_n + f_t."""
    below, above = values[..., 0], values[..., 1]
    return float(np.max(np.abs(above - below) / (above + below)))


def _least(changes: Sequence[Change], most: float) -> float:
    """Return the least size, at most `most`, at which one of the changes loses a contact."""
    for change in changes:
        if change.linear:
            most = min(most, change.most)
            if change.sense > 0.0:  # both senses at once
                most = min(most, least_polynomial_root(change))
    return first_loss([change for change in changes if not change.linear], most)
