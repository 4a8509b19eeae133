"""Settings of the planners, and callbacks during planning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from inspect import Parameter, signature
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar

from pushplan.errors import PlanningError
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import plain_number
from pushplan.util.names import AUTO, COSTS

if TYPE_CHECKING:
    from pushplan.plans.plan import Improvement
    from pushplan.sets.stable_set import StableSet

Margin = float | Literal["auto"]


def _ignore(_: object) -> None:
    """Do nothing."""


def _never() -> bool:
    return False


@dataclass(frozen=True)
class Observer:
    """Callbacks during planning, such as `Observer(improved=found.append)`.

    Attributes:
        message: Function that receives messages for the user, such as warnings.
        improved: Function that receives every better plan.
        cancelled: Function that returns whether to stop now, called many times a second; the best plan so far is
            then the result.
    """

    message: Callable[[str], None] = field(default=_ignore, repr=False)
    improved: Callable[[Improvement], None] = field(default=_ignore, repr=False)
    cancelled: Callable[[], bool] = field(default=_never, repr=False)

    def __init_subclass__(cls) -> None:
        """Refuse subclasses: their methods would never be called."""
        raise TypeError(
            f"{cls.__name__}: pass functions instead of a subclass: Observer(improved=..., cancelled=...)"
        )


class PlanOptions(TypedDict, total=False):
    """Keywords of `PlanSettings` for functions that pass them on; `named` shows them in `help()`."""

    planner: str | Callable[[Any], Any] | None
    stable_set: str | type[StableSet] | None
    seed: int | None
    time_limit: float | None
    first: bool
    iterations: int | None
    cost: str | None
    margin: Margin | None
    gap: float | None
    observer: Observer


@dataclass(frozen=True)
class PlanSettings:
    """Settings of the planners; None leaves a setting to the scenario.

    Attributes:
        planner: Name of the planner, `module:attribute`, or a function from a space information to an
            `ompl.base.Planner`.
        stable_set: Stable set that limits the pusher's twists: its name, `module:attribute`, or a subclass of
            `StableSet`.
        seed: Seed of the random numbers. The same seed gives the same plan unless the time limit ends the search.
        time_limit: Wall-clock limit of preparation and search, s. Execution, validation and the diagnosis of a
            failure take additional time.
        first: Whether to stop at the first plan instead of improving it.
        iterations: Largest number of iterations of the search. If it ends the search before the time limit does, the
            same seed gives the same plan on every machine.
        cost: Quantity that ranks paths, one of `names.COSTS`.
        margin: Lower limit of the margins of twists; `auto` as in `StabilitySettings`.
        gap: Optimality gap at which the search stops, as a share.
        observer: Callbacks during planning.
    """

    planner: str | Callable[[Any], Any] | None = None
    stable_set: str | type[StableSet] | None = None
    seed: int | None = None
    time_limit: float | None = None
    first: bool = False
    iterations: int | None = None
    cost: str | None = None
    margin: Margin | None = None
    gap: float | None = None
    observer: Observer = Observer()

    def __post_init__(self) -> None:
        for name in ("seed", "iterations", "time_limit", "gap", "margin", "first"):
            object.__setattr__(self, name, plain_number(getattr(self, name)))
        number = isinstance(self.margin, Real) and not isinstance(self.margin, bool)
        if self.margin is not None and self.margin != AUTO and not (number and 0.0 <= float(self.margin) < 1.0):
            raise PlanningError(f"the margin is {self.margin}; allowed: {AUTO!r} or a number from 0 to below 1")
        if not isinstance(self.observer, Observer):
            raise PlanningError(f"observer is a {type(self.observer).__name__}; allowed: a pushplan.Observer")
        if self.cost is not None and self.cost not in COSTS:
            raise PlanningError(f"{self.cost!r} is not a cost; allowed: {', '.join(COSTS)}")
        for name in ("seed", "iterations", "time_limit", "gap"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or not isinstance(value, Real)):
                raise PlanningError(f"{name} is {value!r}; allowed: a number")
        if self.seed is not None and not (0 <= self.seed < 2**32 and float(self.seed).is_integer()):
            raise PlanningError(f"the seed is {self.seed}; allowed: a whole number from 0 to 2^32 - 1")
        count = self.iterations
        if count is not None and not (1 <= count < 2**63 and float(count).is_integer()):
            raise PlanningError(f"iterations is {count}; allowed: a whole number from 1 to below 2^63")
        if self.time_limit is not None and not 0.0 <= self.time_limit < 1e6:
            raise PlanningError(f"the time limit is {self.time_limit} s; allowed: from 0 to below 1e6 s")
        if self.gap is not None and not 0.0 <= self.gap < float("inf"):
            raise PlanningError(f"the gap is {self.gap}; allowed: a finite share from 0")

    @property
    def set_name(self) -> str | None:
        """Name of the stable set; None leaves it to the scenario."""
        chosen = self.stable_set
        return chosen if chosen is None or isinstance(chosen, str) else chosen.name

    def completed(self, scenario: Scenario) -> PlanSettings:
        """Return the settings, with missing values from a scenario."""

        def chosen(own: Any, other: Any) -> Any:
            return other if own is None else own

        of = _checked(scenario).planner
        return replace(
            self,
            planner=chosen(self.planner, of.name),
            stable_set=chosen(self.stable_set, scenario.stability.set),
            seed=chosen(self.seed, of.seed),
            time_limit=chosen(self.time_limit, of.time_limit),
            cost=chosen(self.cost, of.cost),
            margin=chosen(self.margin, scenario.stability.margin),
            gap=chosen(self.gap, of.gap),
        )

    def applied(self, scenario: Scenario) -> Scenario:
        """Return a scenario with the margin and the cost of these settings.

        Raises:
            PlanningError: If the margin is 0 and the limits include inertia.
        """
        margin = _checked(scenario).stability.margin if self.margin is None else self.margin
        if margin == 0.0 and scenario.pusher.limits.contact == "dynamic":
            raise PlanningError(
                "the margin is 0, but contacts need some margin for inertia; allowed: a margin above 0, or "
                "pusher.limits.contact: quasi-static"
            )
        cost = scenario.planner.cost if self.cost is None else self.cost
        return scenario.with_margin(margin).with_planner(cost=cost)


def _checked(scenario: object) -> Scenario:
    if isinstance(scenario, Scenario):
        return scenario
    what = f"{scenario!r:.40} is a {type(scenario).__name__}"
    raise PlanningError(f"{what}; allowed: a scenario, its file, or the name of a packaged scenario")


F = TypeVar("F", bound=Callable[..., object])


def named(function: F) -> F:
    """Show every keyword in the signature of a function that takes `**options: Unpack[PlanOptions]`."""
    found = signature(function)
    own = [one for one in found.parameters.values() if one.kind is not Parameter.VAR_KEYWORD]
    how, kinds = Parameter.KEYWORD_ONLY, PlanSettings.__annotations__
    more = [Parameter(x.name, how, default=x.default, annotation=kinds[x.name]) for x in fields(PlanSettings)]
    function.__signature__ = found.replace(parameters=[*own, *more])  # type: ignore[attr-defined]
    return function
