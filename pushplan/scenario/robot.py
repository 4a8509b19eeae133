"""The robot of a scenario file: its parts and its drive brought to the chain frame, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.contact_segments import SHORTEST_CONTACT, TOUCH, find_touch
from pushplan.mechanics.chain import Drive
from pushplan.scenario.arrangement.layout import Layout, Part
from pushplan.scenario.arrangement.meeting import BACK, describe_overlap
from pushplan.scenario.arrangement.shapes import outline_of
from pushplan.scenario.schema.objects import Drive as StatedDrive
from pushplan.scenario.schema.objects import WheeledDrive
from pushplan.scenario.schema.robot import FootprintPart
from pushplan.scenario.schema.scenario import StatedRoom
from pushplan.scenario.yaml.node import Place
from pushplan.scenario.yaml.report import Report
from pushplan.util.arrays import FloatArray
from pushplan.util.names import ROBOT


def footprint_parts(file: StatedRoom) -> tuple[FootprintPart, ...]:
    """Return the parts of the robot, none where it is not stated."""
    stated = file.robot.footprint
    if stated is None:
        return ()
    return (stated,) if isinstance(stated, FootprintPart) else stated


def make_footprint(
    file: StatedRoom, parts: Sequence[Part], layout: Layout, report: Report
) -> tuple[FloatArray, ...]:
    """Return the outlines (v, 2) of the robot's parts in the chain frame, and report where they meet objects."""
    poses = [np.array(part.pose) for part in footprint_parts(file)]
    outlines = tuple(
        se2.transform_points(se2.compose(layout.plate_pose, pose), outline_of(part))
        for part, pose in zip(footprint_parts(file), poses, strict=True)
    )
    one = isinstance(file.robot.footprint, FootprintPart)
    for i, (outline, pose) in enumerate(zip(outlines, poses, strict=True)):
        place: Place = ("robot", "footprint") if one else ("robot", "footprint", i)
        for trouble in _troubles(outline, pose, parts, layout):
            report.add(place, trouble)
    return outlines


def _troubles(outline: FloatArray, pose: FloatArray, parts: Sequence[Part], layout: Layout) -> Iterator[str]:
    """Yield a sentence on every object that a part of the robot, at `pose` (3,) in the plate's frame, meets."""
    plate = shapely.Polygon(layout.plate).buffer(TOUCH, join_style="mitre")
    for part, object_outline in zip(parts, layout.outlines, strict=True):
        overlap = describe_overlap((f"'{part.name}'", object_outline), (ROBOT, outline), pose, BACK)
        if overlap is not None:
            yield overlap
            continue
        touch = find_touch(outline, object_outline)
        segments = [] if touch is None else list(touch)
        # Along the plate's own contact the plate pushes; anywhere else the robot itself would.
        if any(shapely.difference(shapely.LineString(s), plate).length > SHORTEST_CONTACT for s in segments):
            yield (
                f"'{ROBOT}' touches '{part.name}' beside the plate, which alone may push; move it to "
                f"x <= {pose[0] - 1e-3:.6g}"
            )


def make_drive(file: StatedRoom, layout: Layout, report: Report) -> Drive:
    """Return the drive with its axle in the chain frame, and report one that is stated twice."""
    if file.robot.drive is None:
        return _drive(file.pusher.drive, np.zeros(3))
    if "drive" in file.pusher.model_fields_set:
        report.add(("robot", "drive"), "is stated in pusher.drive, too; keep one of them", at_key=True)
    return _drive(file.robot.drive, layout.plate_pose)


def make_base(file: StatedRoom, layout: Layout) -> FloatArray | None:
    """Return the robot's base (3,) in the chain frame; None where it is not stated."""
    stated = file.robot.base
    return None if stated is None else se2.compose(layout.plate_pose, np.array(stated))


def _drive(stated: StatedDrive, frame: FloatArray) -> Drive:
    """Return a drive that is stated in a frame (3,) given in the chain frame."""
    if not isinstance(stated, WheeledDrive):
        return Drive()
    wheels = stated.car or stated.differential
    assert wheels is not None
    axle = se2.compose(frame, np.array(wheels.axle))
    if stated.car is not None:
        return Drive("car", axle, stated.car.min_radius)
    return Drive("differential", axle)
