"""Data of a run for viewers: selected samples, names of contacts and frames, and shapes of contacts.

The shapes are the segment, the friction cone, and the force as an arrow that is scaled to the objects. Every viewer
draws them in the plate frame, with one colour for each contact.
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
"""Frames of every run, beside the plate's, `PUSHER`; each object adds a frame with its name. `CHAIN` is the contact
frame of a single push, fixed to the plate."""

VIEW_RATE = 20.0
"""Samples per second of an execution for viewers."""

SMOOTHED_RATE = 10.0
"""Poses per second of a timed path for viewers."""

MOST_VIEWED = 12_000
"""Largest number of samples and poses for viewers, so that logs of several hours stay within the reader's limits; at
the rates above it is reached after 10 and 20 minutes."""


def contact_names(scenario: Scenario) -> list[str]:
    """Return the name of each object's contact: pusher and object, or only the object if the pusher changes."""
    held = [load.chain.contact_name(k) for load in scenario.task.held for k in range(len(load.chain.contacts))]
    return held or list(scenario.poses)


def parts_of(run: Run | RecordedRun) -> list[tuple[float, float, str]]:
    """Return begin and end, s, and name of each executed segment, in order, for time lines."""
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
    """Return the index of the first sample of each executed segment, in order."""
    return [0, *(np.flatnonzero(np.diff(execution.segment)) + 1).tolist()]


@dataclass(frozen=True)
class ShownStep:
    """One step for the operator: the robot drives to an object and pushes it, or pushes a held load.

    Attributes:
        begin: Start time, s.
        end: End time, s.
        words: Description of the step.
        margin: Smallest margin of a contact; None if none is known.
        contact: Name of that contact.
    """

    begin: float
    end: float
    words: str
    margin: float | None
    contact: str


def steps_of(run: Run | RecordedRun) -> list[ShownStep]:
    """Return the steps of an execution in order."""
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
    """Return a description of segments: distances of transit and push, object, face and purpose."""
    pushes = [one for one in done if one.kind in (PUSH, CLOSE)]
    alone = sum(float(one.path.lengths @ np.hypot(*one.path.twists[:, :2].T)) for one in done if one.kind == TRANSIT)
    if not pushes or pushes[-1].load is None:
        return f"drive {alone:.2f} m" if alone else "drive up to the objects"
    first, load = pushes[0].load, pushes[-1].load
    what, pushed = " and ".join(load.names), sum(one.path.cost for one in pushes)
    onto = " and ".join(dict.fromkeys(one.onto for one in pushes if one.onto))
    way = f"push {what} {pushed:.2f} m"
    if first is not None and onto:
        way = f"push {' and '.join(first.names)} onto {onto}, then all together, {pushed:.2f} m in total,"
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
    """Yield each pushed load, None for nothing, with its indices into `samples` (n,), in order."""
    execution, segments = run.execution, segments_of(run.plan, run.feedback)
    owner = np.zeros(1, dtype=np.int64) if execution is None else execution.segment[samples]
    for part in np.split(np.arange(len(owner)), np.flatnonzero(np.diff(owner)) + 1):
        k = int(owner[part[0]])
        load = segments[k].load if k < len(segments) and segments[k].pushes else None
        if load is None and run.scenario.task.held:
            load = Load.of(run.scenario)
        yield load, part


def smoothed_times(trajectory: Trajectory) -> FloatArray:
    """Return the times (m,) of the drawn poses of a timed path, with its end, s."""
    step = max(1.0 / SMOOTHED_RATE, trajectory.duration / MOST_VIEWED)
    return np.append(np.arange(0.0, trajectory.duration, step), trajectory.duration)


