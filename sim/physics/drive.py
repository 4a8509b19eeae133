"""Drives the plate of a physics model along a motion and records where all bodies go."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.sim.physics.engine import ForceMeter, PhysicsSettings
from pushplan.sim.physics.model import PhysicsModel, build_model
from pushplan.sim.report import CLOSED, contact_motion
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray, IntArray

_BARELY = 1e-9
"""Least sliding speed that the feet are made for, m/s."""


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
        stalled: It ends where the plate would have had to push with more force than it has.
        forces: (k, 2) of the plate in every time step, N, in the axes of the motion's first pose.
    """

    steps: IntArray
    motions: FloatArray
    stalled: bool
    forces: FloatArray


@dataclass(eq=False)
class ContactWatch:
    """Looks at the contacts while a chain is pushed: from when on slides and gaps count, and whether to go on.

    Attributes:
        chain: What is pushed.
        tolerance: Slide or gap over the length of a segment above which a contact counts as moved.
        begin: Share of the motion before which nothing counts.
        end: Share after which nothing does.
        placed: (n, 3) how the objects stand off their places at the start, as motions of the chain frame, or None.
        until_moved: Ask to stop when a contact has moved.
        progress: Called with the share that is done.
        base: Number of the look from which slides and gaps count. Objects off their places touch with a corner only
            and have to close first, until no gap is wider than a tenth of the tolerance. None before that.
    """

    chain: Chain
    tolerance: float
    begin: float = 0.0
    end: float = 1.0
    placed: FloatArray | None = None
    until_moved: bool = False
    progress: Callable[[float], None] | None = None
    base: int | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._most = self.tolerance * np.array([contact.length for contact in self.chain.contacts])
        self._looks, self._reference = 0, np.zeros(0)

    def look(self, share: float, motions: FloatArray) -> bool:
        """Take a look at motions (n + 1, 3) when a share of the motion is done; tell whether to stop."""
        if self.progress is not None:
            self.progress(share)
        counts = self.begin <= share <= self.end
        if self.base is None and counts and self._closed(motions):
            self.base, self._reference = self._looks, motions
        self._looks += 1
        return self.until_moved and counts and self.base is not None and self._moved(motions)

    def _closed(self, motions: FloatArray) -> bool:
        if self.placed is None:
            return True
        opening = contact_motion(self.chain, motions[None], None)[1][0]
        return bool((opening <= CLOSED * self._most).all())

    def _moved(self, motions: FloatArray) -> bool:
        slide, opening, _ = contact_motion(self.chain, np.stack([self._reference, motions]))
        return bool((np.maximum(np.abs(slide[1]), opening[1]) > self._most).any())


def drive(chain: Chain, motion: Motion, settings: PhysicsSettings, watch: ContactWatch | None = None) -> Recording:
    """Push a chain with the plate along a motion.

    First everything is carried along as one for a few steps, so that the feet settle; then only the plate is.

    Args:
        chain: The chain.
        motion: What the plate is made to do.
        settings: See there.
        watch: Where the objects stand at first, and when to stop; None where they are in place, and to the end.

    Raises:
        MissingExtraError: When the engine is not installed.
        PhysicsError: When the simulation does not stay finite.
        SupportError: When a load is not known.
    """
    sliding = max(_sliding_speed(chain, motion), _BARELY)
    placed_at = np.vstack([chain.places, np.zeros(3)])
    model = build_model(World.from_chain(chain), chain, placed_at, sliding, motion.dt, settings)
    bodies = np.arange(len(model.dofs))
    placed = np.zeros((len(bodies), 3))  # as motions of the chain frame, the plate's last
    if watch is not None and watch.placed is not None:
        placed[:-1] = watch.placed
    begin, end = (se2.compose(pose, placed) for pose in motion.poses[:2])
    model.carry(True)
    for _ in range(settings.run_in):
        model.drive(bodies, begin, end)
        model.step()
    model.carry(False)
    model.drive(bodies, begin, end)
    return _push(model, motion, settings, watch, ForceMeter(chain.pusher.limits.force, motion.dt))


def _push(
    model: PhysicsModel, motion: Motion, settings: PhysicsSettings, watch: ContactWatch | None, meter: ForceMeter
) -> Recording:
    """Drive the plate from look to look."""
    count = len(motion.poses) - 1
    looks = np.union1d(np.linspace(0, count, settings.samples + 1).astype(np.int64), motion.marks).astype(np.int64)
    steps, motions, forces, stalled = [0], [model.motions()], [np.zeros((0, 3))], False
    for begin, end in itertools.pairwise(looks.tolist()):
        if stalled or (watch is not None and watch.look(begin / count, motions[-1])):
            break
        found, stalled = model.march(motion.poses[begin : end + 1], meter)
        steps.append(begin + len(found))
        motions.append(model.motions())
        forces.append(-found)
    else:
        if watch is not None and not stalled:
            watch.look(1.0, motions[-1])
    model.require_sound()
    return Recording(np.array(steps), np.array(motions), stalled, np.concatenate(forces)[:, :2])


def _sliding_speed(chain: Chain, motion: Motion) -> float:
    """Return the greatest speed of any point of the objects while nothing slips, m/s."""
    twists = se2.relative(motion.poses[:-1], motion.poses[1:]) / motion.dt
    corners = np.concatenate([obj.outline_chain for obj in chain.objects])
    x = twists[:, 0, None] - twists[:, 2, None] * corners[:, 1]
    y = twists[:, 1, None] + twists[:, 2, None] * corners[:, 0]
    return float(np.hypot(x, y).max())
