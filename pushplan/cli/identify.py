"""Learn friction and loads from logs of pushes in which the objects' poses are."""

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
@p.file_option("-o", "--output", help="Write what was learned as a piece of scenario (YAML).")
@click.option(
    "--into",
    type=p.SCENARIO,
    metavar="SCENARIO",
    help="Write to --output this scenario with what was learned in place of its numbers, ready to plan with.",
)
@click.option("--seed", type=p.SEED, metavar="N", default=1, show_default=True, help="Seed of the search.")
@click.option("--jobs", type=p.COUNT, metavar="N", help="Threads (default: one a processor).")
def identify(
    console: Console, logs: tuple[Path, ...], output: Path | None, into: str | None, seed: int, jobs: int | None
) -> int:
    """Learn friction and loads from logs of pushes of the same objects in which the objects' poses are."""
    if into is not None and output is None:
        raise p.UsageError("--into needs --output: where the scenario with what was learned goes")
    names, target = [str(log) for log in logs], None
    if into is not None:
        from pushplan.scenario.file import load_scenario

        target = load_scenario(into)  # before the work, which is lost if it cannot be read
    p.check_outputs([*names, *([into] if into else [])], None, output)
    with console.working(f"learning from {counted(len(logs), 'log')}") as progress:
        from pushplan.identify import identify as learn

        found = learn(names, seed=seed, jobs=jobs, progress=progress.tell_share)
    console.say((f"learned from {counted(len(logs), 'log')}, 90 % intervals", "bold"))
    console.table(_rows(found))
    if output is not None:
        _write(found, names, target, output)
        console.say(f"{output}: {'the scenario' if into else 'a piece of scenario'} with what was learned")
    console.emit(_document(found, output))
    return 0


def _rows(found: Identification) -> list[tuple[str, str]]:
    from pushplan.sim.identify.measured_push import ROUGH

    told = [
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
    ratios = "only ratios: all floor frictions could be larger alike, the objects would go the same ways"
    floor = [] if found.unknowns.absolute else [("floor friction", ratios)]
    rough = (
        [("intervals", "rough: contacts change what they do too often for the search")] if found.worth < ROUGH else []
    )
    return [*told, ("measured poses off by", noise), *floor, *rough]


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
        scenario_from_document(document, path, into.attachments)  # what is written can be read
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
    missing = [one.unknown.name for one in found.estimates if not one.determined]
    ratios = "" if found.unknowns.absolute else "; floor frictions are ratios to the stated one of the first object"
    lines = [
        f"learned by pushplan identify from {', '.join(logs)}",
        f"90 % intervals{ratios}",
        *([f"not determined, so left out: {', '.join(missing)}"] if missing else []),
    ]
    heading = "".join(f"# {line}\n" for line in lines)
    write_whole(path, (heading + (text if document else "")).encode())
