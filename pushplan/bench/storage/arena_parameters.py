"""What Planner Arena lets people choose problems by."""

from __future__ import annotations

from collections.abc import Iterable

from pushplan.bench.suites.suite import Problem

Values = tuple[object, ...]


def parameter_values(problems: Iterable[Problem]) -> dict[str, Values]:
    """Return the values of `arena.PARAMETERS` by hash of the problem.

    A value is None where all problems of a family have the same: there is nothing to choose then, and Planner Arena's
    page of progress (1.0.1) looks in vain for a parameter with a single value.
    """
    families: dict[str, list[Problem]] = {}
    for problem in problems:
        families.setdefault(problem.family, []).append(problem)
    found: dict[str, Values] = {}
    for family in families.values():
        columns = zip(*(_values(problem) for problem in family), strict=True)
        rows = zip(*(_where_different(column) for column in columns), strict=True)
        found |= {problem.hash: row for problem, row in zip(family, rows, strict=True)}
    return found


def _values(problem: Problem) -> Values:
    scenario = problem.scenario
    drive = scenario.chain.pusher.drive.kind
    return drive, problem.instance, len(scenario.chain.objects), len(scenario.obstacles)


def _where_different(column: Values) -> Values:
    return column if len(set(column)) > 1 else (None,) * len(column)
