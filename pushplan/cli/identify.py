"""Learn friction and loads from logs of pushes in which the objects' poses are."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.failure import DONE
from pushplan.cli.terminal.options import add_output, check_outputs, count, seed

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario
    from pushplan.sim.identify.identification import Identification


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the words of the command."""
    parser.add_argument("logs", metavar="RUN.mcap", nargs="+", help="logs of pushes of the same objects")
    add_output(parser, "-o", "--output", help="write what was learned as a piece of scenario (YAML)")
    parser.add_argument(
        "--into",
        metavar="SCENARIO",
        help="write to --output this scenario with what was learned in place of its numbers, ready to plan with",
    )
    parser.add_argument("--seed", type=seed, default=1, metavar="N", help="seed of the search (default: 1)")
    parser.add_argument("--jobs", type=count, metavar="N", help="threads (default: one a processor)")


def run(args: argparse.Namespace, console: Console) -> int:
    """Carry out the command and return the exit code."""
    from pushplan.errors import PushplanError

    if args.into is not None and args.output is None:
        raise PushplanError("--into needs --output: where the scenario with what was learned goes")
    into = None
    if args.into is not None:
        from pushplan.scenario.file import load_scenario

        into = load_scenario(args.into)  # before the work, which is lost if it cannot be read
    check_outputs([*args.logs, *([args.into] if args.into else [])], None, args.output)
    with console.computing(f"learning from {len(args.logs)} logs") as progress:
        from pushplan.identify import identify

        found = identify(args.logs, seed=args.seed, jobs=args.jobs, progress=progress.tell_share)
    console.say(console.paint(f"learned from {len(args.logs)} logs, 90 % intervals", "bold"))
    console.table(rows(found))
    if args.output is not None:
        _write(found, args.logs, into, args.output)
        console.say(
            f"{args.output}: {'the scenario' if args.into else 'a piece of scenario'} with what was learned"
        )
    console.emit(document(found, args.output))
    return DONE


def rows(found: Identification) -> list[tuple[str, str]]:
    """Return label and value of what was found, for people."""
    from math import degrees

    from pushplan.sim.identify.identification import ROUGH

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
        [("intervals", "rough: contacts change what they do too often for the search")]
        if found.worth < ROUGH
        else []
    )
    return [*told, ("measured poses off by", noise), *floor, *rough]


def document(found: Identification, output: Path | None) -> dict[str, object]:
    """Return the JSON object of what was found."""
    from pushplan.sim.identify.learned import piece_of

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
    from pushplan.sim.identify.learned import piece_of, with_learned
    from pushplan.util.files import write_whole

    document = piece_of(found)
    if into is not None:
        document = with_learned(into.resolved(), document)
        scenario_from_document(document, path, into.attachments)  # what is written can be read
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
    write_whole(path, (_heading(found, logs) + (text if document else "")).encode())


def _heading(found: Identification, logs: list[str]) -> str:
    missing = [one.unknown.name for one in found.estimates if not one.determined]
    ratios = (
        ""
        if found.unknowns.absolute
        else "; floor frictions are ratios to the stated one of the first object"
    )
    lines = [
        f"learned by pushplan identify from {', '.join(logs)}",
        f"90 % intervals{ratios}",
        *([f"not determined, so left out: {', '.join(missing)}"] if missing else []),
    ]
    return "".join(f"# {line}\n" for line in lines)
