"""Drives the plate of a physics model along a motion and records where all bodies go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.arrays import FloatArray, IntArray
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.sim.load_transfer import LoadTransfer
from pushplan.sim.physics_model import PhysicsModel, build_model
from pushplan.sim.physics_settings import PhysicsSettings

_BARELY = 1e-9
"""Least sliding speed that the feet are made for, m/s."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What the plate is made to do, in equal time steps.

    Attributes:
        dt: Time step, s.
        poses: (k + 1, 3) poses of the chain frame, seen from its first one.
        base: Number of the step after which slides and gaps are counted.
    """

    dt: float
    poses: FloatArray
    base: int = 0


@dataclass(frozen=True, eq=False)
class Recording:
    """Where the bodies went.

    Attributes:
        steps: (m,) numbers of time steps after which the bodies were looked at.
        motions: (m, n + 1, 3) how the objects and, last, the plate have moved (see `PhysicsModel.motions`).
    """

    steps: IntArray
    motions: FloatArray


def drive(chain: Chain, motion: Motion, settings: PhysicsSettings) -> Recording:
    """Push a chain with the plate along a motion.

    First everything is carried along as one for a few steps, so that the feet settle; then only the plate is.

    Raises:
        MissingEngineError: When the engine is not installed.
        PhysicsError: When the simulation does not stay finite.
        SupportError: When a load is not known.
    """
    transfer = LoadTransfer(chain)
    model = build_model(chain, motion.dt, max(_sliding_speed(chain, motion), _BARELY), settings)
    bodies = np.arange(len(model.dofs))
    model.carry(True)
    for _ in range(settings.run_in):
        model.drive(bodies, motion.poses[0], motion.poses[1])
        model.step()
        transfer.follow(model)
    model.carry(False)
    model.drive(bodies, motion.poses[0], motion.poses[1])
    return _push(model, transfer, motion, settings)


def _push(
    model: PhysicsModel, transfer: LoadTransfer, motion: Motion, settings: PhysicsSettings
) -> Recording:
    count = len(motion.poses) - 1
    plate = np.array([len(model.dofs) - 1])
    looks = np.union1d(np.linspace(0, count, settings.samples + 1).astype(np.int64), motion.base)
    motions: list[FloatArray] = []
    for i in range(count + 1):
        if i == looks[len(motions)]:
            model.drive(plate, motion.poses[i], motion.poses[i])
            motions.append(model.motions())
        if i < count:
            model.drive(plate, motion.poses[i], motion.poses[i + 1])
            model.step()
            transfer.follow(model)
    model.require_sound()
    return Recording(looks, np.array(motions))


def _sliding_speed(chain: Chain, motion: Motion) -> float:
    """Return the greatest speed of any point of the objects while nothing slips, m/s."""
    twists = se2.relative(motion.poses[:-1], motion.poses[1:]) / motion.dt
    corners = np.concatenate([obj.outline_chain for obj in chain.objects])
    x = twists[:, 0, None] - twists[:, 2, None] * corners[:, 1]
    y = twists[:, 1, None] + twists[:, 2, None] * corners[:, 0]
    return float(np.hypot(x, y).max())
