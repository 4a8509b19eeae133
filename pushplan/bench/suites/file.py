"""Read suite files, with everything wrong told at once, as scenario files are."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from pushplan.bench.suites.problems import make_problems
from pushplan.bench.suites.schema import LimitSection, Planner, SuiteFile
from pushplan.bench.suites.suite import PlannerSetup, Suite
from pushplan.errors import Finding, ScenarioError
from pushplan.scenario.source import MOST_BYTES, DocumentError, Source
from pushplan.scenario.validation import nearest, validate

_SUFFIX = ".yaml"


class SuiteError(ScenarioError):
    """A suite is wrong; `findings` holds everything found."""


def suite_names() -> tuple[str, ...]:
    """Return the names of the packaged suites, in alphabetical order."""
    found = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in found if name.endswith(_SUFFIX)))


def suite_text(name: str) -> str:
    """Return the file of a packaged suite."""
    return (_folder() / (name + _SUFFIX)).read_text(encoding="utf-8")


def load_suite(source: str | Path) -> Suite:
    """Read a suite from a file, or a packaged one by its name, with all its problems.

    Raises:
        SuiteError: With everything found wrong, in the suite and in the scenarios that it names.
    """
    path = Path(source)
    if isinstance(source, str) and source in suite_names() and not path.is_file():
        path = Path(str(_folder() / (source + _SUFFIX)))
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        raise SuiteError(str(source), [Finding("", _unreadable(source, error))]) from error
    return suite_from_text(data, path)


def suite_from_text(text: str | bytes, path: str | Path = "suite.yaml") -> Suite:
    """Read a suite from a text.

    Args:
        text: What a suite file holds.
        path: What messages call it; scenario files are looked for in its folder.

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
        problems = make_problems(file, Path(path).parent, report)
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
        run_seconds=file.limits.run,
        megabytes=file.limits.memory,
        trials=file.trials or 0,
    )


def _planners(file: SuiteFile, report: Source) -> tuple[PlannerSetup, ...]:
    """Return the planners, and report those that are called alike or do the same."""
    made: list[PlannerSetup] = []
    for i, stated in enumerate(file.planners):
        setup = _planner(stated, file.limits)
        _report_twin(setup, made, i, report)
        made.append(setup)
    return tuple(made)


def _report_twin(setup: PlannerSetup, others: list[PlannerSetup], i: int, report: Source) -> None:
    for j, other in enumerate(others):
        if setup.settings == other.settings:
            report.error(("planners", i), f"is the same as planners[{j}]; leave one of them out")
            return
        if setup.label == other.label:
            report.error(
                ("planners", i), f"is called '{setup.label}' like planners[{j}]; give it another label"
            )
            return


def _planner(stated: str | Planner, limits: LimitSection) -> PlannerSetup:
    if isinstance(stated, str):
        return PlannerSetup(stated, stated, False, limits.time, limits.iterations)
    return PlannerSetup(
        label=stated.label or stated.name,
        name=stated.name,
        first=stated.first,
        time=stated.time or limits.time,
        iterations=stated.iterations or limits.iterations,
        cost=stated.cost,
        gap=stated.gap,
    )


def _unreadable(source: str | Path, error: Exception) -> str:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    text = f"cannot read the file: {reason}"
    if isinstance(error, FileNotFoundError) and isinstance(source, str) and Path(source).name == source:
        known = list(suite_names())
        text += (
            f"; no packaged suite is called so either{nearest(source, known)} there are {', '.join(known)}"
        )
    return text


def _folder() -> Traversable:
    return files("pushplan") / "suites"
