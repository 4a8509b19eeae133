"""Whether start or goal is boxed in: proven in steps, or suspected, where hardly any single push is free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pushplan.planners.collision.separation import Scene, sweep_is_free
from pushplan.planners.infeasible.pocket import Pocket, find_pocket
from pushplan.planners.infeasible.turning import tightest_turn
from pushplan.planners.problem.problem import Problem
from pushplan.plans.path import cost_rate
from pushplan.plans.plan import Diagnosis
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


def boxed_in_faults(scenario: Scenario, stable: StableSet, problem: Problem) -> Iterator[list[Diagnosis]]:
    """Yield after each step, a longer one each time, what it has proven; at last what may be.

    Args:
        scenario: The problem.
        stable: The set that limits the pushes.
        problem: The same problem compiled.
    """
    for pocket in find_pocket(scenario, stable, problem):
        yield [_proven(pocket, tightest_turn(scenario, stable, problem.segments))] if pocket else []
    yield _perhaps(scenario, problem)


def _proven(pocket: Pocket, turn: str) -> Diagnosis:
    if pocket.is_goal:
        name, words = "goal", "it is boxed in: pushes into it, however combined, begin"
    else:
        name, words = "start", "the start is boxed in: pushes, however combined, end"
    text = f"the goal cannot be reached: {words} no farther than {pocket.radius:.3g} m from it "
    text += f"(middle of the chain){turn}"
    return Diagnosis("boxed in", text, True, {f"radius_around_{name}": pocket.radius})


def _perhaps(scenario: Scenario, problem: Problem) -> list[Diagnosis]:
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


def _some_pushes(segments: FloatArray) -> FloatArray:
    """At most 300 twists (k, 3) spread over the segments, scaled to a cost rate of 1."""
    rows = segments[np.linspace(0, len(segments) - 1, min(len(segments), 100)).astype(int)]
    twists = np.concatenate([rows[:, :3], 0.5 * (rows[:, :3] + rows[:, 3:]), rows[:, 3:]])
    return np.asarray(twists / cost_rate(twists)[:, None])


def _longest_push(scene: Scene, twists: FloatArray, pose: FloatArray, enough: float) -> tuple[float, int]:
    """Longest free push (m) from a pose, up to `enough`, and how many were tried."""
    best = 0.0
    for tried, twist in enumerate(twists, 1):
        length = max(1e-3, 2.0 * best)
        while sweep_is_free(scene, pose[0], pose[1], pose[2], twist[0], twist[1], twist[2], length):
            best = length
            if best >= enough:
                return best, tried
            length *= 2.0
    return best, len(twists)
