"""From the objects, contacts, pusher and robot of a scenario file to the chain, checked for geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pushplan.mechanics.chain import Chain, Limits, PushedObject, Pusher
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.scenario.arrangement.contact_friction import contact_frictions
from pushplan.scenario.arrangement.contacts import find_segments, make_contacts
from pushplan.scenario.arrangement.layout import Layout, Part, lay_out
from pushplan.scenario.arrangement.shapes import outline_of
from pushplan.scenario.arrangement.snapping import SnapTolerance
from pushplan.scenario.intervals import make_interval_chain, stated_floor_friction
from pushplan.scenario.parts import Snapping
from pushplan.scenario.robot import footprint_parts, make_base, make_drive, make_footprint
from pushplan.scenario.schema.scenario import Snap, StatedRoom
from pushplan.scenario.supports import ReadFile, make_support
from pushplan.scenario.uncertainty import widened
from pushplan.scenario.values.interval import highest, lowest, middle
from pushplan.scenario.yaml.report import Report
from pushplan.util.arrays import FloatArray
from pushplan.util.names import RESERVED_NAMES, ROBOT


@dataclass(frozen=True, eq=False)
class Bodies:
    """What moves.

    Attributes:
        chain: Objects, contacts and pusher; of intervals, the middle of loads and the lowest contact friction.
        interval: The chain with the intervals of its loads and floor frictions, None when these are numbers.
        contact_friction: (n, 2) least and largest coefficient of every contact.
        stated: The same as plain data in the form of the file, with every pose and default filled in.
        snapping: How measured poses were moved; None when they are taken as they are.
    """

    chain: Chain
    interval: IntervalChain | None
    contact_friction: FloatArray
    stated: dict[str, Any]
    snapping: Snapping | None


def build_bodies(file: StatedRoom, read: ReadFile, report: Report) -> Bodies | None:
    """Return the chain of a scenario file, or report what is wrong with it and return None."""
    stated, file = file, widened(file)
    _check_names(file, report)
    parts = [_part(i, file) for i in range(len(file.objects))]
    supports = [
        make_support(obj, part.outline, i, read, report)
        for i, (obj, part) in enumerate(zip(file.objects, parts, strict=True))
    ]
    layout = lay_out(parts, file.pusher.width, file.pusher.thickness, report, _snap_tolerance(file))
    if layout is None:
        return None
    segments = find_segments(parts, layout, report)
    frictions = contact_frictions(file, segments, report)
    pusher = _pusher(file, parts, layout, report)
    if report.findings:
        return None
    floors = [stated_floor_friction(obj, file) for obj in file.objects]
    objects = tuple(
        PushedObject(obj.name, part.outline, middle(obj.mass), middle(floor), support, layout.poses[i])
        for i, (obj, part, support, floor) in enumerate(
            zip(file.objects, parts, supports, floors, strict=True)
        )
        if support is not None
    )
    chain = Chain(objects, make_contacts(segments, frictions), pusher)
    interval = make_interval_chain(stated, chain)
    if report.findings:
        return None
    spans = [frictions[contact.pusher, contact.pushed] for contact in chain.contacts]
    ends = np.array([[lowest(span), highest(span)] for span in spans])
    return Bodies(chain, interval, ends, _stated(stated, layout), layout.snapping)


def _check_names(file: StatedRoom, report: Report) -> None:
    names = [obj.name for obj in file.objects]
    reserved = (*RESERVED_NAMES, *((ROBOT,) if footprint_parts(file) else ()))
    for i, name in enumerate(names):
        if name in names[:i]:
            report.add(
                ("objects", i, "name"), f"objects[{names.index(name)}] is called '{name}' too; names differ"
            )
        if name.lower() in reserved:
            what = f"'{name}' is reserved; allowed: any name but {', '.join(reserved)}"
            report.add(("objects", i, "name"), what)


def _part(i: int, file: StatedRoom) -> Part:
    obj = file.objects[i]
    pose = None if obj.pose is None else np.array(obj.pose)
    return Part(obj.name, outline_of(obj.shape), obj.offset, pose)


def _pusher(file: StatedRoom, parts: Sequence[Part], layout: Layout, report: Report) -> Pusher:
    plate, limits = file.pusher, Limits(**file.pusher.limits.model_dump())
    return Pusher(
        layout.plate,
        lowest(plate.friction),
        plate.contact_height,
        make_drive(file, layout, report),
        limits,
        make_footprint(file, parts, layout, report),
        make_base(file, layout),
    )


def _snap_tolerance(file: StatedRoom) -> SnapTolerance | None:
    stated = file.snap
    if isinstance(stated, float):
        stated = Snap(position=stated)
    return None if stated is None else SnapTolerance(stated.position, stated.angle)


def _stated(file: StatedRoom, layout: Layout) -> dict[str, Any]:
    objects = []
    for i, obj in enumerate(file.objects):
        stated = obj.model_dump(mode="json", exclude_none=True)
        stated |= {"floor_friction": stated_floor_friction(obj, file), "pose": layout.poses[i].tolist()}
        if i > 0:
            stated.pop("offset", None)
        elif obj.pose is None or obj.offset is None:
            stated["offset"] = float(layout.poses[0, 1] - layout.plate_pose[1])
        objects.append(stated)
    sections = {"contacts": file.contacts, "pusher": file.pusher}
    rest = {name: part.model_dump(mode="json", exclude_none=True) for name, part in sections.items()}
    robot = _stated_robot(file)
    if "drive" in robot:
        del rest["pusher"]["drive"]  # its default would be a second drive
    return {"objects": objects, **rest, **({"robot": robot} if robot else {})}


def _stated_robot(file: StatedRoom) -> dict[str, Any]:
    robot = file.robot.model_dump(mode="json", exclude_none=True)
    parts = [part.model_dump(mode="json", exclude_none=True) for part in footprint_parts(file)]
    return robot | ({"footprint": parts} if parts else {})
