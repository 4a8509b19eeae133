"""Errors of objects at their goals."""

from __future__ import annotations

import numpy as np

from pushplan.geometry import se2
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray


def errors_at_goal(scenario: Scenario, objects: FloatArray) -> FloatArray:
    """Return the position errors (m) and angle errors (rad) of objects at the goal (n, 2).

    Args:
        scenario: Scenario with the goals. The nearest goal of a load counts; objects without a goal have error 0.
        objects: (n, 3) poses of all objects' own frames in the world, in the order of `scenario.poses`.
    """
    found, first = [], 0
    for load in scenario.loads:
        own = objects[first : first + len(load.names)]
        first += len(own)
        goals, places, reach = scenario.goals.get(load.name, ()), load.chain.places, load.chain.reach
        each = [se2.pose_errors(own, se2.compose(goal.pose_chain, places)) for goal in goals]
        nearest = min(each, key=lambda off: float(off[0, 0] + reach * off[0, 1]), default=np.zeros((len(own), 2)))
        found.append(nearest)
    return np.concatenate(found)


def goal_columns(scenario: Scenario) -> list[int]:
    """Return the indices of the objects that count at the goal: the goal's object, or all if it names none."""
    return [column for column, _ in _counted(scenario)]


def _counted(scenario: Scenario) -> list[tuple[int, tuple[float, float]]]:
    """Return the index and the tolerance of each object that counts at the goal."""
    found, first = [], 0
    for load in scenario.loads:
        for goal in scenario.goals.get(load.name, ())[:1]:
            own = range(len(load.names)) if goal.of is None else [load.names.index(goal.of)]
            found += [(first + i, goal.tolerance) for i in own]
        first += len(load.names)
    return found


def goal_units(scenario: Scenario, errors: FloatArray) -> FloatArray:
    """Return the errors (n, 2) of the c objects that count at the goal, divided by the tolerances (c, 2)."""
    return np.array([errors[i] / tolerance for i, tolerance in _counted(scenario)]).reshape(-1, 2)


def missed_tolerances(scenario: Scenario, errors: FloatArray) -> tuple[str, ...]:
    """Return the names of the goal's tolerances that errors (n, 2) exceed: `position`, `angle`."""
    worst = goal_units(scenario, errors).max(axis=0, initial=0.0).tolist()
    return tuple(name for name, units in zip(("position", "angle"), worst, strict=True) if units > 1.0)


def worst_at_goal(scenario: Scenario, objects: FloatArray) -> tuple[float, float]:
    """Return the largest position error (m) and angle error (rad) of the objects (n, 3) that count at the goal."""
    off = errors_at_goal(scenario, objects)[goal_columns(scenario)]
    return (float(off[:, 0].max(initial=0.0)), float(off[:, 1].max(initial=0.0)))


def tolerance_of(scenario: Scenario, position: float, angle: float) -> tuple[float, float]:
    """Return the smallest tolerance (m, rad) of all goals, but at least `position` and `angle`."""
    tolerances = [goal.tolerance for goals in scenario.goals.values() for goal in goals]
    return max(position, min(one for one, _ in tolerances)), max(angle, min(one for _, one in tolerances))
