"""Numbers as people read them."""

from __future__ import annotations

from math import degrees


def time_text(seconds: float) -> str:
    """Return a time of any size in a few digits."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.2f} s"


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun, e.g. `1 arc`, `2 arcs`, or `2 feet` with the plural given."""
    return f"{number} {noun}" if number == 1 else f"{number} {plural or noun + 's'}"


def length_text(metres: float) -> str:
    """Return a small length in mm; nobody cares how far below a nanometre it is."""
    return "below 1e-6 mm" if abs(metres) < 1e-9 else f"{1e3 * metres:.3g} mm"


def angle_text(radians: float) -> str:
    """Return a small angle in degrees, likewise."""
    angle = degrees(radians)
    return "below 1e-6 deg" if abs(angle) < 1e-6 else f"{angle:.3g} deg"


def plain(number: float) -> float:
    """Return a number without rounding errors around 0 and without the sign of a zero."""
    return round(number, 9) + 0.0
