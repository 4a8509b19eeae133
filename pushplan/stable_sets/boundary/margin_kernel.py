"""One name for the compiled margins of chains, chains with intervals, and areas with any pressure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import overload

from pushplan.mechanics.contacts.contact_kernel import margin_down_to
from pushplan.mechanics.friction.packed import PackedChain
from pushplan.mechanics.worst_case.interval_kernel import PackedIntervals, interval_margin_down_to
from pushplan.mechanics.worst_case.robust_kernel import PackedAreas, robust_margin_down_to

Packed = PackedChain | PackedIntervals | PackedAreas
"""What compiled margins work on."""

Margin = Callable[[Any, float, float, float, float], float]


def margin_of(packed: Packed, vx: float, vy: float, omega: float, floor: float) -> float:
    """Return the margin at a body twist; inexact, but not above the floor, where it is at most `floor`."""
    if isinstance(packed, PackedChain):
        return margin_down_to(packed, vx, vy, omega, floor)
    if isinstance(packed, PackedIntervals):
        return interval_margin_down_to(packed, vx, vy, omega, floor)
    return robust_margin_down_to(packed, vx, vy, omega, floor)


@overload(margin_of, strict=False)
def _margin_of(packed: Any, vx: Any, vy: Any, omega: Any, floor: Any) -> Margin | None:
    """Choose, while compiling, by the type of `packed`."""
    if not isinstance(packed, types.NamedTuple):
        return None
    if packed.instance_class is PackedChain:
        return lambda packed, vx, vy, omega, floor: margin_down_to(packed, vx, vy, omega, floor)
    if packed.instance_class is PackedIntervals:
        return lambda packed, vx, vy, omega, floor: interval_margin_down_to(packed, vx, vy, omega, floor)
    return lambda packed, vx, vy, omega, floor: robust_margin_down_to(packed, vx, vy, omega, floor)
