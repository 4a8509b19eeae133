"""What a scenario file may say but hardly means: millimetres or degrees written as plain numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import pi
from typing import TypeGuard

from pushplan.errors import Finding
from pushplan.scenario.yaml.node import Document, Place
from pushplan.scenario.yaml.report import Report

LONGEST = 20.0
"""Side, or distance of an axle, up to which a plain number is taken for metres without a question, m."""

FASTEST = 5.0
"""Speed up to which a plain number is taken for m/s without a question."""

_SHAPES = (("objects", "*", "shape"), ("robot", "footprint"), ("robot", "footprint", "*"))
_AXLES = tuple(
    (part, "drive", kind, "axle") for part in ("robot", "pusher") for kind in ("differential", "car")
)

_POSES = (
    ("start",),
    ("goal", "pose"),
    ("robot", "start"),
    ("robot", "base"),
    ("objects", "*", "pose"),
    ("obstacles", "*", "pose"),
)
"""Where poses stand; `*` is any member of a list."""


def questions(document: Document) -> tuple[Finding, ...]:
    """Return what is to be asked, most consequential first; text with a unit is never asked about."""
    report = Report(document)
    stated = document.root.plain()
    length = next(_in_millimetres(stated), None)
    if length is not None:
        report.add(*length)
    for place, angle in _angles(stated):
        if abs(angle) > pi + 0.01:
            report.add(place, f'is {angle:g}: degrees? plain numbers are rad; write "{angle:g} deg" if so')
    for place, speed in _at(stated, ("pusher", "limits", "speed")):
        if _is_number(speed) and speed > FASTEST:
            report.add(place, f'is {speed:g} m/s: mm/s? write "{speed:g} mm/s" if so')
    for place, axle in _axles(stated):
        if 0.0 < axle <= LONGEST:
            report.add(place, f"is {axle:g} m ahead of the plate, where the load is: behind it is below 0")
    return report.findings


def length_question(document: Document) -> Finding | None:
    """Return the question for millimetres alone; what is wrong beside it mostly follows from it."""
    length = next(_in_millimetres(document.root.plain()), None)
    if length is None:
        return None
    report = Report(document)
    report.add(*length)
    return report.findings[0]


def _in_millimetres(stated: object) -> Iterator[tuple[Place, str]]:
    for place, shape in (found for pattern in _SHAPES for found in _at(stated, pattern)):
        for kind in ("box", "polygon"):
            numbers = _numbers(shape.get(kind)) if isinstance(shape, Mapping) else []
            least = min(numbers, default=0.0) if kind == "polygon" else 0.0
            side = max(numbers, default=0.0) - least
            if side > LONGEST:
                yield (
                    (*place, kind),
                    f'is {side:g} m long: mm? plain numbers are m; write "{side:g} mm" if so, everywhere',
                )
    for place, axle in _axles(stated):
        if abs(axle) > LONGEST:
            yield (
                place,
                f'is {axle:g} m from the plate: mm? plain numbers are m; write "{axle:g} mm" if so, everywhere',
            )


def _axles(stated: object) -> Iterator[tuple[Place, float]]:
    """Yield where along the push each axle is, as a plain number."""
    for pattern in _AXLES:
        for place, pose in _at(stated, pattern):
            if isinstance(pose, Sequence) and pose and _is_number(pose[0]):
                yield (*place, 0), pose[0]


def _angles(stated: object) -> Iterator[tuple[Place, float]]:
    for pattern in _POSES:
        for place, pose in _at(stated, pattern):
            if isinstance(pose, Sequence) and len(pose) == 3 and _is_number(pose[2]):
                yield (*place, 2), pose[2]


def _at(stated: object, pattern: Sequence[str], place: Place = ()) -> Iterator[tuple[Place, object]]:
    """Yield all that stands at a place of a document, with the place."""
    if not pattern:
        yield place, stated
        return
    first, *rest = pattern
    if first == "*" and isinstance(stated, list):
        for i, member in enumerate(stated):
            yield from _at(member, rest, (*place, i))
    elif isinstance(stated, Mapping) and first in stated:
        yield from _at(stated[first], rest, (*place, first))


def _numbers(stated: object) -> list[float]:
    if isinstance(stated, list):
        return [number for member in stated for number in _numbers(member)]
    return [float(stated)] if _is_number(stated) else []


def _is_number(stated: object) -> TypeGuard[float]:
    return isinstance(stated, int | float) and not isinstance(stated, bool)
