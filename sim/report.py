"""What contacts do while a plan is executed where they may slip: in the slip simulator and in the physics engine."""

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
"""Slide or opening over the length of the contact segment from which on a contact counts as moved."""
CLOSED = 0.1
"""A contact counts as closed when its gap is below this part of what counts as moved: until then it still slides."""
STILL = 1e-3
"""Farthest that an object may move that is not pushed, m."""


class Mode(IntEnum):
    """What a contact does in a step; unknown where nothing is pushed, or the simulator does not tell."""

    UNKNOWN = -1
    OPEN = slip.OPEN
    STICK = slip.STICK
    SLIDE = slip.SLIDE
    ROLL = slip.ROLL
    ROLL_SLIDE = slip.ROLL_SLIDE


@dataclass(frozen=True)
class ContactLoss(StabilityLoss):
    """The first contact that moved; the execution goes on.

    Attributes:
        margin: As in `Execution.margins` at that time; NaN where these were not worked out.
        mode: What the contact does there.
        point: Middle of the contact segment in the world, m.
    """

    margin: float = field(compare=False)
    mode: Mode
    point: tuple[float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactReport(Execution):
    """An execution whose contacts may slide and open; columns of contacts as in `Execution`, NaN where not pushed.

    Attributes:
        slide: (m, n) how far the middle of each contact segment has slid on the pushing body, m; to the left is
            positive.
        opening: (m, n) the wider of the gaps at the two ends of each segment, m.
        rotation: (m, n) turn of the pushed against the pushing body, rad.
        lengths: (m, n) of the contact segments, m.
        wanted: (n, 3) where the plan has the objects in the end.
        contacts: Names of the contacts by segment and object.
        modes: (m, n) what each contact did in the step that ends at the sample, values of `Mode`.
        jammed_at: Time at which no motion satisfied all contacts and balances, s; everything ends there. None if it
            never came.
        stalled_at: Time at which the plate would have had to push with more than `robot.limits.force`, s; likewise.
        clear: Least distance (m) of robot and load from objects that rest; infinite where it was not looked at,
            because the simulator lets them touch.
        touched: Names of the objects that the plate or its load comes up to, by segment: these may be moved there.
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
        """(m, n) the larger of slide and opening, over the length of the segment."""
        return np.asarray(np.maximum(np.abs(self.slide), self.opening) / self.lengths)

    @property
    def moved(self) -> BoolArray:
        """(m, n) whether each contact has slid or opened by more than `TOLERANCE`."""
        return np.asarray(self.displacement > TOLERANCE)

    @property
    def moved_at(self) -> FloatArray:
        """(n,) time at which each object's contact was first seen to have moved, s; infinite where it did not."""
        moved = self.moved
        return np.where(moved.any(axis=0), self.t[moved.argmax(axis=0)], np.inf)

    @property
    def kept(self) -> bool:
        """Whether no contact moved, nothing jammed or stalled, and nothing but the load was touched."""
        held = not self.moved.any() and self.jammed_at is None and self.stalled_at is None
        return held and self.disturbed <= STILL and self.clear > 0.0

    @cached_property
    def disturbed(self) -> float:
        """Farthest (m) that an object moved while nothing pushed it or came up to it."""
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
        """(n, 2) how far (m) and by what angle (rad) each object ends off the place that the plan has it at."""
        return se2.pose_errors(self.objects[-1], self.wanted)

    def goal_errors(self, scenario: Scenario) -> FloatArray:
        """Return (n, 2) how far (m) and by what angle (rad) each object ends away from its pose at the goal."""
        return errors_at_goal(scenario, self.objects[-1])

    def arrived(self, scenario: Scenario) -> bool:
        """Tell whether every goal is reached within its tolerances; see `goal_units`."""
        units = goal_units(scenario, self.goal_errors(scenario))
        return bool((units <= 1.0).all()) and self.jammed_at is None and self.stalled_at is None

    @property
    def execution(self) -> Execution:
        """The same as logs and pictures know executions: one that a moved contact does not end."""
        plain = {each.name: getattr(self, each.name) for each in fields(Execution)}
        return Execution(**{**plain, "loss": None})

    @property
    def summaries(self) -> tuple[ContactSummary, ...]:
        """What each contact did in each push that was begun."""
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
    """What a contact did in a push.

    Attributes:
        segment: Index of the push.
        contact: What the contact is called.
        moved_at: When it was first seen to have moved, s; None where it held.
        slide: Farthest that it slid, m.
        opening: Widest that it opened, m.
        rotation: Farthest that it turned, rad.
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
    """What one segment of a plan came to.

    Attributes:
        segment: Its index.
        chain: What is pushed, with the contacts as they are; None where nothing is.
        t: (k + 1,) times of the whole plan, s.
        frame: (k + 1, 3) pose of the frame that the plate was moved in: that of the chain, or the plate frame.
        plate: (3,) pose of the plate frame in it.
        objects: (k + 1, n, 3) poses of all objects' own frames in the world.
        base: Number of the sample from which slides and gaps count; None counts them against the chain's contacts.
        modes: (k, n) see `ContactReport`, one for each step.
        wrenches: (k, 3) of the plate in each step, in the frame: N, N, N m.
        touched: What the plate comes up to in an approach, or what a close ends at.
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
        """Return how the chain's objects and, last, the plate have moved (k + 1, c + 1, 3), see `contact_motion`."""
        assert self.chain is not None
        return motions_of(self.chain, self.frame, self.objects[:, columns_of(self.chain, names)])


def columns_of(chain: Chain, names: Sequence[str]) -> list[int]:
    """Return where the objects of a chain are among names."""
    return [names.index(obj.name) for obj in chain.objects]


def motions_of(chain: Chain, frame: FloatArray, objects: FloatArray) -> FloatArray:
    """Return how objects and, last, the plate have moved (m, n + 1, 3), as frames that began where the plate did.

    Args:
        chain: The places of the objects.
        frame: (m, 3) poses of the chain frame in the world.
        objects: (m, n, 3) poses of the objects' own frames in the world.
    """
    own = se2.compose(objects, se2.inverse(chain.places))
    return se2.relative(frame[0], np.concatenate([own, frame[:, None]], axis=1))


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
    """Return what has been added to values (m, ...) since sample `base`, 0 before."""
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
    """Return the report of segments one after the other; a time at which two meet belongs to the earlier one."""
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
    """Return modes (k + 1, n) at samples, given those of the steps that end there; the first one's also before."""
    if part.modes is None or not len(part.modes):
        return np.full((len(part.t), count), Mode.UNKNOWN)
    return np.concatenate([part.modes[:1], part.modes])


def at_poses(wrenches: FloatArray) -> FloatArray:
    """Return wrenches (m, 3) of the plate at poses, given those of the steps between them (m - 1, 3).

    A step's is that in its middle: at a pose it is the mean of the steps before and after. Where the plate rests in
    one of the two, nothing is known of the forces there, and the other one counts.
    """
    if not len(wrenches):
        return np.zeros((1, 3))
    before, after = np.vstack([wrenches[:1], wrenches]), np.vstack([wrenches, wrenches[-1:]])
    moves = [rows.any(axis=1, keepdims=True) for rows in (before, after)]
    return np.asarray((before + after) / np.maximum(1, moves[0].astype(float) + moves[1]))


def twists_between(t: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the twists (m, 3) from each pose to the next; none at the last one."""
    twists = np.zeros(poses.shape)
    twists[:-1] = se2.log(se2.relative(poses[:-1], poses[1:])) / np.diff(t)[:, None]
    return twists


def moving(twists: FloatArray) -> FloatArray:
    """Return the twists (m, 3); where the plate rests, the one that comes next, at the end the one that came last."""
    moves = np.flatnonzero(np.abs(twists).max(axis=1) > 0.0)
    if not len(moves):
        return np.tile([1.0, 0.0, 0.0], (len(twists), 1))
    coming = np.minimum(np.searchsorted(moves, np.arange(len(twists))), len(moves) - 1)
    return np.asarray(twists[moves[coming]])


def with_margins(report: ContactReport, plan: Plan) -> ContactReport:
    """Return a report with the margins of its twists and the error at the goal, which take their time."""
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
    """Return who judges, and the margins (m, n) that twists had if all contacts were as the judge has them.

    The judge is that of the first load, also before it is pushed: in a log that grows, all parts name the same.

    Args:
        loads: What each segment pushes.
        planned: Name of the set that was planned in.
        names: Of the n objects.
        segment: (m,) index of the segment.
        twists: (m, 3) of the plate frame.
    """
    first = next((load for load in loads if load is not None), None)
    judge = "" if first is None else judging_set(first.problem, planned).name
    margins = np.full((len(twists), len(names)), np.nan)
    for k, load in enumerate(loads):
        rows = np.flatnonzero(segment == k)
        if load is not None and len(rows):
            stable = judging_set(load.problem, planned)
            own = np.array(columns_of(load.chain, names))
            asked = se2.twist_of(load.frame_plate, twists[rows])
            asked[-1] = 0.0  # what comes after the last sample is another segment's
            margins[np.ix_(rows, own)] = stable.contact_margins(moving(asked))
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
    """Return where a plan has the objects (n, 3) at the end of what was executed of it."""
    segment = plan.segments[part.segment]
    wanted: Poses = segment.before
    if segment.pushes and segment.load is not None:
        wanted = {**wanted, **segment.load.poses(se2.compose(part.frame[-1], part.plate))}
    return np.stack([wanted[name] for name in names])
