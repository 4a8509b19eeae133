"""The independent check of a motion: exact distances by shapely, no code shared with the planners.

Where two poses are g and h away from everything, and no point of the body travels more than d between them, the
body stays (g + h - d) / 2 away on the whole way. That proves most of a motion from few poses; what it leaves
open is halved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.planners.validation.motion import Motion
from pushplan.planners.validation.room import Room
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

COARSE = 0.2
"""No point of the body moves farther than this (m) between the first poses that are looked at."""

SPACING = 0.002
"""Where nothing is proven, no point of the body moves farther than this (m) between two poses looked at."""


@dataclass(frozen=True)
class Collision:
    """Where a motion comes too near to something.

    Attributes:
        pose: (x, y, theta) of the chain frame in the world.
        body: `robot`, `pusher` or the object's name.
        obstacle: Index of the obstacle, or None for the workspace's walls.
        gap: Distance that is left, m; 0 where they touch or overlap.
    """

    pose: tuple[float, float, float]
    body: str
    obstacle: int | None
    gap: float = 0.0

    def __str__(self) -> str:
        other = "a wall of the workspace" if self.obstacle is None else f"obstacles[{self.obstacle}]"
        x, y, theta = self.pose
        place = f"with the chain frame at ({x:.4f}, {y:.4f}) m, {np.degrees(theta):.2f} deg"
        if self.gap <= 0.0:
            return f"'{self.body}' meets {other} {place}"
        return f"'{self.body}' is {1e3 * self.gap:.3g} mm from {other} {place}"


def find_collision(scenario: Scenario, poses: FloatArray, room: Room | None = None) -> Collision | None:
    """Return the first collision along poses (m, 3) of the chain frame, to `SPACING`, or None.

    It is one when a body comes nearer to something than the scenario's clearance, less `CLEARANCE_ROOM`.

    Args:
        scenario: What moves, what is in the way, and how far to keep from it.
        poses: Between neighbours the twist is constant.
        room: The scenario's, where it is there already.
    """
    return collision_along(scenario, Motion.through(poses, scenario.chain.reach), room)


def collision_along(scenario: Scenario, motion: Motion, room: Room | None = None) -> Collision | None:
    """Return `find_collision` of a motion."""
    required = scenario.clearance - CLEARANCE_ROOM
    room = Room.of(scenario) if room is None else room
    at = _first_too_near(room, motion, required)
    if at is None:
        return None
    pose = motion.at(np.array([at]))[0]
    gap, body, obstacle = room.nearest(pose, required + SPACING)
    x, y, theta = (float(value) for value in pose)
    return Collision((x, y, theta), body, obstacle, gap)


def _first_too_near(room: Room, motion: Motion, required: float) -> float | None:
    """Return the travel at which a motion first comes nearer to something than required (m), to `SPACING`."""
    whole = motion.travel[-1]
    s = np.linspace(0.0, whole, int(np.ceil(whole / COARSE)) + 1)
    gaps = room.gaps(motion.at(s), COARSE + 2.0 * required)
    first = s[gaps < required].min(initial=np.inf)
    ends = np.stack([s[:-1], s[1:], gaps[:-1], gaps[1:]])
    while ends.shape[1]:
        low, high, g, h = ends
        unproven = (g + h - (high - low) < 2.0 * required) & (high - low > SPACING) & (low < first)
        low, high, g, h = ends[:, unproven]
        middle = 0.5 * (low + high)
        m = room.gaps(motion.at(middle), 0.5 * (high - low).max(initial=0.0) + 2.0 * required)
        first = middle[m < required].min(initial=first)
        ends = np.hstack([np.stack([low, middle, g, m]), np.stack([middle, high, m, h])])
    return None if np.isinf(first) else float(first)
