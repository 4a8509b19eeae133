"""Estimate friction and loads from logs of pushes with measured object poses."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, counted

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario
    from pushplan.sim.identify.measured_push import Identification


@p.command
@click.argument("logs", type=p.PATH, metavar="RUN.mcap...", nargs=-1, required=True)
@p.file_option("-o", "--output", help="Write the estimates as a part of a scenario (YAML).")
@click.option(
    "--into",
    type=p.SCENARIO,
    metavar="SCENARIO",
    help="Write this scenario with the estimates in place of its numbers to --output, ready for planning.",
)
@p.plot_option
@click.option("--seed", type=p.SEED, metavar="N", default=1, show_default=True, help="Seed of the search.")
@click.option("--jobs", type=p.COUNT, metavar="N", help="Number of threads (default: one per processor).")
def identify(
    console: Console,
    logs: tuple[Path, ...],
    output: Path | None,
    into: str | None,
    plot: Path | None,
    seed: int,
    jobs: int | None,
) -> int:
    """Estimate friction and loads from logs of pushes of the same objects, with measured object poses."""
    if into is not None and output is None:
        raise p.UsageError("--into needs --output, the file for the scenario with the estimates")
    names, target = [str(log) for log in logs], None
    if into is not None:
        from pushplan.scenario.file import load_scenario

        target = load_scenario(into)  # early: an unreadable file would waste the estimation
    p.check_outputs([*names, *([into] if into else [])], plot, output)
    with console.working(f"estimating from {counted(len(logs), 'log')}") as progress:
        from pushplan.identify import identify as learn

        found = learn(names, seed=seed, jobs=jobs, progress=progress.update_share)
    console.say((f"estimates from {counted(len(logs), 'log')}, 95 % intervals", "bold"))
    console.table(_rows(found))
    if output is not None:
        _write(found, names, target, output)
        console.say(f"{output}: {'the scenario' if into else 'a part of a scenario'} with the estimates")
    if plot is not None:
        with console.working(f"drawing {plot}"):
            from pushplan.drawing.estimates import plot_estimates

            plot_estimates(found.estimates, plot)
    console.emit(_document(found, output))
    return 0


def _rows(found: Identification) -> list[tuple[str, str]]:
    from pushplan.sim.identify.measured_push import ROUGH

    rows = [
        (
            one.unknown.name,
            f"{one.median:.3g} ({one.low:.3g} to {one.high:.3g})"
            if one.determined
            else "not determined by these pushes",
        )
        for one in found.estimates
    ]
    position, angle = found.noise
    noise = f"{1e3 * position:.2g} mm / {degrees(angle):.2g} deg"
    ratios = "only ratios: a common factor on all floor frictions does not change the motion"
    floor = [] if found.unknowns.absolute else [("floor friction", ratios)]
    rough = [("intervals", "rough: the contact modes change too often for the search")] if found.worth < ROUGH else []
    return [*rows, ("measurement noise", noise), *floor, *rough]


def _document(found: Identification, output: Path | None) -> dict[str, object]:
    from pushplan.sim.identify.measured_push import piece_of

    return {
        "estimates": [
            {
                "kind": one.unknown.kind,
                "name": one.unknown.name,
                "interval": [one.low, one.high],
                "median": one.median,
                "determined": one.determined,
            }
            for one in found.estimates
        ],
        "noise": {"position": found.noise[0], "angle": found.noise[1]},
        "correlation": found.correlation,
        "worth": found.worth,
        "learned": piece_of(found),
        "output": output,
    }


def _write(found: Identification, logs: list[str], into: Scenario | None, path: Path) -> None:
    import yaml

    from pushplan.scenario.file import scenario_from_document
    from pushplan.sim.identify.measured_push import piece_of, with_learned
    from pushplan.util.files import write_whole

    document = piece_of(found)
    if into is not None:
        document = with_learned(into.resolved(), document)
        scenario_from_document(document, path, into.attachments)  # checks that the file can be read
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
    missing = [one.unknown.name for one in found.estimates if not one.determined]
    ratios = (
        "" if found.unknowns.absolute else "; floor frictions are relative to the nominal one of the first object"
    )
    lines = [
        f"learned by pushplan identify from {', '.join(logs)}",
        f"95 % intervals{ratios}",
        *([f"left out because these pushes do not determine them: {', '.join(missing)}"] if missing else []),
    ]
    heading = "".join(f"# {line}\n" for line in lines)
    write_whole(path, (heading + (text if document else "")).encode())
