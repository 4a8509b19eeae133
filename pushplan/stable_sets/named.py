"""The stable sets by the names that scenarios and commands use."""

from __future__ import annotations

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.stable_sets.cof_set import CofSet
from pushplan.stable_sets.ecof_set import EcofSet
from pushplan.stable_sets.robust_set import RobustSet
from pushplan.stable_sets.stable_set import StableSet
from pushplan.stable_sets.stable_unknown_set import StableUnknownSet
from pushplan.stable_sets.translation_set import TranslationSet

_SETS: dict[str, type[StableSet]] = {
    kind.name: kind for kind in (EcofSet, CofSet, TranslationSet, StableUnknownSet, RobustSet)
}


def stable_set(chain: Chain, name: str = "ecof") -> StableSet:
    """Return the stable set of `chain` by one of the algorithms in `names.STABLE_SETS`.

    Raises:
        PushplanError: On an unknown name.
        SupportError: When the algorithm needs loads that are not known, or a push at the contact height could
            tip or lift an object.
    """
    if name not in _SETS:
        raise PushplanError(f"no stable set is called {name!r}; there are {', '.join(_SETS)}")
    return _SETS[name](chain)
