"""What a physics simulation of a push comes to: which contact moved, when, and by how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.geometry.se2 import compose, pose_errors, relative, rotate
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import BoolArray, FloatArray, frozen


@dataclass(frozen=True, eq=False)
class PhysicsReport:
    """The course of a simulated push, sampled m times; contacts are counted as in the chain.

    Attributes:
        chain: What was pushed.
        t: (m,) times, s.
        poses: (m, 3) pose of the chain frame, that is of the plate, in the world.
        object_poses: (m, n, 3) poses of the objects' own frames in the world.
        slide: (m, n) how far the middle of each contact segment has slid on the pushing body, m; to the left is
            positive.
        opening: (m, n) the wider of the gaps at the two ends of each segment, m.
        rotation: (m, n) turn of the pushed against the pushing body, rad.
        tolerance: Slide or opening over the length of the segment at which a contact counts as moved.
        seconds: Wall-clock time of the simulation.
        counted_from: Time from which slides and gaps are counted, s.
    """

    chain: Chain
    t: FloatArray
    poses: FloatArray
    object_poses: FloatArray
    slide: FloatArray
    opening: FloatArray
    rotation: FloatArray
    tolerance: float
    seconds: float
    counted_from: float = 0.0

    def __post_init__(self) -> None:
        m, n = len(self.t), len(self.chain.contacts)
        shapes = {
            "t": (m,),
            "poses": (m, 3),
            "object_poses": (m, n, 3),
            "slide": (m, n),
            "opening": (m, n),
            "rotation": (m, n),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(getattr(self, name), shape, f"{name} of the report"))

    @property
    def displacement(self) -> FloatArray:
        """(m, n) the larger of slide and opening, over the length of the segment."""
        lengths = np.array([contact.length for contact in self.chain.contacts])
        return np.asarray(np.maximum(np.abs(self.slide), self.opening) / lengths)

    @property
    def moved(self) -> BoolArray:
        """(n,) whether each contact moved."""
        return np.asarray((self.displacement > self.tolerance).any(axis=0))

    @property
    def kept(self) -> bool:
        """Whether no contact moved."""
        return not self.moved.any()

    @property
    def moved_at(self) -> FloatArray:
        """(n,) time at which each contact was first seen to have moved, s; infinite where it did not."""
        over = self.displacement > self.tolerance
        return np.where(over.any(axis=0), self.t[over.argmax(axis=0)], np.inf)

    @property
    def object_errors(self) -> FloatArray:
        """(n, 2) how far (m) and by what angle (rad) each object ends off the place that the plate wants it at."""
        return pose_errors(self.object_poses[-1], compose(self.poses[-1], self.chain.places))

    def sentences(self) -> tuple[str, ...]:
        """Return for each contact what it did, for people."""
        return tuple(self._sentence(k) for k in range(len(self.chain.contacts)))

    def _sentence(self, k: int) -> str:
        slide, opening = np.abs(self.slide[:, k]).max(), self.opening[:, k].max()
        turn = np.degrees(np.abs(self.rotation[:, k]).max())
        verdict = f"moved from {self.moved_at[k]:.3g} s on" if self.moved[k] else "held"
        return (
            f"{self.chain.contact_name(k)} {verdict}: "
            f"slid {1e3 * slide:.2g} mm, opened {1e3 * opening:.2g} mm, turned {turn:.2g} deg"
        )


def contact_motion(
    chain: Chain, motions: FloatArray, base: int | None = 0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return slide, opening and rotation (m, n) of the contacts, counted from sample `base` on and 0 before.

    Args:
        chain: The chain.
        motions: (m, n + 1, 3) how the objects and, last, the plate have moved, as poses of frames that began as the
            chain frame.
        base: Number of a sample; None counts against the contacts as the chain has them.
    """
    shape = (len(motions), len(chain.contacts))
    slide, opening, rotation = np.empty(shape), np.empty(shape), np.empty(shape)
    for k, contact in enumerate(chain.contacts):
        moved = relative(motions[:, contact.pusher], motions[:, contact.pushed])
        ends = np.stack([contact.right, contact.left])
        shifts = moved[:, None, :2] + rotate(moved[:, None, 2], ends) - ends
        if base is not None:
            moved, shifts = _since(moved, base), _since(shifts, base)
        slide[:, k] = shifts.mean(axis=1) @ contact.tangent
        opening[:, k] = (shifts @ contact.normal).max(axis=1)
        rotation[:, k] = moved[:, 2]
    return slide, opening, rotation


def _since(values: FloatArray, base: int) -> FloatArray:
    """Return what has been added to values (m, ...) since sample `base`, 0 before."""
    before = (np.arange(len(values)) < base).reshape(-1, *[1] * (values.ndim - 1))
    return np.where(before, 0.0, values - values[base])
