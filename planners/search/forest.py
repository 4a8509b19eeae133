"""Two trees that grow towards each other, and the poses drawn for them to grow to.

Poses are drawn from the whole box, from the ellipse that paths cheaper than the best one stay in (Gammell, Srinivasa
and Barfoot 2014), or near a way for the body's middle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pushplan.arrays import FloatArray, IntArray, RandomState
from pushplan.compiled import inlined
from pushplan.planners.collision import separation
from pushplan.planners.problem.problem import Problem, random, remaining

NODE = 17
"""Columns of a node: x, y, theta, cost to the tree's root, parent, and up to three arcs (vx, vy, omega, length)
between the node and its parent, in the order of travel."""

DRAWS = 20
"""Poses drawn, at most, until one is free and worth reaching."""

ALONG_SHARE = 0.7
"""Share of the samples that are drawn near the way, where there is one."""

TANGENT = 3
"""Points of the way, before and after one, between which its direction is taken."""

TURNED = 1.0
"""Largest angle between the push and the way, rad."""


class Forest(NamedTuple):
    """Both trees and what grows them.

    Attributes:
        ahead: (capacity, NODE) tree from the start.
        behind: (capacity, NODE) tree to the goal.
        counts: (2,) nodes in each.
        box: (4,) xmin, ymin, xmax, ymax that positions are drawn from.
        heading_length: Metres that a radian counts as in the choice of the nearest nodes; so far from the way, m,
            positions are drawn.
        reach: Longest piece of a word that is added at a time, m of cost.
        state: (1,) of the random generator.
        way: (k, 2) points near which the body's middle is to pass; none of them, k = 0, to draw from the box alone.
        middle: (3,) the body's middle in the chain frame, and the direction of its straight push there.
        blind: Share of the extensions that take a random arc instead of a word towards the sample.
    """

    ahead: FloatArray
    behind: FloatArray
    counts: IntArray
    box: FloatArray
    heading_length: float
    reach: float
    state: RandomState
    way: FloatArray
    middle: FloatArray
    blind: float


def plant(forest: Forest, start: FloatArray, goal: FloatArray) -> None:
    """Reduce both trees to their roots."""
    forest.ahead[0, :] = 0.0
    forest.behind[0, :] = 0.0
    forest.ahead[0, :3] = start
    forest.behind[0, :3] = goal
    forest.ahead[0, 4] = -1.0
    forest.behind[0, 4] = -1.0
    forest.counts[:] = 1


@inlined
def _draw(forest: Forest, start: FloatArray, goal: FloatArray, bound: float, pose: FloatArray) -> None:
    """Draw a pose: its position from the box, or from the ellipse that paths below the bound stay in, if smaller."""
    box, state = forest.box, forest.state
    pose[2] = 2.0 * math.pi * random(state)
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    minor_squared = bound * bound - dx * dx - dy * dy
    if math.pi * bound * math.sqrt(max(minor_squared, 0.0)) < 4.0 * (box[2] - box[0]) * (box[3] - box[1]):
        r, angle = math.sqrt(random(state)), 2.0 * math.pi * random(state)
        along = 0.5 * bound * r * math.cos(angle)
        across = 0.5 * math.sqrt(max(minor_squared, 0.0)) * r * math.sin(angle)
        distance = max(math.hypot(dx, dy), 1e-12)
        ux, uy = dx / distance, dy / distance
        pose[0] = 0.5 * (start[0] + goal[0]) + ux * along - uy * across
        pose[1] = 0.5 * (start[1] + goal[1]) + uy * along + ux * across
    else:
        pose[0] = box[0] + (box[2] - box[0]) * random(state)
        pose[1] = box[1] + (box[3] - box[1]) * random(state)


@inlined
def _draw_along(forest: Forest, pose: FloatArray) -> None:
    """Draw a pose near the way, the push about along it."""
    way, state = forest.way, forest.state
    k = way.shape[0]
    i = int(random(state) * k)
    before, after = max(0, i - TANGENT), min(k - 1, i + TANGENT)
    heading = math.atan2(way[after, 1] - way[before, 1], way[after, 0] - way[before, 0])
    pose[2] = heading - forest.middle[2] + TURNED * (random(state) + random(state) - 1.0)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = forest.middle[0], forest.middle[1]
    pose[0] = way[i, 0] - c * x + s * y + forest.heading_length * (random(state) + random(state) - 1.0)
    pose[1] = way[i, 1] - s * x - c * y + forest.heading_length * (random(state) + random(state) - 1.0)


@inlined
def draw_pose(problem: Problem, forest: Forest, start: FloatArray, bound: float, pose: FloatArray) -> bool:
    """Draw a free pose that a path cheaper than the bound could pass; give up after some tries."""
    goal = problem.goal
    for _ in range(DRAWS):
        if forest.way.shape[0] > 0 and random(forest.state) < ALONG_SHARE:
            _draw_along(forest, pose)
        else:
            _draw(forest, start, goal, bound, pose)
        x, y, theta = pose[0], pose[1], pose[2]
        through = remaining(x, y, theta, goal) + remaining(start[0], start[1], start[2], pose)
        clearance = problem.scene.clearance
        if through < bound and separation(problem.scene, x, y, theta, 2.0 * clearance) >= clearance:
            return True
    return False
