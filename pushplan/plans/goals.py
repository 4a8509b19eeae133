"""How far objects are from where a scenario wants them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from pushplan.plans.plan import Plan
    from pushplan.scenario.model import Scenario


def errors_at_goal(scenario: Scenario, objects: FloatArray) -> FloatArray:
    """Return how far (m) and by what angle (rad) objects are off their places at the goal (n, 2).

    Args:
        scenario: Of several goals for one load, the nearest counts; what has no goal is not off.
        objects: (n, 3) poses of all objects' own frames in the world, in the order of `scenario.poses`.
    """
    found, first = [], 0
    for task in scenario.tasks:
        own = objects[first : first + len(task.chain.objects)]
        first += len(own)
        each = [se2.pose_errors(own, se2.compose(goal.pose_chain, task.chain.places)) for goal in task.goals]
        reach = task.chain.reach
        nearest = min(each, key=lambda off: float(off[0, 0] + reach * off[0, 1]), default=np.zeros((len(own), 2)))
        found.append(nearest)
    return np.concatenate(found)


def goal_columns(scenario: Scenario) -> list[int]:
    """Return which of the objects count at the goal: the goal's object, or all where it names none."""
    found: list[int] = []
    first = 0
    for task in scenario.tasks:
        names = [obj.name for obj in task.chain.objects]
        if task.goals:
            of = task.goals[0].of
            found += range(first, first + len(names)) if of is None else [first + names.index(of)]
        first += len(names)
    return found


def goal_units(scenario: Scenario, errors: FloatArray) -> FloatArray:
    """Return the errors (n, 2) of the objects that count at the goal over its tolerances (c, 2)."""
    units, first = [], 0
    counted = goal_columns(scenario)
    for task in scenario.tasks:
        last = first + len(task.chain.objects)
        for i in counted:
            if first <= i < last:
                goal = task.goals[0]
                units.append(errors[i] / [goal.position_tolerance, goal.angle_tolerance])
        first = last
    return np.array(units).reshape(-1, 2)


def worst_at_goal(scenario: Scenario, objects: FloatArray) -> tuple[float, float]:
    """Return how far (m) and by what angle (rad) the objects (n, 3) that count at the goal are off at most."""
    off = errors_at_goal(scenario, objects)[goal_columns(scenario)]
    return (float(off[:, 0].max(initial=0.0)), float(off[:, 1].max(initial=0.0)))


def tolerance_of(scenario: Scenario, position: float, angle: float) -> tuple[float, float]:
    """Return how far (m) and by what angle (rad) objects may be off: what every goal allows, at least that stated."""
    goals = [goal for task in scenario.tasks for goal in task.goals]
    return (
        max(position, min(goal.position_tolerance for goal in goals)),
        max(angle, min(goal.angle_tolerance for goal in goals)),
    )


def in_row(scenario: Scenario, tolerance: tuple[float, float]) -> tuple[float, float]:
    """Return how far (m) and by what angle (rad) objects of a row may be off in it, and others likewise.

    Each stands flush with the one in front: where that is turned within its tolerance, the others are aside by it.

    Args:
        scenario: With a goal for every object.
        tolerance: Of one object that stands for itself.
    """
    if scenario.row is None:
        return tolerance
    there = np.array([scenario.goals[name][0].pose[:2] for name in scenario.row.of])
    position, angle = tolerance
    return position + angle * float(np.linalg.norm(np.ptp(there, axis=0))), angle


def with_places(scenario: Scenario, plan: Plan) -> Scenario:
    """Return the scenario with a goal for each object: in a row the plan says what place each one has."""
    return plan.scenario if scenario.row is not None else scenario
