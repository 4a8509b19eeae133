"""Measured pushes, their comparison with predictions, and the identified values."""

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
from pushplan.sim.identify.unknowns import LOADS, Unknown, Unknowns
from pushplan.sim.report import at_poses
from pushplan.sim.slip import steps_of
from pushplan.util.arrays import FloatArray, IntArray, frozen
from pushplan.util.names import PUSHER


@dataclass(frozen=True, eq=False)
class MeasuredPush:
    """Poses in the world, and wrenches, measured at the same times.

    Attributes:
        plate_poses: Poses of the plate, that is of the chain frame, (m, 3).
        object_poses: Poses of the objects' own frames, (m, n, 3); NaN at times without a measurement. Predictions
            are compared at the times when all objects were measured; at least two are needed.
        name: Name in messages.
        wrenches: Wrenches of the plate on all objects that it touches, in the chain frame about its origin, (m, 3):
            N, N, N m. None without a force sensor.

    Raises:
        PushplanError: If there are fewer than three poses, they are not finite, or all objects are measured
            fewer than twice.
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
            raise PushplanError(f"{self.name}: there are {len(plate)} measured poses; at least 3 are needed")
        object.__setattr__(self, "plate_poses", frozen(plate, (None, 3), f"{self.name}: poses of the plate"))
        seen = ~np.isnan(objects).any(axis=(1, 2))
        if np.count_nonzero(seen) < 2:
            raise PushplanError(
                f"{self.name}: all objects are measured at {np.count_nonzero(seen)} times; at least 2 are needed"
            )
        poses = np.full(objects.shape, np.nan)
        poses[seen] = frozen(objects[seen], (None, objects.shape[1], 3), f"{self.name}: poses of the objects")
        poses.setflags(write=False)
        object.__setattr__(self, "object_poses", poses)
        if self.wrenches is not None:
            wrenches = frozen(self.wrenches, (len(plate), 3), f"{self.name}: wrenches of the plate")
            object.__setattr__(self, "wrenches", wrenches)

    @property
    def seen(self) -> IntArray:
        """Indices of the times at which all objects were measured."""
        return np.flatnonzero(~np.isnan(self.object_poses[:, 0, 0]))

    def pieces(self, reach: float, step: float, way: float) -> list[MeasuredPush]:
        """Split the push into short pieces and drop poses without motion.

        A prediction over a long distance is chaotic: it depends on the last bit of the initial poses. Every piece
        therefore starts from measured poses.

        Args:
            reach: Distance of the farthest corner from the plate's reference, m.
            step: Smallest path length of that corner between two poses, m.
            way: Approximate largest path length of that corner in a piece, m.
        """
        moved = se2.log(se2.relative(self.plate_poses[:-1], self.plate_poses[1:]))
        gone = np.concatenate([[0.0], np.cumsum(np.hypot(moved[:, 0], moved[:, 1]) + reach * np.abs(moved[:, 2]))])
        # Keep a pose at every multiple of the step, also if rounding puts one just before it.
        marks, seen = np.floor(gone / step * (1.0 + 1e-9)), self.seen
        every, compared = (rows[np.diff(marks[rows], prepend=-1.0) > 0] for rows in (np.arange(len(gone)), seen))
        # Measurements can be rare, for example only before and after the push: keep them all the same.
        ends = np.unique([*compared, seen[-1]])
        kept, count = np.union1d(every, ends), max(1, int(np.ceil(gone[-1] / way)))
        cuts = np.unique(np.searchsorted(gone[ends], gone[-1] * np.arange(count + 1) / count).clip(max=len(ends) - 1))
        return [
            MeasuredPush(
                self.plate_poses[these],
                self.object_poses[these],
                self.name,
                None if self.wrenches is None else self.wrenches[these],
            )
            for a, b in pairwise(ends[cuts])
            if len(these := kept[(kept >= a) & (kept <= b)]) > 2
        ]


STEP = 3e-3
"""Approximate path length of the fastest corner in a simulated step, m."""
WAY = 0.2
"""Approximate path length of the fastest corner in a piece of a push, m."""
CLOSING = 0.02
"""Path length of the fastest corner, m, before wrenches are compared. Errors of the initial poses open contacts;
while these close, the wrench of the plate is strongly nonlinear in the error."""
MOST_COMPARED = 60
"""Largest number of compared poses of a piece, spread evenly over it."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """A piece of a push, prepared for repeated prediction.

    Attributes:
        push: Measured piece.
        motions: Body twists of the plate times time, one for each simulated step, (s, 3).
        marks: Numbers of steps after which poses are compared, (k,); the first is 0.
        samples: Indices of the compared measured poses, (k,).
        closed: Whether the contacts have closed, so that wrenches are compared, (k,).
    """

    push: MeasuredPush
    motions: FloatArray
    marks: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    samples: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    closed: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

    @classmethod
    def of_pieces(cls, push: MeasuredPush, reach: float) -> list[Comparison]:
        """Return all pieces of a push; `reach` (m) is as in `MeasuredPush.pieces`."""
        return [cls._of_piece(piece, reach) for piece in push.pieces(reach, STEP, WAY)]

    @classmethod
    def _of_piece(cls, push: MeasuredPush, reach: float) -> Comparison:
        motions = steps_of(push.plate_poses)
        way = np.hypot(motions[:, 0], motions[:, 1]) + reach * np.abs(motions[:, 2])
        counts = np.maximum(1, np.ceil(way / (1.5 * STEP))).astype(np.int64)
        fine = np.repeat(motions / counts[:, None], counts, axis=0)
        ends = np.concatenate([[0], np.cumsum(counts)])
        seen = push.seen
        samples = seen[np.unique(np.linspace(0, len(seen) - 1, min(MOST_COMPARED, len(seen))).astype(np.int64))]
        gone = np.concatenate([[0.0], np.cumsum(way)])
        return cls(push, fine, ends[samples], samples, gone[samples] >= CLOSING)

    def errors(self, packed: slip.World, shift: FloatArray) -> FloatArray:
        """Return the differences of predicted and measured poses, and of wrenches if these were measured.

        Args:
            packed: World with the parameters to test.
            shift: Offsets of the true initial object poses from the measured ones, in the plate's frame, (n, 3):
                m, rad.

        Returns:
            Errors (k, n, 3) in the plate's frame, m and rad. With wrenches (k, n + 1, 3); the last row is in N, N,
            N m, and zero while contacts close.
        """
        plate = self.push.plate_poses
        first = se2.relative(plate[0], self.push.object_poses[0]) + shift
        begin = se2.compose(plate[0], first)
        trace = slip.Simulation(packed, begin, plate[0]).march(self.motions)
        # After a jam nothing moves: the last step of the trace is the jammed one, without motion.
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


LEVEL = 0.95
"""Probability that an interval holds the true value."""
ROUGH = 50.0
"""Number of independent samples below which the ends of intervals are rough: 5 % +- 3 % of the samples lie beyond."""
_NARROW = 0.5
"""Largest share of the prior range that the interval of a determined number covers; without data it is 0.9."""
_ONE_SIDED = 0.15
"""Share of the prior range that a one-sided bound of a contact friction must exclude to count as determined."""


@dataclass(frozen=True)
class Estimate:
    """Estimate of one unknown number from the measurements.

    Attributes:
        unknown: Estimated unknown.
        low: Lower end of the 95 % interval.
        median: Median of the samples.
        high: Upper end of the 95 % interval.
        determined: Whether the data narrow it down.
    """

    unknown: Unknown
    low: float
    median: float
    high: float
    determined: bool


@dataclass(frozen=True, eq=False)
class Identification:
    """Friction and loads identified from pushes.

    Attributes:
        unknowns: Identified unknowns.
        samples: Posterior samples of their values, equally likely, (k, p).
        noise: Residual error of a measured position (m, in x and y each) and angle (rad) at the best prediction.
        correlation: Factor >= 1 by which persistent errors along a push, such as model errors, widen the intervals.
        worth: Effective number of independent samples; below `ROUGH` the ends of intervals are rough.
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
        ends = one.share(np.array([low, high]))
        one_sided = one.kind == "contact_friction" and bool(ends[0] > _ONE_SIDED or ends[1] < 1.0 - _ONE_SIDED)
        determined = one_sided or bool(ends[1] - ends[0] < _NARROW)
        return Estimate(one, float(low), float(median), float(high), determined)

    @property
    def friction_spans(self) -> FloatArray:
        """95 % intervals of the objects' floor friction coefficients at their nominal masses, (n, 2)."""
        objects = self.unknowns.world.chain.objects
        coefficients = np.array([obj.floor_friction / obj.friction_load for obj in objects])
        found = coefficients * self.unknowns.friction_loads(self.samples)
        return np.asarray(np.quantile(found, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0).T)

    def load_spans(self, i: int) -> FloatArray:
        """Return the 95 % intervals (k, 2) of the share of object i's weight on each of its points."""
        chosen = self.samples[:: max(1, len(self.samples) // 400)]
        loads = np.array([self.unknowns.fractions(values)[i] for values in chosen])
        return np.asarray(np.quantile(loads, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0).T)


Document = dict[str, Any]


def piece_of(found: Identification) -> Document:
    """Return the determined values as part of a scenario file: `contacts.between` and `objects`.

    Frictions are intervals. Without measured forces, floor frictions assume the nominal one of the first object. A
    load is a list of points with an interval of the share of the weight on each.
    """
    between = [_contact(found, one) for one in found.estimates if _is_determined(one, "contact_friction")]
    objects = [_object(found, i) for i in range(len(found.unknowns.loads))]
    objects = [obj for obj in objects if len(obj) > 1]
    return {**({"objects": objects} if objects else {}), **({"contacts": {"between": between}} if between else {})}


def with_learned(document: Mapping[str, Any], piece: Mapping[str, Any]) -> Document:
    """Return a scenario as plain data with the identified values in place of its numbers.

    Args:
        document: Scenario from `Scenario.resolved`.
        piece: Identified values from `piece_of`.
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


def _is_determined(one: Estimate, kind: str) -> bool:
    return one.unknown.kind == kind and one.determined


def _contact(found: Identification, one: Estimate) -> Document:
    chain = found.unknowns.world.chain
    contact = chain.contacts[one.unknown.of]
    pushing = PUSHER if contact.pusher == PLATE else chain.objects[contact.pusher].name
    return {"objects": [pushing, chain.objects[contact.pushed].name], "friction": _span(one.low, one.high)}


def _object(found: Identification, i: int) -> Document:
    learned: Document = {"name": found.unknowns.world.chain.objects[i].name}
    ratio = any(one.unknown.of == i and _is_determined(one, "floor_ratio") for one in found.estimates)
    if ratio or (i == 0 and any(_is_determined(one, "floor_friction") for one in found.estimates)):
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
    """Return an interval rounded to four digits."""
    return [float(f"{low:.4g}"), float(f"{high:.4g}")]
