"""Pushes between poses of the load by exact words of one mode, each begun by a short straight push."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import any_integer, compiled
from pushplan.planners.collision.separation import Scene, separation, step, sweep_is_free
from pushplan.planners.problem.posing import ROUNDING, SLACK, scene_with_gap
from pushplan.planners.problem.steering import MAX_WORDS, connect, find_words
from pushplan.util.arrays import BoolArray, FloatArray

ARCS = 4
"""Of a push, at most: the settling one, and those of a word."""

TRIES = any_integer(6)
"""Words that are swept for a push, at most."""


class PackedMode(NamedTuple):
    """A contact and the pushes that it can make.

    Attributes:
        families: (f, 3, 3) left, straight and right twists in the contact's chain frame.
        contact: (3,) pose of that frame in the load's.
        robot: (3,) pose of the robot's frame in that frame.
        settling: (3,) twist of the straight push that a push begins with.
        settle: Its length, m.
        approach: Length of the straight way to the contact, m.
        retreat: Length of the straight way back from it, m.
        clearance: What is kept from everything, m.
        faster: How much faster than a push's cost grows the origin of the load's frame moves, at most.
    """

    families: FloatArray
    contact: FloatArray
    robot: FloatArray
    settling: FloatArray
    settle: float
    approach: float
    retreat: float
    clearance: float
    faster: float


@compiled
def joined(place: FloatArray, inner: FloatArray) -> FloatArray:
    """Return the pose (3,) `inner` of a frame that is at `place` (3,), in the world."""
    c, s = math.cos(place[2]), math.sin(place[2])
    out = np.empty(3)
    out[0] = place[0] + c * inner[0] - s * inner[1]
    out[1] = place[1] + s * inner[0] + c * inner[1]
    out[2] = place[2] + inner[2]
    return out


@compiled
def seen_from_contact(at: FloatArray, contact: FloatArray) -> FloatArray:
    """Return the load's pose (3,) with a contact at a pose (3,) in the world that is at `contact` in its frame."""
    out = np.empty(3)
    out[2] = at[2] - contact[2]
    c, s = math.cos(out[2]), math.sin(out[2])
    out[0] = at[0] - c * contact[0] + s * contact[1]
    out[1] = at[1] - s * contact[0] - c * contact[1]
    return out


@compiled
def robot_at(mode: PackedMode, load: FloatArray, behind: float) -> FloatArray:
    """Return the robot's pose (3,) so far behind the contact, m, with the load at a pose (3,)."""
    pose = joined(joined(load, mode.contact), mode.robot)
    pose[0] -= behind * math.cos(pose[2])
    pose[1] -= behind * math.sin(pose[2])
    return pose


@compiled
def _settled(mode: PackedMode, contact: FloatArray) -> FloatArray:
    """Return where the contact's frame (3,) is after the settling push."""
    out = np.empty(3)
    x, y, _ = mode.settling
    out[0], out[1], out[2] = step(contact[0], contact[1], contact[2], x, y, 0.0, mode.settle)
    return out


@compiled
def word_costs(
    mode: PackedMode, starts: FloatArray, goals: FloatArray, sofar: FloatArray, left: FloatArray, below: float
) -> FloatArray:
    """Return what the cheapest pushes from loads at `starts` (n, 3) to `goals` (m, 3) cost, whatever is in the way.

    A pair is left out (infinite) that cannot be part of a plan which costs less than `below`, as what comes before
    the start costs at least `sofar` (n,) and what comes after the goal `left` (m,).
    """
    out, words = np.full((len(starts), len(goals)), np.inf), np.empty((MAX_WORDS, 7))
    ends = np.empty((len(goals), 3))
    for j in range(len(goals)):
        ends[j] = joined(goals[j], mode.contact)
    for i in range(len(starts)):
        begin = _settled(mode, joined(starts[i], mode.contact))
        for j in range(len(goals)):
            away = math.hypot(goals[j, 0] - starts[i, 0], goals[j, 1] - starts[i, 1])
            # A distance costs next to nothing beside the words, of which most pairs need none then.
            if sofar[i] + away / mode.faster + left[j] >= below:
                continue
            for f in range(len(mode.families)):
                for k in range(find_words(mode.families[f], begin, ends[j], words)):
                    out[i, j] = min(out[i, j], mode.settle + words[k, 0])
    return out


@compiled
def push(scene: Scene, mode: PackedMode, start: FloatArray, goal: FloatArray, arcs: FloatArray) -> float:
    """Find the cheapest free push between two poses of the load.

    Args:
        scene: The chain with this contact in the room.
        mode: The contact.
        start: (3,) pose of the load.
        goal: Likewise.
        arcs: (ARCS, 4) filled with the twists, in the contact's frame, and lengths.

    Returns:
        Its cost, m; infinite if there is none.
    """
    first, last = joined(start, mode.contact), joined(goal, mode.contact)
    gap = min(
        separation(scene, first[0], first[1], first[2], mode.clearance + SLACK),
        separation(scene, last[0], last[1], last[2], mode.clearance + SLACK),
    )
    if gap < mode.clearance - ROUNDING:
        return np.inf
    between = scene_with_gap(scene, gap, mode.clearance)
    x, y, _ = mode.settling
    if not sweep_is_free(between, first[0], first[1], first[2], x, y, 0.0, mode.settle):
        return np.inf
    begin, word = _settled(mode, first), np.zeros((3, 4))
    cost, _ = connect(between, mode.families, begin, last, np.inf, TRIES, word)
    if cost == np.inf:
        return np.inf
    arcs[0, 0], arcs[0, 1], arcs[0, 2], arcs[0, 3] = x, y, 0.0, mode.settle
    arcs[1:] = word
    return mode.settle + cost


@compiled
def settles(scene: Scene, mode: PackedMode, load: FloatArray) -> bool:
    """Return whether the settling push is free with the load at a pose (3,)."""
    at = joined(load, mode.contact)
    gap = separation(scene, at[0], at[1], at[2], mode.clearance + SLACK)
    if gap < mode.clearance - ROUNDING:
        return False
    between = scene_with_gap(scene, gap, mode.clearance)
    return bool(
        sweep_is_free(between, at[0], at[1], at[2], mode.settling[0], mode.settling[1], 0.0, mode.settle)
    )


@compiled
def approaches_are_free(robot: Scene, mode: PackedMode, loads: FloatArray, back: bool) -> BoolArray:
    """Return (k,) whether the straight way to the contact, or back from it, is free with the load at poses (k, 3)."""
    out = np.zeros(len(loads), dtype=np.bool_)
    behind = mode.retreat if back else mode.approach
    for i in range(len(loads)):
        near, away = robot_at(mode, loads[i], 0.0), robot_at(mode, loads[i], behind)
        gap = separation(robot, near[0], near[1], near[2], mode.clearance + SLACK)
        # Where the robot drives on, it keeps what every transit keeps.
        far = separation(robot, away[0], away[1], away[2], mode.clearance + SLACK)
        if gap < mode.clearance - ROUNDING or far < mode.clearance + SLACK:
            continue
        between = scene_with_gap(robot, gap, mode.clearance)
        out[i] = sweep_is_free(between, away[0], away[1], away[2], 1.0, 0.0, 0.0, behind)
    return out
