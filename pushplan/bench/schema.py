"""The suite file as a typed model: which problems, planners, sets and seeds a benchmark runs, within which limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar

from pushplan.scenario import fields as t
from pushplan.scenario import units
from pushplan.scenario.json_schema import finished
from pushplan.scenario.records import (
    After,
    Chosen,
    Faults,
    Record,
    Several,
    Wrong,
    json_schema,
    key,
)
from pushplan.scenario.source import Place
from pushplan.scenario.units import NotAllowedError, Quantity, Stated, friction, nearest, show
from pushplan.util import names
from pushplan.util.naming import PLACE, OpenNames, planner_names, stable_set_names

SUITE_FORMAT = "pushplan-suite/1"
"""What `format` says in a suite file."""

MOST_PROBLEMS = 10_000
MOST_SEEDS = 100_000

_MEMORY = {"MB": 1.0, "GB": 1e3, "MiB": 1.048576, "GiB": 1073.741824}

Memory = Annotated[float, Quantity("an amount of memory", _MEMORY, 1.0, 1e6, "2 GB")]
Iterations = Annotated[int, Quantity("a whole number", {}, 1, 1e12, whole=True)]
Trials = Annotated[int, Quantity("a whole number", {}, 1, 100_000, whole=True)]
Count = Annotated[int, Quantity("a whole number", {}, 1, MOST_SEEDS, whole=True)]


_WORD_OR_MORE = Chosen(lambda value: int(isinstance(value, dict | list)))
"""Tells the shorter way of writing something, the first form, from the longer one, a list or a mapping."""


def _pair(value: Any) -> Any:
    low, high = value if isinstance(value, tuple) else (value, value)
    if low > high:
        raise NotAllowedError(f"is [{low:.9g}, {high:.9g}]", "[low, high] with low <= high")
    return low, high


def _different(values: Sequence[Any]) -> Sequence[Any]:
    for i, value in enumerate(values):
        if value in values[:i]:
            raise NotAllowedError(f"holds {value} twice", "each value once")
    return values


Q = TypeVar("Q")
if TYPE_CHECKING:
    Range = Annotated[tuple[Q, Q], "once it is read"]
else:
    Range = Annotated[Q | Annotated[tuple[Q, Q], Several(2, 2)], _WORD_OR_MORE, After(_pair)]
"""[low, high], or one number that is both."""

Choice = Annotated[tuple[Q, ...], Several(1, 3)]


def _number(low: float, high: float, dimension: str = "", whole: bool = False) -> Quantity:
    kinds: dict[str, tuple[str, dict[str, float], str]] = {
        "": ("a whole number" if whole else "a number", {}, ""),
        "m": ("a length", dict(units.LENGTH), "5 mm"),
        "kg": ("a mass", dict(units.MASS), "800 g"),
        "%": ("a share", {"%": 0.01}, "10 %"),
    }
    noun, known, example = kinds[dimension]
    return Quantity(noun, known, low, high, example, whole=whole)


_OBJECTS = Annotated[int, _number(1, 8, whole=True)]
_OBSTACLES = Annotated[int, _number(0, 1000, whole=True)]
_NUMBERS = "a number, or [low, high]"


class ProblemParameters(Record):
    """Random problems: ranges [low, high], both included, or single numbers, and words to choose from."""

    objects: Range[_OBJECTS] = key(default=(1, 5), description=f"{_NUMBERS}, from 1 to 8")
    shapes: Choice[Literal["box", "polygon"]] = key(
        default=("box", "polygon"), description="a list of box, polygon"
    )
    size: Range[Annotated[float, _number(0.01, 10.0, "m")]] = key(
        default=(0.08, 0.2), description=f"{_NUMBERS}, lengths of objects in m"
    )
    mass: Range[Annotated[float, _number(1e-3, 1e3, "kg")]] = key(
        default=(0.3, 3.0), description=f"{_NUMBERS}, masses in kg"
    )
    supports: Choice[Literal["uniform", "feet"]] = key(
        default=("uniform",), description="a list of uniform, feet"
    )
    floor_friction: Range[Annotated[float, friction(1e-3)]] = key(default=(0.2, 0.5), description=_NUMBERS)
    contact_friction: Range[Annotated[float, friction(0.0)]] = key(default=(0.2, 0.5), description=_NUMBERS)
    pusher_friction: Range[Annotated[float, friction(0.0)]] = key(default=(0.3, 0.7), description=_NUMBERS)
    drives: Choice[Literal["omnidirectional", "differential", "car"]] = key(
        default=("omnidirectional",), description="a list of omnidirectional, differential, car"
    )
    turning_radius: Annotated[float, _number(1e-3, 100.0, "m")] = key(
        default=1.0,
        description="a length in m: how far to both sides the centres of turns are, or as near to it as a few draws "
        "give (long chains before wheels); workspace and obstacles are larger then, in proportion",
    )
    workspace: Range[Annotated[float, _number(0.1, 1e3, "m")]] = key(
        default=(3.0, 4.0), description=f"{_NUMBERS}, sides of the square workspace in m"
    )
    room: Annotated[float, _number(1e-3, 100.0, "m")] = key(
        default=0.3, description="a length in m that is free ahead of the start and behind the goal"
    )
    obstacles: Range[_OBSTACLES] = key(
        default=(0, 30), description=f"{_NUMBERS}, from 0 to 1000; those that find no place are left out"
    )
    obstacle_shapes: Choice[Literal["box", "polygon", "circle"]] = key(
        default=("box", "polygon", "circle"), description="a list of box, polygon, circle"
    )
    obstacle_size: Range[Annotated[float, _number(0.005, 100.0, "m")]] = key(
        default=(0.1, 0.4), description=f"{_NUMBERS}, lengths of obstacles in m"
    )
    density: Range[Annotated[float, _number(0.0, 0.9, "%")]] | None = key(
        default=None, description=f"{_NUMBERS}, shares of the workspace at which no more obstacles are added"
    )
    gap: Range[Annotated[float, _number(1.05, 100.0)]] | None = key(
        default=None, description=f"{_NUMBERS}, widths of a gap in a wall, in widths of the chain"
    )
    robot: Range[Annotated[float, _number(0.05, 100.0, "m")]] | None = key(
        default=None,
        description=f"{_NUMBERS}, lengths in m: how far the robot is from the chain at first, for multi-push plans",
    )


class StatedProblem(Record):
    """A scenario, or `count` random problems with the seeds from `seed` on."""

    scenario: t.FileName | None = key(
        default=None, description="a packaged scenario, or a file relative to the suite's folder"
    )
    generate: ProblemParameters | None = key(default=None, description="{objects: ..., obstacles: ..., ...}")
    name: t.Name | None = key(default=None, description="what reports call it")
    count: Count | None = key(default=None, description="a whole number of random problems")
    seed: t.Seed | None = key(default=None, description="seed of the first random problem")

    @classmethod
    def read(cls, value: Any, place: Place, faults: Faults) -> Self | None:
        """Return the problem that a file states; see `Record`."""
        if isinstance(value, dict) and "format" in value:
            fault = NotAllowedError(
                "has a format: suites do not read files of ReloPush any more",
                "scenario files, which `python benchmarks/relopush.py FOLDER --scenarios DIR` writes",
            )
            faults.append(Wrong(place, str(fault)))
            return None
        return super().read(value, place, faults)

    def checked(self) -> Self:
        """Refuse values that do not go together."""
        t.require_one(self, "scenario", "generate")
        if self.generate is None and (self.count is not None or self.seed is not None):
            raise NotAllowedError("has count or seed but generates nothing", "{scenario: ..., name: ...}")
        if self.generate is not None and self.name is None:
            raise NotAllowedError(
                "generates problems without a name", "{name: ..., generate: {...}, count: ...}"
            )
        return self


@dataclass(frozen=True)
class _OneOf(Stated):
    """A name: one that is built in or of an installed package, or `module:attribute`."""

    known: OpenNames

    def read(self, value: Any) -> str:
        """Return the name."""
        if value in self.known:
            return str(value)
        raise NotAllowedError(
            show(value), hint=nearest(value, tuple(self.known)) if isinstance(value, str) else ";"
        )

    def schema(self) -> dict[str, Any]:
        """Return its JSON Schema, which does not know names that installed packages add."""
        return {"anyOf": [{"enum": list(self.known)}, {"type": "string", "pattern": f"^{PLACE.pattern}$"}]}


_PLANNERS, _SETS = planner_names(), stable_set_names()
_PlannerName = Annotated[str, _OneOf(_PLANNERS)]
_SetName = Annotated[str, _OneOf(_SETS)]


class Planner(Record):
    """A planner with settings; times and iterations here go before those of `limits`."""

    name: _PlannerName = key(description=f"one of {_PLANNERS.words}")
    label: t.Name | None = key(default=None, description="what reports call it")
    first: bool = key(default=False, description="true to stop at the first path, or false")
    time: t.Duration | None = key(default=None, description="a time in s")
    iterations: Iterations | None = key(default=None, description="a whole number")
    cost: Literal[names.COSTS] | None = key(  # type: ignore[valid-type]
        default=None, description=f"one of {', '.join(names.COSTS)}; without it the scenario's own"
    )
    gap: t.Gap | None = key(default=None, description="a share from 0 to 100; without it the scenario's own")


class LimitSection(Record):
    """What a run may use."""

    time: t.Duration = key(default=2.0, description="planning time in s")
    iterations: Iterations | None = key(default=None, description="a whole number")
    run: t.Duration | None = key(default=None, description="time in s after which a run is killed")
    memory: Memory = key(default=2000.0, description="memory in MB that a run may allocate")


class SuiteFile(Record):
    """A benchmark."""

    format: Literal["pushplan-suite/1"] = key(description=SUITE_FORMAT)
    name: t.Name | None = key(default=None, description="a name")
    problems: Annotated[
        tuple[Annotated[t.FileName | StatedProblem, _WORD_OR_MORE], ...], Several(1, MOST_PROBLEMS)
    ] = key(
        description="a list of scenarios (packaged or files) and of {name: ..., generate: {...}, count: ...}"
    )
    planners: Annotated[tuple[Annotated[_PlannerName | Planner, _WORD_OR_MORE], ...], Several(1, 100)] = key(
        default=("auto",), description=f"a list of {_PLANNERS.words}, or of {{name: ..., ...}}"
    )
    sets: Annotated[tuple[_SetName, ...], Several(1, 100), After(_different)] | None = key(
        default=None, description=f"a list of {_SETS.words}; without it each scenario's own"
    )
    seeds: Annotated[
        Count | Annotated[tuple[t.Seed, ...], Several(1, MOST_SEEDS), After(_different)], _WORD_OR_MORE
    ] = key(default=10, description="a number of seeds, or a list of them")
    trials: Trials | None = key(
        default=None, description="a whole number of Monte Carlo samples that every plan is tried in"
    )
    limits: LimitSection = key(default_factory=LimitSection, description="{time: ..., memory: ..., run: ...}")


def suite_schema() -> dict[str, Any]:
    """Return the JSON Schema of suites; it does not know names that installed packages add."""
    definitions: dict[str, Any] = {}
    json_schema(SuiteFile, definitions)
    return finished({"$defs": definitions, **definitions.pop("SuiteFile")}, "pushplan benchmark suite")
