"""Where the plate can push a load from: faces of its objects, and the plate's places on them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from pushplan.basics.arrays import FloatArray
from pushplan.basics.names import FACES
from pushplan.geometry import se2
from pushplan.geometry.contact_segments import TOUCH, find_touch
from pushplan.geometry.penetration import overlap_depth
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.scenario_parts import Pushes

SAME_DIRECTION = math.radians(1.0)
"""Outward normals that differ by less are in the direction that a face is named by."""

STRAIGHT = 1e-9
"""Sine of the angle between neighbouring edges below which they are one face."""

_NORMALS = dict(zip(FACES, (math.pi, 0.0, 0.5 * math.pi, -0.5 * math.pi), strict=True))


@dataclass(frozen=True, eq=False)
class Place:
    """A place of the plate on a face.

    Attributes:
        touched: Index of the object.
        face: What the face is called: one of `names.FACES` or the angle of its outward normal, in deg; where there
            are several objects, after the name of its own.
        offset: Of the plate's middle from that of the face, to the left of the push, m.
        plate: (3,) pose of the plate's frame in the chain frame of the scenario.
        contact: (3,) pose there of the contact's middle, +x along the push.
    """

    touched: int
    face: str
    offset: float
    plate: FloatArray
    contact: FloatArray


def places(chain: Chain, pushes: Pushes) -> Iterator[Place]:
    """Yield the places that the plate may take, so that it touches one object along one line and overlaps none."""
    plate = chain.pusher.outline - [chain.pusher.outline[:, 0].max(), chain.pusher.outline[:, 1].mean()]
    outlines = [obj.outline_chain for obj in chain.objects]
    for i, outline in enumerate(outlines):
        owner = f"{chain.objects[i].name} " if len(outlines) > 1 else ""
        for begin, end in _edges(outline):
            normal = _outward(begin, end)
            if not _is_asked_for(normal, pushes.faces):
                continue
            heading = float(se2.wrap_angle(normal + math.pi))
            tangent = np.array([-math.sin(heading), math.cos(heading)])
            for offset in pushes.offsets:
                middle = 0.5 * (begin + end) + offset * tangent
                pose = np.array([*middle, heading])
                contact = _contact(se2.transform_points(pose, plate), i, outlines)
                if contact is not None:
                    yield Place(i, f"{owner}{_name(normal)}", offset, pose, np.array([*contact, heading]))


def carried_from(chain: Chain, touched: int) -> list[int]:
    """Return the objects' indices in an order in which each one touches one before it, beginning with `touched`."""
    neighbours: dict[int, set[int]] = {i: set() for i in range(len(chain.objects))}
    for contact in chain.contacts:
        if contact.pusher != PLATE:
            neighbours[contact.pusher].add(contact.pushed)
            neighbours[contact.pushed].add(contact.pusher)
    order = [touched]
    for i in order:
        order += sorted(neighbours[i] - set(order))
    return order


def _edges(outline: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the ends of the faces of a counter-clockwise outline (v, 2), neighbouring edges on one line as one."""
    edge = np.roll(outline, -1, axis=0) - outline
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    before = np.roll(edge, 1, axis=0)
    corner = np.flatnonzero(np.abs(before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0]) > STRAIGHT)
    for begin, end in zip(corner, np.roll(corner, -1), strict=True):
        yield outline[begin], outline[end]


def _outward(begin: FloatArray, end: FloatArray) -> float:
    """Angle of the outward normal of an edge of a counter-clockwise outline."""
    x, y = end - begin
    return math.atan2(-x, y)


def _is_asked_for(normal: float, faces: tuple[str | float, ...] | None) -> bool:
    if faces is None:
        return True
    wanted = [_NORMALS[face] if isinstance(face, str) else face for face in faces]
    return any(abs(float(se2.wrap_angle(normal - angle))) < SAME_DIRECTION for angle in wanted)


def _name(normal: float) -> str:
    for name, angle in _NORMALS.items():
        if abs(float(se2.wrap_angle(normal - angle))) < SAME_DIRECTION:
            return name
    return f"{math.degrees(normal):.3g} deg"


def _contact(plate: FloatArray, touched: int, outlines: list[FloatArray]) -> FloatArray | None:
    """Return the middle (2,) of the plate's contact, None where it is not one line on that object alone."""
    around = shapely.Polygon(plate)
    for i, outline in enumerate(outlines):
        if overlap_depth(plate, outline) > TOUCH:
            return None
        if i != touched and around.distance(shapely.Polygon(outline)) < 1e-3:
            return None
    touch = find_touch(plate, outlines[touched])
    if touch is None or len(touch.segments) != 1:
        return None
    return np.asarray(touch.segments[0].mean(axis=0))
