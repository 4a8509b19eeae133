"""Pushes to learn from, and what was learned from them."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

import pushplan.core.slip as slip
from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE
from pushplan.sim.identify.unknowns import Unknown, Unknowns
from pushplan.sim.report import at_poses
from pushplan.sim.slip import steps_of
from pushplan.util.arrays import FloatArray, frozen
from pushplan.util.names import PUSHER


@dataclass(frozen=True, eq=False)
class MeasuredPush:
    """Poses in the world, and wrenches, measured at the same times.

    Attributes:
        plate_poses: (m, 3) of the chain frame, that is of the plate.
        object_poses: (m, n, 3) of the objects' own frames.
        name: What messages call it.
        wrenches: (m, 3) with which the plate pushes on all that it touches, in the chain frame, about its origin:
            N, N, N m. None where nobody measured.

    Raises:
        PushplanError: When there are fewer than three, or they are not finite.
    """

    plate_poses: FloatArray
    object_poses: FloatArray
    name: str = "push"
    wrenches: FloatArray | None = None

    def __post_init__(self) -> None:
        plate, objects = np.asarray(self.plate_poses), np.asarray(self.object_poses)
        if objects.ndim != 3 or plate.shape != (len(objects), 3) or objects.shape[2] != 3:
            raise PushplanError(
                f"{self.name}: poses of the plate have shape {plate.shape} and those of the objects "
                f"{objects.shape}; they must be (m, 3) and (m, n, 3)"
            )
        if len(plate) < 3:
            raise PushplanError(f"{self.name}: there are {len(plate)} measured poses; 3 is the least")
        object.__setattr__(self, "plate_poses", frozen(plate, (None, 3), f"{self.name}: poses of the plate"))
        shape = (len(plate), objects.shape[1], 3)
        object.__setattr__(self, "object_poses", frozen(objects, shape, f"{self.name}: poses of the objects"))
        if self.wrenches is not None:
            wrenches = frozen(self.wrenches, (len(plate), 3), f"{self.name}: wrenches of the plate")
            object.__setattr__(self, "wrenches", wrenches)

    def pieces(self, reach: float, step: float, way: float) -> list[MeasuredPush]:
        """Return the push cut into shorter ones, of poses between which something moves.

        What is predicted over a long way depends on the last bit of where it began; every piece begins anew where
        the objects were seen.

        Args:
            reach: Distance of the farthest corner from the plate's reference, m.
            step: Way of that corner between two poses at least, m.
            way: Its way in a piece at most, about, m.
        """
        moved = se2.log(se2.relative(self.plate_poses[:-1], self.plate_poses[1:]))
        gone = np.concatenate([[0.0], np.cumsum(np.hypot(moved[:, 0], moved[:, 1]) + reach * np.abs(moved[:, 2]))])
        # Poses at every multiple of the step of the way gone, also where rounding puts one just before it.
        marks = np.floor(gone / step * (1.0 + 1e-9))
        kept = np.flatnonzero(np.diff(marks, prepend=-1.0) > 0)
        count = max(1, int(np.ceil(gone[-1] / way)))
        cuts = np.unique(np.searchsorted(gone[kept], gone[-1] * np.arange(count + 1) / count).clip(max=len(kept) - 1))
        return [
            MeasuredPush(
                self.plate_poses[these],
                self.object_poses[these],
                self.name,
                None if self.wrenches is None else self.wrenches[these],
            )
            for a, b in pairwise(cuts)
            if len(these := kept[a : b + 1]) > 2
        ]


STEP = 3e-3
"""How far the fastest corner moves in a simulated step, about, m."""
WAY = 0.2
"""How far the fastest corner moves in a piece of a push that is predicted from where it begins, m."""
CLOSING = 0.02
"""How far the fastest corner moves at first, m, before wrenches are compared: contacts that are open by the error of
their first measured place close, and what the plate feels of that is anything but linear in the error."""
MOST_COMPARED = 60
"""Poses of a piece that are compared, evenly over its way."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """A push made ready to be predicted again and again.

    Attributes:
        push: What was measured.
        motions: (s, 3) body twists times time of the plate, one for each simulated step.
        marks: (k,) number of steps after which poses are compared; the first is 0.
        samples: (k,) which measured poses those are.
        closed: (k,) whether the plate has gone so far that wrenches are compared.
    """

    push: MeasuredPush
    motions: FloatArray
    marks: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    samples: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    closed: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

    @classmethod
    def of_pieces(cls, push: MeasuredPush, reach: float) -> list[Comparison]:
        """Return all pieces of a push; `reach` (m) is how far the farthest corner is from the plate's reference."""
        return [cls._of_piece(piece, reach) for piece in push.pieces(reach, STEP, WAY)]

    @classmethod
    def _of_piece(cls, push: MeasuredPush, reach: float) -> Comparison:
        motions = steps_of(push.plate_poses)
        way = np.hypot(motions[:, 0], motions[:, 1]) + reach * np.abs(motions[:, 2])
        counts = np.maximum(1, np.ceil(way / (1.5 * STEP))).astype(np.int64)
        fine = np.repeat(motions / counts[:, None], counts, axis=0)
        ends = np.concatenate([[0], np.cumsum(counts)])
        samples = np.unique(np.linspace(0, len(ends) - 1, min(MOST_COMPARED, len(ends))).astype(np.int64))
        gone = np.concatenate([[0.0], np.cumsum(way)])
        return cls(push, fine, ends[samples], samples, gone[samples] >= CLOSING)

    def errors(self, packed: slip.World, shift: FloatArray) -> FloatArray:
        """Return by how much predicted poses, and wrenches where they were measured, are off the measured ones.

        Args:
            packed: What is pushed.
            shift: (n, 3) by what the objects really stood off their first measured poses, in the plate's frame:
                m, rad.

        Returns:
            (k, n, 3) in the plate's frame: m and rad; with wrenches (k, n + 1, 3), the last row N, N, N m, and zero
            while contacts close.
        """
        plate = self.push.plate_poses
        first = se2.relative(plate[0], self.push.object_poses[0]) + shift
        begin = se2.compose(plate[0], first)
        trace = slip.Simulation(packed, begin, plate[0]).march(self.motions)
        # After a jam nothing moves on; in its step, the last of the trace, nothing has moved.
        poses = np.concatenate([begin[None], trace.poses])
        reached = poses[np.minimum(self.marks, len(trace.end))]
        there = plate[self.samples][:, None]
        off = se2.relative(there, reached) - se2.relative(there, self.push.object_poses[self.samples])
        off[..., 2] = se2.wrap_angle(off[..., 2])
        if self.push.wrenches is None:
            return np.asarray(off)
        wrenches = np.zeros((len(self.motions), 3))
        wrenches[: len(trace.end)] = trace.wrenches
        pushed = at_poses(wrenches)[self.marks] - self.push.wrenches[self.samples]
        pushed[~self.closed] = 0.0
        return np.concatenate([off, pushed[:, None]], axis=1)


