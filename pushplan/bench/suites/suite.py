"""A benchmark suite: problems times planners times stable sets times seeds, and the runs that it consists of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import product
from pathlib import Path

from pushplan.scenario.model import Scenario

KEY_LENGTH = 16
"""Hexadecimal digits of a run's key."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One push problem of a suite.

    Attributes:
        name: Unique within the suite.
        family: Name that all problems of one generator share; of a single scenario its own.
        instance: Seed of the generator, or None.
        scenario: What is to be solved.
    """

    name: str
    family: str
    instance: int | None
    scenario: Scenario

    @cached_property
    def hash(self) -> str:
        """SHA-256 of the scenario file and of all files that it refers to."""
        digest = hashlib.sha256(self.scenario.source)
        for name, data in sorted(self.scenario.attachments.items()):
            digest.update(f"\0{name}\0{len(data)}\0".encode())
            digest.update(data)
        return digest.hexdigest()


@dataclass(frozen=True)
class PlannerSetup:
    """A planner with its settings.

    Attributes:
        label: What reports call it; unique within the suite.
        name: Of the planner.
        first: It stops at the first path.
        time: Planning time, s, at most.
        iterations: Extensions and shortcuts, at most, or None.
        cost: What paths are ranked by; None stands for the scenario's own.
        gap: Share above the lower bound at which a path is good enough; None likewise.
    """

    label: str
    name: str
    first: bool
    time: float
    iterations: int | None
    cost: str | None = None
    gap: float | None = None

    @property
    def settings(self) -> dict[str, object]:
        """All that bears on results, without the label."""
        return {name: value for name, value in asdict(self).items() if name != "label"}


@dataclass(frozen=True, eq=False)
class RunSpec:
    """One run of a suite.

    Attributes:
        key: Digest of the problem, the planner and its settings, the stable set, the seed and the version.
        problem: What is to be solved.
        planner: By which planner.
        stable_set: Within which stable set.
        seed: From which random numbers.
        seconds: Wall-clock time of the whole run after which it is ended, s.
        megabytes: Memory that it may allocate, MB.
        version: Of the package.
        trials: Number of sampled worlds that its plan is tried in.
    """

    key: str
    problem: Problem
    planner: PlannerSetup
    stable_set: str
    seed: int
    seconds: float
    megabytes: float
    version: str
    trials: int = 0

    @property
    def words(self) -> dict[str, str]:
        """What filters look at, and people read."""
        return {
            "problem": self.problem.name,
            "planner": self.planner.label,
            "set": self.stable_set,
            "seed": str(self.seed),
        }

    def __str__(self) -> str:
        return " ".join(f"{name}={value}" for name, value in self.words.items())


@dataclass(frozen=True, eq=False)
class Suite:
    """A benchmark.

    Attributes:
        name: For people.
        path: The file that it was read from.
        source: The bytes of that file.
        problems: What is to be solved.
        planners: By which planners.
        sets: Within which stable sets; None stands for each scenario's own.
        seeds: From which random numbers.
        run_seconds: Wall-clock time of a run, s, after which it is killed; None for a generous one.
        megabytes: Memory that a run may allocate, MB.
        trials: Number of sampled worlds that every plan is tried in.
    """

    name: str
    path: Path
    source: bytes
    problems: tuple[Problem, ...]
    planners: tuple[PlannerSetup, ...]
    sets: tuple[str, ...] | None
    seeds: tuple[int, ...]
    run_seconds: float | None
    megabytes: float
    trials: int = 0

    def runs(self, version: str) -> Iterator[RunSpec]:
        """Yield all runs, seed by seed, so that a benchmark that is stopped early has some of everything."""
        for seed, problem, planner in product(self.seeds, self.problems, self.planners):
            for name in self.sets or (problem.scenario.stability.set,):
                tried = {"trials": self.trials} if self.trials else {}
                key = run_key(problem.hash, {**planner.settings, **tried}, name, seed, version)
                limits = self.seconds_for(planner), self.megabytes
                yield RunSpec(key, problem, planner, name, seed, *limits, version, self.trials)

    def seconds_for(self, planner: PlannerSetup) -> float:
        """Return how long a run with a planner may take, s."""
        return 5.0 * planner.time + 30.0 if self.run_seconds is None else self.run_seconds


def run_key(problem: str, settings: Mapping[str, object], stable_set: str, seed: int, version: str) -> str:
    """Return the key of a run: equal for equal work, and different whenever a result may differ."""
    parts = json.dumps([problem, settings, stable_set, seed, version], sort_keys=True)
    return hashlib.sha256(parts.encode()).hexdigest()[:KEY_LENGTH]
