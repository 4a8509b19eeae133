"""Reports of executions with slip, from the slip simulator and the physics engine: the motion of every contact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np

import pushplan.core.slip as slip
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.plans.execution import Execution, StabilityLoss
from pushplan.plans.goals import errors_at_goal, goal_units, worst_at_goal
from pushplan.plans.judge import judging_set
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Poses
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

TOLERANCE = 1e-3
"""Slide or opening, over the length of the contact segment, above which a contact counts as moved."""
CLOSED = 0.1
"""A contact counts as closed if its gap is below this share of `TOLERANCE`; with a wider gap it still slides."""
STILL = 1e-3
"""Largest allowed motion of an object that is not pushed, m."""


class Mode(IntEnum):
    """Motion of a contact in a step; unknown if nothing is pushed, or the simulator does not provide it."""

    UNKNOWN = -1
    OPEN = slip.OPEN
    STICK = slip.STICK
    SLIDE = slip.SLIDE
    ROLL = slip.ROLL
    ROLL_SLIDE = slip.ROLL_SLIDE


@dataclass(frozen=True)
class ContactLoss(StabilityLoss):
    """First contact that moved; it does not end the execution.

    Attributes:
        margin: Margin from `Execution.margins` at that time; NaN if these were not computed.
        mode: Mode of the contact at that time.
        point: Midpoint of the contact segment in the world, m.
    """

    margin: float = field(compare=False)
    mode: Mode
    point: tuple[float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactReport(Execution):
    """Execution whose contacts can slide and open; columns of contacts as in `Execution`, NaN where not pushed.

    Attributes:
        slide: Slide of the midpoint of each contact segment on the pushing body, m, left positive, (m, n).
        opening: The wider of the gaps at the two ends of each segment, m, (m, n).
        rotation: Rotation of the pushed relative to the pushing body, rad, (m, n).
        lengths: Lengths of the contact segments, m, (m, n).
        wanted: Final object poses of the plan, (n, 3).
        contacts: Names of the contacts by segment and object.
        modes: Mode of each contact in the step that ends at the sample, values of `Mode`, (m, n).
        jammed_at: Time at which no motion satisfied all contacts and balances, s; the execution ends there. None
            without a jam.
        stalled_at: Time at which the push needed more than `robot.limits.force`, s; the execution ends there. None
            without a stall.
        clear: Smallest distance (m) of robot and load from resting objects; infinite if the simulator handles their
            contact.
        touched: Names of the objects that the plate or its load comes up to, by segment; these can move there.
    """

    slide: FloatArray
    opening: FloatArray
    rotation: FloatArray
    lengths: FloatArray
    wanted: FloatArray
    contacts: Mapping[tuple[int, str], str]
    modes: IntArray
    jammed_at: float | None = None
    stalled_at: float | None = None
    clear: float = math.inf
    touched: Mapping[int, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def displacement(self) -> FloatArray:
        """The larger of slide and opening over the length of the segment, (m, n)."""
        return np.asarray(np.maximum(np.abs(self.slide), self.opening) / self.lengths)

    @property
    def moved(self) -> BoolArray:
        """Whether each contact has slid or opened by more than `TOLERANCE`, (m, n)."""
        return np.asarray(self.displacement > TOLERANCE)

    @property
    def moved_at(self) -> FloatArray:
        """First sample time with a moved contact of each object, s, (n,); infinite if it did not move."""
        moved = self.moved
        return np.where(moved.any(axis=0), self.t[moved.argmax(axis=0)], np.inf)

    @property
    def kept(self) -> bool:
        """Whether no contact moved, nothing jammed or stalled, and only the load was touched."""
        held = not self.moved.any() and self.jammed_at is None and self.stalled_at is None
        return held and self.disturbed <= STILL and self.clear > 0.0

    @cached_property
    def disturbed(self) -> float:
        """Largest motion (m) of an object while nothing pushed it or came up to it."""
        farthest = 0.0
        for k in np.unique(self.segment):
            rows = np.flatnonzero(self.segment == k)
            way = self.objects[rows[-1], :, :2] - self.objects[max(rows[0] - 1, 0), :, :2]
            rests = np.isnan(self.lengths[rows[-1]])
            rests[[self.names.index(name) for name in self.touched.get(int(k), ())]] = False
            farthest = max(farthest, float(np.where(rests, np.hypot(*way.T), 0.0).max()))
        return farthest

    @property
    def object_errors(self) -> FloatArray:
        """Final distance (m) and angle (rad) of each object from its pose in the plan, (n, 2)."""
        return se2.pose_errors(self.objects[-1], self.wanted)

    def goal_errors(self, scenario: Scenario) -> FloatArray:
        """Return the final distance (m) and angle (rad) of each object from its goal pose, (n, 2)."""
        return errors_at_goal(scenario, self.objects[-1])

    def arrived(self, scenario: Scenario) -> bool:
        """Return whether every goal is reached within its tolerances; see `goal_units`."""
        units = goal_units(scenario, self.goal_errors(scenario))
        return bool((units <= 1.0).all()) and self.jammed_at is None and self.stalled_at is None

    @property
    def execution(self) -> Execution:
        """The same as a plain `Execution` for logs and figures, without a loss."""
        plain = {each.name: getattr(self, each.name) for each in fields(Execution)}
        return Execution(**{**plain, "loss": None})

    @property
    def summaries(self) -> tuple[ContactSummary, ...]:
        """Summary of each contact in each started push."""
        found = []
        for (k, name), contact in self.contacts.items():
            rows, i = np.flatnonzero(self.segment == k), self.names.index(name)
            moved = rows[self.moved[rows, i]]
            at = float(self.t[moved[0]]) if len(moved) else None
            most = (np.abs(values[rows, i]).max() for values in (self.slide, self.rotation))
            slide, rotation = (float(value) for value in most)
            found.append(ContactSummary(k, contact, at, slide, float(self.opening[rows, i].max()), rotation))
        return tuple(found)


@dataclass(frozen=True)
class ContactSummary:
    """Motion of a contact in a push.

    Attributes:
        segment: Index of the push.
        contact: Name of the contact.
        moved_at: First sample time at which it had moved, s; None if it held.
        slide: Largest slide, m.
        opening: Largest opening, m.
        rotation: Largest rotation, rad.
    """

    segment: int
    contact: str
    moved_at: float | None
    slide: float
    opening: float
    rotation: float

    def __str__(self) -> str:
        verdict = "held" if self.moved_at is None else f"moved from {self.moved_at:.3g} s on"
        return (
            f"{self.contact} {verdict}: slid {1e3 * self.slide:.2g} mm, opened {1e3 * self.opening:.2g} mm, "
            f"turned {math.degrees(self.rotation):.2g} deg"
        )


@dataclass(frozen=True, eq=False)
class Part:
    """Execution of one segment of a plan.

    Attributes:
        segment: Index of the segment.
        chain: Pushed chain with its actual contacts; None without a push.
        t: Times in the whole plan, s, (k + 1,).
        frame: Poses of the moved frame: the chain frame, or the plate frame without a chain, (k + 1, 3).
        plate: Pose of the plate frame in that frame, (3,).
        objects: Poses of all objects' own frames in the world, (k + 1, n, 3).
        base: Index of the reference sample of slides and gaps; None if the chain's contacts are the reference.
        modes: Modes of `ContactReport`, one for each step, (k, n).
        wrenches: Wrenches of the plate in each step, in the moved frame: N, N, N m, (k, 3).
        touched: Objects that the plate comes up to in an approach, or at which a close ends.
    """

    segment: int
    chain: Chain | None
    t: FloatArray
    frame: FloatArray
    plate: FloatArray
    objects: FloatArray
    base: int | None = 0
    modes: IntArray | None = None
    wrenches: FloatArray | None = None
    touched: tuple[str, ...] = ()

    def motions(self, names: Sequence[str]) -> FloatArray:
        """Return the motions of the chain's objects and, last, of the plate (k + 1, c + 1, 3); see `motions_of`."""
        assert self.chain is not None
        return motions_of(self.chain, self.frame, self.objects[:, columns_of(self.chain, names)])


