"""Results of a benchmark made up so that what a report has to say is known."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from pathlib import Path

from pushplan.bench.batch import run_suite
from pushplan.bench.processes.outcome import Figures, Outcome, Task
from pushplan.bench.storage.folder import ResultsFolder
from pushplan.bench.storage.results import Results, read_results
from pushplan.bench.suites.file import suite_from_text

Make = Callable[[Task], Outcome]

SUITE = """\
format: pushplan-suite/1
name: made up
problems: [one-box, two-crates]
planners: [auto, {name: rrt, label: slow}]
seeds: 12
limits: {time: 4 s}
"""


def solved(task: Task, cost: float, first: float, **more: object) -> Outcome:
    figures = Figures(
        found=True,
        valid=True,
        first_solution_s=first,
        path_cost=cost,
        seconds={"search": 2.0},
        min_margin=0.1,
        progress=((first, 2.0 * cost, 1), (3.0 * first, cost, 2)),
    )
    return Outcome(task.key, "ok", "", figures, seconds=2.1, host="here")


def typical(task: Task) -> Outcome:
    """`slow` is ten times slower and a tenth costlier; one run is invalid, one crashes, one has no plan."""
    slow = task.planner == "rrt"
    if slow and task.seed == 3 and task.name == "one-box":
        return Outcome(
            task.key, "invalid", "it <slips>", Figures(found=True, path_cost=0.5, first_solution_s=0.1)
        )
    if slow and task.seed == 4 and task.name == "one-box":
        return Outcome(task.key, "crash", "killed by SIGSEGV\nFatal <error>")
    if slow and task.seed == 5 and task.name == "one-box":
        return Outcome(task.key, "no plan", "there is none", Figures())
    noise = 1.0 + 0.01 * task.seed
    return solved(task, (3.3 if slow else 3.0) * noise, (0.5 if slow else 0.05) * noise)


def make(folder: Path, outcome: Make = typical, text: str = SUITE) -> Results:
    def engine(tasks: Iterable[Task]) -> Generator[Outcome]:
        for task in tasks:
            yield outcome(task)

    results = ResultsFolder(folder)
    with results.locked():
        run_suite(suite_from_text(text), results, engine, version="1")
    return read_results(folder)
