"""Where the plate can push a load from: faces of its objects, and the plate's places on them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.contact_segments import TOUCH, find_touch
from pushplan.geometry.penetration import overlap_depth
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.scenario.parts import Pushes
from pushplan.util.arrays import FloatArray
from pushplan.util.names import FACES

SAME_DIRECTION = math.radians(1.0)
"""Outward normals that differ by less are in the direction that a face is named by."""

_NORMALS = dict(zip(FACES, (math.pi, 0.0, 0.5 * math.pi, -0.5 * math.pi), strict=True))


@dataclass(frozen=True, eq=False)
class Place:
    """A place of the plate on a face.

    Attributes:
        touched: Indices of the objects: one of each stack.
        face: What the face is called: one of `names.FACES` or the angle of its outward normal, in deg; where there
            are several objects, after the names of its own.
        offset: Of the plate's middle from that of the face, to the left of the push, m.
        plate: (3,) pose of the plate's frame in the chain frame of the scenario.
        contact: (3,) pose there of the middle of the contact with the first object touched, +x along the push.
    """

    touched: tuple[int, ...]
    face: str
    offset: float
    plate: FloatArray
    contact: FloatArray


def places(chain: Chain, pushes: Pushes) -> Iterator[Place]:
    """Yield the places that the plate may take, so that it touches one object of each stack along one line.

    Objects that touch one another are a stack. Stacks side by side are held together by the plate alone: driven up to
    along the normal of faces that lie on one line, it touches all of them at once, and pushes all or none.
    """
    plate = chain.pusher.outline - [chain.pusher.outline[:, 0].max(), chain.pusher.outline[:, 1].mean()]
    outlines, found = [obj.outline_chain for obj in chain.objects], stacks(chain)
    for i in found[0]:
        for begin, end in _edges(outlines[i]):
            normal, ends = _outward(begin, end), _abreast(begin, end, outlines, found[1:])
            if ends is None or not _is_asked_for(normal, pushes.faces):
                continue
            heading = float(se2.wrap_angle(normal + math.pi))
            tangent = np.array([-math.sin(heading), math.cos(heading)])
            for offset in pushes.offsets:
                middle = ends.mean(axis=0) + offset * tangent
                pose = np.array([*middle, heading])
                contacts = _contacts(se2.transform_points(pose, plate), found, outlines)
                if i in contacts:
                    face = _named(chain, list(contacts), normal)
                    yield Place(tuple(contacts), face, offset, pose, np.array([*contacts[i], heading]))


def stacks(chain: Chain) -> list[list[int]]:
    """Return the objects' indices by stack: those that touch one another, whether the plate is there or not."""
    left, found = set(range(len(chain.objects))), []
    while left:
        found.append(carried_from(chain, (min(left),)))
        left -= set(found[-1])
    return found


def carried_from(chain: Chain, touched: tuple[int, ...]) -> list[int]:
    """Return the objects' indices in an order in which each one touches one before it, but for those `touched`."""
    neighbours: dict[int, set[int]] = {i: set() for i in range(len(chain.objects))}
    for contact in chain.contacts:
        if contact.pusher != PLATE:
            neighbours[contact.pusher].add(contact.pushed)
            neighbours[contact.pushed].add(contact.pusher)
    order = list(touched)
    for i in order:
        order += sorted(neighbours[i] - set(order))
    return order


def _abreast(
    begin: FloatArray, end: FloatArray, outlines: list[FloatArray], others: list[list[int]]
) -> FloatArray | None:
    """Return the ends (2, 2) of a face together with those of other stacks on its line, None where one has none."""
    along = (end - begin) / np.linalg.norm(end - begin)
    across = np.array([along[1], -along[0]])
    points = [begin, end]
    for stack in others:
        edges = [np.array(edge) for i in stack for edge in _edges(outlines[i])]
        beside = [
            edge
            for edge in edges
            if (np.abs((edge - begin) @ across) < TOUCH).all() and (edge[1] - edge[0]) @ along > 0.0
        ]
        if not beside:
            return None
        points += list(np.concatenate(beside))
    reach = (np.array(points) - begin) @ along
    return np.asarray(begin + np.outer([reach.min(), reach.max()], along))


def _edges(outline: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the ends of the faces of a counter-clockwise outline (v, 2), neighbouring edges on one line as one."""
    edge = np.roll(outline, -1, axis=0) - outline
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    before = np.roll(edge, 1, axis=0)
    # The sine of the angle between neighbouring edges; up to rounding they are one face.
    corner = np.flatnonzero(np.abs(before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0]) > 1e-9)
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


def _named(chain: Chain, touched: list[int], normal: float) -> str:
    owners = " and ".join(chain.objects[i].name for i in touched)
    return f"{owners} {_name(normal)}" if len(chain.objects) > 1 else _name(normal)


def _contacts(plate: FloatArray, found: list[list[int]], outlines: list[FloatArray]) -> dict[int, FloatArray]:
    """Return the middles (2,) of the plate's contacts by object; empty unless it is one line on one of each stack."""
    around = shapely.Polygon(plate)
    # The plate keeps 1 mm from objects that it does not touch.
    near = [i for i, outline in enumerate(outlines) if around.distance(shapely.Polygon(outline)) < 1e-3]
    touched = [[i for i in stack if i in near] for stack in found]
    if any(overlap_depth(plate, outline) > TOUCH for outline in outlines) or any(
        len(t) != 1 for t in touched
    ):
        return {}
    touches = {i: find_touch(plate, outlines[i]) for (i,) in touched}
    if any(touch is None or len(touch) != 1 for touch in touches.values()):
        return {}
    return {i: np.asarray(touch[0].mean(axis=0)) for i, touch in touches.items() if touch is not None}
