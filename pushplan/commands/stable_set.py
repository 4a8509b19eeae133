"""Show which pusher twists keep every contact: translations, turns, tightest radii."""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from math import atan2, degrees, isfinite
from time import perf_counter
from typing import TYPE_CHECKING

from pushplan.commands.console import Console
from pushplan.commands.failure import DONE
from pushplan.commands.numbers import time_text
from pushplan.commands.options import add_plot, add_scenario, check_outputs
from pushplan.naming import stable_set_names

if TYPE_CHECKING:
    from pushplan.scenario import Scenario
    from pushplan.stable_sets.cor_region import Window
    from pushplan.stable_sets.stable_set import StableSet


@dataclass(frozen=True)
class Described:
    """A stable set as the command shows it.

    Attributes:
        stable: The set.
        cone: Its stable translations, right-most and left-most unit vector, or None.
        left: Smallest radius of a left turn, m; None when no left turn is stable.
        right: Likewise to the right.
        seconds: Time that computing all of it took.
    """

    stable: StableSet
    cone: list[list[float]] | None
    left: float | None
    right: float | None
    seconds: float


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    add_scenario(parser)
    sets = stable_set_names()
    parser.add_argument(
        "--set",
        action="append",
        choices=sets,
        metavar="NAME",
        help=f"one of {sets.words}; may be repeated (default: the scenario's)",
    )
    add_plot(parser, "draw the regions of the centre of rotation")


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.scenario import load_scenario

    check_outputs(args.scenario, args.plot)
    scenario = load_scenario(args.scenario)
    with console.computing("computing stable sets"):
        from pushplan.stable_sets.cor_window import default_window
        from pushplan.stable_sets.named import add_set

        names = dict.fromkeys(add_set(name) for name in args.set or [scenario.stability.set])
        found = {name: describe(scenario, name) for name in names}
        window = default_window(scenario.chain, [each.stable for each in found.values()])
        document = _document(scenario, found, window) if args.json else {}
    if args.plot is not None:
        _draw(scenario, found, args, window, console)
    for name, each in found.items():
        console.say(console.paint(name, "bold"))
        console.table(rows(each))
    console.emit(document)
    return DONE


def describe(scenario: Scenario, name: str) -> Described:
    """Compute a stable set and what is said about it."""
    begin = perf_counter()
    stable = scenario.stable_set(name)
    cone, radii = stable.translation_cone(), stable.turning_radii()
    return Described(
        stable,
        None if cone is None else cone.tolist(),
        radii.left if isfinite(radii.left) else None,
        radii.right if isfinite(radii.right) else None,
        perf_counter() - begin,
    )


def rows(described: Described) -> list[tuple[str, str]]:
    """Return label and value of what people want to know about a set."""
    cone = "none is stable"
    if described.cone is not None:
        low, high = (atan2(dy, dx) for dx, dy in described.cone)
        cone = f"{degrees(low):+.1f} to {degrees(high):+.1f} deg from the push normal"
    return [
        ("translations", cone),
        ("tightest left turn", _radius(described.left)),
        ("tightest right turn", _radius(described.right)),
        ("computed in", time_text(described.seconds)),
    ]


def document(described: Described) -> dict[str, object]:
    """Return the numbers of a set as an object for JSON."""
    return {
        "translation_cone": described.cone,
        "min_turning_radius": {"left": described.left, "right": described.right},
        "seconds": described.seconds,
    }


def _radius(radius: float | None) -> str:
    return "none is stable" if radius is None else f"radius {radius:.3f} m of the contact midpoint"


def _document(scenario: Scenario, found: dict[str, Described], window: Window) -> dict[str, object]:
    sets = {
        name: {
            **document(each),
            "cor_regions": {"ccw": _geojson(each, +1, window), "cw": _geojson(each, -1, window)},
        }
        for name, each in found.items()
    }
    return {"scenario": scenario.name, "window": window, "sets": sets}


def _geojson(described: Described, sense: int, window: Window) -> object:
    import shapely

    return json.loads(shapely.to_geojson(described.stable.cor_region(sense, window)))


def _draw(
    scenario: Scenario,
    found: dict[str, Described],
    args: argparse.Namespace,
    window: Window,
    console: Console,
) -> None:
    with console.computing(f"drawing {args.plot}"):
        from pushplan.drawing.sets import plot_stable_sets

        sets = [each.stable for each in found.values()]
        plot_stable_sets(scenario.chain, sets, args.plot, window)
