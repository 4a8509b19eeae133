"""The stable sets by the names that scenarios and commands use."""

from __future__ import annotations

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.heights import counts_by_centre
from pushplan.mechanics.intervals import IntervalChain
from pushplan.sets.interval_set import stable_set_over
from pushplan.sets.known_load_sets import CofSet, EcofSet, TranslationSet
from pushplan.sets.robust_set import RobustSet
from pushplan.sets.stable_set import StableSet
from pushplan.sets.stable_unknown_set import StableUnknownSet
from pushplan.util.naming import PLACE, attribute_named, stable_set_names

_SETS: dict[str, type[StableSet]] = {
    kind.name: kind for kind in (EcofSet, CofSet, TranslationSet, StableUnknownSet, RobustSet)
}


_OTHERS: dict[str, type[StableSet]] = {}
"""What was handed over to this process: a run log, which names the set it was planned in, loads no code."""


def stable_set(chain: Chain, name: str = "ecof") -> StableSet:
    """Return the stable set of `chain` by one of the algorithms in `names.STABLE_SETS`, or one that was added.

    Raises:
        PushplanError: On an unknown name.
        SupportError: When the algorithm needs loads that are not known, or a push at the contact heights could tip an
            object (for `cof` also: lift a part of one).
    """
    if name not in _SETS and name not in _OTHERS and PLACE.fullmatch(name) is None:
        add_set(name)
    kind = _SETS.get(name) or _OTHERS.get(name)
    if kind is None:
        raise PushplanError(_unknown(name))
    if kind in (EcofSet, TranslationSet) and counts_by_centre(chain):
        return stable_set_over(IntervalChain.from_ranges(chain), name)
    return kind(chain)


def add_set(given: str | type[StableSet]) -> str:
    """Make a stable set known by its name in this process; return the name.

    Args:
        given: A name of `names.STABLE_SETS`, of an installed package's set, `module:attribute`, or a subclass of
            `StableSet`.

    Raises:
        PushplanError: When there is none, or it is no stable set with a name of its own.
    """
    if isinstance(given, str) and (given in _SETS or given in _OTHERS):
        return given
    kind = attribute_named(given, stable_set_names().group) if isinstance(given, str) else given
    if kind is None:
        raise PushplanError(_unknown(str(given)))
    if not (isinstance(kind, type) and issubclass(kind, StableSet)):
        raise PushplanError(f"{given!r} is no stable set; allowed: a subclass of pushplan.StableSet")
    name = getattr(kind, "name", None)
    if not isinstance(name, str) or (name in _SETS and _SETS[name] is not kind):
        raise PushplanError(
            f"the stable set {given!r} has the name {name!r}; allowed: a text other than {', '.join(_SETS)}"
        )
    if name not in _SETS:
        _OTHERS[name] = kind
    return name


def _unknown(name: str) -> str:
    return (
        f"no stable set is called {name!r}; there are {', '.join((*_SETS, *_OTHERS))}, those of installed packages, "
        "and any other one as module:attribute"
    )
