"""Where a piece that is in the way can be put: along straight pushes, and around where it is."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.geometry import se2
from pushplan.rearrangement.pieces import Piece, Situation
from pushplan.scenario.parts import Goal, Workspace
from pushplan.util.arrays import FloatArray

AWAY = np.concatenate([np.arange(0.1, 1.05, 0.1), np.arange(1.25, 3.1, 0.25)])
"""How far straight pushes lead, m."""

SCATTERED = 60
"""Places around the piece."""

MOST = 24
"""Places that are offered, the nearest ones."""

ROOM = 0.05
"""What a place keeps from other pieces and from goals, beside the clearance, m."""


def parking(
    pieces: tuple[Piece, ...], now: Situation, piece: int, random: np.random.Generator
) -> tuple[Goal, ...]:
    """Return places for a piece that no goal needs, nearest first.

    Args:
        pieces: All of them.
        now: Where they are.
        piece: Index of the one to be put away.
        random: For the places that are not straight ahead of a face.
    """
    own, pose = pieces[piece], now.poses[piece]
    taken = _taken(pieces, now, piece)
    tolerance = own.prepared.scenario.goal
    places = [p for p in (*_straight(own, pose), *_scattered(pose, random)) if _is_free(own, p, taken)]
    nearest = sorted(places, key=lambda p: math.hypot(*(p - pose)[:2]))[:MOST]
    return tuple(Goal(p, None, p, tolerance.position_tolerance, tolerance.angle_tolerance) for p in nearest)


def _taken(pieces: tuple[Piece, ...], now: Situation, piece: int) -> BaseGeometry:
    """What other pieces cover, where they are and where those that are left shall go."""
    kept = pieces[piece].prepared.scenario.clearance + ROOM
    areas = [other.area(now.poses[k]) for k, other in enumerate(pieces) if k != piece]
    areas += [pieces[k].area(goal.pose_chain) for k in now.left if k != piece for goal in pieces[k].goals]
    return shapely.union_all(areas).buffer(kept)


def _straight(piece: Piece, pose: FloatArray) -> Iterator[FloatArray]:
    for contact in piece.prepared.room(0).contacts:
        ahead = se2.rotate(contact.packed.contact[2], contact.packed.settling[:2])
        for away in AWAY:
            yield se2.compose(pose, np.append(away * ahead, 0.0))


def _scattered(pose: FloatArray, random: np.random.Generator) -> Iterator[FloatArray]:
    for _ in range(SCATTERED):
        away, way = random.uniform(AWAY[0], AWAY[-1]), random.uniform(-np.pi, np.pi)
        yield pose + np.array([away * math.cos(way), away * math.sin(way), random.uniform(-np.pi, np.pi)])


def _is_free(piece: Piece, pose: FloatArray, taken: BaseGeometry) -> bool:
    area = piece.area(pose)
    return _is_inside(area, piece.prepared.scenario.workspace) and not taken.intersects(area)


def _is_inside(area: BaseGeometry, workspace: Workspace | None) -> bool:
    if workspace is None:
        return True
    x0, y0, x1, y1 = area.bounds
    return bool(
        workspace.xmin + ROOM < x0
        and x1 < workspace.xmax - ROOM
        and workspace.ymin + ROOM < y0
        and y1 < workspace.ymax - ROOM
    )
