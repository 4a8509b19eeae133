"""Pushes between poses of the load by exact words of one mode, each begun by a short straight push."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.basics.arrays import BoolArray, FloatArray
from pushplan.compiled import any_integer, compiled
from pushplan.planners.collision.separation import Scene, separation, step, sweep_is_free
from pushplan.planners.problem.posing import SLACK, kept_distances
from pushplan.planners.problem.steering import MAX_WORDS, connect, find_words

ARCS = 4
"""Of a push, at most: the settling one, and those of a word."""

TRIES = any_integer(6)
"""Words that are swept for a push, at most."""


class Hold(NamedTuple):
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
def robot_at(hold: Hold, load: FloatArray, behind: float) -> FloatArray:
    """Return the robot's pose (3,) so far behind the contact, m, with the load at a pose (3,)."""
    pose = joined(joined(load, hold.contact), hold.robot)
    pose[0] -= behind * math.cos(pose[2])
    pose[1] -= behind * math.sin(pose[2])
    return pose


@compiled
def _settled(hold: Hold, contact: FloatArray) -> FloatArray:
    """Return where the contact's frame (3,) is after the settling push."""
    out = np.empty(3)
    x, y, _ = hold.settling
    out[0], out[1], out[2] = step(contact[0], contact[1], contact[2], x, y, 0.0, hold.settle)
    return out


@compiled
def word_costs(
    hold: Hold, starts: FloatArray, goals: FloatArray, sofar: FloatArray, left: FloatArray, below: float
) -> FloatArray:
    """Return what the cheapest pushes from loads at `starts` (n, 3) to `goals` (m, 3) cost, whatever is in the way.

    A pair is left out (infinite) that cannot be part of a plan which costs less than `below`, as what comes before
    the start costs at least `sofar` (n,) and what comes after the goal `left` (m,).
    """
    out, words = np.full((len(starts), len(goals)), np.inf), np.empty((MAX_WORDS, 7))
    ends = np.empty((len(goals), 3))
    for j in range(len(goals)):
        ends[j] = joined(goals[j], hold.contact)
    for i in range(len(starts)):
        begin = _settled(hold, joined(starts[i], hold.contact))
        for j in range(len(goals)):
            away = math.hypot(goals[j, 0] - starts[i, 0], goals[j, 1] - starts[i, 1])
            if sofar[i] + away / hold.faster + left[j] >= below:
                continue
            for f in range(len(hold.families)):
                for k in range(find_words(hold.families[f], begin, ends[j], words)):
                    out[i, j] = min(out[i, j], hold.settle + words[k, 0])
    return out


@compiled
def push(scene: Scene, hold: Hold, start: FloatArray, goal: FloatArray, arcs: FloatArray) -> float:
    """Find the cheapest free push between two poses of the load.

    Args:
        scene: The chain with this contact in the room.
        hold: The contact.
        start: (3,) pose of the load.
        goal: Likewise.
        arcs: (ARCS, 4) filled with the twists, in the contact's frame, and lengths.

    Returns:
        Its cost, m; infinite if there is none.
    """
    first, last = joined(start, hold.contact), joined(goal, hold.contact)
    gap = min(
        separation(scene, first[0], first[1], first[2], hold.clearance + SLACK),
        separation(scene, last[0], last[1], last[2], hold.clearance + SLACK),
    )
    if gap < hold.clearance - 1e-9:
        return np.inf
    looked_at, kept = kept_distances(gap, hold.clearance)
    between = Scene(
        scene.body, scene.body_bound, scene.obstacles, scene.circles, scene.tree, scene.walls, looked_at, kept
    )
    x, y, _ = hold.settling
    if not sweep_is_free(between, first[0], first[1], first[2], x, y, 0.0, hold.settle):
        return np.inf
    begin, word = _settled(hold, first), np.zeros((3, 4))
    cost, _ = connect(between, hold.families, begin, last, np.inf, TRIES, word)
    if cost == np.inf:
        return np.inf
    arcs[0, 0], arcs[0, 1], arcs[0, 2], arcs[0, 3] = x, y, 0.0, hold.settle
    arcs[1:] = word
    return hold.settle + cost


@compiled
def settles(scene: Scene, hold: Hold, load: FloatArray) -> bool:
    """Return whether the settling push is free with the load at a pose (3,)."""
    at = joined(load, hold.contact)
    gap = separation(scene, at[0], at[1], at[2], hold.clearance + SLACK)
    if gap < hold.clearance - 1e-9:
        return False
    looked_at, kept = kept_distances(gap, hold.clearance)
    between = Scene(
        scene.body, scene.body_bound, scene.obstacles, scene.circles, scene.tree, scene.walls, looked_at, kept
    )
    return bool(
        sweep_is_free(between, at[0], at[1], at[2], hold.settling[0], hold.settling[1], 0.0, hold.settle)
    )


@compiled
def ways_are_free(robot: Scene, hold: Hold, loads: FloatArray, back: bool) -> BoolArray:
    """Return (k,) whether the straight way to the contact, or back from it, is free with the load at poses (k, 3)."""
    out = np.zeros(len(loads), dtype=np.bool_)
    behind = hold.retreat if back else hold.approach
    for i in range(len(loads)):
        near, away = robot_at(hold, loads[i], 0.0), robot_at(hold, loads[i], behind)
        gap = separation(robot, near[0], near[1], near[2], hold.clearance + SLACK)
        # Where the robot drives on, it keeps what every transit keeps.
        far = separation(robot, away[0], away[1], away[2], hold.clearance + SLACK)
        if gap < hold.clearance - 1e-9 or far < hold.clearance + SLACK:
            continue
        looked_at, kept = kept_distances(gap, hold.clearance)
        between = Scene(
            robot.body,
            robot.body_bound,
            robot.obstacles,
            robot.circles,
            robot.tree,
            robot.walls,
            looked_at,
            kept,
        )
        out[i] = sweep_is_free(between, away[0], away[1], away[2], 1.0, 0.0, 0.0, behind)
    return out
