"""From a planned path to the trajectory that its scenario asks for."""

from __future__ import annotations

from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.names import KNOWN_LOAD_SETS
from pushplan.path import PushPath
from pushplan.planners.blending import blend_path
from pushplan.planners.timing import time_path
from pushplan.scenario import Scenario
from pushplan.stable_sets.stable_set import StableSet
from pushplan.trajectory import SAMPLE_RATE, Trajectory


def make_trajectory(
    scenario: Scenario, path: PushPath, stable: StableSet, rate: float = SAMPLE_RATE
) -> Trajectory:
    """Return a path timed within the limits of the pusher and, if asked for, of the contacts.

    Args:
        scenario: Chooses by `trajectory` whether the pusher stops at every corner (`exact`) or at as few as
            possible (`blended`), and by `limits.contact` whether inertia may make a contact slip.
        path: Constant-twist arcs, free of collision and stable.
        stable: The set that the path was planned in.
        rate: Samples per second of the trajectory.

    Raises:
        TimingError: When an arc cannot be timed within the limits.
    """
    limits = scenario.chain.pusher.limits
    contacts = contact_dynamics(scenario, stable) if limits.contact == "dynamic" else None
    if scenario.trajectory == "blended":
        return blend_path(scenario, path, stable, rate, contacts).trajectory
    return time_path(path, limits, rate, contacts)


def contact_dynamics(scenario: Scenario, stable: StableSet) -> ContactDynamics:
    """Return the contact conditions with inertia, in the worst case over all pressures where the set is for that."""
    known = stable.loads_known and stable.name in KNOWN_LOAD_SETS
    return ContactDynamics(scenario.chain, worst_case=not known)
