"""Results of a benchmark made up so that what a report has to say is known."""

from collections.abc import Callable, Generator, Iterable
from pathlib import Path

from pushplan.bench.batch import run_suite
from pushplan.bench.outcome import Outcome
from pushplan.bench.results import Results, read_results
from pushplan.bench.store import ResultsFolder
from pushplan.bench.suite import RunSpec, suite_from_text

Make = Callable[[RunSpec], Outcome]

SUITE = """\
format: pushplan-suite/1
name: made up
problems: [one-box, two-crates]
planners: [auto, {name: rrt, label: slow}]
seeds: 12
limits: {time: 4 s}
"""


def solved(spec: RunSpec, cost: float, first: float) -> Outcome:
    values = {
        "time": 2.0,
        "first_solution_time": first,
        "solution_length": cost,
        "min_margin": 0.1,
        "total_time": 2.1,
    }
    progress = ((first, 2.0 * cost, 1), (3.0 * first, cost, 2))
    return Outcome(spec.key, "ok", "", values, progress=progress, host="here")


def typical(spec: RunSpec) -> Outcome:
    """`slow` is ten times slower and a tenth costlier; one run is invalid, one crashes, one has no plan."""
    slow = spec.planner.name == "rrt"
    if slow and spec.problem.name == "one-box" and 3 <= spec.seed <= 5:
        spoilt = {"solution_length": 0.5, "first_solution_time": 0.1}
        return {
            3: Outcome(spec.key, "invalid", "it <slips>", spoilt),
            4: Outcome(spec.key, "crash", "killed by SIGSEGV\nFatal <error>"),
            5: Outcome(spec.key, "no plan", "there is none"),
        }[spec.seed]
    noise = 1.0 + 0.01 * spec.seed
    return solved(spec, (3.3 if slow else 3.0) * noise, (0.5 if slow else 0.05) * noise)


def make(folder: Path, outcome: Make = typical, text: str = SUITE) -> Results:
    def engine(specs: Iterable[RunSpec]) -> Generator[Outcome]:
        for spec in specs:
            yield outcome(spec)

    results = ResultsFolder(folder)
    with results.locked():
        run_suite(suite_from_text(text), results, engine, version="1")
    return read_results(folder)
