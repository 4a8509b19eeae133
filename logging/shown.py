"""What viewers get of a run: which samples, what contacts and frames are called, and the shapes of the contacts.

The shapes are segment, friction cone, and the force as an arrow that suits the objects. Every viewer draws these, all
in the plate frame, and one contact in one colour.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.mechanics.chain import Contact
from pushplan.mechanics.contacts import friction_cone
from pushplan.plans.execution import Execution
from pushplan.plans.load import Load
from pushplan.plans.run import segments_of
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, IntArray, distinct
from pushplan.util.names import APPROACH, CLOSE, PUSH, TRANSIT

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.plans.run import Run

WORLD, CHAIN = "world", "chain"
"""Frames of every run, beside the plate's, `PUSHER`; each object adds one of its own name. `CHAIN` is that of the
contact of a single push, fixed to the plate."""

VIEW_RATE = 20.0
"""Samples per second that viewers get of an execution."""

SMOOTHED_RATE = 10.0
"""Poses per second of a timed path in pictures."""

MOST_VIEWED = 12_000
"""Samples and poses that viewers get, at most, so that logs of drives of hours are read within their limits: at the
rates above that is 10 and 20 minutes."""


def contact_names(scenario: Scenario) -> list[str]:
    """Return what the contact of each object is called: who pushes whom, or the object where that changes."""
    held = [load.chain.contact_name(k) for load in scenario.task.held for k in range(len(load.chain.contacts))]
    return held or list(scenario.poses)


def parts_of(run: Run | RecordedRun) -> list[tuple[float, float, str]]:
    """Return begin and end, s, and a name for each segment that was executed, in order: what is on a time line."""
    execution, plan = run.execution, run.plan
    if execution is None or plan is None or len(execution.t) < 2:
        return []
    owner, begins = execution.segment, _begins(execution)
    edges = [float(execution.t[k]) for k in begins] + [float(execution.t[-1])]
    count = {k: f"{k + 1}. " for k in range(len(plan.segments))} if len(plan.segments) > 1 else {}
    parts = []
    for k, low, high in zip(begins, edges, edges[1:], strict=False):
        segment = plan.segments[min(int(owner[k]), len(plan.segments) - 1)]
        names = f" {', '.join(segment.load.names)}" if segment.load is not None and segment.pushes else ""
        parts.append((low, high, f"{count.get(int(owner[k]), '')}{segment.kind}{names}"))
    return parts


def _begins(execution: Execution) -> list[int]:
    """Return the first sample of each segment that was executed, in order."""
    return [0, *(np.flatnonzero(np.diff(execution.segment)) + 1).tolist()]


@dataclass(frozen=True)
class ShownStep:
    """What a worker sees as one step: the robot drives to an object and pushes it, or pushes what it holds.

    Attributes:
        begin: Time, s.
        end: Likewise.
        words: What happens, in words.
        margin: The smallest of a contact; None where none is known.
        contact: Name of that contact.
    """

    begin: float
    end: float
    words: str
    margin: float | None
    contact: str


def steps_of(run: Run | RecordedRun) -> list[ShownStep]:
    """Return the steps of an execution in order, as a person would tell them."""
    execution, segments = run.execution, segments_of(run.plan, run.feedback)
    if execution is None or not segments or len(execution.t) < 2:
        return []
    begins = _begins(execution)
    owners = [min(int(execution.segment[k]), len(segments) - 1) for k in begins]
    groups: list[list[int]] = []
    for k, owner in enumerate(owners):
        before = [segments[owners[j]].kind for j in groups[-1]] if groups else []
        if not groups or (segments[owner].kind in (TRANSIT, APPROACH) and (PUSH in before or CLOSE in before)):
            groups.append([])
        groups[-1].append(k)
    names = contact_names(run.scenario)
    ends = [*begins[1:], len(execution.t)]
    found = []
    for group in groups:
        first, last = begins[group[0]], ends[group[-1]]
        margins = execution.margins[first:last]
        known = np.isfinite(margins).any()
        weakest = int(np.nanargmin(margins)) % margins.shape[1] if known else 0
        done = [segments[owners[k]] for k in group]
        later = segments[owners[group[-1]] + 1 :]
        found.append(
            ShownStep(
                float(execution.t[first]),
                float(execution.t[min(last, len(execution.t) - 1)]),
                _in_words(run.scenario, done, later),
                float(np.nanmin(margins)) if known else None,
                names[weakest] if known else "",
            )
        )
    return found


def _in_words(scenario: Scenario, done: Sequence[Segment], later: Sequence[Segment]) -> str:
    """Return what segments do, in words: how far the robot drives to what, and how far it pushes it where."""
    pushes = [one for one in done if one.kind in (PUSH, CLOSE)]
    alone = sum(float(one.path.lengths @ np.hypot(*one.path.twists[:, :2].T)) for one in done if one.kind == TRANSIT)
    if not pushes or pushes[-1].load is None:
        return f"drive {alone:.2f} m" if alone else "drive up to the objects"
    first, load = pushes[0].load, pushes[-1].load
    what, pushed = " and ".join(load.names), sum(one.path.cost for one in pushes)
    onto = " and ".join(dict.fromkeys(one.onto for one in pushes if one.onto))
    way = f"push {what} {pushed:.2f} m"
    if first is not None and onto:
        way = f"push {' and '.join(first.names)} onto {onto}, and all of them on, {pushed:.2f} m in all,"
    if first is not None and first.face and any(one.kind == APPROACH for one in done):
        single = len(first.names) == 1
        face = f"the {first.face} face of {first.names[0]}" if single else f"the face '{first.face}'"
        way = f"drive {f'{alone:.2f} m' if alone else 'up'} to {face}, {way}"
    again = any(one.load is not None and set(one.load.names) & set(load.names) for one in later if one.pushes)
    if again:
        return f"{way}, not yet to the goal" if len(scenario.loads) == 1 else f"{way} out of the way"
    aimed = {name for goal in scenario.task.goals for name in goal.names}
    return f"{way} to the goal" if scenario.task.held or aimed & set(load.names) else f"{way} out of the way"


def pushed_at_samples(run: Run | RecordedRun, samples: IntArray) -> Iterator[tuple[Load | None, IntArray]]:
    """Yield what is pushed, None for nothing, and the indices of the samples (n,) at which it is, in their order."""
    execution, segments = run.execution, segments_of(run.plan, run.feedback)
    owner = np.zeros(1, dtype=np.int64) if execution is None else execution.segment[samples]
    for part in np.split(np.arange(len(owner)), np.flatnonzero(np.diff(owner)) + 1):
        k = int(owner[part[0]])
        load = segments[k].load if k < len(segments) and segments[k].pushes else None
        if load is None and run.scenario.task.held:
            load = Load.of(run.scenario)
        yield load, part


def smoothed_times(trajectory: Trajectory) -> FloatArray:
    """Return the times (m,) at which a timed path is drawn, its end included, s."""
    step = max(1.0 / SMOOTHED_RATE, trajectory.duration / MOST_VIEWED)
    return np.append(np.arange(0.0, trajectory.duration, step), trajectory.duration)


def viewed(execution: Execution) -> IntArray:
    """Return the samples to show: the first of each 1/20 s and segment, the last, where each margin is smallest.

    Of a long execution it is the first of each `MOST_VIEWED`th part.
    """
    if len(execution.t) == 0:
        return np.zeros(0, dtype=np.int64)
    rate = min(VIEW_RATE, MOST_VIEWED / max(float(execution.t[-1]), 1.0))
    frame = np.floor(execution.t * rate + 1e-6)  # t = 0.35 s is in frame 7, whatever its last bits say
    first = np.flatnonzero(np.diff(frame, prepend=-1.0))
    begun = np.flatnonzero(np.diff(execution.segment, prepend=-1))
    margins = np.where(np.isnan(execution.margins), np.inf, execution.margins)
    smallest = np.argmin(margins, axis=0) if margins.size else []
    return distinct(np.array([*first, *begun, *smallest, len(execution.t) - 1], dtype=np.int64))


def worst_contacts(execution: Execution) -> list[int]:
    """Return the columns of the contacts with the smallest margins, at most six, in order; none never pushed."""
    least = np.where(np.isnan(execution.margins), np.inf, execution.margins).min(axis=0, initial=np.inf)
    pushed = np.argsort(least, kind="stable")[: np.isfinite(least).sum()]
    return sorted(pushed[:6].tolist())


_ARROW, _CONE, _HEAD = 0.9, 0.45, 0.3
"""Length of the largest force's arrow and height of the cones, as shares of the size of an object (the root of its
area); length of an arrow's head as a share of that of the longest arrow."""