def columns_of(chain: Chain, names: Sequence[str]) -> list[int]:
    """Return the indices of a chain's objects in `names`."""
    return [names.index(obj.name) for obj in chain.objects]


def motions_of(chain: Chain, frame: FloatArray, objects: FloatArray) -> FloatArray:
    """Return the motions of the objects and, last, of the plate (m, n + 1, 3).

    A motion is the pose of a body-fixed frame that coincides with the chain frame at first, relative to that frame.

    Args:
        chain: Chain with the object poses in its frame.
        frame: Poses of the chain frame in the world, (m, 3).
        objects: Poses of the objects' own frames in the world, (m, n, 3).
    """
    own = se2.compose(objects, se2.inverse(chain.places))
    return se2.relative(frame[0], np.concatenate([own, frame[:, None]], axis=1))


def contact_motion(
    chain: Chain, motions: FloatArray, base: int | None = 0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return slide, opening and rotation (m, n) of the contacts relative to sample `base`, and 0 before it.

    Args:
        chain: Chain with the contacts.
        motions: Motions of the objects and, last, of the plate, (m, n + 1, 3); see `motions_of`.
        base: Index of the reference sample; None if the chain's contacts are the reference.
    """
    shape = (len(motions), len(chain.contacts))
    slide, opening, rotation = np.empty(shape), np.empty(shape), np.empty(shape)
    for k, contact in enumerate(chain.contacts):
        moved = se2.relative(motions[:, contact.pusher], motions[:, contact.pushed])
        ends = np.stack([contact.right, contact.left])
        shifts = moved[:, None, :2] + se2.rotate(moved[:, None, 2], ends) - ends
        if base is not None:
            moved, shifts = _since(moved, base), _since(shifts, base)
        slide[:, k] = shifts.mean(axis=1) @ contact.tangent
        opening[:, k] = (shifts @ contact.normal).max(axis=1)
        rotation[:, k] = moved[:, 2]
    return slide, opening, rotation


def _since(values: FloatArray, base: int) -> FloatArray:
    """Return the change of values (m, ...) since sample `base`, and 0 before it."""
    before = (np.arange(len(values)) < base).reshape(-1, *[1] * (values.ndim - 1))
    return np.where(before, 0.0, values - values[base])


def first_closed(chain: Chain, motions: FloatArray, begin: int = 0) -> int | None:
    """Return the first sample from `begin` on at which all contacts are closed; None if there is none."""
    most = TOLERANCE * np.array([contact.length for contact in chain.contacts])
    closed = (contact_motion(chain, motions[begin:], None)[1] <= CLOSED * most).all(axis=1)
    return begin + int(closed.argmax()) if closed.any() else None


def report_of(
    names: tuple[str, ...],
    parts: Sequence[Part],
    wanted: FloatArray,
    *,
    jammed_at: float | None = None,
    stalled_at: float | None = None,
    clear: float = math.inf,
) -> ContactReport:
    """Join the parts of consecutive segments into one report; a shared time belongs to the earlier segment."""
    kept = [slice(0 if k == 0 else 1, None) for k in range(len(parts))]

    def joined(each: Sequence[Any]) -> Any:
        return np.concatenate([one[rows] for one, rows in zip(each, kept, strict=True)])

    t = joined([part.t for part in parts])
    plates = [se2.compose(part.frame, part.plate) for part in parts]
    poses, columns = joined(plates), joined([_columns(part, names) for part in parts])
    wrenches = [part.wrenches for part in parts if part.wrenches is not None]
    contacts = {
        (part.segment, obj.name): part.chain.contact_name(i)
        for part in parts
        if part.chain is not None
        for i, obj in enumerate(part.chain.objects)
    }
    report = ContactReport(
        names,
        "",
        t,
        poses,
        twists_between(t, poses),
        joined([part.objects for part in parts]),
        joined([np.full(len(part.t), part.segment) for part in parts]),
        np.full((len(t), len(names)), np.nan),
        None,
        (math.nan, math.nan),
        wrenches=joined([at_poses(each) for each in wrenches]) if len(wrenches) == len(parts) else None,
        slide=columns[..., 0],
        opening=columns[..., 1],
        rotation=columns[..., 2],
        lengths=columns[..., 3],
        wanted=wanted,
        contacts=contacts,
        modes=joined([_modes(part, len(names)) for part in parts]),
        jammed_at=jammed_at,
        stalled_at=stalled_at,
        clear=clear,
        touched={part.segment: part.touched for part in parts if part.touched},
    )
    return replace(report, loss=_loss(report, parts))


def _columns(part: Part, names: tuple[str, ...]) -> FloatArray:
    """Return slide, opening and rotation of the contacts of a part, and their lengths (k + 1, n, 4)."""
    found = np.full((len(part.t), len(names), 4), np.nan)
    if part.chain is not None:
        own = columns_of(part.chain, names)
        moved = contact_motion(part.chain, part.motions(names), part.base)
        lengths = np.broadcast_to([contact.length for contact in part.chain.contacts], moved[0].shape)
        found[:, own] = np.stack([*moved, lengths], axis=-1)
    return found


def _modes(part: Part, count: int) -> IntArray:
    """Return the modes (k + 1, n) at samples: those of the step that ends there (first sample: of the first step)."""
    if part.modes is None or not len(part.modes):
        return np.full((len(part.t), count), Mode.UNKNOWN)
    return np.concatenate([part.modes[:1], part.modes])


def at_poses(wrenches: FloatArray) -> FloatArray:
    """Return the wrenches of the plate (m, 3) at poses, given those of the steps between them (m - 1, 3).

    A step has the wrench of its middle, so a pose gets the mean of the steps before and after. A step at rest has no
    known wrench and is left out.
    """
    if not len(wrenches):
        return np.zeros((1, 3))
    before, after = np.vstack([wrenches[:1], wrenches]), np.vstack([wrenches, wrenches[-1:]])
    moves = [rows.any(axis=1, keepdims=True) for rows in (before, after)]
    return np.asarray((before + after) / np.maximum(1, moves[0].astype(float) + moves[1]))


def twists_between(t: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the twists (m, 3) from each pose to the next; zero at the last pose."""
    twists = np.zeros(poses.shape)
    twists[:-1] = se2.log(se2.relative(poses[:-1], poses[1:])) / np.diff(t)[:, None]
    return twists


def moving(twists: FloatArray) -> FloatArray:
    """Return the twists (m, 3) with those at rest replaced by the next nonzero twist (at the end: by the last)."""
    moves = np.flatnonzero(np.abs(twists).max(axis=1) > 0.0)
    if not len(moves):
        return np.tile([1.0, 0.0, 0.0], (len(twists), 1))
    coming = np.minimum(np.searchsorted(moves, np.arange(len(twists))), len(moves) - 1)
    return np.asarray(twists[moves[coming]])


def with_margins(report: ContactReport, plan: Plan) -> ContactReport:
    """Return a report with the margins of its twists and the goal error added."""
    loads = [segment.load if segment.pushes else None for segment in plan.segments]
    judge, margins = judged(loads, plan.stable_set, report.names, report.segment, report.twists)
    loss = report.loss
    if isinstance(loss, ContactLoss):
        at = int(np.searchsorted(report.t, loss.time))
        loss = replace(loss, margin=float(margins[at, report.names.index(loss.object)]))
    off = worst_at_goal(plan.scenario, report.objects[-1])
    return replace(report, judge=judge, margins=margins, loss=loss, goal_error=off)


def judged(
    loads: Sequence[Load | None], planned: str, names: Sequence[str], segment: IntArray, twists: FloatArray
) -> tuple[str, FloatArray]:
    """Return the name of the checking set, and the margins (m, n) of twists for the nominal contacts of that set.

    The name is that of the first load, also before it is pushed, so that all parts of a growing log have the same.

    Args:
        loads: Load of each segment; None without a push.
        planned: Name of the stable set of the plan.
        names: Names of the n objects.
        segment: Index of the segment at each sample, (m,).
        twists: Twists of the plate frame, (m, 3).
    """
    first = next((load for load in loads if load is not None), None)
    judge = "" if first is None else judging_set(first.problem, planned).name
    margins = np.full((len(twists), len(names)), np.nan)
    for k, load in enumerate(loads):
        rows = np.flatnonzero(segment == k)
        if load is not None and len(rows):
            stable = judging_set(load.problem, planned)
            own = np.array(columns_of(load.chain, names))
            contact_twists = se2.twist_of(load.frame_plate, twists[rows])
            contact_twists[-1] = 0.0  # the twist after the last sample belongs to the next segment
            margins[np.ix_(rows, own)] = stable.contact_margins(moving(contact_twists))
    return judge, margins


def _loss(report: ContactReport, parts: Sequence[Part]) -> ContactLoss | None:
    over = np.flatnonzero(report.moved.any(axis=1))
    if not len(over):
        return None
    k = int(over[0])
    column = int(np.nanargmax(report.displacement[k]))
    name, segment = report.names[column], int(report.segment[k])
    part = next(one for one in parts if one.segment == segment)
    assert part.chain is not None
    contact = part.chain.contacts[part.chain.index_of(name)]
    frame = se2.compose(report.poses[k], se2.inverse(part.plate))
    x, y = se2.transform_points(frame, 0.5 * (contact.right + contact.left)).tolist()
    mode = Mode(int(report.modes[k, column]))
    px, py, theta = report.poses[k].tolist()
    words = report.contacts[segment, name]
    return ContactLoss(float(report.t[k]), segment, name, words, math.nan, (px, py, theta), mode, (x, y))


def wanted_at_end(plan: Plan, part: Part, names: Sequence[str]) -> FloatArray:
    """Return the planned object poses (n, 3) at the end of the executed part."""
    segment = plan.segments[part.segment]
    wanted: Poses = segment.before
    if segment.pushes and segment.load is not None:
        wanted = {**wanted, **segment.load.poses(se2.compose(part.frame[-1], part.plate))}
    return np.stack([wanted[name] for name in names])
