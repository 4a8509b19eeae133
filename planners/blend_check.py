"""The checks that a blended trajectory has to pass: stable at every sample, and free of collision."""

from __future__ import annotations

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.planners.checker import find_collision
from pushplan.planners.problem import body_reach, scenario_scene
from pushplan.planners.sweep import contact_times
from pushplan.scenario import Scenario
from pushplan.stable_set import StableSet
from pushplan.trajectory import Trajectory

APART = 0.1
"""Failures closer together than this (s) have one cause."""

RESTING = 1e-9
"""Twist components below this (m/s, rad/s) are rest."""


def failure_times(scenario: Scenario, stable: StableSet, trajectory: Trajectory) -> FloatArray:
    """Return when (k,) the trajectory fails, one time for each cause; none where it is good.

    It has to keep more than the scenario's margin at all its samples, at all its breaks and in between, and to
    be free of collision, by the compiled check of the planners and by the independent one.
    """
    times = _unstable_times(scenario, stable, trajectory)
    if not len(times):
        times = contact_times(scenario_scene(scenario), trajectory, body_reach(scenario))
    if not len(times):
        times = _collision_times(scenario, trajectory)
    groups = np.split(times, np.flatnonzero(np.diff(times) > APART) + 1)
    return np.array([np.median(group) for group in groups if len(group)])


def _unstable_times(scenario: Scenario, stable: StableSet, trajectory: Trajectory) -> FloatArray:
    breaks = trajectory.breaks
    times = np.unique(np.concatenate([trajectory.t, breaks, 0.5 * (breaks[:-1] + breaks[1:])]))
    twists = trajectory.twists_at(times)
    moving = np.abs(twists).max(axis=1) > RESTING
    times, twists = times[moving], twists[moving]
    return np.asarray(times[stable.margin(twists) <= scenario.stability.margin])


def _collision_times(scenario: Scenario, trajectory: Trajectory) -> FloatArray:
    """The time of the sample nearest to the first collision that the independent checker finds, if any."""
    hit = find_collision(scenario, trajectory.poses)
    if hit is None:
        return np.zeros(0)
    away = np.abs(trajectory.poses - np.array(hit.pose)).sum(axis=1)
    return trajectory.t[[int(np.argmin(away))]]
