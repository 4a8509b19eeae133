"""Creates stable sets by name, for chains of plain numbers and of intervals."""

from __future__ import annotations

from dataclasses import replace

import pushplan.core.uncertain as uncertain
from pushplan.errors import PushplanError, SupportError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.dynamics import Wrenches
from pushplan.mechanics.heights import counts_by_centre, load_areas
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.uncertain import pack_loads
from pushplan.sets.known_load_sets import CofSet, EcofSet, TranslationSet
from pushplan.sets.stable_set import StableSet
from pushplan.sets.unknown_load_sets import RobustSet, StableUnknownSet
from pushplan.util.arrays import FloatArray
from pushplan.util.names import STABLE_SETS
from pushplan.util.naming import PLACE, STABLE_SET_NAMES, attribute_named


class IntervalEcofSet(StableSet):
    """Twists that are in the set `ecof` for all values in the intervals.

    The margin is the smallest contact row, divided by the following upper bound of |w_k|:

        |sum F_i w_i at the middles of the intervals| + sum of half widths of the intervals times |w_i|

    The margin is at most that of `ecof` for any of the values, and equal to it if all intervals are points. The set
    is exact except for uncertain pressures, for which it is conservative (see `core/uncertain.hpp`). If pushes act
    above the floor or inertia shifts loads, the set covers every pressure with the possible centres
    (`mechanics.heights`) and is more conservative.

    Raises:
        SupportError: See `EcofSet`.
    """

    name = "ecof"

    def __init__(self, interval: IntervalChain) -> None:
        super().__init__(interval.chain)
        self._packed = pack_loads(interval.chain, interval)

    @property
    def loads_known(self) -> bool:
        """False, because the contact forces depend on the values."""
        return False

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return Wrenches(*uncertain.rows_of(self._packed, twists)).margins

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); see `StableSet` for `floor`."""
        return uncertain.margins_of(self._packed, twists, float(floor))


def stable_set_over(interval: IntervalChain, name: str = "ecof") -> StableSet:
    """Return a set of twists that are stable for all values in the intervals.

    `ecof`, `translation` and `robust` are exact, but conservative for uncertain pressures (see `core/uncertain.hpp`).
    `stable` allows a centre of friction anywhere in the region that the loads allow. `cof` is not available, because
    its conditions are not linear in the loads.

    Raises:
        PushplanError: If the name is unknown or `cof`.
        SupportError: If the algorithm needs a plain number where the chain has an interval.
    """
    if name not in STABLE_SETS:
        raise PushplanError(
            f"the stable set {name!r} is not available for intervals of loads and frictions; allowed: "
            f"{', '.join(STABLE_SETS)}"
        )
    chain = interval.chain
    if name == "cof":
        raise PushplanError(
            "the stable set 'cof' is not available for intervals: its conditions are not linear in the loads; "
            "use 'ecof', which it approximates"
        )
    if name == "stable" and interval.fractions:
        feet = chain.objects[min(interval.fractions)].name
        raise SupportError(
            f"the set {name!r} needs the centre of each load, which is not known for {feet!r} because its load "
            "fractions are intervals; give it a center_of_mass, or use 'ecof'"
        )
    if name == "stable":
        return StableUnknownSet(chain, interval)
    if name == "robust":
        return RobustSet(chain, interval)
    if name == "ecof":
        return IntervalEcofSet(interval)
    if not counts_by_centre(interval.chain, interval):
        load_areas(interval.chain, interval)
        interval = replace(interval, chain=interval.chain.at_floor())
    return TranslationSet(chain, IntervalEcofSet(interval))


_SETS: dict[str, type[StableSet]] = {
    kind.name: kind for kind in (EcofSet, CofSet, TranslationSet, StableUnknownSet, RobustSet)
}


_OTHERS: dict[str, type[StableSet]] = {}
"""Sets that were added in this process. Reading a run log does not add the set that it names."""


def stable_set(chain: Chain, name: str = "ecof") -> StableSet:
    """Return the stable set of `chain` by one of the algorithms in `names.STABLE_SETS`, or an added one.

    Raises:
        PushplanError: If the name is unknown.
        SupportError: If the algorithm needs loads that are not known, or a push at the contact heights can tip an
            object (with `cof` also: lift a part of one).
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
    """Register a stable set in this process and return its name.

    Args:
        given: A name in `names.STABLE_SETS`, the name of an installed package's set, `module:attribute`, or a
            subclass of `StableSet`.

    Raises:
        PushplanError: If there is no such stable set, or its name is invalid or already taken.
    """
    if isinstance(given, str) and (given in _SETS or given in _OTHERS):
        return given
    kind = attribute_named(given, STABLE_SET_NAMES.group) if isinstance(given, str) else given
    if kind is None:
        raise PushplanError(_unknown(str(given)))
    if not (isinstance(kind, type) and issubclass(kind, StableSet)):
        raise PushplanError(f"{given!r} is not a stable set; allowed: a subclass of pushplan.StableSet")
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
        f"no stable set is called {name!r}; allowed: {', '.join((*_SETS, *_OTHERS))}, a set of an installed package, "
        "or module:attribute"
    )