@dataclass(frozen=True, eq=False)
class ContactShapes:
    """A contact at n instants, plate frame, m.

    Attributes:
        column: Of the object that is pushed, in an execution.
        name: What the contact is called.
        segment: (2, 2) right and left end.
        cones: (n, c, 3, 2) triangles: one at the point of application, or one at either end where that is not known.
        shafts: (n, 2, 2) from the point of application to the tip of the force's arrow; None where it is not known.
        heads: (n, 3, 2) triangles at the tips, which are their first corners; None likewise.
    """

    column: int
    name: str
    segment: FloatArray
    cones: FloatArray
    shafts: FloatArray | None = None
    heads: FloatArray | None = None


def object_size(scenario: Scenario) -> float:
    """Return the side of a square as large as the median object, m."""
    return math.sqrt(statistics.median(shapely.Polygon(obj.outline).area for obj in scenario.objects))


def longest_arrow(scenario: Scenario) -> float:
    """Return the length of the arrow of the largest force, m."""
    return _ARROW * object_size(scenario)


def cone_height(contact: Contact, size: float) -> float:
    """Return how tall the friction cone of a contact is drawn, m, where objects have a size, m."""
    return min(_CONE * size, 0.5 * contact.length)


def largest_force(execution: Execution | None) -> float:
    """Return the size of the largest finite force of an execution, N; 1 where there is none."""
    if execution is None or execution.forces is None:
        return 1.0
    sizes = np.hypot(execution.forces[..., 0], execution.forces[..., 1])
    return float(sizes.max(initial=0.0, where=np.isfinite(sizes))) or 1.0


