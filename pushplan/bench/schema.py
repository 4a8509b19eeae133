"""The suite file as a typed model: problems, planners, stable sets, seeds and limits of a benchmark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, WithJsonSchema, model_validator

from pushplan.scenario import fields as t
from pushplan.scenario import units
from pushplan.scenario.schema import finished
from pushplan.scenario.units import Quantity, fault, friction
from pushplan.util import names
from pushplan.util.naming import PLACE, PLANNER_NAMES, STABLE_SET_NAMES, OpenNames

SUITE_FORMAT = "pushplan-suite/1"
"""Value of `format` in a suite file."""

MOST_PROBLEMS = 10_000
MOST_SEEDS = 100_000

_MEMORY = {"MB": 1.0, "GB": 1e3, "MiB": 1.048576, "GiB": 1073.741824}

Memory = Annotated[float, Quantity("an amount of memory", _MEMORY, 1.0, 1e6, "2 GB")]
Iterations = Annotated[int, Quantity("a whole number", {}, 1, 1e12, whole=True)]
Trials = Annotated[int, Quantity("a whole number", {}, 1, 100_000, whole=True)]
Count = Annotated[int, Quantity("a whole number", {}, 1, MOST_SEEDS, whole=True)]


def _form(value: Any) -> str:
    """Return the tag of a value's form: a list or mapping, or a single word."""
    return "<mapping>" if isinstance(value, dict | list | tuple | t.Strict) else "<word>"


def _as_list(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _pair(value: Any) -> Any:
    low, high = value if isinstance(value, tuple) else (value, value)
    if low > high:
        raise fault(f"is [{low:.9g}, {high:.9g}]", "[low, high] with low <= high")
    return low, high


def _different(values: Sequence[Any]) -> Sequence[Any]:
    for i, value in enumerate(values):
        if value in values[:i]:
            raise fault(f"holds {value} twice", "each value once")
    return values


Q = TypeVar("Q")
if TYPE_CHECKING:
    Range = Annotated[tuple[Q, Q], "after validation"]
else:
    Range = Annotated[
        Annotated[Q, Tag("<word>")] | Annotated[tuple[Q, Q], t.Several(2, 2), Tag("<mapping>")],
        Discriminator(_form),
        BeforeValidator(_as_list),
        AfterValidator(_pair),
    ]
"""[low, high], or one number for both."""

Choice = Annotated[tuple[Q, ...], t.Several(1, 3), BeforeValidator(_as_list)]


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


class ProblemParameters(t.Strict):
    """Parameters of random problems: ranges [low, high] (inclusive) or single numbers, and lists of words."""

    objects: Range[_OBJECTS] = Field(default=(1, 5), description=f"{_NUMBERS}, from 1 to 8")
    shapes: Choice[Literal["box", "polygon"]] = Field(
        default=("box", "polygon"), description="a list of box, polygon"
    )
    size: Range[Annotated[float, _number(0.01, 10.0, "m")]] = Field(
        default=(0.08, 0.2), description=f"{_NUMBERS}, lengths of objects in m"
    )
    mass: Range[Annotated[float, _number(1e-3, 1e3, "kg")]] = Field(
        default=(0.3, 3.0), description=f"{_NUMBERS}, masses in kg"
    )
    supports: Choice[Literal["uniform", "feet"]] = Field(default=("uniform",), description="a list of uniform, feet")
    floor_friction: Range[Annotated[float, friction(1e-3)]] = Field(default=(0.2, 0.5), description=_NUMBERS)
    contact_friction: Range[Annotated[float, friction(0.0)]] = Field(default=(0.2, 0.5), description=_NUMBERS)
    pusher_friction: Range[Annotated[float, friction(0.0)]] = Field(default=(0.3, 0.7), description=_NUMBERS)
    drives: Choice[Literal["omnidirectional", "differential", "car"]] = Field(
        default=("omnidirectional",), description="a list of omnidirectional, differential, car"
    )
    turning_radius: Annotated[float, _number(1e-3, 100.0, "m")] = Field(
        default=1.0,
        description="a length in m: distance of the turning centres to both sides. If a few draws give no chain that "
        "turns so tightly (long chains, wheels), workspace and obstacles grow in proportion",
    )
    workspace: Range[Annotated[float, _number(0.1, 1e3, "m")]] = Field(
        default=(3.0, 4.0), description=f"{_NUMBERS}, sides of the square workspace in m"
    )
    room: Annotated[float, _number(1e-3, 100.0, "m")] = Field(
        default=0.3, description="a free length in m ahead of the start and behind the goal"
    )
    obstacles: Range[_OBSTACLES] = Field(
        default=(0, 30), description=f"{_NUMBERS}, from 0 to 1000; obstacles without free space are left out"
    )
    obstacle_shapes: Choice[Literal["box", "polygon", "circle"]] = Field(
        default=("box", "polygon", "circle"), description="a list of box, polygon, circle"
    )
    obstacle_size: Range[Annotated[float, _number(0.005, 100.0, "m")]] = Field(
        default=(0.1, 0.4), description=f"{_NUMBERS}, lengths of obstacles in m"
    )
    density: Range[Annotated[float, _number(0.0, 0.9, "%")]] | None = Field(
        default=None, description=f"{_NUMBERS}, largest shares of the workspace that obstacles cover"
    )
    gap: Range[Annotated[float, _number(1.05, 100.0)]] | None = Field(
        default=None, description=f"{_NUMBERS}, widths of a gap in a wall, as multiples of the chain's width"
    )
    robot: Range[Annotated[float, _number(0.05, 100.0, "m")]] | None = Field(
        default=None,
        description=f"{_NUMBERS}, initial distances of the robot from the chain in m, for multi-push plans",
    )


class StatedProblem(t.Strict):
    """A scenario, or `count` random problems whose seeds start at `seed`."""

    scenario: Annotated[str, Field(strict=True, min_length=1)] | None = Field(
        default=None, description="a packaged scenario, or a file relative to the suite's folder"
    )
    generate: ProblemParameters | None = Field(default=None, description="{objects: ..., obstacles: ..., ...}")
    name: t.Name | None = Field(default=None, description="a name for reports")
    count: Count | None = Field(default=None, description="a whole number of random problems")
    seed: t.Seed | None = Field(default=None, description="seed of the first random problem")

    @model_validator(mode="before")
    @classmethod
    def _not_of_relopush(cls, value: Any) -> Any:
        if isinstance(value, dict) and "format" in value:
            raise fault(
                "has a format: suites no longer read files of ReloPush",
                "scenario files, as `python benchmarks/relopush.py FOLDER --scenarios DIR` writes them",
            )
        return value

    @model_validator(mode="after")
    def _one(self) -> StatedProblem:
        given = [key for key in ("scenario", "generate") if getattr(self, key) is not None]
        if len(given) != 1:
            found = f"has {' and '.join(given)}" if given else "has none of scenario, generate"
            raise fault(found, "exactly one of scenario, generate")
        if self.generate is None and (self.count is not None or self.seed is not None):
            raise fault("has count or seed but generates nothing", "{scenario: ..., name: ...}")
        if self.generate is not None and self.name is None:
            raise fault("generates problems without a name", "{name: ..., generate: {...}, count: ...}")
        return self


def _one_of(known: OpenNames) -> Any:
    """Return the type of an extensible name: built in, from an installed package, or `module:attribute`."""

    def whose(value: Any) -> str:
        added = isinstance(value, str) and value not in tuple(known) and known.adds(value)
        return "<loaded>" if added else "<word>"

    built_in = Annotated[Literal[tuple(known)], Tag("<word>")]  # type: ignore[valid-type]
    added = Annotated[str, Tag("<loaded>")]
    schema = {"anyOf": [{"enum": list(known)}, {"type": "string", "pattern": f"^{PLACE.pattern}$"}]}
    return Annotated[built_in | added, Discriminator(whose), WithJsonSchema(schema)]


_PLANNERS, _SETS = PLANNER_NAMES, STABLE_SET_NAMES
_PlannerName, _SetName = Annotated[_one_of(_PLANNERS), BeforeValidator(t.still_here)], _one_of(_SETS)


class Planner(t.Strict):
    """A planner with settings; its time and iterations override those of `limits`."""

    name: _PlannerName = Field(description=f"one of {_PLANNERS.words}")  # type: ignore[valid-type]
    label: t.Name | None = Field(default=None, description="a name for reports")
    first: bool = Field(default=False, strict=True, description="true to stop at the first plan, or false")
    time: t.Duration | None = Field(default=None, description="a time in s")
    iterations: Iterations | None = Field(default=None, description="a whole number")
    cost: Literal[names.COSTS] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"one of {', '.join(names.COSTS)}; without it the scenario's own"
    )
    gap: t.Gap | None = Field(default=None, description="a share from 0 to 100; without it the scenario's own")


