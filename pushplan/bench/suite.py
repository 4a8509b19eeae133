"""Suites: products of problems, planners, stable sets and seeds, with one run for each combination."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from importlib.resources import files
from itertools import product
from pathlib import Path

from pushplan.bench.random_problems import GeneratorError, generate
from pushplan.bench.schema import LimitSection, Planner, StatedProblem, SuiteFile
from pushplan.errors import PushplanError, ScenarioError
from pushplan.scenario.file import load_scenario, names_in, read_named, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.source import DocumentError, Source
from pushplan.scenario.validation import validate
from pushplan.util.naming import PLACE

KEY_LENGTH = 16
"""Length of a run's key, hexadecimal digits."""

FIELDS = ("problem", "planner", "set", "seed")
"""Fields of a run that filters can match."""

PACKAGED = Path(str(files("pushplan"))) / "suites"


class SuiteError(ScenarioError):
    """A suite is wrong; `findings` holds all errors."""


class SelectionError(PushplanError, ValueError):
    """A filter or a key matches no run."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One push problem of a suite, small enough to be sent to other processes.

    Attributes:
        name: Name, unique within the suite.
        family: Common name of all problems of one generator, or the name of a single scenario.
        instance: Seed of the generator, or None.
        source: Bytes of the scenario file.
        attachments: Bytes of the files that it refers to, by name.
        stable_set: Stable set of the scenario.
        counts: Drive of the pusher, and numbers of objects and obstacles.
    """

    name: str
    family: str
    instance: int | None
    source: bytes
    attachments: Mapping[str, bytes]
    stable_set: str
    counts: tuple[str, int, int]

    @classmethod
    def of(cls, scenario: Scenario, name: str, family: str, instance: int | None = None) -> Problem:
        """Return the problem of a scenario."""
        counts = scenario.pusher.drive.kind, len(scenario.poses), len(scenario.obstacles)
        attachments = dict(scenario.attachments)
        return cls(name, family, instance, scenario.source, attachments, scenario.stability.set, counts)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of the scenario file and of all files that it refers to."""
        digest = hashlib.sha256(self.source)
        for name, data in sorted(self.attachments.items()):
            digest.update(f"\0{name}\0{len(data)}\0".encode())
            digest.update(data)
        return digest.hexdigest()

    def scenario(self) -> Scenario:
        """Read the scenario."""
        return scenario_from_text(self.source, f"{self.name}.yaml", self.attachments)


@dataclass(frozen=True, eq=False)
class RunSpec:
    """One run of a suite, with all inputs of its process.

    Attributes:
        key: Digest of the problem, the planner and its settings, the stable set, the seed and the version.
        problem: Push problem.
        planner: Planner, with `label` and `time` filled in.
        stable_set: Name of the stable set.
        seed: Seed of the random numbers.
        seconds: Wall-clock time after which the whole run is killed, s.
        megabytes: Memory that the run can allocate, MB.
        version: Version of the package.
        trials: Number of Monte Carlo samples of its plan.
    """

    key: str
    problem: Problem
    planner: Planner
    stable_set: str
    seed: int
    seconds: float
    megabytes: float
    version: str
    trials: int = 0

    @property
    def label(self) -> str:
        """Name of the planner in reports."""
        return self.planner.label or self.planner.name

    @property
    def fields(self) -> dict[str, str]:
        """Fields for filters and messages."""
        return dict(zip(FIELDS, (self.problem.name, self.label, self.stable_set, str(self.seed)), strict=True))

    def __str__(self) -> str:
        return " ".join(f"{name}={value}" for name, value in self.fields.items())


def planner_settings(planner: Planner) -> dict[str, object]:
    """Return all settings of a planner that affect results, that is, all but its label."""
    return planner.model_dump(exclude={"label"})


@dataclass(frozen=True, eq=False)
class Suite:
    """A benchmark.

    Attributes:
        name: Name in reports.
        path: File of the suite.
        source: Bytes of that file.
        problems: Push problems.
        planners: Planners, with `label` and `time` filled in.
        sets: Names of the stable sets; None for each scenario's own.
        seeds: Seeds of the random numbers.
        limits: Limits of a run.
        trials: Number of Monte Carlo samples of every plan.
    """

    name: str
    path: Path
    source: bytes
    problems: tuple[Problem, ...]
    planners: tuple[Planner, ...]
    sets: tuple[str, ...] | None
    seeds: tuple[int, ...]
    limits: LimitSection
    trials: int = 0

    def runs(self, version: str) -> Iterator[RunSpec]:
        """Yield all runs, seed by seed, so that a stopped benchmark has results of every problem and planner."""
        tried = {"trials": self.trials} if self.trials else {}
        for seed, problem, planner in product(self.seeds, self.problems, self.planners):
            assert planner.time is not None
            seconds = self.limits.run or 5.0 * planner.time + 30.0
            for name in self.sets or (problem.stable_set,):
                parts = [problem.hash, {**planner_settings(planner), **tried}, name, seed, version]
                key = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:KEY_LENGTH]
                yield RunSpec(key, problem, planner, name, seed, seconds, self.limits.memory, version, self.trials)

    @property
    def code(self) -> tuple[str, ...]:
        """Planners and stable sets of the form `module:attribute`, whose code the runs import."""
        named = [planner.name for planner in self.planners]
        named += self.sets or [problem.stable_set for problem in self.problems]
        return tuple(dict.fromkeys(name for name in named if PLACE.fullmatch(name)))


def select(runs: Sequence[RunSpec], filters: Sequence[str]) -> list[RunSpec]:
    """Return the runs that match all filters.

    Args:
        runs: All runs.
        filters: Texts FIELD=PATTERN with one of `FIELDS`; in the pattern `*` matches any text.

    Raises:
        SelectionError: If a filter is malformed, or no run matches.
    """
    kept = list(runs)
    for text in filters:
        field, sign, pattern = text.partition("=")
        if not sign or field not in FIELDS:
            raise SelectionError(
                f"'{text}' is not a filter; allowed: FIELD=PATTERN, FIELD one of {', '.join(FIELDS)}"
            )
        kept = [run for run in kept if fnmatchcase(run.fields[field], pattern)]
    if not kept:
        known = {field: sorted({run.fields[field] for run in runs})[:20] for field in FIELDS}
        there = "; ".join(f"{field}: {', '.join(values)}" for field, values in known.items())
        raise SelectionError(f"no run matches {' and '.join(filters)}; allowed values: {there}")
    return kept


def run_with_key(runs: Sequence[RunSpec], key: str) -> RunSpec:
    """Return the run whose key begins with `key`.

    Raises:
        SelectionError: If there is none, or more than one.
    """
    found = [run for run in runs if run.key.startswith(key)]
    if len(found) != 1:
        raise SelectionError(
            f"{len(found) or 'no'} run{'s' * (len(found) > 1)} of this suite and version has a key that begins with "
            f"'{key}'; report.html and runs.csv list the keys, which differ between versions of pushplan"
        )
    return found[0]


# --- reading ----------------------------------------------------------------------------------------------------


def suite_names() -> tuple[str, ...]:
    """Return the names of the packaged suites, in alphabetical order."""
    return names_in(PACKAGED)


def suite_text(name: str) -> str:
    """Return the file of a packaged suite."""
    return (PACKAGED / f"{name}.yaml").read_text(encoding="utf-8")


def load_suite(source: str | Path) -> Suite:
    """Read a suite with all its problems, from a file or from a packaged suite.

    Raises:
        SuiteError: If the suite or one of its scenarios is wrong, with all errors.
    """
    data, path = read_named(source, PACKAGED, "suite", SuiteError)
    return suite_from_text(data, path)


def suite_from_text(text: str | bytes, path: str | Path = "suite.yaml") -> Suite:
    """Read a suite from a text.

    Args:
        text: Contents of a suite file.
        path: Path of the file for messages; scenario files are relative to its folder.

    Raises:
        SuiteError: As for `load_suite`.
    """
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    try:
        report = Source(data, path)
    except DocumentError as error:
        raise SuiteError(str(path), error.findings) from error
    file = validate(SuiteFile, report)
    if file is not None:
        planners = _planners(file, report)
        problems = _problems(file, Path(path).parent, report)
    if file is None or report.findings:
        raise SuiteError(str(path), report.findings)
    return Suite(
        name=file.name or Path(path).stem,
        path=Path(path),
        source=data,
        problems=problems,
        planners=planners,
        sets=file.sets,
        seeds=file.seeds if isinstance(file.seeds, tuple) else tuple(range(1, file.seeds + 1)),
        limits=file.limits,
        trials=file.trials or 0,
    )


def _planners(file: SuiteFile, report: Source) -> tuple[Planner, ...]:
    """Return the planners with label and limits filled in; report planners with the same label or settings."""
    made: list[Planner] = []
    for i, stated in enumerate(file.planners):
        planner = Planner(name=stated) if isinstance(stated, str) else stated
        planner = planner.model_copy(
            update={
                "label": planner.label or planner.name,
                "time": planner.time or file.limits.time,
                "iterations": planner.iterations or file.limits.iterations,
            }
        )
        for j, other in enumerate(made):
            if planner_settings(planner) == planner_settings(other):
                report.error(("planners", i), f"is the same as planners[{j}]; leave one of them out")
                break
            if planner.label == other.label:
                text = f"has the label '{planner.label}' of planners[{j}]; give it another label"
                report.error(("planners", i), text)
                break
        made.append(planner)
    return tuple(made)


def _problems(file: SuiteFile, folder: Path, report: Source) -> tuple[Problem, ...]:
    made: list[Problem] = []
    known: dict[str, Problem] = {}
    for i, stated in enumerate(file.problems):
        entry = StatedProblem(scenario=stated) if isinstance(stated, str) else stated
        try:
            for problem in _problems_of(entry, folder):
                signs = ((problem.hash, "is the same problem as"), (problem.name, "has the same name as"))
                for sign, how in signs:
                    if sign in known:
                        text = f"'{problem.name}' {how} '{known[sign].name}'; leave it out or change it"
                        report.error(("problems", i), text)
                        break
                known |= {problem.hash: problem, problem.name: problem}
                made.append(problem)
        except ScenarioError as error:
            for finding in error.findings:
                report.error(("problems", i), f"cannot be used: {finding.text(error.path)}")
        except GeneratorError as error:
            report.error(("problems", i), str(error))
    return tuple(made)


def _problems_of(entry: StatedProblem, folder: Path) -> Iterator[Problem]:
    """Yield the random problems of an entry, or its scenario: a file beside the suite, else a packaged one."""
    if entry.generate is None:
        assert entry.scenario is not None
        beside = folder / entry.scenario
        scenario = load_scenario(beside if beside.is_file() else entry.scenario)
        name = entry.name or scenario.name
        yield Problem.of(scenario, name, name)
        return
    assert entry.name is not None
    first = 1 if entry.seed is None else entry.seed
    for seed in range(first, first + (entry.count or 1)):
        name = f"{entry.name}-{seed}"
        scenario = scenario_from_text(generate(entry.generate, seed), f"{name}.yaml")
        yield Problem.of(scenario, name, entry.name, seed)
