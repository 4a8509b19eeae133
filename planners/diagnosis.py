"""Why no path was found: what is proven, what may be the reason, and how far the search came.

It is made after a search that found nothing. "Cannot" is said of what is proven, "perhaps" of everything else.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.geometry import se2
from pushplan.path import cost_rate
from pushplan.planners.collision import Scene, sweep_is_free
from pushplan.planners.controls import segment_ends, straight_pushes
from pushplan.planners.passage import passage_faults
from pushplan.planners.pocket import Pocket, find_pocket
from pushplan.planners.search import Problem
from pushplan.result import Diagnosis
from pushplan.scenario import Scenario
from pushplan.stable_sets.stable_set import StableSet

PUSHES_TRIED = 300
"""Pushes tried from the start and into the goal."""

SHORTEST_PUSH = 1e-3
"""Travel (m) of the shortest push tried; the next ones are twice as long each."""

ROUNDING = 1e-9
"""Headings and directions (rad) that differ by less are the same."""


def diagnose(
    scenario: Scenario, stable: StableSet, problem: Problem, extensions: int, error: tuple[float, float]
) -> tuple[Diagnosis, ...]:
    """Return what kept a search from finding a path, proven reasons first.

    Args:
        scenario: The problem.
        stable: The set that it was posed in.
        problem: What was searched.
        extensions: Arcs that were propagated.
        error: How far (m, rad) from the goal the nearest pose was that the search reached.
    """
    found = [
        *passage_faults(scenario, straight_pushes(problem.segments)),
        *_turning(scenario, stable, problem.segments),
    ]
    if not any(item.proven for item in found):
        found += _boxed_in(scenario, stable, problem)
    proven = tuple(item for item in found if item.proven)
    return proven or (*found, _just_time(extensions, error, bool(found)))


def _turning(scenario: Scenario, stable: StableSet, segments: FloatArray) -> list[Diagnosis]:
    """What the chain's turns, or their absence, have to do with it."""
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
    cone = stable.translation_cone(scenario.stability.margin)
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


def _boxed_in(scenario: Scenario, stable: StableSet, problem: Problem) -> list[Diagnosis]:
    """No pushes lead far from the start, or from far away into the goal: proven, or hardly any single one is free."""
    pocket = find_pocket(scenario, stable, problem)
    if pocket is not None:
        return [_pocket_words(pocket)]
    found = []
    reach = float(problem.scene.body_bound[2])
    for name, pose, sign, words in (
        ("start", scenario.start, 1.0, "leads farther from the start than"),
        ("goal", scenario.goal.pose_chain, -1.0, "leads to the goal from farther away than"),
    ):
        free, tried = _longest_push(problem.scene, sign * _some_pushes(problem.segments), pose, reach)
        if free < reach:
            text = f"perhaps the {name} is boxed in: none of {tried} pushes tried {words} {1e3 * free:.3g} mm"
            found.append(Diagnosis("boxed in", text, False, {f"free_from_{name}": free}))
    return found


def _pocket_words(pocket: Pocket) -> Diagnosis:
    if pocket.is_goal:
        name, words = "goal", "it is boxed in: pushes into it, however combined, begin"
    else:
        name, words = "start", "the start is boxed in: pushes, however combined, end"
    text = f"the goal cannot be reached: {words} no farther than {pocket.radius:.3g} m from it (middle of the chain)"
    return Diagnosis("boxed in", text, True, {f"radius_around_{name}": pocket.radius})


def _some_pushes(segments: FloatArray) -> FloatArray:
    """Twists (k, 3) spread over the segments, scaled to a cost rate of 1."""
    rows = segments[np.linspace(0, len(segments) - 1, min(len(segments), PUSHES_TRIED // 3)).astype(int)]
    twists = np.concatenate([rows[:, :3], 0.5 * (rows[:, :3] + rows[:, 3:]), rows[:, 3:]])
    return np.asarray(twists / cost_rate(twists)[:, None])


def _longest_push(scene: Scene, twists: FloatArray, pose: FloatArray, enough: float) -> tuple[float, int]:
    """Longest free push (m) from a pose, up to `enough`, and how many were tried."""
    best = 0.0
    for tried, twist in enumerate(twists, 1):
        length = max(SHORTEST_PUSH, 2.0 * best)
        while sweep_is_free(scene, pose[0], pose[1], pose[2], twist[0], twist[1], twist[2], length):
            best = length
            if best >= enough:
                return best, tried
            length *= 2.0
    return best, len(twists)


def _just_time(extensions: int, error: tuple[float, float], guessed: bool) -> Diagnosis:
    first = "nothing proves that there is no way" if guessed else "nothing shows that there is no way"
    text = (
        f"{first}: {extensions} extensions came within {error[0]:.3g} m and {math.degrees(error[1]):.3g} deg of the "
        "goal, and more time or another seed may help"
    )
    numbers = {"extensions": float(extensions), "position": error[0], "angle": error[1]}
    return Diagnosis("time", text, False, numbers)
