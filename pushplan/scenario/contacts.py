"""Finds the contacts of a chain and their friction. Each object is pushed by one earlier body in the list."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely

from pushplan.geometry.polygon import TOUCH, find_touch
from pushplan.mechanics.chain import PLATE, Contact
from pushplan.scenario.bodies import ContactPair
from pushplan.scenario.layout import Layout, Part, describe_gap, describe_overlap, millimetres
from pushplan.scenario.schema import RoomFile
from pushplan.scenario.source import Place, Source
from pushplan.scenario.units import Span, highest, lowest
from pushplan.scenario.validation import unknown_object
from pushplan.util.arrays import BoolArray, FloatArray
from pushplan.util.names import PUSHER

Pair = tuple[int, int]
"""Indices of a pushing and a pushed body; `PLATE` stands for the plate."""

NEARLY = 1e-3
"""Smallest gap that is clearly not a contact, m."""


SIDEWAYS = math.radians(1.0)
"""Sides within this angle of the push direction, rad, need not transmit force: the bodies on both sides do not move
relative to each other, whether they touch or not."""


def find_segments(parts: Sequence[Part], layout: Layout, source: Source) -> dict[Pair, FloatArray]:
    """Return the single contact segment (2, 2) of each object, and report objects without one."""
    found: dict[Pair, FloatArray] = {}
    for i in range(len(parts)):
        touching = _touching(i, parts, layout, source)
        if touching is None:
            continue
        error = _contact_error(i, touching, parts, layout)
        if error is not None:
            source.error(("objects", i), error)
            continue
        for j, gap in _nearly_touching(i, layout):
            source.error(
                ("objects", i),
                f"{_name(i, parts)} and {_name(j, parts)} do not touch, but are only {millimetres(gap)} apart: a "
                f"small error would make them touch; allowed: at least {millimetres(NEARLY)}, or a contact",
            )
        ((pusher, segments),) = touching.items()
        found[pusher, i] = segments[0]
    return found


def _name(index: int, parts: Sequence[Part]) -> str:
    return "the plate" if index == PLATE else f"'{parts[index].name}'"


def _near(i: int, layout: Layout, reach: float) -> Iterator[tuple[int, FloatArray]]:
    """Yield the earlier bodies, plate first, whose bounding boxes are nearer than `reach` to that of object i."""
    low, high = layout.outlines[i].min(axis=0) - reach, layout.outlines[i].max(axis=0) + reach
    for j, outline in enumerate((layout.plate, *layout.outlines[:i]), start=PLATE):
        if (outline.min(axis=0) <= high).all() and (outline.max(axis=0) >= low).all():
            yield j, outline


def _touching(i: int, parts: Sequence[Part], layout: Layout, source: Source) -> dict[int, FloatArray] | None:
    """Return the segments (k, 2, 2) along which object i touches each earlier body; None if they overlap."""
    touching: dict[int, FloatArray] = {}
    overlaps = False
    for j, outline in _near(i, layout, TOUCH):
        overlap = describe_overlap((_name(j, parts), outline), (parts[i].name, layout.outlines[i]))
        if overlap is not None:
            source.error(("objects", i), overlap)
            overlaps = True
        touch = find_touch(outline, layout.outlines[i])
        touch = None if touch is None else touch[~_is_sideways(touch[:, 1] - touch[:, 0])]
        if touch is not None and len(touch):
            touching[j] = touch
    return None if overlaps else touching


def _nearly_touching(i: int, layout: Layout) -> Iterator[tuple[int, float]]:
    """Yield the earlier bodies that object i nearly touches, with the gap, m."""
    own = shapely.Polygon(layout.outlines[i])
    for j, outline in _near(i, layout, NEARLY):
        between = shapely.get_coordinates(shapely.shortest_line(own, shapely.Polygon(outline)))
        across = between[1] - between[0]
        gap = float(np.hypot(*across))
        # The shortest line between two sides is perpendicular to them.
        if TOUCH < gap < NEARLY - TOUCH and not _is_sideways(np.array([across[1], -across[0]])):
            yield j, gap


def _is_sideways(along: FloatArray) -> BoolArray:
    """Return whether edges with directions (..., 2) in the chain frame are parallel to the push."""
    return np.asarray(np.abs(along[..., 1]) <= math.tan(SIDEWAYS) * np.abs(along[..., 0]))


def _contact_error(i: int, touching: Mapping[int, FloatArray], parts: Sequence[Part], layout: Layout) -> str | None:
    """Return the reason why object i has no single contact; None if it has one."""
    name = f"'{parts[i].name}'"
    if len(touching) > 1:
        bodies = " and ".join(_name(j, parts) for j in touching)
        return (
            f"{name} touches {bodies}: the forces in a loop of contacts are indeterminate; "
            f"allowed: one contact with one earlier body in the list"
        )
    segments = next(iter(touching.values()), np.empty((0, 2, 2)))
    if len(segments) > 1:
        (j,) = touching
        return f"{name} touches {_name(j, parts)} along {len(segments)} lines; allowed: one straight line"
    if len(segments) == 1:
        return None
    own = shapely.Polygon(layout.outlines[i])
    bodies_before = [shapely.Polygon(outline) for outline in (layout.plate, *layout.outlines[:i])]
    nearest_one = PLATE + int(np.argmin([shapely.distance(own, body) for body in bodies_before]))
    j = next(iter(touching), nearest_one)
    outline = layout.plate if j == PLATE else layout.outlines[j]
    return describe_gap((_name(j, parts), outline), (parts[i].name, layout.outlines[i]))


def make_contacts(
    file: RoomFile, segments: Mapping[Pair, FloatArray], source: Source
) -> tuple[tuple[Contact, ...], FloatArray]:
    """Return the contacts through segments (2, 2), with the lowest friction, and all friction intervals (n, 2).

    Missing friction and contacts above an object are reported.
    """
    names = [obj.name for obj in file.objects]
    between, stated = file.contacts.between, _stated(file, names, source)
    contacts: list[Contact] = []
    ends: list[Span] = []
    touching = set()
    for pair, (right, left) in segments.items():
        key = frozenset(PUSHER if i == PLATE else names[i] for i in pair)
        touching.add(key)
        i = stated.get(key, -1)
        entry = ContactPair.model_construct() if i < 0 else between[i]
        friction = file.pusher.friction if PLATE in pair else file.contacts.friction
        friction = friction if entry.friction is None else entry.friction
        if friction is None:
            first, second = (names[k] for k in pair)
            what = f"is missing, and '{first}' and '{second}' touch; needed: a friction coefficient"
            source.error(("contacts", "friction"), what)
        else:
            span = None if entry.height is None else (lowest(entry.height), highest(entry.height))
            ends.append((lowest(friction), highest(friction)))
            contacts.append(Contact(right, left, ends[-1][0], pushed=pair[1], pusher=pair[0], height=span))
        height = file.pusher.contact_height if entry.height is None else entry.height
        for obj in (file.objects[k] for k in pair if k != PLATE):
            if obj.height is not None and highest(height) > obj.height:
                place: Place = ("contacts", "between", i, "height")
                place = ("pusher", "contact_height") if entry.height is None else place
                reach, top = millimetres(highest(height)), millimetres(obj.height)
                source.error(place, f"reaches {reach}, but '{obj.name}' is {top} high; allowed: up to {top}")
    if len(contacts) == len(names):
        for key, i in stated.items():
            if key not in touching and between[i].friction is not None:
                first, second = between[i].objects
                what = f"'{first}' and '{second}' do not touch; leave it out"
                source.error(("contacts", "between", i, "objects"), what)
    return tuple(contacts), np.array(ends).reshape(-1, 2)


def _stated(file: RoomFile, names: Sequence[str], source: Source) -> dict[frozenset[str], int]:
    """Return the index in `contacts.between` of each pair, and report entries that do not name a pair."""
    stated: dict[frozenset[str], int] = {}
    known = [*names, PUSHER]
    for i, entry in enumerate(file.contacts.between):
        place = ("contacts", "between", i, "objects")
        unknown = [(k, name) for k, name in enumerate(entry.objects) if name not in known]
        for k, name in unknown:
            source.error((*place, k), unknown_object(name, known))
        pair = frozenset(entry.objects)
        if len(pair) == 1 and not unknown:
            source.error(place, "names one object twice; allowed: two objects that touch")
        elif pair in stated:
            source.error(place, "this pair already has an entry; keep one")
        elif not unknown:
            stated[pair] = i
    return stated
