"""Builds the chain from the objects, contacts, pusher and robot of a scenario file, and checks its geometry."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
import shapely

from pushplan.errors import PushplanError, SupportError
from pushplan.geometry import se2
from pushplan.geometry.polygon import SHORTEST_CONTACT, TOUCH, area_moments, find_touch
from pushplan.mechanics.chain import Chain, Drive, Limits, PushedObject, Pusher
from pushplan.mechanics.intervals import IntervalChain, fractions_within
from pushplan.mechanics.support import (
    FRACTION_TOLERANCE,
    FeetSupport,
    PressureMapSupport,
    Support,
    UniformSupport,
    UnknownSupport,
)
from pushplan.scenario import bodies, schema
from pushplan.scenario.contacts import find_segments, make_contacts
from pushplan.scenario.layout import Layout, Part, describe_overlap, lay_out, outline_of
from pushplan.scenario.loads import Bodies
from pushplan.scenario.schema import RoomFile
from pushplan.scenario.source import Source
from pushplan.scenario.units import Span, lowest, middle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import RESERVED_NAMES, ROBOT

ReadFile = Callable[[str], bytes]
"""Function that returns the bytes of a file by its name in the scenario; raises SupportError if it cannot."""

File = TypeVar("File", bound=RoomFile)


MOST_UNCERTAIN = 16
"""Largest number of objects in a chain with intervals: planning takes 4 s for 10 objects and 20 s for 20."""


def build_bodies(stated: RoomFile, read: ReadFile, source: Source) -> Bodies | None:
    """Return the chain of a scenario file, or report its errors and return None."""
    file = widened(stated)
    _check_names(file, source)
    _check_fractions(stated, source)
    parts = [
        Part(obj.name, outline_of(obj.shape), obj.offset, None if obj.pose is None else np.array(obj.pose))
        for obj in file.objects
    ]
    supports = [
        _support(obj, part.outline, i, read, source)
        for i, (obj, part) in enumerate(zip(file.objects, parts, strict=True))
    ]
    snap = schema.Snap(position=file.snap) if isinstance(file.snap, float) else file.snap
    layout = lay_out(parts, file.pusher.width, file.pusher.thickness, source, snap)
    if layout is None:
        return None
    segments = find_segments(parts, layout, source)
    contacts, ends = make_contacts(file, segments, source)
    pusher = _pusher(file, parts, layout, source)
    if source.findings:
        return None
    floors = [floor_friction(obj, file) for obj in file.objects]
    objects = []
    for obj, part, support, floor, pose in zip(file.objects, parts, supports, floors, layout.poses, strict=True):
        assert support is not None
        center = None if obj.height is None else 0.5 * obj.height  # default height of the centre of mass
        if obj.center_of_mass is not None and len(obj.center_of_mass) == 3:
            center = obj.center_of_mass[2]
        objects.append(PushedObject(obj.name, part.outline, middle(obj.mass), middle(floor), support, pose, center))
    chain = Chain(tuple(objects), contacts, pusher)
    interval = _interval_chain(file, chain)
    if interval is not None and len(objects) > MOST_UNCERTAIN:
        source.error(
            ("objects",),
            f"are {len(objects)}; allowed: {MOST_UNCERTAIN} with intervals or an uncertainty, because the stable set "
            "of all values takes minutes to compute for more; use plain numbers",
        )
        return None
    return Bodies(
        chain=chain,
        interval=interval,
        contact_friction=ends,
        stated=_resolved(stated, layout),
        snapping=layout.snapping,
    )


def check_differ(names: Sequence[str], source: Source) -> None:
    """Report objects with the same name as another one."""
    for i, name in enumerate(names):
        if name in names[:i]:
            what = f"objects[{names.index(name)}] is called '{name}' too; allowed: each name once"
            source.error(("objects", i, "name"), what)


def _check_names(file: RoomFile, source: Source) -> None:
    names = [obj.name for obj in file.objects]
    check_differ(names, source)
    reserved = (*RESERVED_NAMES, *((ROBOT,) if file.robot.footprint else ()))
    for i, name in enumerate(names):
        if name.lower() in reserved:
            what = f"'{name}' is reserved; allowed: any name but {', '.join(reserved)}"
            source.error(("objects", i, "name"), what)


def floor_friction(obj: bodies.Object, file: RoomFile) -> float | Span:
    """Return the friction between an object and the floor."""
    return file.floor.friction if obj.floor_friction is None else obj.floor_friction


# --- uncertain numbers ---


def widened(file: File) -> File:
    """Return a file with the intervals of its `uncertainty`; explicit intervals are kept.

    A share s turns a value v into the interval [(1 - s) v, (1 + s) v]. For an object without feet, `load` is the
    uncertainty of the pressure at every point, which is not applied here.
    """
    share = file.uncertainty
    floor = file.floor.model_copy(update={"friction": around(file.floor.friction, share.floor_friction)})
    pusher = {"friction": around(file.pusher.friction, share.contact_friction)}
    between = tuple(
        pair
        if pair.friction is None
        else pair.model_copy(update={"friction": around(pair.friction, share.contact_friction)})
        for pair in file.contacts.between
    )
    friction = file.contacts.friction
    friction = None if friction is None else around(friction, share.contact_friction)
    return file.model_copy(
        update={
            "floor": floor,
            "objects": tuple(_widened(obj, share) for obj in file.objects),
            "contacts": file.contacts.model_copy(update={"friction": friction, "between": between}),
            "pusher": file.pusher.model_copy(update=pusher),
        }
    )


def _widened(obj: bodies.Object, share: schema.Uncertainty) -> bodies.Object:
    update = dict[str, Any]()
    if obj.floor_friction is not None:
        update["floor_friction"] = around(obj.floor_friction, share.floor_friction)
    if isinstance(obj.support, bodies.Feet):
        feet = tuple((*foot[:2], *(around(f, share.load, 1.0) for f in foot[2:])) for foot in obj.support.feet)
        update["support"] = obj.support.model_copy(update={"feet": feet})
    return obj.model_copy(update=update)


def around(value: float | Span, share: float, most: float = float("inf")) -> float | Span:
    """Return the interval around a number, limited to `most`; return an interval or an exact number unchanged."""
    if isinstance(value, tuple) or share == 0.0:
        return value
    return (1.0 - share) * value, min((1.0 + share) * value, most)


def _interval_chain(file: RoomFile, chain: Chain) -> IntervalChain | None:
    """Return the chain with the intervals of a widened file; None if loads and floor frictions are plain numbers.

    Intervals of contact friction are ignored, because the chain holds their lowest values, which are the worst case.
    """
    masses = {obj.name: obj.mass for obj in file.objects if isinstance(obj.mass, tuple)}
    floors = {obj.name: floor_friction(obj, file) for obj in file.objects}
    frictions = {name: value for name, value in floors.items() if isinstance(value, tuple)}
    fractions = {obj.name: spans for obj in file.objects if (spans := _foot_spans(obj.support)) is not None}
    share = file.uncertainty.load
    known = [
        obj.name for obj in file.objects if not isinstance(obj.support, bodies.Feet) and obj.support != "unknown"
    ]
    pressures = dict.fromkeys(known, share) if share > 0.0 else {}
    if not (masses or frictions or fractions or pressures):
        return None
    return IntervalChain.from_ranges(chain, masses, frictions, None, fractions, pressures)


def _foot_spans(support: object) -> list[Span] | None:
    """Return the interval of every foot's load fraction; None if all are plain numbers."""
    if not isinstance(support, bodies.Feet):
        return None
    loads = [foot[2] for foot in support.feet if len(foot) == 3]
    if not any(isinstance(load, tuple) for load in loads):
        return None
    return [load if isinstance(load, tuple) else (load, load) for load in loads]


