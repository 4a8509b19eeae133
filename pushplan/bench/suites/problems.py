"""From the problems that a suite states to scenarios."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pushplan.bench.random_problems.generator import generate
from pushplan.bench.random_problems.parameters import GeneratorError, ProblemParameters
from pushplan.bench.suites.relopush import block_scenarios, read_instances
from pushplan.bench.suites.schema import Generator, SuiteFile
from pushplan.bench.suites.schema import Problem as StatedProblem
from pushplan.bench.suites.suite import Problem
from pushplan.errors import ScenarioError
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.scenario.source import Place, Source


def make_problems(file: SuiteFile, folder: Path, report: Source) -> tuple[Problem, ...]:
    """Return the problems of a suite, or report what is wrong with them.

    Args:
        file: The suite.
        folder: Where its scenario files are.
        report: Takes the findings.
    """
    made: list[Problem] = []
    known: dict[str, Problem] = {}
    for i, stated in enumerate(file.problems):
        entry = StatedProblem(scenario=stated) if isinstance(stated, str) else stated
        for problem in _problems(entry, folder, ("problems", i), report):
            for sign, same in (
                (problem.hash, "states the same problem as"),
                (problem.name, "is called like"),
            ):
                if sign in known:
                    what = f"'{problem.name}' {same} '{known[sign].name}'; leave it out or change it"
                    report.error(("problems", i), what)
                    break
            known |= {problem.hash: problem, problem.name: problem}
            made.append(problem)
    return tuple(made)


def _problems(entry: StatedProblem, folder: Path, place: Place, report: Source) -> Iterator[Problem]:
    """Yield the problems of one entry, or report why there are none."""
    try:
        if entry.generate is not None:
            yield from _generated(entry)
        elif entry.format is not None:
            yield from _blocks(entry, folder)
        else:
            yield from _scenario(entry, folder)
    except ScenarioError as error:
        for finding in error.findings:
            report.error(place, f"cannot be used: {finding.text(error.path)}")
    except GeneratorError as error:
        report.error(place, str(error))


def _scenario(entry: StatedProblem, folder: Path) -> Iterator[Problem]:
    """Yield the scenario of a file in the suite's folder, or else the packaged one of that name."""
    assert entry.scenario is not None
    beside = folder / entry.scenario
    scenario = load_scenario(beside if beside.is_file() else entry.scenario)
    name = entry.name or scenario.name
    yield Problem(name, name, None, scenario)


def _blocks(entry: StatedProblem, folder: Path) -> Iterator[Problem]:
    """Yield the blocks of a file of ReloPush whose goals are free, instance by instance, counted from 1."""
    assert entry.scenario is not None
    path = folder / entry.scenario
    family = entry.name or path.stem
    for k, instance in enumerate(read_instances(path)[: entry.count], start=1):
        for block, scenario in block_scenarios(instance, f"{family}-{k}", entry.walls or "loose"):
            yield Problem(f"{family}-{k}-{block}", family, k, scenario)


def _generated(entry: StatedProblem) -> Iterator[Problem]:
    assert entry.generate is not None
    assert entry.name is not None
    parameters = _parameters(entry.generate)
    first = 1 if entry.seed is None else entry.seed
    for seed in range(first, first + (entry.count or 1)):
        name = f"{entry.name}-{seed}"
        yield Problem(name, entry.name, seed, scenario_from_text(generate(parameters, seed), f"{name}.yaml"))


def _parameters(stated: Generator) -> ProblemParameters:
    """Return the parameters that a suite states; a single number stands for both ends of a range."""
    given: dict[str, Any] = stated.model_dump(exclude_none=True)
    for name in given.keys() - {"turning_radius", "room"}:
        if isinstance(given[name], int | float):
            given[name] = (given[name], given[name])
    return ProblemParameters(**given)
