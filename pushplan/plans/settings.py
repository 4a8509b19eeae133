"""How to plan: what a caller may ask for, and who is told while it goes on."""

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
    """Take what nobody wants to hear."""


def _never() -> bool:
    return False


@dataclass(frozen=True)
class Observer:
    """Who is told while a plan is made, and may end it: functions, as `Observer(improved=found.append)`.

    Attributes:
        message: Called with sentences for the user: what takes long, warnings.
        improved: Called with every better plan.
        cancelled: Asked many times a second whether to end at once; the best plan until then counts.
    """

    message: Callable[[str], None] = field(default=_ignore, repr=False)
    improved: Callable[[Improvement], None] = field(default=_ignore, repr=False)
    cancelled: Callable[[], bool] = field(default=_never, repr=False)

    def __init_subclass__(cls) -> None:
        """Refuse what would never be called."""
        raise TypeError(f"{cls.__name__}: an Observer is made of functions, as Observer(improved=..., cancelled=...)")


class PlanOptions(TypedDict, total=False):
    """The keywords of `PlanSettings`, for those who hand them on; `named` shows them to `help()`."""

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
    """How to plan; None leaves a setting to the scenario.

    Attributes:
        planner: Name of the planner, `module:attribute`, or what makes an `ompl.base.Planner` from a space
            information.
        stable_set: What limits the pusher's twists: the name of a stable set, `module:attribute`, or a subclass of
            `StableSet`.
        seed: Of the random numbers; the same seed gives the same plan unless the time limit cuts it short.
        time_limit: Wall-clock seconds of preparing and of searching, at most; executing and validating the plan, or
            finding out why there is none, come on top.
        first: Stop at the first plan instead of improving it.
        iterations: Of the search, at most; where they, not the time limit, end it, the same seed gives the same plan
            on every machine.
        cost: What ranks paths, one of `names.COSTS`.
        margin: What the twists' margins have to exceed; `auto` as in `StabilitySettings`.
        gap: Share above the lower bound at which a plan is good enough to stop.
        observer: Who is told.
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
            raise PlanningError(f"no cost is called {self.cost!r}; there are {', '.join(COSTS)}")
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
            raise PlanningError(f"the time limit is {self.time_limit} s; allowed: from 0 to below a million")
        if self.gap is not None and not 0.0 <= self.gap < float("inf"):
            raise PlanningError(f"the gap is {self.gap}; allowed: a share from 0")

    @property
    def set_name(self) -> str | None:
        """Name of the stable set; None where it is left to the scenario."""
        chosen = self.stable_set
        return chosen if chosen is None or isinstance(chosen, str) else chosen.name

    def completed(self, scenario: Scenario) -> PlanSettings:
        """Return them with what they leave open taken from a scenario."""

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
        """Return a scenario with the margin and the cost that these settings ask for.

        Raises:
            PlanningError: When a margin of 0 goes together with limits that count inertia.
        """
        margin = _checked(scenario).stability.margin if self.margin is None else self.margin
        if margin == 0.0 and scenario.pusher.limits.contact == "dynamic":
            raise PlanningError(
                "a margin of 0 leaves the contacts nothing to spare for inertia; allowed: a margin above 0, or "
                "pusher.limits.contact: quasi-static"
            )
        cost = scenario.planner.cost if self.cost is None else self.cost
        return scenario.with_margin(margin).with_planner(cost=cost)


def _checked(scenario: object) -> Scenario:
    if isinstance(scenario, Scenario):
        return scenario
    what = f"{scenario!r:.40} is a {type(scenario).__name__}"
    raise PlanningError(f"{what}; allowed: a scenario, its file, or the name of a packaged one")


F = TypeVar("F", bound=Callable[..., object])


def named(function: F) -> F:
    """Show every keyword in the signature of a function that takes `**options: Unpack[PlanOptions]`."""
    found = signature(function)
    own = [one for one in found.parameters.values() if one.kind is not Parameter.VAR_KEYWORD]
    how, kinds = Parameter.KEYWORD_ONLY, PlanSettings.__annotations__
    more = [Parameter(x.name, how, default=x.default, annotation=kinds[x.name]) for x in fields(PlanSettings)]
    function.__signature__ = found.replace(parameters=[*own, *more])  # type: ignore[attr-defined]
    return function
