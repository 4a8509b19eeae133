"""What the scripts of this folder share: options, the clock of the processor, and how figures are printed."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from pushplan.bench.store import Machine
from pushplan.plans.execution import wilson


def options(doc: str | None, *paths: str, **defaults: Any) -> argparse.Namespace:
    """Read the command line and print the machine; all time limits count CPU time from now on.

    Args:
        doc: Docstring of the script, which `--help` prints.
        paths: Names of positional arguments, which are paths.
        defaults: Options with their defaults. False makes a flag and a tuple takes several values. A type stands for
            an option without a default.
    """
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in paths:
        parser.add_argument(name, type=Path)
    for name, default in defaults.items():
        option = f"--{name.replace('_', '-')}"
        if default is False:
            parser.add_argument(option, action="store_true")
        else:
            several: dict[str, Any] = {"nargs": "+"} if isinstance(default, tuple) else {}
            one = default[0] if isinstance(default, tuple) else default
            stated: dict[str, Any] = (
                {"type": one} if isinstance(one, type) else {"type": type(one), "default": default}
            )
            parser.add_argument(option, **several, **stated)
    asked = parser.parse_args()
    time.perf_counter = time.process_time
    print(Machine.this().words, flush=True)
    return asked


def share(successes: int, count: int) -> str:
    """Return a share with its 95 % interval."""
    low, high = wilson(successes, count)
    return f"{successes} of {count} ({100 * low:.1f} to {100 * high:.1f} %)"


def tell(what: str, value: float, relation: str, wanted: float) -> bool:
    """Print a figure with its target; return whether it is met."""
    met = {"<=": value <= wanted, ">=": value >= wanted}[relation]
    print(f"{'ok  ' if met else 'MISS'} {what}: {value:.4g} (wanted {relation} {wanted:g})")
    return met
