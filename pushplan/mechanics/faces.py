"""Faces of the objects that the plate can push, and the chain for each of them.

Objects that touch each other form a stack. Stacks side by side touch only the plate. If their faces are on one line,
the plate approaches along the normal, touches all stacks at once, and pushes all or none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import shapely

from pushplan.errors import ChainError
from pushplan.geometry import se2
from pushplan.geometry.polygon import SHORTEST_CONTACT, TOUCH, find_touch, overlap_depth
from pushplan.mechanics.chain import PLATE, Chain, Contact, Drive, PushedObject, Pusher
from pushplan.util.arrays import FloatArray
from pushplan.util.names import FACES

SAME_DIRECTION = math.radians(1.0)
"""Largest angle between an outward normal and the direction of a face's name, rad."""

PARALLEL = 1e-6
"""Largest deviation of opposite faces from parallel, rad; with a larger one, no flush row is possible."""

_NORMALS = dict(zip(FACES, (math.pi, 0.0, 0.5 * math.pi, -0.5 * math.pi), strict=True))


@dataclass(frozen=True, eq=False)
class Place:
    """A position of the plate at a face.

    Attributes:
        touched: Indices of the touched objects, one of each stack.
        face: Name of the face: one of `names.FACES` or the angle of its outward normal in deg; for several objects,
            the names of the touched ones come first.
        offset: Offset of the plate's middle from the middle of the face, to the left of the push, m.
        plate: Pose (3,) of the plate's frame in the chain frame of the scenario.
        contact: Pose (3,) of the middle of the contact with the first touched object in this chain frame, +x along
            the push.
    """

    touched: tuple[int, ...]
    face: str
    offset: float
    plate: FloatArray
    contact: FloatArray


def places(
    chain: Chain, faces: Sequence[str | float] | None = None, offsets: Sequence[float] = (0.0,)
) -> Iterator[Place]:
    """Yield the allowed positions of the plate, in which it touches one object of each stack along one line.

    Args:
        chain: Chain with the objects; its current plate position is ignored.
        faces: Names in `names.FACES` and angles of outward normals in the chain frame, rad; None for all.
        offsets: Offsets of the plate's middle from the middle of the face, to the left of the push, m.
    """
    plate = chain.pusher.outline - [chain.pusher.outline[:, 0].max(), chain.pusher.outline[:, 1].mean()]
    outlines, found = [obj.outline_chain for obj in chain.objects], stacks(chain)
    for i in found[0]:
        for begin, end in _edges(outlines[i]):
            normal, ends = _outward(begin, end), _abreast(begin, end, outlines, found[1:])
            if ends is None or not _is_asked_for(normal, faces):
                continue
            heading = float(se2.wrap_angle(normal + math.pi))
            tangent = np.array([-math.sin(heading), math.cos(heading)])
            for offset in offsets:
                middle = ends.mean(axis=0) + offset * tangent
                pose = np.array([*middle, heading])
                contacts = _contacts(se2.transform_points(pose, plate), found, outlines)
                if i in contacts:
                    face = _named(chain, list(contacts), normal)
                    yield Place(tuple(contacts), face, offset, pose, np.array([*contacts[i], heading]))


@dataclass(frozen=True, eq=False)
class FacePair:
    """A face at which an object is pushed, and the opposite face, which pushes the next object.

    Attributes:
        face: Name of the pushed face in the object's own frame.
        entry: Pose (3,) of the pushed face's middle in the object's frame, +x into the object.
        length: Length of the pushed face, m.
        exit: Pose (3,) of the opposite face's middle in the object's frame, +x out of the object; None if there is no
            such face.
    """

    face: str
    entry: FloatArray
    length: float
    exit: FloatArray | None

    @property
    def across(self) -> FloatArray | None:
        """Pose (3,) of `exit` in the frame `entry`; None without an exit."""
        return None if self.exit is None else se2.relative(self.entry, self.exit)


def face_pairs(outline: FloatArray, faces: Sequence[str | float] | None = None) -> tuple[FacePair, ...]:
    """Return the faces at which an object can be pushed, with their opposite faces.

    Args:
        outline: Outline (v, 2) in the object's own frame, counter-clockwise, m.
        faces: See `places`.
    """
    wanted = None if faces is None else tuple(faces)
    return _face_pairs(np.asarray(outline, dtype=np.float64).tobytes(), wanted)


