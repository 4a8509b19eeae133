"""The stable sets by the names that scenarios and commands use, of numbers and of intervals."""

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

    The margin is the least row divided by an upper bound of |w_k|,

        |sum F_i w_i at the intervals' middles| + sum of half their widths times |w_i|:

    at most the margin for any of the values, and equal to it where all intervals are points. The set is exact but for
    pressures, where it errs on the safe side (see `core/uncertain.hpp`). Where pushes are above the floor, or inertia
    moves loads, any pressure with the centres that these allow counts (`mechanics.heights`): it errs on the safe side
    by more then.

    Raises:
        SupportError: See `EcofSet`.
    """

    name = "ecof"

    def __init__(self, interval: IntervalChain) -> None:
        super().__init__(interval.chain)
        self._packed = pack_loads(interval.chain, interval)

    @property
    def loads_known(self) -> bool:
        """False: the contact forces depend on the values."""
        return False

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return Wrenches(*uncertain.rows_of(self._packed, twists)).margins

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        return uncertain.margins_of(self._packed, twists, float(floor))


def stable_set_over(interval: IntervalChain, name: str = "ecof") -> StableSet:
    """Return a set of twists that are stable for all values in the intervals.

    Exact for `ecof`, `translation` and `robust`, but on the safe side for pressures that may be off (see
    `core/uncertain.hpp`); for `stable`, the rule for a centre of friction anywhere in the region the loads allow.
    The set `cof` has no such form: its centre moves with the loads, and its conditions are not linear in them.

    Raises:
        PushplanError: On an unknown name, or `cof`.
        SupportError: If the algorithm needs something as a number that is an interval.
    """
    if name not in STABLE_SETS:
        raise PushplanError(
            f"the stable set {name!r} is not known for intervals of loads and frictions; there are "
            f"{', '.join(STABLE_SETS)}"
        )
    chain = interval.chain
    if name == "cof":
        raise PushplanError(
            "the stable set 'cof' is not linear in the loads, so that it cannot be had for intervals of them; "
            "use 'ecof', which it approximates"
        )
    if name == "stable" and interval.fractions:
        feet = chain.objects[min(interval.fractions)].name
        raise SupportError(
            f"the set {name!r} goes by the centre of each load, which intervals of load fractions leave open for "
            f"{feet!r}; give it a center_of_mass, or use 'ecof'"
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
"""What was handed over to this process: a run log, which names the set it was planned in, loads no code."""


def stable_set(chain: Chain, name: str = "ecof") -> StableSet:
    """Return the stable set of `chain` by one of the algorithms in `names.STABLE_SETS`, or one that was added.

    Raises:
        PushplanError: On an unknown name.
        SupportError: If the algorithm needs loads that are not known, or a push at the contact heights could tip an
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
        PushplanError: If there is none, or it is no stable set with a name of its own.
    """
    if isinstance(given, str) and (given in _SETS or given in _OTHERS):
        return given
    kind = attribute_named(given, STABLE_SET_NAMES.group) if isinstance(given, str) else given
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