def viewed(execution: Execution) -> IntArray:
    """Return the samples to show: the first of each 1/20 s and segment, the last, and those with smallest margins.

    For a long execution, it is the first sample of each `MOST_VIEWED`th part.
    """
    if len(execution.t) == 0:
        return np.zeros(0, dtype=np.int64)
    rate = min(VIEW_RATE, MOST_VIEWED / max(float(execution.t[-1]), 1.0))
    frame = np.floor(execution.t * rate + 1e-6)  # t = 0.35 s is in frame 7 despite rounding errors
    first = np.flatnonzero(np.diff(frame, prepend=-1.0))
    begun = np.flatnonzero(np.diff(execution.segment, prepend=-1))
    margins = np.where(np.isnan(execution.margins), np.inf, execution.margins)
    smallest = np.argmin(margins, axis=0) if margins.size else []
    return distinct(np.array([*first, *begun, *smallest, len(execution.t) - 1], dtype=np.int64))


def worst_contacts(execution: Execution) -> list[int]:
    """Return the columns of the contacts with the smallest margins in order, at most six; only pushed ones count."""
    least = np.where(np.isnan(execution.margins), np.inf, execution.margins).min(axis=0, initial=np.inf)
    pushed = np.argsort(least, kind="stable")[: np.isfinite(least).sum()]
    return sorted(pushed[:6].tolist())


_ARROW, _CONE, _HEAD = 0.9, 0.45, 0.3
"""Length of the largest force's arrow and height of the cones, as shares of an object's size (the root of its area);
length of an arrow's head as a share of the longest arrow."""


@dataclass(frozen=True, eq=False)
class ContactShapes:
    """Shapes of a contact at n instants in the plate frame, m.

    Attributes:
        column: Column of the pushed object in an execution.
        name: Name of the contact.
        segment: Right and left end, (2, 2).
        cones: Triangles of the friction cones, (n, c, 3, 2): at the point of application, or at both ends if that is
            not known.
        shafts: Arrows of the force, from the point of application to the tip, (n, 2, 2); None if it is not known.
        heads: Triangles of the arrow heads, tip first, (n, 3, 2); None if the force is not known.
    """

    column: int
    name: str
    segment: FloatArray
    cones: FloatArray
    shafts: FloatArray | None = None
    heads: FloatArray | None = None


def object_size(scenario: Scenario) -> float:
    """Return the side of a square with the area of the median object, m."""
    return math.sqrt(statistics.median(shapely.Polygon(obj.outline).area for obj in scenario.objects))


def longest_arrow(scenario: Scenario) -> float:
    """Return the length of the arrow of the largest force, m."""
    return _ARROW * object_size(scenario)


def cone_height(contact: Contact, size: float) -> float:
    """Return the drawn height of a contact's friction cone, m, for an object size, m."""
    return min(_CONE * size, 0.5 * contact.length)


def largest_force(execution: Execution | None) -> float:
    """Return the largest finite force of an execution, N; 1 without one."""
    if execution is None or execution.forces is None:
        return 1.0
    sizes = np.hypot(execution.forces[..., 0], execution.forces[..., 1])
    return float(sizes.max(initial=0.0, where=np.isfinite(sizes))) or 1.0


class LoadContacts:
    """Shapes of the contacts of loads, at rest or during an execution; arrows are scaled to its largest force."""

    def __init__(self, scenario: Scenario, execution: Execution | None = None) -> None:
        self._names = list(scenario.poses)
        self._size, self._longest = object_size(scenario), longest_arrow(scenario)
        self._execution, self._largest = execution, largest_force(execution)

    def at(self, load: Load, samples: IntArray | None = None) -> list[ContactShapes]:
        """Return the contacts of a load at some `samples` (n,) of the execution; None for a load at rest."""
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
        """Return point of application (n,), as a share of the segment, and arrow (n, 2), m, of a contact's force."""
        execution = self._execution
        if samples is None or execution is None or execution.forces is None or execution.lambdas is None:
            return None
        arrows = execution.forces[samples, column] / self._largest
        shares = np.nan_to_num(execution.lambdas[samples, column])
        return shares, self._longest * np.nan_to_num(arrows, posinf=0, neginf=0)


def _with_force(
    contact: Contact, tall: float, shares: FloatArray, arrows: FloatArray, longest: float
) -> list[FloatArray]:
    """Return cones, shafts and heads, as in `ContactShapes`, in the contact frame.

    The arrows (n, 2), m, start at `shares` (n,) of the length of the contact segment.
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
