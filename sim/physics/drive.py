"""Drives the plate of a physics model along a motion and records where all bodies go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.sim.physics.engine import PhysicsSettings, engine
from pushplan.sim.physics.model import LoadTransfer, PhysicsModel, build_model, joint_coordinates
from pushplan.sim.slip.packing import push_heights
from pushplan.util.arrays import FloatArray, IntArray

_BARELY = 1e-9
"""Least sliding speed that the feet are made for, m/s."""

Watch = Callable[[float, FloatArray], bool]
"""Called at every look with the share of the motion that is done and the motions (n + 1, 3); True ends the drive."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What the plate is made to do, in equal time steps.

    Attributes:
        dt: Time step, s.
        poses: (k + 1, 3) poses of the chain frame, seen from its first one.
        marks: Numbers of steps after which the bodies are looked at in any case.
    """

    dt: float
    poses: FloatArray
    marks: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Recording:
    """Where the bodies went.

    Attributes:
        steps: (m,) numbers of time steps after which the bodies were looked at.
        motions: (m, n + 1, 3) how the objects and, last, the plate have moved (see `PhysicsModel.motions`).
    """

    steps: IntArray
    motions: FloatArray


def drive(
    chain: Chain,
    motion: Motion,
    settings: PhysicsSettings,
    placed: FloatArray | None = None,
    watch: Watch | None = None,
) -> Recording:
    """Push a chain with the plate along a motion.

    First everything is carried along as one for a few steps, so that the feet settle; then only the plate is.

    Args:
        chain: The chain.
        motion: What the plate is made to do.
        settings: See there.
        placed: (n, 3) how the objects stand off their places, as motions of the chain frame; None for not at all.
        watch: See there.

    Raises:
        MissingEngineError: When the engine is not installed.
        PhysicsError: When the simulation does not stay finite.
        SupportError: When a load is not known.
    """
    transfer = LoadTransfer(chain.objects, push_heights(chain, chain.objects))
    model = build_model(chain, motion.dt, max(_sliding_speed(chain, motion), _BARELY), settings)
    bodies = np.arange(len(model.dofs))
    begin, end = (_all_moved(pose, placed, len(bodies)) for pose in motion.poses[:2])
    model.carry(True)
    for _ in range(settings.run_in):
        model.drive(bodies, begin, end)
        model.step()
        transfer.follow(model)
    model.carry(False)
    model.drive(bodies, begin, end)
    return _push(model, transfer, motion, settings, watch)


def _all_moved(motion: FloatArray, placed: FloatArray | None, bodies: int) -> FloatArray:
    """Return how all bodies have moved (n + 1, 3) when they follow the plate as they were placed."""
    moved = np.tile(motion, (bodies, 1))
    if placed is not None:
        moved[:-1] = se2.compose(motion, placed)
    return moved


def _push(
    model: PhysicsModel,
    transfer: LoadTransfer,
    motion: Motion,
    settings: PhysicsSettings,
    watch: Watch | None,
) -> Recording:
    """Drive the plate step by step: its joint coordinates are computed beforehand, the loop only hands them over."""
    count, plate = len(motion.poses) - 1, int(model.dofs[-1])
    ways = joint_coordinates(model.anchors[-1], motion.poses)
    speeds = np.diff(ways, axis=0) / motion.dt
    looks = np.union1d(np.linspace(0, count, settings.samples + 1).astype(np.int64), motion.marks).astype(
        np.int64
    )
    position, velocity = model.data.qpos[plate : plate + 3], model.data.qvel[plate : plate + 3]  # views
    step, motions = engine().mj_step, list[FloatArray]()
    for i in range(count + 1):
        position[:] = ways[i]
        if i == looks[len(motions)]:
            motions.append(model.motions())
            if watch is not None and watch(i / count, motions[-1]):
                break
        if i < count:
            velocity[:] = speeds[i]
            step(model.model, model.data)
            transfer.follow(model)
    model.require_sound()
    return Recording(looks[: len(motions)], np.array(motions))


def _sliding_speed(chain: Chain, motion: Motion) -> float:
    """Return the greatest speed of any point of the objects while nothing slips, m/s."""
    twists = se2.relative(motion.poses[:-1], motion.poses[1:]) / motion.dt
    corners = np.concatenate([obj.outline_chain for obj in chain.objects])
    x = twists[:, 0, None] - twists[:, 2, None] * corners[:, 1]
    y = twists[:, 1, None] + twists[:, 2, None] * corners[:, 0]
    return float(np.hypot(x, y).max())
