"""Results of executing a plan, separate from the simulators, which load slowly."""

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
    """Loss of a contact, at which an execution ends.

    Attributes:
        time: Time, s.
        segment: Index of the segment.
        object: Name of the object that the contact pushes.
        contact: Name of the contact: pushing and pushed body.
        margin: Margin at that time, <= 0.
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
    """Executed motion, sampled at the trajectory's rate.

    Each contact belongs to the object that it pushes, so arrays of contacts have one column per object. Their values
    are NaN while the object is not pushed.

    Attributes:
        names: Names of the objects.
        judge: Name of the stable set of the margins.
        t: (m,) times, s; they end early if a contact was lost.
        poses: (m, 3) integrated poses of the plate frame in the world.
        twists: (m, 3) executed body twists of the plate frame.
        objects: (m, n, 3) poses of the objects' own frames in the world.
        segment: (m,) index of the segment, see `segments_of`.
        margins: (m, n) margin of each contact; at rest, the margin of the next twist (at the end: of the last). If
            the simulator lets contacts slip, the margins that the twists have without slip.
        loss: The first loss of a contact, or None.
        goal_error: (position m, angle rad) errors of the final poses, the largest of all objects.
        dynamic_margins: (m, n) margins with inertia; None if not computed.
        friction_margins: (m, n) angle between the contact force and the nearer edge of its friction cone, rad. Like
            `lambdas` and `forces`, None if the loads on the floor are unknown.
        lambdas: (m, n) point of the contact segment through which the force passes: 0 right end, 1 left end.
        forces: (m, n, 2) contact force on the pushed object, in the contact frame of its load, N.
        wrenches: (m, 3) wrench of the plate on all bodies that it touches, in the contact frame about its origin:
            N, N, N m. None for a simulator without slip, where `forces` give it.
        needed_forces: (m,) required pushing force of the plate, N: `|F_xy|` for the least favourable of the stated
            loads and frictions, with inertia, and with static friction at the start of a push. NaN if nothing is
            pushed; None for a simulator with slip.
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
        """Smallest margin of any contact, without inertia; None if nothing was pushed."""
        return _least(self.margins)

    @property
    def min_dynamic_margin(self) -> float | None:
        """Smallest margin of any contact with inertia; None if not computed or nothing was pushed."""
        return None if self.dynamic_margins is None else _least(self.dynamic_margins)

    def max_force(self, segment: int | None = None) -> float | None:
        """Return the largest force `|F_xy|` of the plate, N, in one segment or in all; None if unknown.

        It is that of `needed_forces`, or of `wrenches` (without static friction) if the simulator lets contacts slip.
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
        """Return the force that the plate needs (or used, for a simulator with slip) as text; empty if unknown."""
        most, what = self.max_force(), "needs" if self.wrenches is None else "pushed with"
        if most is None:
            return ""
        return f"{what} up to {most:.3g} N" + ("" if math.isinf(limit) else f" of {limit:.3g} N")

    def until(self, count: int) -> Execution:
        """Return the first `count` samples as an execution without loss and goal error."""
        arrays: dict[str, Any] = {k: v[:count] for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        return replace(self, **arrays, loss=None, goal_error=(math.nan, math.nan))

    def poses_at(self, time: float) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return the poses (3,) of the plate frame and, by name, of the objects at a time, s."""

        def at(columns: FloatArray) -> FloatArray:
            return np.array([np.interp(time, self.t, column) for column in columns.T])

        return at(self.poses), {name: at(self.objects[:, k]) for k, name in enumerate(self.names)}


def _least(margins: FloatArray) -> float | None:
    known = margins[~np.isnan(margins)]
    return float(known.min()) if known.size else None


@dataclass(frozen=True, eq=False)
class TrialEnd:
    """Outcome of the execution of a plan in one Monte Carlo sample.

    Attributes:
        sample: Number of the sample.
        arrived: Whether every goal is reached within its tolerances.
        jammed: Whether the push ended early because objects jammed or the robot had too little force.
        errors: (n, 2) position error (m) and angle error (rad) of every object at the goal.
        objects: (n, 3) final poses of the objects in the world.
        contact: Name of the contact that moved first; empty if all held.
        mode: Motion of this contact: a name of `sim.report.Mode` in lower case, or `inertia` if it moves only with
            inertia.
        time: Time of this motion, s; NaN if all held.
        object: Name of the object that the contact pushes; empty if all held.
        point: Middle of the contact segment at that time, in the world, m; NaN if all held.
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
    """Return a warning if a contact slips with inertia, which a quasi-static scenario neglects; else empty."""
    least = execution.min_dynamic_margin
    if scenario.pusher.limits.contact == "dynamic" or least is None or least > 0.0:
        return ""
    return (
        f"the plan neglects inertia (limits.contact: quasi-static), and at this speed a contact slips "
        f"(margin {least:.2g}): lower the speed, or use limits.contact: dynamic"
    )


Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the standard normal distribution."""


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Return Wilson's 95 % score interval of a share, which is wide for few samples even if all succeed."""
    if count == 0:
        return math.nan, math.nan
    share, z2 = successes / count, Z95 * Z95 / count
    middle = (share + 0.5 * z2) / (1.0 + z2)
    half = Z95 * math.sqrt(share * (1.0 - share) / count + 0.25 * z2 / count) / (1.0 + z2)
    return max(0.0, middle - half), min(1.0, middle + half)
