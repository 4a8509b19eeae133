"""The checks that a blended trajectory has to pass: stable at every sample, and free of collision."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.contacts.contact_kernel import contact_margins_of
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.validation.clearance import find_collision
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sets.ecof_set import EcofSet
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, columns_of

RESTING = 1e-9
"""Twist components below this (m/s, rad/s) are rest."""


def unstable_times(
    scenario: Scenario, stable: StableSet, trajectory: Trajectory, bounds: Bounds
) -> FloatArray:
    """Return when (k,) the trajectory does not keep more than the scenario's margins, worst first, s.

    It is looked at its samples, its breaks and half-way between them; where the pusher rests, nothing is asked.
    """
    breaks = trajectory.breaks
    times = np.unique(np.concatenate([trajectory.t, breaks, 0.5 * (breaks[:-1] + breaks[1:])]))
    twists = trajectory.twists_at(times)
    moving = np.abs(columns_of(twists)).max(axis=0) > RESTING
    times, twists = times[moving], twists[moving]
    contacts, floor = bounds.contacts, None
    if contacts is not None and isinstance(stable, EcofSet) and stable.chain is contacts.chain:
        floor = contacts.floor_wrenches(twists)  # those that the set asks for
        margins = columns_of(contact_margins_of(stable.packed, floor)).min(axis=0)
    else:
        margins = stable.margin(twists)
    spare = margins - scenario.required_margin
    if contacts is not None:
        with_inertia = contacts.margins(twists, trajectory.rates_at(times), floor)
        spare = np.minimum(spare, columns_of(with_inertia).min(axis=0) - bounds.margin)
    worst = np.argsort(spare, kind="stable")
    return np.asarray(times[worst][spare[worst] <= 0.0])


def off_chords(trajectory: Trajectory, reach: float) -> float:
    """Return how far (m) a body gets, at most, from the constant twists between the samples of its motion.

    The part of dV/dt along the twist V changes when the body is somewhere, not where it is. The rest takes a point by
    no more than h^2 / 8 of the acceleration that it has from it, h being the time between samples.

    Args:
        trajectory: The motion.
        reach: Distance from the chain frame's origin to the body's farthest point, m.
    """
    durations, scale = np.diff(trajectory.breaks)[:, None], np.array([1.0, 1.0, reach])
    c0, c1, c2 = (trajectory.coefficients[:, k] * scale for k in range(3))
    twists = np.concatenate([c0, c0 + durations * (c1 + durations * c2)])
    rates = np.concatenate([c1, c1 + 2.0 * durations * c2])
    along = (rates * twists).sum(axis=1) / np.maximum((twists * twists).sum(axis=1), RESTING**2)
    rest = rates - along[:, None] * twists
    most = np.hypot(rest[:, 0], rest[:, 1]) + np.abs(rest[:, 2])
    return float(most.max(initial=0.0)) / (8.0 * trajectory.sample_rate**2)


def collision_times(scenario: Scenario, trajectory: Trajectory) -> FloatArray:
    """Return the time of the sample nearest to the first collision that the independent checker finds, if any."""
    hit = find_collision(scenario, trajectory.poses)
    if hit is None:
        return np.zeros(0)
    away = np.abs(trajectory.poses - np.array(hit.pose)).sum(axis=1)
    return trajectory.t[[int(np.argmin(away))]]
