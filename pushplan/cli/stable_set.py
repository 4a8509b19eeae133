"""Show the pusher twists that keep every contact: translations and turning radii."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import atan2, degrees, isfinite
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, time_text

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario
    from pushplan.sets.cor import Window
    from pushplan.sets.stable_set import StableSet


@p.command
@p.scenario_argument
@click.option(
    "--set",
    "sets",
    type=p.STABLE_SET,
    multiple=True,
    help="Name of a stable set, or module:attribute; can be repeated (default: the scenario's).",
)
@p.plot_option
@p.no_code_option
def stable_set(console: Console, scenario: str, sets: tuple[str, ...], plot: Path | None, no_code: bool) -> int:
    """Show which pusher twists keep every contact: translations and smallest turning radii."""
    from pushplan.scenario.file import load_scenario

    p.check_outputs([scenario], plot)
    with p.code_of(scenario, console.note, no_code), console.working("computing stable sets"):
        from pushplan.sets.named import add_set
        from pushplan.sets.stable_set import default_window

        stated = load_scenario(scenario)
        names = dict.fromkeys(add_set(name) for name in sets or [stated.stability.set])
        found = {name: describe(stated, name) for name in names}
        window = default_window(stated.chain, [stable for stable, _ in found.values()])
    if plot is not None:
        with console.working(f"drawing {plot}"):
            from pushplan.drawing.sets import plot_stable_sets

            plot_stable_sets(stated.chain, [stable for stable, _ in found.values()], plot, window)
    for name, (_, described) in found.items():
        console.say((name, "bold"))
        console.table(set_rows(described, stated.chain.pusher.drive.kind))
    if console.json:
        regions = {
            name: {
                **described,
                "cor_regions": {"ccw": _geojson(stable, +1, window), "cw": _geojson(stable, -1, window)},
            }
            for name, (stable, described) in found.items()
        }
        console.emit({"scenario": stated.name, "window": window, "sets": regions})
    return 0


def describe(scenario: Scenario, name: str) -> tuple[StableSet, dict[str, Any]]:
    """Return a stable set and its description as a JSON object."""
    from pushplan.planners.controls import drive_radii

    begin = perf_counter()
    stable = scenario.stable_set(name)
    cone, radii = stable.translation_cone(), stable.turning_radii()
    driven = drive_radii(stable, scenario.chain.pusher.drive)
    known = [{side: r if isfinite(r) else None for side, r in one._asdict().items()} for one in (radii, driven)]
    return stable, {
        "translation_cone": None if cone is None else cone.tolist(),
        "min_turning_radius": known[0],
        "min_turning_radius_with_drive": known[1],
        "seconds": perf_counter() - begin,
    }


def set_rows(described: Mapping[str, Any], drive: str) -> list[tuple[str, str]]:
    """Return labels and values of a stable set's description, for a kind of drive."""
    cone, rows = "none is stable", []
    if described["translation_cone"] is not None:
        low, high = (atan2(dy, dx) for dx, dy in described["translation_cone"])
        cone = f"{degrees(low):+.1f} to {degrees(high):+.1f} deg from the push normal"
    for side, radius in described["min_turning_radius"].items():
        text = "none is stable" if radius is None else f"radius {radius:.3f} m of the contact midpoint"
        driven = described["min_turning_radius_with_drive"][side]
        words = "none" if driven is None else f"{driven:.3f} m"
        if radius is not None and words != f"{radius:.3f} m":
            text += f"; with the {drive} drive {words}"
        rows.append((f"tightest {side} turn", text))
    return [("translations", cone), *rows, ("computed in", time_text(described["seconds"]))]


def _geojson(stable: StableSet, sense: int, window: Window) -> object:
    import shapely

    return json.loads(shapely.to_geojson(stable.cor_region(sense, window)))
