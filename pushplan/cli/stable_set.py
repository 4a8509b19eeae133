"""Show which pusher twists keep every contact: translations, turns, tightest radii."""

from __future__ import annotations

import json
from dataclasses import dataclass
from math import atan2, degrees, isfinite
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, time_text

if TYPE_CHECKING:
    from pushplan.mechanics.sphere import TurningRadii
    from pushplan.scenario.model import Scenario
    from pushplan.sets.cor import Window
    from pushplan.sets.stable_set import StableSet


@dataclass(frozen=True)
class Described:
    """A stable set as the command shows it.

    Attributes:
        stable: The set.
        cone: Its stable translations, right-most and left-most unit vector, or None.
        radii: Smallest radii of stable turns, m.
        drive: Kind of the robot's drive.
        drive_radii: Smallest radii of those that the drive can make, m.
        seconds: Time that computing all of it took.
    """

    stable: StableSet
    cone: list[list[float]] | None
    radii: TurningRadii
    drive: str
    drive_radii: TurningRadii
    seconds: float


@p.command
@p.scenario_argument
@click.option(
    "--set",
    "sets",
    type=p.STABLE_SET,
    multiple=True,
    help="Name of a stable set, or module:attribute; may be repeated (default: the scenario's).",
)
@p.plot_option
@p.no_code_option
def stable_set(console: Console, scenario: str, sets: tuple[str, ...], plot: Path | None, no_code: bool) -> int:
    """Show which pusher twists keep every contact: translations, turns, tightest radii."""
    from pushplan.scenario.file import load_scenario

    p.check_outputs([scenario], plot)
    with p.code_of(scenario, console.note, no_code), console.working("computing stable sets"):
        from pushplan.sets.named import add_set
        from pushplan.sets.stable_set import default_window

        stated = load_scenario(scenario)
        names = dict.fromkeys(add_set(name) for name in sets or [stated.stability.set])
        found = {name: describe(stated, name) for name in names}
        window = default_window(stated.chain, [each.stable for each in found.values()])
    if plot is not None:
        with console.working(f"drawing {plot}"):
            from pushplan.drawing.sets import plot_stable_sets

            plot_stable_sets(stated.chain, [each.stable for each in found.values()], plot, window)
    for name, each in found.items():
        console.say((name, "bold"))
        console.table(set_rows(each))
    if console.json:
        regions = {
            name: {
                **set_document(each),
                "cor_regions": {"ccw": _geojson(each, +1, window), "cw": _geojson(each, -1, window)},
            }
            for name, each in found.items()
        }
        console.emit({"scenario": stated.name, "window": window, "sets": regions})
    return 0


def describe(scenario: Scenario, name: str) -> Described:
    """Compute a stable set and what is said about it."""
    from pushplan.planners.controls import drive_radii

    begin, drive = perf_counter(), scenario.chain.pusher.drive
    stable = scenario.stable_set(name)
    cone = stable.translation_cone()
    return Described(
        stable,
        None if cone is None else cone.tolist(),
        stable.turning_radii(),
        drive.kind,
        drive_radii(stable, drive),
        perf_counter() - begin,
    )


def set_rows(described: Described) -> list[tuple[str, str]]:
    """Return label and value of what people want to know about a set."""
    cone = "none is stable"
    if described.cone is not None:
        low, high = (atan2(dy, dx) for dx, dy in described.cone)
        cone = f"{degrees(low):+.1f} to {degrees(high):+.1f} deg from the push normal"
    return [
        ("translations", cone),
        *((f"tightest {side} turn", _radius_text(described, side)) for side in ("left", "right")),
        ("computed in", time_text(described.seconds)),
    ]


def set_document(described: Described) -> dict[str, object]:
    """Return the numbers of a set as an object for JSON."""
    return {
        "translation_cone": described.cone,
        "min_turning_radius": _radii_document(described.radii),
        "min_turning_radius_with_drive": _radii_document(described.drive_radii),
        "seconds": described.seconds,
    }


def _radii_document(radii: TurningRadii) -> dict[str, float | None]:
    return {side: radius if isfinite(radius) else None for side, radius in radii._asdict().items()}


def _radius_text(described: Described, side: str) -> str:
    """Return the set's radius, and where it is another one, that with the drive."""
    radius, driven = (getattr(each, side) for each in (described.radii, described.drive_radii))
    if not isfinite(radius):
        return "none is stable"
    text = f"radius {radius:.3f} m of the contact midpoint"
    if f"{driven:.3f}" == f"{radius:.3f}":
        return text
    words = f"{driven:.3f} m" if isfinite(driven) else "none"
    return f"{text}; with the {described.drive} drive {words}"


def _geojson(described: Described, sense: int, window: Window) -> object:
    import shapely

    return json.loads(shapely.to_geojson(described.stable.cor_region(sense, window)))
