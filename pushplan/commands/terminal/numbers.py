"""Numbers as people read them."""

from __future__ import annotations


def time_text(seconds: float) -> str:
    """Return a time of any size in a few digits."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.2f} s"


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun, e.g. `1 arc`, `2 arcs`, or `2 feet` with the plural given."""
    return f"{number} {noun}" if number == 1 else f"{number} {plural or noun + 's'}"
