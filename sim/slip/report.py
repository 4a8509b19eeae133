"""What a push with slip comes to: where everything went, what the contacts did, which failed first, and where."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from pushplan.geometry import se2
from pushplan.scenario.parts import Goal
from pushplan.sim.physics.report import contact_motion
from pushplan.sim.slip.kernels import state
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import BoolArray, FloatArray, IntArray, frozen

_CLOSED = 0.1
"""A contact counts as closed when its gap is below this part of what counts as moved."""


class Mode(IntEnum):
    """What a contact does in a step."""

    OPEN = state.OPEN
    STICK = state.STICK
    SLIDE = state.SLIDE
    ROLL = state.ROLL
    ROLL_SLIDE = state.ROLL_SLIDE


@dataclass(frozen=True)
class ContactLoss:
    """Where a contact was lost.

    Attributes:
        time: s.
        contact: Index of the contact (0 touches the plate).
        mode: What it does there.
        pose: Pose of the chain frame in the world.
        point: Middle of the contact segment in the world, m.
    """

    time: float
    contact: int
    mode: Mode
    pose: tuple[float, float, float]
    point: tuple[float, float]


@dataclass(frozen=True, eq=False)
class SlipReport:
    """The course of a push; contacts are counted as in the chain, and sample k > 0 is the end of step k - 1.

    Attributes:
        world: What was pushed.
        settings: How.
        t: (m + 1,) times, s.
        poses: (m + 1, 3) pose of the chain frame, that is of the plate, in the world.
        object_poses: (m + 1, n, 3) poses of the objects' own frames in the world.
        modes: (m, n) what every contact did in every step, values of `Mode`.
        forces: (m, n, 3) normal force at the right and the left end and tangential force on the pushed object, N.
        wrenches: (m, 3) with which the plate pushes on all that it touches, in the chain frame: N, N, N m.
        others: (m, n) how many other bodies press on every object: obstacles, walls, objects it was not stacked on.
        residual: (m,) what is left of the balance of forces, over the friction of all objects.
        end: (m,) how the solver ended, see `sim.slip.kernels.state`.
        switched: (m,) 1 where a motion jumped though the plate went on as before and no contact closed.
        jammed_at: Time at which no motion satisfied all contacts and balances, s; everything ends there. None if it
            never came.
    """

    world: World
    settings: SlipSettings
    t: FloatArray
    poses: FloatArray
    object_poses: FloatArray
    modes: IntArray
    forces: FloatArray
    wrenches: FloatArray
    others: IntArray
    residual: FloatArray
    end: IntArray
    switched: IntArray
    jammed_at: float | None

    def __post_init__(self) -> None:
        m, n = len(self.t), len(self.world.chain.contacts)
        for name, shape in (("t", (m,)), ("poses", (m, 3)), ("object_poses", (m, n, 3))):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, f"{name} of the report"))

    @cached_property
    def motions(self) -> FloatArray:
        """(m + 1, n + 1, 3) how objects and, last, plate have moved in `world.start`, as frames that began in it."""
        objects = se2.compose(self.object_poses, se2.inverse(self.world.chain.places))
        return se2.relative(self.world.start, np.concatenate([objects, self.poses[:, None]], axis=1))

    @cached_property
    def base(self) -> int | None:
        """Number of the sample from which slides and gaps count: where all contacts are closed; None: never."""
        if not self.world.offsets.any():
            return 0
        opening = contact_motion(self.world.chain, self.motions, None)[1]
        closed = (opening <= _CLOSED * self._most).all(axis=1)
        return int(closed.argmax()) if closed.any() else None

    @cached_property
    def _contact_motion(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return contact_motion(self.world.chain, self.motions, self.base)

    @property
    def slide(self) -> FloatArray:
        """(m + 1, n) how far the middle of each segment has slid on the pushing body, m; to the left is positive."""
        return self._contact_motion[0]

    @property
    def opening(self) -> FloatArray:
        """(m + 1, n) the wider of the gaps at the two ends of each segment, m."""
        return self._contact_motion[1]

    @property
    def rotation(self) -> FloatArray:
        """(m + 1, n) turn of the pushed against the pushing body, rad."""
        return self._contact_motion[2]

    @property
    def _most(self) -> FloatArray:
        lengths = np.array([contact.length for contact in self.world.chain.contacts])
        return np.asarray(self.settings.tolerance * lengths)

    @cached_property
    def moved(self) -> BoolArray:
        """(m + 1, n) whether each contact has slid or opened by more than the tolerance."""
        return np.asarray(np.maximum(np.abs(self.slide), self.opening) > self._most)

    @property
    def kept(self) -> bool:
        """Whether no contact moved, and nothing jammed."""
        return not self.moved.any() and self.jammed_at is None

    @cached_property
    def loss(self) -> ContactLoss | None:
        """The first contact that moved; None when all held."""
        over = self.moved.any(axis=1)
        if not over.any():
            return None
        k = int(over.argmax())
        ratio = np.maximum(np.abs(self.slide[k]), self.opening[k]) / self._most
        contact = int(np.argmax(ratio))
        segment = self.world.chain.contacts[contact]
        pose = self.poses[k]
        point = se2.transform_points(pose, 0.5 * (segment.right + segment.left))
        mode = Mode(int(self.modes[max(k - 1, 0), contact]))
        x, y, theta = (float(value) for value in pose)
        return ContactLoss(float(self.t[k]), contact, mode, (x, y, theta), (float(point[0]), float(point[1])))

    @property
    def object_errors(self) -> FloatArray:
        """(n, 2) how far (m) and by what angle (rad) each object ends off the place that the plate wants it at."""
        return se2.pose_errors(self.object_poses[-1], se2.compose(self.poses[-1], self.world.chain.places))

    def goal_errors(self, goal: Goal) -> FloatArray:
        """Return (n, 2) how far (m) and by what angle (rad) each object ends off its place at a goal."""
        return se2.pose_errors(self.object_poses[-1], se2.compose(goal.pose_chain, self.world.chain.places))

    def arrived(self, goal: Goal) -> bool:
        """Tell whether the goal's object, or every object where it names none, ends within the goal's tolerances."""
        errors = self.goal_errors(goal)
        if goal.of is not None:
            errors = errors[[self.world.chain.index_of(goal.of)]]
        return (
            bool((errors <= [goal.position_tolerance, goal.angle_tolerance]).all()) and self.jammed_at is None
        )
