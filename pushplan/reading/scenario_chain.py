"""From the objects, contacts and pusher of a scenario file to the chain, checked for geometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.geometry.polygon import simple_polygon
from pushplan.mechanics.chain import Chain, Drive, Limits, PushedObject, Pusher
from pushplan.mechanics.interval_chain import IntervalChain
from pushplan.names import RESERVED_NAMES
from pushplan.reading.chain_contacts import find_segments, make_contacts
from pushplan.reading.contact_friction import contact_frictions
from pushplan.reading.interval import highest, lowest, middle
from pushplan.reading.layout import Layout, Part, lay_out
from pushplan.reading.report import Report
from pushplan.reading.scenario_intervals import make_interval_chain, stated_floor_friction
from pushplan.reading.scenario_schema import Obstacle, ScenarioFile, Snap
from pushplan.reading.scenario_supports import ReadFile, make_support
from pushplan.reading.schema_objects import Plate, Shape, WheeledDrive
from pushplan.reading.snapping import SnapTolerance
from pushplan.reading.stacking import box_outline
from pushplan.reading.uncertainty import widened
from pushplan.scenario_parts import Snapping


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


def build_bodies(file: ScenarioFile, read: ReadFile, report: Report) -> Bodies | None:
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
    chain = Chain(objects, make_contacts(segments, frictions), _pusher(file.pusher, layout.plate))
    interval = make_interval_chain(stated, chain, report)
    if report.findings:
        return None
    spans = [frictions[contact.pusher, contact.pushed] for contact in chain.contacts]
    ends = np.array([[lowest(span), highest(span)] for span in spans])
    return Bodies(chain, interval, ends, _stated(stated, layout), layout.snapping)


def outline_of(stated: Shape | Obstacle) -> FloatArray:
    """Return the counter-clockwise outline (v, 2) of a box or polygon in its own frame, m."""
    return box_outline(*stated.box) if stated.box else simple_polygon(stated.polygon or (), "outline")


def _check_names(file: ScenarioFile, report: Report) -> None:
    names = [obj.name for obj in file.objects]
    for i, name in enumerate(names):
        if name in names[:i]:
            report.add(
                ("objects", i, "name"), f"objects[{names.index(name)}] is called '{name}' too; names differ"
            )
        if name.lower() in RESERVED_NAMES:
            what = f"'{name}' is reserved; allowed: any name but {', '.join(RESERVED_NAMES)}"
            report.add(("objects", i, "name"), what)


def _part(i: int, file: ScenarioFile) -> Part:
    obj = file.objects[i]
    pose = None if obj.pose is None else np.array(obj.pose)
    return Part(obj.name, outline_of(obj.shape), obj.offset, pose)


def _snap_tolerance(file: ScenarioFile) -> SnapTolerance | None:
    stated = file.snap
    if isinstance(stated, float):
        stated = Snap(position=stated)
    return None if stated is None else SnapTolerance(stated.position, stated.angle)


def _pusher(plate: Plate, outline: FloatArray) -> Pusher:
    limits = Limits(**plate.limits.model_dump())
    return Pusher(outline, lowest(plate.friction), plate.contact_height, _drive(plate), limits)


def _drive(plate: Plate) -> Drive:
    drive = plate.drive
    if not isinstance(drive, WheeledDrive):
        return Drive()
    if drive.car is not None:
        return Drive("car", np.array(drive.car.axle), drive.car.min_radius)
    assert drive.differential is not None
    return Drive("differential", np.array(drive.differential.axle))


def _stated(file: ScenarioFile, layout: Layout) -> dict[str, Any]:
    objects = []
    for i, obj in enumerate(file.objects):
        stated = obj.model_dump(mode="json", exclude_none=True)
        stated |= {"floor_friction": stated_floor_friction(obj, file), "pose": layout.poses[i].tolist()}
        if i > 0:
            stated.pop("offset", None)
        elif obj.pose is None or obj.offset is None:
            stated["offset"] = float(layout.poses[0, 1] - layout.plate[:, 1].mean())
        objects.append(stated)
    sections = {"contacts": file.contacts, "pusher": file.pusher}
    rest = {name: part.model_dump(mode="json", exclude_none=True) for name, part in sections.items()}
    return {"objects": objects, **rest}
