"""One comparison of a recorded quantity with the same made again."""

from __future__ import annotations

from dataclasses import dataclass

TOLERANCE = 1e-9
"""Largest difference that counts as rounding, in SI units; of forces, per newton of the largest one."""


@dataclass(frozen=True)
class Check:
    """A comparison of one quantity.

    Attributes:
        quantity: What was compared.
        difference: The largest difference found; infinite where one side has nothing to compare.
        tolerance: What would still pass.
        time: Simulated time of the largest difference, s; None where the quantity has no time.
        what: The difference in words, where a number does not say it.
    """

    quantity: str
    difference: float
    tolerance: float = TOLERANCE
    time: float | None = None
    what: str = ""

    @property
    def matches(self) -> bool:
        """Whether the difference is within the tolerance."""
        return self.difference <= self.tolerance  # False for NaN

    @property
    def text(self) -> str:
        """The outcome in a sentence."""
        if self.what:
            return f"{self.quantity}: {self.what}"
        at = "" if self.time is None else f" at {self.time:.3f} s"
        sign = "<=" if self.matches else ">"
        return f"{self.quantity}: differs by {self.difference:.3g}{at} ({sign} {self.tolerance:.3g})"
