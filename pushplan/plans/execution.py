"""What executing a plan comes to; kept apart from the simulators: they load slowly."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pushplan.util.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario


@dataclass(frozen=True)
class StabilityLoss:
    """Where an execution lost a contact; what happens after it is not predicted.

    Attributes:
        time: s.
        segment: Index of the segment.
        object: Name of the object that the contact pushes.
        contact: What the contact is called: who pushes, and whom.
        margin: The margin found there, <= 0.
        pose: (3,) pose of the plate frame in the world.
    """

    time: float
    segment: int
    object: str
    contact: str
    margin: float
    pose: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Execution:
    """What happened, sampled at the trajectory's rate.

    A contact is known by the object that it pushes; columns of contacts are those of the objects. They are NaN where
    the object is not pushed.

    Attributes:
        names: Of the objects.
        judge: Name of the stable set whose margins decide.
        t: (m,) times, s; ends early when stability was lost.
        poses: (m, 3) integrated pose of the plate frame in the world.
        twists: (m, 3) executed body twists of the plate frame.
        objects: (m, n, 3) poses of the objects' own frames in the world.
        segment: (m,) index of the segment, see `segments_of`.
        margins: (m, n) margin of each contact; where the pusher rests, that of the twist it is about to take (at
            the end: has just taken). Where contacts may slip: what the twists would have if nothing had.
        loss: The first loss of stability, or None.
        goal_error: (position m, angle rad) of the final poses against the goals, the largest of all objects.
        dynamic_margins: (m, n) with inertia; None where it was not looked at.
        friction_margins: (m, n) angle of the contact force to the nearer edge of its friction cone, rad; like
            `lambdas` and `forces`, None where the loads on the floor are not known.
        lambdas: (m, n) where the force passes through the contact's segment, 0 at the right end, 1 at the left end.
        forces: (m, n, 2) contact force on the pushed object, in the contact's frame of its load, N.
        wrenches: (m, 3) with which the plate pushes on all that it touches, in the contact's frame, about its origin:
            N, N, N m. None where contacts may not slip: it is then that of `forces`.
        needed_forces: (m,) with which the plate has to push, N: `|F_xy|` for the least favourable of the stated loads
            and frictions, inertia included, and as a push begins what static friction asks for. NaN where nothing is
            pushed; None where contacts may slip.
    """

    names: tuple[str, ...]
    judge: str
    t: FloatArray
    poses: FloatArray
    twists: FloatArray
    objects: FloatArray
    segment: IntArray
    margins: FloatArray
    loss: StabilityLoss | None
    goal_error: tuple[float, float]
    dynamic_margins: FloatArray | None = None
    friction_margins: FloatArray | None = None
    lambdas: FloatArray | None = None
    forces: FloatArray | None = None
    wrenches: FloatArray | None = None
    needed_forces: FloatArray | None = None

    @property
    def min_margin(self) -> float | None:
        """Smallest margin of any contact, without inertia; None where nothing was pushed."""
        return _least(self.margins)

    @property
    def min_dynamic_margin(self) -> float | None:
        """Smallest margin of any contact with inertia, None where it was not looked at or nothing was pushed."""
        return None if self.dynamic_margins is None else _least(self.dynamic_margins)

    def max_force(self, segment: int | None = None) -> float | None:
        """Return the largest force `|F_xy|` of the plate, N, in a segment or in all; None where it is not known.

        That is of `needed_forces`, and of `wrenches` where contacts may slip: without breaking away.
        """
        forces = self.needed_forces
        if self.wrenches is not None:
            forces = np.hypot(self.wrenches[:, 0], self.wrenches[:, 1])
        if forces is None:
            return None
        forces = forces if segment is None else forces[self.segment == segment]
        known = forces[~np.isnan(forces)]
        return float(known.max()) if known.size else None

    def force_words(self, limit: float) -> str:
        """Return what force the plate needs, or has pushed with where contacts may slip; empty where not known."""
        most, what = self.max_force(), "needs" if self.wrenches is None else "pushed with"
        if most is None:
            return ""
        return f"{what} up to {most:.3g} N" + ("" if math.isinf(limit) else f" of {limit:.3g} N")

    def until(self, count: int) -> Execution:
        """Return the first samples, as of an execution that has not come to its end."""
        arrays: dict[str, Any] = {k: v[:count] for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        return replace(self, **arrays, loss=None, goal_error=(math.nan, math.nan))

    def poses_at(self, time: float) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return where the plate frame (3,) and the objects are at a time, s."""

        def at(columns: FloatArray) -> FloatArray:
            return np.array([np.interp(time, self.t, column) for column in columns.T])

        return at(self.poses), {name: at(self.objects[:, k]) for k, name in enumerate(self.names)}


def _least(margins: FloatArray) -> float | None:
    known = margins[~np.isnan(margins)]
    return float(known.min()) if known.size else None


@dataclass(frozen=True, eq=False)
class TrialEnd:
    """How the execution of a plan in one sampled world ended.

    Attributes:
        sample: Number of the world.
        arrived: Whether every goal is reached within its tolerances.
        jammed: Whether nothing could give way, or the robot had not the force, so that the push ended early.
        errors: (n, 2) how far (m) and by what angle (rad) every object is away from its pose at the goal.
        objects: (n, 3) where the objects are, in the world.
        contact: What the first contact that moved is called; empty where all held.
        mode: What it did, a name of `sim.report.Mode` in lower case; `inertia` where it held without inertia only.
        time: When, s; NaN where all held.
        object: Name of the object that it pushes; empty where all held.
        point: Middle of its segment then, in the world, m; NaN where all held.
    """

    sample: int
    arrived: bool
    jammed: bool
    errors: FloatArray
    objects: FloatArray
    contact: str
    mode: str
    time: float
    object: str
    point: tuple[float, float]


def inertia_warning(scenario: Scenario, execution: Execution) -> str:
    """Return that inertia, which the scenario leaves out, would make a contact slip; empty where it would not."""
    least = execution.min_dynamic_margin
    if scenario.pusher.limits.contact == "dynamic" or least is None or least > 0.0:
        return ""
    return (
        f"inertia was left out (limits.contact: quasi-static), and at this speed a contact slips "
        f"(margin {least:.2g}): push more slowly, or use dynamic limits"
    )


Z95 = 1.959963984540054
"""Standard deviations on either side that hold 95 % of a normal distribution."""


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Return Wilson's 95 % score interval of a share: in doubt even when all of few succeed (Wilson 1927)."""
    if count == 0:
        return math.nan, math.nan
    share, z2 = successes / count, Z95 * Z95 / count
    middle = (share + 0.5 * z2) / (1.0 + z2)
    half = Z95 * math.sqrt(share * (1.0 - share) / count + 0.25 * z2 / count) / (1.0 + z2)
    return max(0.0, middle - half), min(1.0, middle + half)