@lru_cache(maxsize=256)
def _face_pairs(corners: bytes, faces: tuple[str | float, ...] | None) -> tuple[FacePair, ...]:
    return tuple(_each_face_pair(np.frombuffer(corners).reshape(-1, 2), faces))


def _each_face_pair(outline: FloatArray, faces: tuple[str | float, ...] | None) -> Iterator[FacePair]:
    edges = list(_edges(outline))
    for begin, end in edges:
        normal = _outward(begin, end)
        if not _is_asked_for(normal, faces):
            continue
        heading = float(se2.wrap_angle(normal + math.pi))
        entry = np.array([*0.5 * (begin + end), heading])
        ahead = np.array([math.cos(heading), math.sin(heading)])
        opposite = [
            0.5 * (b + e) for b, e in edges if abs(float(se2.wrap_angle(_outward(b, e) - heading))) < PARALLEL
        ]
        front = max(opposite, key=lambda middle: float(middle @ ahead), default=None)
        yield FacePair(
            face_name(normal),
            entry,
            float(np.linalg.norm(end - begin)),
            None if front is None else np.array([*front, heading]),
        )


def pushed_at(chain: Chain, face: str | float, offset: float = 0.0) -> Chain:
    """Return the chain that is pushed at another face.

    Args:
        chain: Objects, plate and robot.
        face: Name of the form `Place.face`, one of `names.FACES`, or the angle of the outward normal in the chain
            frame, rad.
        offset: Offset of the plate's middle from the middle of the face, to the left of the push, m.

    Raises:
        ChainError: If there is no such face or more than one, or for the reasons in `pushed_from`.
    """
    found = [
        place
        for place in places(chain, None, (offset,))
        if face == place.face
        or (
            (not isinstance(face, str) or face in _NORMALS)
            and _is_asked_for(float(place.contact[2]) + math.pi, (face,))
        )
    ]
    if len(found) != 1:
        allowed = ", ".join(dict.fromkeys(place.face for place in places(chain, None, (offset,))))
        what = f"{len(found)} faces are called {face!r}" if found else f"no face is called {face!r}"
        raise ChainError(f"{what}; allowed with the offset {offset:.6g} m: {allowed}")
    return pushed_from(chain, found[0])


def pushed_from(chain: Chain, place: Place) -> Chain:
    """Return the chain with the plate at another position; the chain frame is that of the new contact.

    The objects keep their poses, and are ordered so that each is pushed by the plate or an earlier object. Contacts
    between objects keep friction and height in both directions. The same holds for an object that the plate already
    touches; for other objects, the plate's own friction and height are used.

    Raises:
        ChainError: If the robot's footprint overlaps an object, or touches one beside the plate.
    """
    order = carried_from(chain, place.touched)
    into = se2.inverse(place.contact)
    objects = tuple(
        replace(chain.objects[i], pose_chain=se2.compose(into, chain.objects[i].pose_chain)) for i in order
    )
    pusher = pusher_at(chain.pusher, float(se2.compose(into, place.plate)[1]))
    contacts = tuple(_contact(chain, order, objects, pusher, k) for k in range(len(order)))
    _require_clear(pusher, objects)
    return Chain(objects, contacts, pusher)


def pusher_at(pusher: Pusher, sideways: float) -> Pusher:
    """Return the plate and robot with the plate's frame at (0, `sideways`, 0) in the chain frame."""
    plate = np.array([0.0, sideways, 0.0])

    def moved(pose: FloatArray) -> FloatArray:
        return se2.compose(plate, se2.relative(pusher.plate_pose, pose))

    drive: Drive = pusher.drive
    return replace(
        pusher,
        outline=pusher.outline - pusher.plate_pose[:2] + plate[:2],
        drive=drive if drive.axle is None else replace(drive, axle=moved(drive.axle)),
        footprint=tuple(part - pusher.plate_pose[:2] + plate[:2] for part in pusher.footprint),
        base=None if pusher.base is None else moved(pusher.base),
    )


