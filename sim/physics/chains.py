"""Push a chain alone in the physics engine: with a constant twist, or along a trajectory."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import GRAVITY, Chain
from pushplan.mechanics.sphere import checked_twists
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.physics.drive import ContactWatch, Motion, drive
from pushplan.sim.physics.engine import PhysicsError, PhysicsSettings
from pushplan.sim.report import ContactReport, Part, report_of
from pushplan.util.arrays import FloatArray

DEFAULTS = PhysicsSettings()
TRAVEL = 0.1
"""Default travel of a constant twist over the chain's characteristic length."""


def simulate_twist(
    chain: Chain, twist: ArrayLike, travel: float | None = None, settings: PhysicsSettings = DEFAULTS
) -> ContactReport:
    """Push a chain with a constant twist, so slowly that inertia does not matter.

    Args:
        chain: Objects with known loads.
        twist: (3,) body twist in the chain frame; only its direction matters.
        travel: How far to push: hypot(v, L omega) times the time, L being the chain's characteristic length, m;
            None stands for 0.1 L.
        settings: See there.

    Raises:
        MissingEngineError: When the engine is not installed.
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
    way = travel * _soft_start(int(np.ceil(travel / (settings.step * length))), settings.run_in)
    dt = float(way[-1] - way[-2]) / _creep(chain, settings)
    motion = _counted(chain, Motion(dt, se2.exp(direction * way[:, None])), settings)
    watch = ContactWatch(chain, settings.tolerance, motion.marks[0] / (len(motion.poses) - 1))
    return _simulate(chain, np.zeros(3), motion, dt, settings, watch)


def simulate_trajectory(
    chain: Chain,
    trajectory: Trajectory,
    quasi_static: bool = False,
    settings: PhysicsSettings = DEFAULTS,
    *,
    placed: FloatArray | None = None,
) -> ContactReport:
    """Push a chain along a trajectory, at full speed with all inertia.

    Args:
        chain: Objects with known loads.
        trajectory: What the plate is made to do.
        quasi_static: Follow it so slowly instead that inertia does not matter; times are reported as planned.
        settings: See there.
        placed: (n, 3) how the objects stand off their places (see `perturb.shifted_places`); slides and gaps then
            count from the moment on in which all contacts are closed. None for not at all.

    Raises:
        MissingEngineError: When the engine is not installed.
        PhysicsError: When there is nothing to simulate, or the simulation does not stay finite.
        SupportError: When a load is not known.
    """
    length = chain.characteristic_length
    peak = float(_rate(trajectory.twists, length).max(initial=0.0))
    if not peak > 0.0:
        raise PhysicsError("the trajectory does not move: there is nothing to simulate")
    wanted = settings.step * length / peak if quasi_static else settings.time_step
    steps = int(np.ceil(trajectory.duration / wanted))
    dt = trajectory.duration / steps
    poses = se2.relative(trajectory.start, trajectory.poses_at(dt * np.arange(steps + 1)))
    if quasi_static:
        motion = _counted(chain, Motion(dt * peak / _creep(chain, settings), poses), settings)
    else:
        motion = Motion(dt, poses)
    begin = motion.marks[0] / steps if motion.marks else 0.0
    watch = ContactWatch(chain, settings.tolerance, begin, placed=placed)
    return _simulate(chain, trajectory.start, motion, dt, settings, watch)


def _simulate(
    chain: Chain, start: FloatArray, motion: Motion, dt: float, settings: PhysicsSettings, watch: ContactWatch
) -> ContactReport:
    """Return the report of a motion from `start`; one of its steps counts as `dt`."""
    began = perf_counter()
    recording = drive(chain, motion, settings, watch.placed, watch)
    poses = se2.compose(start, recording.motions[:, -1])
    objects = se2.compose(start, se2.compose(recording.motions[:, :-1], chain.places))
    t = np.asarray(dt * recording.steps, dtype=np.float64)
    part = Part(0, chain, t, poses, chain.pusher.plate_pose, objects, watch.base)
    names, wanted = tuple(obj.name for obj in chain.objects), se2.compose(poses[-1], chain.places)
    ended = {"stalled_at": float(t[-1])} if recording.stalled else {}
    return report_of(names, (part,), settings.tolerance, wanted, **ended, seconds=perf_counter() - began)


def _counted(chain: Chain, motion: Motion, settings: PhysicsSettings) -> Motion:
    """Return the motion with slides and gaps counted from where the contacts have taken up their load."""
    length = chain.characteristic_length
    way = np.cumsum(_rate(se2.relative(motion.poses[:-1], motion.poses[1:]), length))
    taken_up = np.searchsorted(way, min(settings.taking_up * length, 0.5 * float(way[-1])))
    return replace(motion, marks=(int(taken_up) + 1,))


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


def _creep(chain: Chain, settings: PhysicsSettings) -> float:
    """Return the speed at which inertia does not matter: inertia = v^2 / (mu g L)."""
    frictions = [obj.floor_friction for obj in chain.objects if obj.floor_friction > 0.0]
    if not frictions:
        raise PhysicsError("no object has friction with the floor: no speed is slow enough to neglect inertia")
    return float(np.sqrt(settings.inertia * min(frictions) * GRAVITY * chain.characteristic_length))