class LimitSection(t.Strict):
    """Limits of a run."""

    time: t.Duration = Field(default=2.0, description="planning time in s")
    iterations: Iterations | None = Field(default=None, description="a whole number")
    run: t.Duration | None = Field(default=None, description="time in s after which a run is killed")
    memory: Memory = Field(default=2000.0, description="memory in MB that a run can allocate")


class SuiteFile(t.Strict):
    """A benchmark."""

    format: Literal["pushplan-suite/1"] = Field(description=SUITE_FORMAT)
    name: t.Name | None = Field(default=None, description="a name")
    problems: Annotated[
        tuple[
            Annotated[
                Annotated[str, Field(strict=True, min_length=1), Tag("<word>")]
                | Annotated[StatedProblem, Tag("<mapping>")],
                Discriminator(_form),
            ],
            ...,
        ],
        t.Several(1, MOST_PROBLEMS),
    ] = Field(description="a list of scenarios (packaged or files) and of {name: ..., generate: {...}, count: ...}")
    planners: Annotated[
        tuple[
            Annotated[
                Annotated[_PlannerName, Tag("<word>")] | Annotated[Planner, Tag("<mapping>")],  # type: ignore[valid-type]
                Discriminator(_form),
            ],
            ...,
        ],
        t.Several(1, 100),
    ] = Field(default=("auto",), description=f"a list of {_PLANNERS.words}, or of {{name: ..., ...}}")
    sets: (
        Annotated[
            tuple[_SetName, ...],  # type: ignore[valid-type]
            t.Several(1, 100),
            AfterValidator(_different),
        ]
        | None
    ) = Field(default=None, description=f"a list of {_SETS.words}; without it each scenario's own")
    seeds: Annotated[
        Annotated[Count, Tag("<word>")]
        | Annotated[tuple[t.Seed, ...], t.Several(1, MOST_SEEDS), AfterValidator(_different), Tag("<mapping>")],
        Discriminator(_form),
    ] = Field(default=10, description="a number of seeds, or a list of them")
    trials: Trials | None = Field(default=None, description="a whole number of Monte Carlo samples for every plan")
    limits: LimitSection = t.with_defaults(LimitSection, "{time: ..., memory: ..., run: ...}")


def suite_schema() -> dict[str, Any]:
    """Return the JSON Schema of suites, without the names that installed packages add."""
    return finished(SuiteFile.model_json_schema(), "pushplan benchmark suite")