def _contact(chain: Chain, order: Sequence[int], objects: Sequence[PushedObject], pusher: Pusher, k: int) -> Contact:
    """Return the contact through which the k-th object of another order is pushed."""
    own, friction, height = order[k], {}, {}
    for contact in chain.contacts:
        if own in (contact.pushed, contact.pusher):
            other = contact.pushed + contact.pusher - own
            friction[other], height[other] = contact.friction, contact.height
    before = [j for j in range(k) if order[j] in friction]
    pushing = before[0] if before else PLATE
    outline = pusher.outline if pushing == PLATE else objects[pushing].outline_chain
    touch = find_touch(outline, objects[k].outline_chain)
    if touch is None or len(touch) != 1:
        raise ChainError(f"{objects[k].name!r} is not pushed along a single line at this face")
    mu = friction[order[pushing]] if before else friction.get(PLATE, pusher.friction)
    return Contact(touch[0][0], touch[0][1], mu, k, pushing, height.get(order[pushing] if before else PLATE))


def _require_clear(pusher: Pusher, objects: Sequence[PushedObject]) -> None:
    """Raise ChainError if the robot itself would push an object."""
    plate = shapely.Polygon(pusher.outline).buffer(TOUCH, join_style="mitre")
    for part in pusher.footprint:
        for obj in objects:
            depth = overlap_depth(obj.outline_chain, part)
            if depth > 0.0:
                raise ChainError(f"the robot overlaps {obj.name!r} by {1e3 * depth:.3g} mm at this face")
            touch = find_touch(part, obj.outline_chain)
            beside = [] if touch is None else [shapely.difference(shapely.LineString(s), plate) for s in touch]
            if any(line.length > SHORTEST_CONTACT for line in beside):
                raise ChainError(f"the robot touches {obj.name!r} beside the plate; only the plate may push")


def stacks(chain: Chain) -> list[list[int]]:
    """Return the objects' indices by stack; a stack consists of objects that touch each other."""
    left, found = set(range(len(chain.objects))), []
    while left:
        found.append(carried_from(chain, (min(left),)))
        left -= set(found[-1])
    return found


def carried_from(chain: Chain, touched: tuple[int, ...]) -> list[int]:
    """Return the objects' indices, the `touched` ones first, so that each other object touches an earlier one."""
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
    """Return the ends (2, 2) of a face joined with all other stacks' faces on its line; None if a stack has none."""
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
    """Yield the ends of the faces of a counter-clockwise outline (v, 2); collinear adjacent edges are one face."""
    edge = np.roll(outline, -1, axis=0) - outline
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    before = np.roll(edge, 1, axis=0)
    # Sine of the angle between adjacent edges; if it is a rounding error, they are one face.
    corner = np.flatnonzero(np.abs(before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0]) > 1e-9)
    for begin, end in zip(corner, np.roll(corner, -1), strict=True):
        yield outline[begin], outline[end]


def _outward(begin: FloatArray, end: FloatArray) -> float:
    """Return the angle of the outward normal of an edge of a counter-clockwise outline, rad."""
    x, y = end - begin
    return math.atan2(-x, y)


def _is_asked_for(normal: float, faces: Sequence[str | float] | None) -> bool:
    if faces is None:
        return True
    wanted = [_NORMALS[face] if isinstance(face, str) else face for face in faces]
    return any(abs(float(se2.wrap_angle(normal - angle))) < SAME_DIRECTION for angle in wanted)


def face_name(normal: float) -> str:
    """Return the name of a face by the angle of its outward normal, rad."""
    for name, angle in _NORMALS.items():
        if abs(float(se2.wrap_angle(normal - angle))) < SAME_DIRECTION:
            return name
    return f"{math.degrees(normal):.3g} deg"


def _named(chain: Chain, touched: list[int], normal: float) -> str:
    owners = " and ".join(chain.objects[i].name for i in touched)
    return f"{owners} {face_name(normal)}" if len(chain.objects) > 1 else face_name(normal)


def _contacts(plate: FloatArray, found: list[list[int]], outlines: list[FloatArray]) -> dict[int, FloatArray]:
    """Return the middles (2,) of the plate's contacts by object; empty unless it has one line contact per stack."""
    around = shapely.Polygon(plate)
    # The plate must keep 1 mm from objects that it does not touch.
    near = [i for i, outline in enumerate(outlines) if around.distance(shapely.Polygon(outline)) < 1e-3]
    touched = [[i for i in stack if i in near] for stack in found]
    if any(overlap_depth(plate, outline) > TOUCH for outline in outlines) or any(len(t) != 1 for t in touched):
        return {}
    touches = {i: find_touch(plate, outlines[i]) for (i,) in touched}
    if any(touch is None or len(touch) != 1 for touch in touches.values()):
        return {}
    return {i: np.asarray(touch[0].mean(axis=0)) for i, touch in touches.items() if touch is not None}
