"""The suite file as a typed model: which problems, planners, sets and seeds a benchmark runs, within which limits."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, Discriminator, Field, Tag, WithJsonSchema, model_validator

from pushplan.bench.random_problems import parameters as p
from pushplan.scenario import fields as t
from pushplan.scenario.units import Quantity, fault
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
Number = Annotated[int, Quantity("a whole number", {}, 0, p.MOST_OBSTACLES, whole=True)]
Share = Annotated[float, Quantity("a share", {"%": 0.01}, 0.0, 1.0, "10 %")]
Factor = Annotated[float, Quantity("a factor", {}, 1.0, 100.0)]


def _form(value: Any) -> str:
    """Tell the longer way of writing something, a list or a mapping, from the shorter one."""
    return "<mapping>" if isinstance(value, dict | list | tuple | t.Strict) else "<word>"


def _ordered(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise fault(f"is [{ends[0]:.9g}, {ends[1]:.9g}]", "[low, high] with low <= high")
    return ends


def _different(values: tuple[Any, ...]) -> tuple[Any, ...]:
    for i, value in enumerate(values):
        if value in values[:i]:
            raise fault(f"holds {value} twice", "each value once")
    return values


def _one_of(known: OpenNames) -> Any:
    """Return the type of a name: one that is built in or of an installed package, or `module:attribute`."""

    def whose(value: Any) -> str:
        added = isinstance(value, str) and value not in tuple(known) and known.adds(value)
        return "<loaded>" if added else "<word>"

    built_in = Annotated[Literal[tuple(known)], Tag("<word>")]  # type: ignore[valid-type]
    added = Annotated[str, Tag("<loaded>")]
    schema = {"anyOf": [{"enum": list(known)}, {"type": "string", "pattern": f"^{PLACE.pattern}$"}]}
    return Annotated[built_in | added, Discriminator(whose), WithJsonSchema(schema)]


_PLANNERS, _SETS = planner_names(), stable_set_names()
_PlannerName, _SetName = _one_of(_PLANNERS), _one_of(_SETS)

Q = TypeVar("Q")
Range = Annotated[
    Annotated[Q, Tag("<word>")]
    | Annotated[tuple[Q, Q], t.Several(2, 2), AfterValidator(_ordered), Tag("<mapping>")],
    Discriminator(_form),
]
"""[low, high], or one number that is both."""

_NUMBERS = "a number, or [low, high]"


class Generator(t.Strict):
    """Random problems; what is left out has the default of `ProblemParameters`."""

    objects: Range[Number] | None = Field(default=None, description=f"{_NUMBERS}, from 1 to {p.MOST_OBJECTS}")
    shapes: Annotated[tuple[Literal[p.SHAPES], ...], t.Several(1, 2)] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"a list of {', '.join(p.SHAPES)}"
    )
    size: Range[t.Size] | None = Field(default=None, description=f"{_NUMBERS}, lengths in m")
    mass: Range[t.Mass] | None = Field(default=None, description=f"{_NUMBERS}, masses in kg")
    supports: Annotated[tuple[Literal[p.SUPPORTS], ...], t.Several(1, 2)] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"a list of {', '.join(p.SUPPORTS)}"
    )
    floor_friction: Range[t.FloorFriction] | None = Field(default=None, description=f"{_NUMBERS}")
    contact_friction: Range[t.Friction] | None = Field(default=None, description=f"{_NUMBERS}")
    pusher_friction: Range[t.Friction] | None = Field(default=None, description=f"{_NUMBERS}")
    drives: Annotated[tuple[Literal[p.DRIVES], ...], t.Several(1, 3)] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"a list of {', '.join(p.DRIVES)}"
    )
    turning_radius: t.Size | None = Field(default=None, description="a length in m")
    workspace: Range[t.Size] | None = Field(default=None, description=f"{_NUMBERS}, lengths in m")
    room: t.Size | None = Field(default=None, description="a length in m")
    obstacles: Range[Number] | None = Field(
        default=None, description=f"{_NUMBERS}, from 0 to {p.MOST_OBSTACLES}"
    )
    obstacle_shapes: Annotated[tuple[Literal[p.OBSTACLE_SHAPES], ...], t.Several(1, 3)] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"a list of {', '.join(p.OBSTACLE_SHAPES)}"
    )
    obstacle_size: Range[t.Size] | None = Field(default=None, description=f"{_NUMBERS}, lengths in m")
    density: Range[Share] | None = Field(default=None, description=f"{_NUMBERS}, shares of the workspace")
    gap: Range[Factor] | None = Field(default=None, description=f"{_NUMBERS}, in widths of the chain")
    robot: Range[t.Size] | None = Field(
        default=None, description=f"{_NUMBERS}, lengths in m: how far the robot is from the chain at first"
    )


class Problem(t.Strict):
    """A scenario, the blocks of a file of ReloPush, or `count` random problems with the seeds from `seed` on."""

    scenario: Annotated[str, Field(strict=True, min_length=1)] | None = Field(
        default=None, description="a packaged scenario, or a file relative to the suite's folder"
    )
    format: Literal["relopush"] | None = Field(
        default=None, description="relopush for a file of ReloPush: each of its blocks is a problem"
    )
    walls: Literal["loose", "strict"] | None = Field(
        default=None,
        description="loose or strict: whether the walls of ReloPush let the robot out of the room",
    )
    generate: Generator | None = Field(default=None, description="{objects: ..., obstacles: ..., ...}")
    name: t.Name | None = Field(default=None, description="what reports call it")
    count: Count | None = Field(
        default=None, description="a whole number of random problems, or of instances of a file of ReloPush"
    )
    seed: t.Seed | None = Field(default=None, description="seed of the first random problem")

    @model_validator(mode="after")
    def _one(self) -> Problem:
        t.require_one(self, "scenario", "generate")
        if self.format is not None:
            self._of_relopush()
        elif self.walls is not None:
            raise fault("has walls but no format", "{scenario: FILE, format: relopush, walls: strict}")
        elif self.generate is None and (self.count is not None or self.seed is not None):
            raise fault("has count or seed but generates nothing", "{scenario: ..., name: ...}")
        if self.generate is not None and self.name is None:
            raise fault("generates problems without a name", "{name: ..., generate: {...}, count: ...}")
        return self

    def _of_relopush(self) -> None:
        if self.generate is not None or self.seed is not None:
            raise fault(
                "has a format but generates problems", "{scenario: FILE, format: relopush, count: ...}"
            )


class Planner(t.Strict):
    """A planner with settings; times and iterations here go before those of `limits`."""

    name: _PlannerName = Field(description=f"one of {_PLANNERS.words}")  # type: ignore[valid-type]
    label: t.Name | None = Field(default=None, description="what reports call it")
    first: bool = Field(default=False, strict=True, description="true to stop at the first path, or false")
    time: t.Duration | None = Field(default=None, description="a time in s")
    iterations: Iterations | None = Field(default=None, description="a whole number")
    cost: Literal[names.COSTS] | None = Field(  # type: ignore[valid-type]
        default=None, description=f"one of {', '.join(names.COSTS)}; without it the scenario's own"
    )
    gap: t.Gap | None = Field(
        default=None, description="a share from 0 to 100; without it the scenario's own"
    )


class LimitSection(t.Strict):
    """What a run may use."""

    time: t.Duration = Field(default=2.0, description="planning time in s")
    iterations: Iterations | None = Field(default=None, description="a whole number")
    run: t.Duration | None = Field(default=None, description="time in s after which a run is killed")
    memory: Memory = Field(default=2000.0, description="memory in MB that a run may allocate")


class SuiteFile(t.Strict):
    """A benchmark."""

    format: Literal["pushplan-suite/1"] = Field(description=SUITE_FORMAT)
    name: t.Name | None = Field(default=None, description="a name")
    problems: Annotated[
        tuple[
            Annotated[
                Annotated[str, Field(strict=True, min_length=1), Tag("<word>")]
                | Annotated[Problem, Tag("<mapping>")],
                Discriminator(_form),
            ],
            ...,
        ],
        t.Several(1, MOST_PROBLEMS),
    ] = Field(
        description="a list of scenarios (packaged or files) and of {name: ..., generate: {...}, count: ...}"
    )
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
    ) = Field(
        default=None,
        description=f"a list of {_SETS.words}; without it each scenario's own",
    )
    seeds: Annotated[
        Annotated[Count, Tag("<word>")]
        | Annotated[
            tuple[t.Seed, ...], t.Several(1, MOST_SEEDS), AfterValidator(_different), Tag("<mapping>")
        ],
        Discriminator(_form),
    ] = Field(default=10, description="a number of seeds, or a list of them")
    trials: Trials | None = Field(
        default=None, description="a whole number of sampled worlds that every plan is tried in"
    )
    limits: LimitSection = Field(
        default_factory=LimitSection, description="{time: ..., memory: ..., run: ...}"
    )