# --- supports ---


def _support(
    stated: bodies.Object, outline: FloatArray, index: int, read: ReadFile, source: Source
) -> Support | None:
    """Return the support of object `index` with the counter-clockwise `outline` (v, 2), or report its error."""
    center = None if stated.center_of_mass is None else np.array(stated.center_of_mass[:2])
    try:
        if isinstance(stated.support, str):
            return (UniformSupport if stated.support == "uniform" else UnknownSupport)(outline, center)
        return _placed_support(stated.support, outline, center, read)
    except PushplanError as error:
        about_center = "center_of_mass" in str(error) and center is not None
        source.error(("objects", index, "center_of_mass" if about_center else "support"), str(error))
        return None


def _check_fractions(stated: RoomFile, source: Source) -> None:
    """Report nominal load fractions that do not sum to 1; this is not visible after `uncertainty` widens them."""
    for i, obj in enumerate(stated.objects):
        loads = (
            [load for foot in obj.support.feet for load in foot[2:]] if isinstance(obj.support, bodies.Feet) else []
        )
        numbers = [load for load in loads if isinstance(load, float)]
        if numbers and len(numbers) == len(loads) and abs(sum(numbers) - 1.0) > FRACTION_TOLERANCE:
            source.error(("objects", i, "support"), f"load fractions sum to {sum(numbers):.9g}; they must sum to 1")