LEVEL = 0.9
"""Share of the intervals that hold the truth."""
ROUGH = 50.0
"""Independent samples of which a twentieth lies beyond an end of an interval, give or take 3 % of all."""
_SHORT = 0.5
"""Part of what was possible that an interval has to be shorter than; without data it is 0.9."""
_SAID = 0.15
"""A contact's friction that is only known to be more, or less, than something is worth saying from here on."""


@dataclass(frozen=True)
class Estimate:
    """One unknown number after the measurements.

    Attributes:
        unknown: Which.
        low: Lower end of the 90 % interval.
        median: Half of what is possible lies below.
        high: Upper end.
        determined: Whether the data say anything about it.
    """

    unknown: Unknown
    low: float
    median: float
    high: float
    determined: bool


@dataclass(frozen=True, eq=False)
class Identification:
    """What pushes tell about friction and loads.

    Attributes:
        unknowns: What was looked for.
        samples: (k, p) values that are possible, each as likely as the others.
        noise: Error of a measured position (m, in x and y each) and angle (rad), as the best prediction leaves it.
        worth: How many independent samples they are worth: below `ROUGH` the intervals' ends are rough.
        correlation: By how much errors that persist along a push widen the intervals, >= 1: those of the model do.
    """

    unknowns: Unknowns
    samples: FloatArray
    noise: tuple[float, float]
    correlation: float
    worth: float

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """All unknowns with their intervals."""
        return tuple(self._estimate(k, one) for k, one in enumerate(self.unknowns.each))

    def _estimate(self, k: int, one: Unknown) -> Estimate:
        low, median, high = np.quantile(self.samples[:, k], [0.5 - LEVEL / 2, 0.5, 0.5 + LEVEL / 2])
        ends = _place(one, np.array([low, high]))
        one_sided = one.kind == "contact_friction" and bool(ends[0] > _SAID or ends[1] < 1.0 - _SAID)
        determined = one_sided or bool(ends[1] - ends[0] < _SHORT)
        return Estimate(one, float(low), float(median), float(high), determined)

    @property
    def friction_spans(self) -> FloatArray:
        """(n, 2) 90 % intervals of the objects' coefficients of floor friction, with their masses as stated."""
        objects = self.unknowns.world.chain.objects
        coefficients = np.array([obj.floor_friction / obj.friction_load for obj in objects])
        found = coefficients * self.unknowns.friction_loads(self.samples)
        return np.asarray(np.quantile(found, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0).T)

    def load_spans(self, i: int) -> FloatArray:
        """Return the 90 % intervals (k, 2) of the part of object i's weight on each of its points."""
        chosen = self.samples[:: max(1, len(self.samples) // 400)]
        loads = np.array([self.unknowns.fractions(values)[i] for values in chosen])
        return np.asarray(np.quantile(loads, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0).T)


def _place(one: Unknown, values: FloatArray) -> FloatArray:
    """Return where values are between the ends of an unknown, 0 to 1."""
    if one.logarithmic:
        return np.asarray(np.log(values / one.low) / np.log(one.high / one.low))
    return np.asarray((values - one.low) / (one.high - one.low))


Document = dict[str, Any]

LOADS = ("border", "tilt", "foot")
"""Kinds of unknowns that the load under an object follows from."""


def piece_of(found: Identification) -> Document:
    """Return what the data determine, in the form of a scenario file: `contacts.between` and `objects`.

    Frictions are intervals; without measured forces floor frictions are those that go with the stated one of the
    first object. A load is one on points, the part of the weight on each an interval.
    """
    between = [_contact(found, one) for one in found.estimates if _told(one, "contact_friction")]
    objects = [_object(found, i) for i in range(len(found.unknowns.loads))]
    objects = [obj for obj in objects if len(obj) > 1]
    return {**({"objects": objects} if objects else {}), **({"contacts": {"between": between}} if between else {})}


def with_learned(document: Mapping[str, Any], piece: Mapping[str, Any]) -> Document:
    """Return a scenario as plain data with what was learned in place of its numbers.

    Args:
        document: As `Scenario.resolved` returns it.
        piece: As `piece_of` returns it.
    """
    merged = deepcopy(dict(document))
    learned = {obj["name"]: obj for obj in piece.get("objects", ())}
    for obj in merged["objects"]:
        obj.update(learned.get(obj["name"], {}))
        if "support" in learned.get(obj["name"], {}):
            obj.pop("center_of_mass", None)  # it follows from the loads
    contacts = merged.setdefault("contacts", {})
    pairs = list(piece.get("contacts", {}).get("between", ()))
    new = [set(pair["objects"]) for pair in pairs]
    kept = [pair for pair in contacts.get("between") or () if set(pair["objects"]) not in new]
    contacts["between"] = [*kept, *pairs]
    return merged


def _told(one: Estimate, kind: str) -> bool:
    return one.unknown.kind == kind and one.determined


def _contact(found: Identification, one: Estimate) -> Document:
    chain = found.unknowns.world.chain
    contact = chain.contacts[one.unknown.of]
    pushing = PUSHER if contact.pusher == PLATE else chain.objects[contact.pusher].name
    return {"objects": [pushing, chain.objects[contact.pushed].name], "friction": _span(one.low, one.high)}


def _object(found: Identification, i: int) -> Document:
    learned: Document = {"name": found.unknowns.world.chain.objects[i].name}
    ratio = any(one.unknown.of == i and _told(one, "floor_ratio") for one in found.estimates)
    if ratio or (i == 0 and any(_told(one, "floor_friction") for one in found.estimates)):
        learned["floor_friction"] = _span(*found.friction_spans[i])
    if any(one.unknown.of == i and one.determined and one.unknown.kind in LOADS for one in found.estimates):
        points, spans = found.unknowns.loads[i].points, found.load_spans(i)
        feet = [
            [round(float(x), 6), round(float(y), 6), _span(low, high)]
            for (x, y), (low, high) in zip(points, spans, strict=True)
        ]
        learned["support"] = {"feet": feet}
    return learned


def _span(low: float, high: float) -> list[float]:
    """Return an interval to four digits, rounded outwards by less than what matters."""
    return [float(f"{low:.4g}"), float(f"{high:.4g}")]
