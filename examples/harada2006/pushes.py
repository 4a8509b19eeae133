"""Push a chain alone in the physics engine: with a constant twist, or along a trajectory.

Slowly means without inertia within a time step: v^2 / (mu g L), inertial over friction forces, is `INERTIA`, well
below the travel of a time step over L. Then friction stops a body that is let go within one time step, and contacts
neither chatter nor open by the second-order errors of a step.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import GRAVITY, Chain
from pushplan.mechanics.sphere import checked_twists
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.physics.engine import PhysicsError, PhysicsSettings
from pushplan.sim.physics.simulator import PhysicsSimulator, sliding_speed
from pushplan.sim.report import ContactReport, Part, report_of
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

DEFAULTS = PhysicsSettings()
SLIPPING, SLIPPING_STEP = PhysicsSettings(friction_stiffness=1e5, indentation=3e-5, slip_time=20.0), 3e-5
"""Settings and step with which contacts slide as far as Coulomb's law says, ten times slower to simulate."""
TRAVEL = 0.1
"""Default travel of a constant twist over the chain's characteristic length L."""
STEP = 2.5e-4
"""Travel in one time step, over L."""
INERTIA = 1e-5
TAKING_UP = 6e-3
"""Travel over L in which contacts take up their load and corners sink into faces; slides count from there on."""
LOOKS = 200
"""Looks at a push."""


def simulate_twist(
    chain: Chain,
    twist: ArrayLike,
    travel: float | None = None,
    settings: PhysicsSettings = DEFAULTS,
    step: float = STEP,
) -> ContactReport:
    """Push a chain with a constant twist.

    Args:
        chain: Objects with known loads.
        twist: (3,) body twist in the chain frame; only its direction matters.
        travel: How far to push: hypot(v, L omega) times the time, L being the chain's characteristic length, m;
            None stands for 0.1 L.
        settings: See there.
        step: Travel in one time step, over L.

    Raises:
        MissingExtraError: When the engine is not installed.
        PhysicsError: When no object has friction with the floor, or the simulation does not stay finite.
        PushplanError: On a twist that is zero, not finite or not (3,), or a travel that is not positive.
        SupportError: When a load is not known.
    """
    length = chain.characteristic_length
    direction = checked_twists(np.asarray(twist, dtype=np.float64)[None])[0]
    direction = direction / _rate(direction[None], length)[0]
    travel = TRAVEL * length if travel is None else travel
    if not travel > 0.0:
        raise PushplanError(f"travel is {travel} m; it must be > 0")
    way = travel * _soft_start(int(np.ceil(travel / (step * length))), settings.run_in)
    dt, frames = float(way[-1] - way[-2]) / _creep(chain), se2.exp(direction * way[:, None])
    return _simulate(chain, frames, dt, replace(settings, time_step=dt), _taken_up(chain, frames))


def simulate_trajectory(chain: Chain, trajectory: Trajectory, slow: bool = False) -> ContactReport:
    """Push a chain along a trajectory, with all inertia or `slow`; times are reported as planned.

    Raises:
        MissingExtraError: When the engine is not installed.
        PhysicsError: When there is nothing to simulate, or the simulation does not stay finite.
        SupportError: When a load is not known.
    """
    length = chain.characteristic_length
    peak = float(_rate(trajectory.twists, length).max(initial=0.0))
    if not peak > 0.0:
        raise PhysicsError("the trajectory does not move: there is nothing to simulate")
    steps = int(np.ceil(trajectory.duration / (STEP * length / peak if slow else DEFAULTS.time_step)))
    dt = trajectory.duration / steps
    frames = trajectory.poses_at(dt * np.arange(steps + 1))
    settings = replace(DEFAULTS, time_step=dt * peak / _creep(chain) if slow else dt)
    return _simulate(chain, frames, dt, settings, _taken_up(chain, frames) if slow else 0)


def _simulate(chain: Chain, frames: FloatArray, dt: float, settings: PhysicsSettings, counted: int) -> ContactReport:
    """Return the report of a motion of the chain frame, slides and gaps counted from one of its steps of `dt` on."""
    count = len(frames) - 1
    sliding = sliding_speed(chain, frames, settings.time_step)
    simulator = PhysicsSimulator(World.from_chain(chain, frames[0]), settings, sliding)
    looks = np.union1d(np.linspace(0, count, LOOKS + 1).astype(np.int64), counted)
    objects = [simulator.object_poses]
    for begin, end in pairwise(looks.tolist()):
        simulator.move_along(frames[begin : end + 1])
        objects.append(simulator.object_poses)
    t, poses, base = np.asarray(dt * looks, dtype=np.float64), frames[looks], int(np.searchsorted(looks, counted))
    part = Part(0, chain, t, poses, chain.pusher.plate_pose, np.array(objects), base)
    names, wanted = tuple(obj.name for obj in chain.objects), se2.compose(poses[-1], chain.places)
    return report_of(names, (part,), wanted)


def _taken_up(chain: Chain, frames: FloatArray) -> int:
    """Return the number of the step after which the contacts have taken up their load: slides count from there on."""
    length = chain.characteristic_length
    way = np.cumsum(_rate(se2.relative(frames[:-1], frames[1:]), length))
    return int(np.searchsorted(way, min(TAKING_UP * length, 0.5 * float(way[-1])))) + 1


def _soft_start(steps: int, ramp: int) -> FloatArray:
    """Return parts of the way (k,) from 0 to 1, at even speed but for the first `ramp` steps, where it rises.

    A contact that has to bear its force all at once slips before it does, in proportion to the first step.
    """
    speed = np.minimum((np.arange(steps + ramp // 2) + 1.0) ** 2 / ramp**2, 1.0)
    way = np.concatenate([[0.0], np.cumsum(speed)])
    return np.asarray(way / way[-1])


def _rate(twists: FloatArray, length: float) -> FloatArray:
    """Return how fast body twists (k, 3) move the chain, hypot(v, L omega)."""
    return np.asarray(np.sqrt(twists[:, 0] ** 2 + twists[:, 1] ** 2 + (length * twists[:, 2]) ** 2))


def _creep(chain: Chain) -> float:
    """Return the speed at which inertia does not matter: inertia = v^2 / (mu g L)."""
    frictions = [obj.floor_friction for obj in chain.objects if obj.floor_friction > 0.0]
    if not frictions:
        raise PhysicsError("no object has friction with the floor: no speed is slow enough to neglect inertia")
    return float(np.sqrt(INERTIA * min(frictions) * GRAVITY * chain.characteristic_length))
