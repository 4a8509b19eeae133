"""Where plate and objects are in the chain frame: stacked from the plate outward, or at stated poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.geometry.contact_segments import TOUCH, find_touch
from pushplan.reading.meeting import describe_gap, describe_overlap
from pushplan.reading.report import Report
from pushplan.reading.stacking import flush_pose, plate_outline


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
    """

    plate: FloatArray
    poses: FloatArray
    outlines: tuple[FloatArray, ...]

    @property
    def plate_pose(self) -> FloatArray:
        """(3,) pose in the chain frame of the plate's frame: the middle of its front edge, +x along the push."""
        return np.array([self.plate[:, 0].max(), self.plate[:, 1].mean(), 0.0])


def lay_out(parts: Sequence[Part], width: float, thickness: float, report: Report) -> Layout | None:
    """Place the plate and all parts, or report why not and return None.

    The chain frame's origin is the midpoint of the plate's contact with the first part. When that part states its
    pose, the plate's middle is at the origin, or at the pose's y less the offset if there is one.
    """
    first = _place_first(parts[0], width, thickness, report)
    if first is None:
        return None
    plate, poses = first[0], [first[1]]
    for i, part in enumerate(parts[1:], start=1):
        if part.pose is not None and part.offset is not None:
            report.add(("objects", i, "offset"), "has no meaning beside pose; keep one of them", at_key=True)
        before = parts[i - 1]
        pose = _placed(before.outline, part, (f"'{before.name}'", i), report)
        if pose is None:
            return None
        poses.append(pose if part.pose is not None else se2.compose(poses[-1], pose))
    outlines = tuple(se2.transform_points(p, part.outline) for p, part in zip(poses, parts, strict=True))
    return Layout(plate, np.array(poses), outlines)


def _place_first(
    part: Part, width: float, thickness: float, report: Report
) -> tuple[FloatArray, FloatArray] | None:
    """Return the plate (4, 2) and the first part's pose (3,) in the chain frame."""
    middle = float(part.pose[1]) - part.offset if part.pose is not None and part.offset is not None else 0.0
    plate = plate_outline(width, thickness, middle)
    pose = _placed(plate, part, ("the plate", 0), report)
    if pose is None:
        return None
    outline = se2.transform_points(pose, part.outline)
    trouble = describe_overlap(("the plate", plate), (part.name, outline), pose)
    touch = find_touch(plate, outline)
    if trouble is None and (touch is None or len(touch.segments) == 0):
        trouble = describe_gap(("the plate", plate), (part.name, outline), pose)
    if trouble is not None or touch is None:
        report.add(("objects", 0), trouble or "")
        return None
    origin = touch.segments[0].mean(axis=0).round(15)  # so that what is symmetric stays so
    if part.pose is None:
        return plate - origin, pose - [*origin, 0.0]
    return (plate, pose) if _at_origin(origin, part, middle, report) else None


def _placed(base: FloatArray, part: Part, where: tuple[str, int], report: Report) -> FloatArray | None:
    """Return the pose of a part, in the chain frame if it states one, else in the frame of `base`."""
    if part.pose is not None:
        return part.pose
    try:
        return flush_pose(base, part.outline, part.offset or 0.0, (where[0], f"'{part.name}'"))
    except ChainError as error:
        report.add(("objects", where[1]), str(error))
        return None


def _at_origin(origin: FloatArray, part: Part, middle: float, report: Report) -> bool:
    """Tell whether the plate's contact with the first part has its midpoint at the chain frame's origin."""
    if float(np.linalg.norm(origin)) <= TOUCH:
        return True
    assert part.pose is not None
    x, y, theta = part.pose - [*origin, 0.0]
    report.add(
        ("objects", 0, "pose"),
        f"the plate touches '{part.name}' with the contact's midpoint at ({origin[0]:.6g}, {origin[1]:.6g}), but "
        f"that is the chain frame's origin; write pose: [{x:.6g}, {y:.6g}, {theta:.6g}] and "
        f"offset: {part.pose[1] - middle:.6g}",
    )
    return False