class LoadContacts:
    """The contacts of loads, at rest or during an execution; arrows show shares of its largest force."""

    def __init__(self, scenario: Scenario, execution: Execution | None = None) -> None:
        self._names = list(scenario.poses)
        self._size, self._longest = object_size(scenario), longest_arrow(scenario)
        self._execution, self._largest = execution, largest_force(execution)

    def at(self, load: Load, samples: IntArray | None = None) -> list[ContactShapes]:
        """Return the contacts of a load at some `samples` (n,) of the execution; None stands for one at rest."""
        shapes = []
        for i, (name, contact) in enumerate(zip(load.names, load.chain.contacts, strict=True)):
            column, tall = self._names.index(name), cone_height(contact, self._size)
            ends = np.stack([contact.right, contact.left])
            if (own := self._forces(column, samples)) is not None:
                parts = _with_force(contact, tall, *own, self._longest)
            else:
                cones = friction_cone(contact, ends, tall)
                parts = [np.tile(cones, (1 if samples is None else len(samples), 1, 1, 1))]
            frame = load.frame_plate
            parts = [se2.transform_points(frame, part.reshape(-1, 2)).reshape(part.shape) for part in (ends, *parts)]
            shapes.append(ContactShapes(column, load.chain.contact_name(i), *parts))
        return shapes

    def _forces(self, column: int, samples: IntArray | None) -> tuple[FloatArray, FloatArray] | None:
        """Return where a force passes through a contact's segment (n,), as shares, and its arrow (n, 2), m."""
        execution = self._execution
        if samples is None or execution is None or execution.forces is None or execution.lambdas is None:
            return None
        arrows = execution.forces[samples, column] / self._largest
        shares = np.nan_to_num(execution.lambdas[samples, column])
        return shares, self._longest * np.nan_to_num(arrows, posinf=0, neginf=0)


def _with_force(
    contact: Contact, tall: float, shares: FloatArray, arrows: FloatArray, longest: float
) -> list[FloatArray]:
    """Return cones, shafts and heads, as in `ContactShapes`, in the contact's frame.

    The forces (n, 2), as arrows, m, pass through the contact's segment at `shares` (n,) of its length.
    """
    ends = np.stack([contact.right, contact.left])
    points = ends[0] + shares[:, None] * (ends[1] - ends[0])
    tips = points + arrows
    lengths = np.hypot(arrows[:, 0], arrows[:, 1])[:, None]
    along = np.divide(arrows, lengths, out=np.zeros_like(arrows), where=lengths > 0.0)
    back = np.minimum(_HEAD * longest, lengths) * along
    aside = 0.4 * np.stack([-back[:, 1], back[:, 0]], axis=1)
    heads = np.stack([tips, tips - back + aside, tips - back - aside], axis=1)
    cones = friction_cone(contact, points, tall)[:, None]
    return [cones, np.stack([points, tips - 0.5 * back], axis=1), heads]
