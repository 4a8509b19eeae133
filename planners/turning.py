"""What the turns that a chain can make, or cannot, say about the way to its goal."""

from __future__ import annotations

import math

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.geometry import se2
from pushplan.planners.controls import segment_ends
from pushplan.result import Diagnosis
from pushplan.scenario import Scenario
from pushplan.stable_sets.stable_set import StableSet

ROUNDING = 1e-9
"""Headings and directions (rad) that differ by less are the same."""


def turning_faults(scenario: Scenario, stable: StableSet, segments: FloatArray) -> list[Diagnosis]:
    """Return what the chain's turns, or their absence, may have to do with a path that is not found.

    Args:
        scenario: The problem.
        stable: The set that limits the pushes.
        segments: (k, 6) its twists that the drive can make; see `controls`.
    """
    ends = segment_ends(segments)
    goal = scenario.goal.pose_chain
    turn = float(se2.wrap_angle(goal[2] - scenario.start[2]))
    if (ends[:, 2] == 0.0).all():
        return _no_turning(scenario, stable, turn)
    left, right = (_radius(ends[side * ends[:, 2] > 0.0]) for side in (1.0, -1.0))
    found = _one_sided(scenario, turn, left, right)
    area = scenario.workspace
    if area is not None and abs(turn) > ROUNDING:
        across, radius = min(area.xmax - area.xmin, area.ymax - area.ymin), min(left, right)
        if 2.0 * radius > across:
            text = (
                f"perhaps the turns are too wide: the tightest one, of radius {radius:.3g} m, makes a circle "
                f"that does not fit into the workspace, {across:.3g} m across"
            )
            found.append(Diagnosis("wide turns", text, False, {"radius": radius, "across": across}))
    return found


def _radius(twists: FloatArray) -> float:
    """Smallest radius (m) at which twists (k, 3) turn the chain frame's origin, infinite without any."""
    return float(np.min(np.hypot(twists[:, 0], twists[:, 1]) / np.abs(twists[:, 2]), initial=math.inf))


def _no_turning(scenario: Scenario, stable: StableSet, turn: float) -> list[Diagnosis]:
    """Without turns the heading stays, and the way lies within the cone of the straight pushes."""
    set_name = f"no push of the set {stable.name} turns the chain"
    if abs(turn) > ROUNDING:
        text = (
            f"the goal cannot be reached: {set_name}, and it asks for a turn by {math.degrees(turn):.4g} deg"
        )
        return [Diagnosis("heading", text, True, {"turn": turn})]
    cone = stable.translation_cone(scenario.required_margin)
    if cone is None or scenario.chain.pusher.drive.axle is not None:
        return []
    away = scenario.goal.pose_chain[:2] - scenario.start[:2]
    lowest, highest = np.arctan2(cone[:, 1], cone[:, 0])
    direction = math.atan2(away[1], away[0]) - scenario.start[2]
    opening = (highest - lowest) % (2.0 * math.pi)
    if opening >= math.pi or (direction - lowest) % (2.0 * math.pi) <= opening + ROUNDING:
        return []
    aside = float(se2.wrap_angle(direction))
    text = (
        f"the goal cannot be reached: {set_name}, straight pushes go {math.degrees(lowest):.4g} to "
        f"{math.degrees(highest):.4g} deg from straight ahead, and the goal lies at {math.degrees(aside):.4g} deg"
    )
    numbers = {"direction": aside, "lowest": float(lowest), "highest": float(highest)}
    return [Diagnosis("direction", text, True, numbers)]


def _one_sided(scenario: Scenario, turn: float, left: float, right: float) -> list[Diagnosis]:
    """The goal asks for a turn, or lies, to the side to which the chain does not turn."""
    if math.isfinite(left) and math.isfinite(right):
        return []
    able, unable, sign = ("left", "right", -1.0) if math.isfinite(left) else ("right", "left", 1.0)
    away = scenario.goal.pose_chain[:2] - scenario.start[:2]
    aside = math.cos(scenario.start[2]) * away[1] - math.sin(scenario.start[2]) * away[0]
    if sign * turn <= ROUNDING and sign * aside <= ROUNDING:
        return []
    radius = min(left, right)
    text = (
        f"perhaps the one-sided turning is the reason: every stable turn goes to the {able}, with a radius of "
        f"{radius:.3g} m or more, and the goal asks for a way to the {unable}"
    )
    return [Diagnosis("one-sided", text, False, {"radius": radius, "turn": turn, "aside": aside})]
