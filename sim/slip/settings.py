"""How finely slip is simulated, and when a contact counts as lost."""

from __future__ import annotations

from dataclasses import dataclass, fields

from pushplan.errors import PushplanError


@dataclass(frozen=True)
class SlipSettings:
    """Settings that all simulations share.

    Attributes:
        step: How far the fastest corner of plate and stacked objects moves in a step at most, m.
        tolerance: Slide or opening over the length of the contact segment from which on a contact counts as moved.
    """

    step: float = 1e-3
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise PushplanError(f"{field.name} of the slip settings is {value}; it must be > 0")
