"""Where plate and objects are in the chain frame: stacked from the plate outward, or at stated poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.geometry.contact_segments import TOUCH, find_touch
from pushplan.scenario.arrangement.meeting import Named, describe_gap, describe_overlap
from pushplan.scenario.arrangement.snapping import SnapTolerance, snap, too_far
from pushplan.scenario.arrangement.stacking import flush_pose, plate_outline
from pushplan.scenario.parts import Snapped, Snapping
from pushplan.scenario.yaml.report import Report
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Part:
    """What is stated of one object.

    Attributes:
        name: For messages.
        outline: (v, 2) in its own frame, m, counter-clockwise.
        offset: Its frame's y against the frame of the one before (the first: against the plate's middle), m.
        pose: (3,) in the chain frame, or None to stack it.
    """

    name: str
    outline: FloatArray
    offset: float | None = None
    pose: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Layout:
    """Where everything is.

    Attributes:
        plate: (4, 2) outline of the plate in the chain frame, m.
        poses: (n, 3) poses of the objects in the chain frame.
        outlines: Outlines (v, 2) of the objects in the chain frame, m.
        snapping: How measured poses were moved; None when they are taken as they are.
    """

    plate: FloatArray
    poses: FloatArray
    outlines: tuple[FloatArray, ...]
    snapping: Snapping | None = None

    @property
    def plate_pose(self) -> FloatArray:
        """(3,) pose in the chain frame of the plate's frame: the middle of its front edge, +x along the push."""
        return np.array([self.plate[:, 0].max(), self.plate[:, 1].mean(), 0.0])


def lay_out(
    parts: Sequence[Part],
    width: float,
    thickness: float,
    report: Report,
    within: SnapTolerance | None = None,
) -> Layout | None:
    """Place the plate and all parts, or report why not and return None.

    The chain frame's origin is the midpoint of the plate's contact with the first part. When that part states its
    pose, the plate's middle is at the origin, or at the pose's y less the offset if there is one. With `within`,
    stated poses are moved onto the contacts that are nearer than that, from the plate outward; where the plate's
    contact then has its midpoint aside of the origin, the frame is moved there.
    """
    first = _place_first(parts[0], width, thickness, report, within)
    if first is None:
        return None
    plate, poses, moved, sideways = first.plate, [first.pose], list(first.moved), first.sideways
    for i, part in enumerate(parts[1:], start=1):
        if part.pose is not None and part.offset is not None:
            report.add(("objects", i, "offset"), "has no meaning beside pose; keep one of them", at_key=True)
        pose = _placed(parts[i - 1].outline, part, (f"'{parts[i - 1].name}'", i), report)
        if pose is None:
            return None
        if part.pose is None:
            pose = se2.compose(poses[-1], pose)
        elif within is not None:
            bodies = [("the plate", plate), *_bodies(parts, poses)]
            measured = pose - [0.0, sideways, 0.0]
            pose, snapped = snap(bodies, (part.name, part.outline), measured, within)
            moved.append(snapped)
            if _too_far(i, snapped, within, report):
                return None
        poses.append(pose)
    outlines = tuple(outline for _, outline in _bodies(parts, poses))
    snapping = None if within is None else Snapping(tuple(moved), sideways)
    return Layout(plate, np.array(poses), outlines, snapping)


def _bodies(parts: Sequence[Part], poses: Sequence[FloatArray]) -> list[Named]:
    """Return what messages call the parts that have a pose, and their outlines in the chain frame."""
    return [
        (f"'{part.name}'", se2.transform_points(pose, part.outline))
        for part, pose in zip(parts, poses, strict=False)
    ]


def _too_far(i: int, snapped: Snapped, within: SnapTolerance, report: Report) -> bool:
    """Tell whether an object is farther from its contact than is allowed, and report it."""
    trouble = too_far(snapped, within)
    if trouble is not None:
        report.add(("objects", i, "pose"), trouble)
    return trouble is not None


class _First(NamedTuple):
    """The plate (4, 2), the first part's pose (3,), how that was snapped, and by how much the frame was moved, m."""

    plate: FloatArray
    pose: FloatArray
    moved: tuple[Snapped, ...] = ()
    sideways: float = 0.0


def _place_first(
    part: Part, width: float, thickness: float, report: Report, within: SnapTolerance | None
) -> _First | None:
    """Return the plate and the first part in the chain frame."""
    middle = float(part.pose[1]) - part.offset if part.pose is not None and part.offset is not None else 0.0
    plate = plate_outline(width, thickness, middle)
    pose = _placed(plate, part, ("the plate", 0), report)
    if pose is None:
        return None
    moved: tuple[Snapped, ...] = ()
    if part.pose is not None and within is not None:
        pose, snapped = snap([("the plate", plate)], (part.name, part.outline), pose, within)
        if _too_far(0, snapped, within, report):
            return None
        moved = (snapped,)
    outline = se2.transform_points(pose, part.outline)
    trouble = describe_overlap(("the plate", plate), (part.name, outline), pose)
    touch = find_touch(plate, outline)
    if trouble is None and (touch is None or len(touch) == 0):
        trouble = describe_gap(("the plate", plate), (part.name, outline), pose)
    if trouble is not None or touch is None:
        report.add(("objects", 0), trouble or "")
        return None
    origin = touch[0].mean(axis=0).round(15)  # so that what is symmetric stays so
    if part.pose is None:
        return _First(plate - origin, pose - [*origin, 0.0])
    away = float(np.linalg.norm(origin))
    if within is not None and TOUCH < away <= within.position:
        return _First(plate - origin, pose - [*origin, 0.0], moved, float(origin[1]))
    return _First(plate, pose, moved) if _at_origin(origin, pose, middle, part.name, report) else None


def _placed(base: FloatArray, part: Part, where: tuple[str, int], report: Report) -> FloatArray | None:
    """Return the pose of a part, in the chain frame if it states one, else in the frame of `base`."""
    if part.pose is not None:
        return part.pose
    try:
        return flush_pose(base, part.outline, part.offset or 0.0, (where[0], f"'{part.name}'"))
    except ChainError as error:
        report.add(("objects", where[1]), str(error))
        return None


def _at_origin(origin: FloatArray, pose: FloatArray, middle: float, name: str, report: Report) -> bool:
    """Tell whether the plate's contact with the first part has its midpoint at the chain frame's origin."""
    if float(np.linalg.norm(origin)) <= TOUCH:
        return True
    x, y, theta = pose - [*origin, 0.0]
    report.add(
        ("objects", 0, "pose"),
        f"the plate touches '{name}' with the contact's midpoint at ({origin[0]:.6g}, {origin[1]:.6g}), but "
        f"that is the chain frame's origin; write pose: [{x:.6g}, {y:.6g}, {theta:.6g}] and "
        f"offset: {pose[1] - middle:.6g}",
    )
    return False
