"""Find the contacts of a laid-out chain: each object must be pushed by exactly one body before it in the list."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely

from pushplan.geometry.contact_segments import TOUCH, find_touch
from pushplan.mechanics.chain import PLATE, Contact
from pushplan.scenario.arrangement.layout import Layout, Part
from pushplan.scenario.arrangement.meeting import NEARLY, describe_gap, describe_nearness, describe_overlap
from pushplan.scenario.values.interval import Span, lowest
from pushplan.scenario.yaml.report import Report
from pushplan.util.arrays import FloatArray

Segments = dict[tuple[int, int], FloatArray]
"""Contact segments (k, 2, 2) by the indices of the pushing and the pushed body; `PLATE` is the plate."""


def find_segments(parts: Sequence[Part], layout: Layout, report: Report) -> Segments:
    """Return the one segment (2, 2) through which each object is pushed, and report what keeps it from being one."""
    found: Segments = {}
    for i in range(len(parts)):
        touching = _touching(i, parts, layout, report)
        if touching is None:
            continue
        trouble = _trouble(i, touching, parts, layout)
        if trouble is not None:
            report.add(("objects", i), trouble)
            continue
        for j, gap in _nearly_touching(i, layout):
            report.add(("objects", i), describe_nearness(body_name(i, parts), body_name(j, parts), gap))
        ((pusher, segments),) = touching.items()
        found[pusher, i] = segments[0]
    return found


def _nearly_touching(i: int, layout: Layout) -> Iterator[tuple[int, float]]:
    """Yield the earlier bodies that object i does not touch but nearly, and the gap, m."""
    own = shapely.Polygon(layout.outlines[i])
    for j, outline in _near(i, layout, NEARLY):
        gap = float(shapely.distance(own, shapely.Polygon(outline)))
        if TOUCH < gap < NEARLY - TOUCH:
            yield j, gap


def body_name(index: int, parts: Sequence[Part]) -> str:
    """Return what messages call a body."""
    return "the plate" if index == PLATE else f"'{parts[index].name}'"


def _touching(i: int, parts: Sequence[Part], layout: Layout, report: Report) -> dict[int, FloatArray] | None:
    """Return the segments (k, 2, 2) shared with each earlier body that object i touches; None on overlap."""
    touching: dict[int, FloatArray] = {}
    overlaps = False
    for j, outline in _near(i, layout):
        moving = parts[i].name, layout.outlines[i]
        overlap = describe_overlap((body_name(j, parts), outline), moving, layout.poses[i])
        if overlap is not None:
            report.add(("objects", i), overlap)
            overlaps = True
        touch = find_touch(outline, layout.outlines[i])
        if touch is not None:
            touching[j] = touch
    return None if overlaps else touching


def _near(i: int, layout: Layout, reach: float = TOUCH) -> Iterator[tuple[int, FloatArray]]:
    """Yield the earlier bodies whose bounding boxes come nearer to that of object i than `reach`, the plate first."""
    low, high = layout.outlines[i].min(axis=0) - reach, layout.outlines[i].max(axis=0) + reach
    for j, outline in enumerate((layout.plate, *layout.outlines[:i]), start=PLATE):
        if (outline.min(axis=0) <= high).all() and (outline.max(axis=0) >= low).all():
            yield j, outline


def _trouble(i: int, touching: Mapping[int, FloatArray], parts: Sequence[Part], layout: Layout) -> str | None:
    """Return why object i has no single contact, or None."""
    name = f"'{parts[i].name}'"
    if len(touching) > 1:
        bodies = " and ".join(body_name(j, parts) for j in touching)
        return (
            f"{name} touches {bodies}: how a loop of contacts shares its forces cannot be told; "
            f"allowed: one contact with one body before it in the list"
        )
    segments = next(iter(touching.values()), np.empty((0, 2, 2)))
    if len(segments) > 1:
        (j,) = touching
        return f"{name} touches {body_name(j, parts)} along {len(segments)} lines; allowed: one straight line"
    if len(segments) == 0:
        j = _nearest(i, touching, layout)
        outline = layout.plate if j == PLATE else layout.outlines[j]
        return describe_gap(
            (body_name(j, parts), outline), (parts[i].name, layout.outlines[i]), layout.poses[i]
        )
    return None


def _nearest(i: int, touching: Mapping[int, FloatArray], layout: Layout) -> int:
    """Return the earlier body that object i touches at a point, or else the nearest one."""
    if touching:
        return next(iter(touching))
    own = shapely.Polygon(layout.outlines[i])
    bodies = [shapely.Polygon(outline) for outline in (layout.plate, *layout.outlines[:i])]
    return PLATE + int(np.argmin([shapely.distance(own, body) for body in bodies]))


def make_contacts(
    segments: Segments, frictions: Mapping[tuple[int, int], float | Span]
) -> tuple[Contact, ...]:
    """Return the contacts in the order of the objects that they push, with their lowest frictions."""
    pairs = sorted(segments, key=lambda pair: pair[1])
    return tuple(
        Contact(segments[pair][0], segments[pair][1], lowest(frictions[pair]), pushed=pair[1], pusher=pair[0])
        for pair in pairs
    )
