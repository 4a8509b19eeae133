"""The words of options that hold several named numbers, such as `rate=20,delay=50 ms`."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping

from pushplan.scenario.units import split_unit


def pairs(text: str, names: Iterable[str], what: str) -> list[tuple[str, str]]:
    """Return name and text of every value, which a message calls `what`.

    Raises:
        argparse.ArgumentTypeError: When one is not among `names`, or has no value.
    """
    found = []
    for pair in text.split(","):
        name, equals, value = (piece.strip() for piece in pair.partition("="))
        if name not in names or not equals:
            raise argparse.ArgumentTypeError(f"'{pair}' is not NAME={what} with a NAME of {', '.join(names)}")
        found.append((name, value))
    return found


def number(name: str, text: str, units: Mapping[str, float]) -> float:
    """Return a number, plain or with one of the `units`, which state their size.

    Raises:
        argparse.ArgumentTypeError: When it is neither.
    """
    split = split_unit(text)
    try:
        return float(text) if split is None else split[0] * units[split[1]]
    except (ValueError, KeyError):
        allowed = ", ".join(units)
        raise argparse.ArgumentTypeError(
            f"{name} is '{text}'; allowed: a number, also with a unit ({allowed})"
        ) from None
