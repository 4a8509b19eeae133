"""Whether a trajectory holds in the physics engine, at its own speed: what `--physics` asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import ceil

from pushplan.mechanics.chain import Chain
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.physics.model.settings import PhysicsSettings
from pushplan.sim.physics.report import PhysicsReport
from pushplan.sim.physics.simulate import simulate_trajectory
from pushplan.util.arrays import FloatArray

HARD = PhysicsSettings(time_step=1e-3, indentation=5e-6)
"""Hard contacts creep least, and a longer time step is enough. Where contacts slip, they slip too far with these."""
STEPS = (1.0, 0.25, 0.125)
"""Shares of the time step that a motion is executed with, one after the other while a contact moves.

The engine's friction creeps: what it holds still slides a little, in proportion to the way and to the time step. On
20 m of way that reaches the thousandth of a segment at which a contact counts as moved: 1.0e-3 with a step of 1 ms,
0.8e-3 with 0.25 ms (random 4 of benchmarks/plans_in_physics.py); on 35 m it is 2.6e-3 and 1.0e-3 (random 26).
"""
LATER = 1.2
"""What creeps counts as moved this much later, at least, in the next smaller step; what slips, at the same time."""
LOOKS = 50.0
"""Looks per second at a motion, which may open a contact and close it again."""


def verdict_of_physics(
    chain: Chain,
    trajectory: Trajectory,
    *,
    placed: FloatArray | None = None,
    until_moved: bool = False,
    progress: Callable[[float], None] | None = None,
) -> PhysicsReport:
    """Execute a trajectory at full speed, in smaller steps as long as a contact creeps; the last report counts.

    Args:
        chain: Objects with known loads.
        trajectory: What the plate is made to do.
        placed: (n, 3) how the objects stand off their places (see `mechanics.perturb.shifted_places`), None for
            not at all.
        until_moved: End as soon as a contact counts as moved.
        progress: Called now and then with the share of the trajectory that is done.

    Raises:
        MissingEngineError: When the engine is not installed.
        PhysicsError: When there is nothing to simulate, or the simulation does not stay finite.
        SupportError: When a load is not known.
    """
    samples = max(HARD.samples, ceil(LOOKS * trajectory.duration))
    moved_at = 0.0
    for share in STEPS:
        settings = replace(HARD, samples=samples, time_step=share * HARD.time_step)
        report = simulate_trajectory(
            chain, trajectory, settings=settings, placed=placed, until_moved=True, progress=progress
        )
        before, moved_at = moved_at, float(report.moved_at.min())
        if report.kept or (before > 0.0 and moved_at <= LATER * before):
            break
    if report.kept or until_moved:
        return report
    return simulate_trajectory(chain, trajectory, settings=settings, placed=placed, progress=progress)
