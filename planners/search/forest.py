"""Two trees that grow towards each other, and the poses drawn for them to grow to.

Poses are drawn from the whole box, or from the ellipse that paths cheaper than the best one stay in (Gammell,
Srinivasa and Barfoot 2014).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pushplan.compiled import inlined
from pushplan.planners.collision.separation import separation
from pushplan.planners.problem.problem import Problem, random, remaining
from pushplan.util.arrays import FloatArray, IntArray, RandomState

NODE = 17
"""Columns of a node: x, y, theta, cost to the tree's root, parent, and up to three arcs (vx, vy, omega, length)
between the node and its parent, in the order of travel."""


class Forest(NamedTuple):
    """Both trees and what grows them.

    Attributes:
        start_tree: (capacity, NODE) tree from the start.
        goal_tree: (capacity, NODE) tree to the goal.
        counts: (2,) nodes in each.
        box: (4,) xmin, ymin, xmax, ymax that positions are drawn from.
        heading_length: Metres that a radian counts as in the choice of the nearest nodes.
        reach: Longest piece of a word that is added at a time, m of cost.
        state: (1,) of the random generator.
    """

    start_tree: FloatArray
    goal_tree: FloatArray
    counts: IntArray
    box: FloatArray
    heading_length: float
    reach: float
    state: RandomState


def plant(forest: Forest, start: FloatArray, goal: FloatArray) -> None:
    """Reduce both trees to their roots."""
    forest.start_tree[0, :] = 0.0
    forest.goal_tree[0, :] = 0.0
    forest.start_tree[0, :3] = start
    forest.goal_tree[0, :3] = goal
    forest.start_tree[0, 4] = -1.0
    forest.goal_tree[0, 4] = -1.0
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
def draw_pose(problem: Problem, forest: Forest, start: FloatArray, bound: float, pose: FloatArray) -> bool:
    """Draw a free pose that a path cheaper than the bound could pass; give up after some tries."""
    goal = problem.goal
    for _ in range(20):
        _draw(forest, start, goal, bound, pose)
        x, y, theta = pose[0], pose[1], pose[2]
        through = remaining(x, y, theta, goal) + remaining(start[0], start[1], start[2], pose)
        clearance = problem.scene.clearance
        if through < bound and separation(problem.scene, x, y, theta, 2.0 * clearance) >= clearance:
            return True
    return False