def _placed_support(
    support: bodies.Feet | bodies.PressureMap, outline: FloatArray, center: FloatArray | None, read: ReadFile
) -> Support:
    """Return feet or a pressure map; the default centre of mass of feet without loads is the outline's centroid."""
    bare = isinstance(support, bodies.Feet) and len(support.feet[0]) == 2
    if center is not None and not bare:
        raise SupportError("center_of_mass follows from the given loads; leave it out")
    if isinstance(support, bodies.PressureMap):
        return PressureMapSupport.from_bytes(read(support.pressure_map), support.pressure_map)
    positions = np.array([foot[:2] for foot in support.feet], dtype=np.float64)
    if bare:
        return FeetSupport(positions, None, area_moments(outline).centroid if center is None else center)
    spans = _foot_spans(support)
    if spans is not None:
        return FeetSupport(positions, fractions_within(np.array(spans)))
    return FeetSupport(positions, np.array([foot[2:] for foot in support.feet], dtype=np.float64)[:, 0])


# --- plate and robot ---


def _pusher(file: RoomFile, parts: Sequence[Part], layout: Layout, source: Source) -> Pusher:
    plate, robot, frame = file.pusher, file.robot, layout.plate_pose
    if robot.drive is not None and "drive" in plate.model_fields_set:
        source.error(("robot", "drive"), "is also given as pusher.drive; keep one of them", at_key=True)
    return Pusher(
        layout.plate,
        lowest(plate.friction),
        plate.contact_height,
        _drive(plate.drive, np.zeros(3)) if robot.drive is None else _drive(robot.drive, frame),
        Limits(**plate.limits.model_dump(), **({} if robot.limits is None else robot.limits.model_dump())),
        _footprint(file, parts, layout, source),
        None if robot.base is None else se2.compose(frame, np.array(robot.base)),
    )


def _drive(stated: bodies.Drive, frame: FloatArray) -> Drive:
    """Return a drive whose axle is given in a frame at a pose (3,) in the chain frame."""
    match stated:
        case bodies.Car(car=car):
            return Drive("car", se2.compose(frame, np.array(car.axle)), car.min_radius)
        case bodies.Differential(differential=wheels):
            return Drive("differential", se2.compose(frame, np.array(wheels.axle)))
    return Drive()


def _footprint(file: RoomFile, parts: Sequence[Part], layout: Layout, source: Source) -> tuple[FloatArray, ...]:
    """Return the outlines (v, 2) of the robot's parts in the chain frame, and report parts that meet objects."""
    stated = file.robot.footprint or ()
    several = isinstance(stated, tuple)
    outlines = []
    for i, part in enumerate(stated if isinstance(stated, tuple) else (stated,)):
        pose = se2.compose(layout.plate_pose, np.array(part.pose))
        outlines.append(se2.transform_points(pose, outline_of(part)))
        for error in _footprint_errors(outlines[-1], parts, layout):
            source.error(("robot", "footprint", i) if several else ("robot", "footprint"), error)
    return tuple(outlines)


def _footprint_errors(outline: FloatArray, parts: Sequence[Part], layout: Layout) -> Iterator[str]:
    """Yield a sentence for every object that a part of the robot meets."""
    plate = shapely.Polygon(layout.plate).buffer(TOUCH, join_style="mitre")
    for part, object_outline in zip(parts, layout.outlines, strict=True):
        overlap = describe_overlap((f"'{part.name}'", object_outline), (ROBOT, outline))
        if overlap is not None:
            yield overlap
            continue
        touch = find_touch(outline, object_outline)
        segments = [] if touch is None else list(touch)
        # A touch along the plate's contact is a push by the plate; any other touch is a push by the robot.
        if any(shapely.difference(shapely.LineString(s), plate).length > SHORTEST_CONTACT for s in segments):
            yield f"'{ROBOT}' touches '{part.name}' beside the plate; only the plate may push: move it back"


# --- plain data ---


def _resolved(file: RoomFile, layout: Layout) -> dict[str, Any]:
    """Return objects, contacts, pusher and robot as plain data, with poses and defaults filled in."""
    parts = {"objects", "contacts", "pusher", "robot"}
    resolved = file.model_dump(mode="json", exclude_none=True, include=parts)
    for i, (obj, stated) in enumerate(zip(file.objects, resolved["objects"], strict=True)):
        stated |= {"floor_friction": floor_friction(obj, file), "pose": layout.poses[i].tolist()}
        if i > 0:
            stated.pop("offset", None)
        elif obj.pose is None or obj.offset is None:
            stated["offset"] = float(layout.poses[0, 1] - layout.plate_pose[1])
    robot = resolved["robot"]
    if isinstance(robot.get("footprint"), dict):
        robot["footprint"] = [robot["footprint"]]
    if "drive" in robot:
        del resolved["pusher"]["drive"]  # its default would be a second drive
    if not robot:
        del resolved["robot"]
    return resolved
