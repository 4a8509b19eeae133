"""Commands that write a new scenario, list examples and recorded runs, and support editors and shells."""

from __future__ import annotations

import shlex
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.shell_completion import get_completion_class

from pushplan.cli import parameters as p
from pushplan.cli.console import Console, counted, span_text

if TYPE_CHECKING:
    from pushplan.logging.runs import RunEntry

_HEAD = ("", "outcome", "scenario", "planner", "set", "seed", "path cost", "age", "size")


@p.command
@p.runs_option
@click.option("--last", type=p.COUNT, metavar="N", help="List only the last N runs.")
@click.option(
    "--filter",
    "filters",
    metavar="FIELD=PATTERN",
    multiple=True,
    help="List only runs whose outcome, scenario, planner, set or seed matches (scenario=two-*); can be repeated.",
)
def runs(console: Console, runs: Path | None, last: int | None, filters: tuple[str, ...]) -> int:
    """List the recorded runs, newest first."""
    from pushplan.logging.runs import chosen, runs_folder, runs_of

    folder = runs_folder(runs)
    every = runs_of(folder)
    found = chosen(every, list(filters))[:last]
    now = datetime.now(UTC)
    rows = [_HEAD]
    for one in found:
        cost = "" if one.cost is None else f"{one.cost:.3f} m"
        age = "" if one.started is None else span_text((now - one.started).total_seconds())
        number = "" if one.number is None else f"@{one.number}"
        about = (one.scenario, one.planner, one.set, one.seed, cost, age, f"{one.size / 1000:.0f} KB")
        rows.append((number, one.outcome, *about))
    if found:
        console.table(rows, style="")
    some = f"{len(found)} of " if len(found) < len(every) else ""
    console.say(f"{some}{counted(len(every), 'run')} in {folder}")
    console.emit({"folder": folder, "runs": [_document(one, now) for one in found]})
    return 0


def _document(one: RunEntry, now: datetime) -> dict[str, object]:
    return {
        "number": one.number,
        "log": one.path,
        "outcome": one.outcome,
        "scenario": one.scenario,
        "planner": one.planner,
        "set": one.set,
        "seed": int(one.seed) if one.seed.lstrip("-").isdigit() else None,
        "path_cost": one.cost,
        "started_at": None if one.started is None else one.started.isoformat(),
        "age_s": None if one.started is None else (now - one.started).total_seconds(),
        "bytes": one.size,
    }


@p.command
@click.argument("name", metavar="NAME")
@click.option(
    "--drive",
    type=click.Choice(("omnidirectional", "differential", "car")),
    default="omnidirectional",
    show_default=True,
    help="Drive of the robot.",
)
@click.option(
    "--map",
    "map_file",
    type=p.PATH,
    metavar="MAP.yaml",
    help="ROS map (Nav2) in the scenario's folder or below; start and goal are placed in its free space.",
)
def new(console: Console, name: str, drive: str, map_file: Path | None) -> int:
    """Write a commented scenario NAME.yaml to start from; existing files are never overwritten."""
    from pushplan.scenario.template import write_new_scenario

    path = write_new_scenario(name, drive=drive, map_file=map_file)
    console.say(f"wrote {path}; next:")
    typed, picture = shlex.quote(str(path)), shlex.quote(f"{path.stem}.png")
    console.table([("see it", f"pushplan check {typed} --plot {picture}"), ("plan it", f"pushplan plan {typed}")])
    console.emit({"name": path.stem, "file": path})
    return 0


@p.command
@click.argument("name", type=p.SCENARIO, metavar="[NAME]", required=False)
def examples(console: Console, name: str | None) -> int:
    """List the packaged scenarios, or print the file of one."""
    from pushplan.scenario.file import example_names, example_text

    if name is not None:
        text = example_text(name)
        console.say(text.rstrip("\n"))
        console.emit({"name": name, "text": text})
        return 0
    about = {name: first_comment(example_text(name)) for name in example_names()}
    console.table(about.items())
    console.emit({"examples": about})
    return 0


def first_comment(text: str) -> str:
    """Return the text of the first comment line, or an empty text."""
    comments = (line.lstrip("# ").rstrip() for line in text.splitlines() if line.startswith("#"))
    return next(comments, "")


@p.command
@click.argument("kind", type=click.Choice(("scenario", "suite")), metavar="[scenario|suite]", default="scenario")
def schema(console: Console, kind: str) -> int:
    """Print the JSON Schema of scenario files (the default) or of benchmark suites, for editors."""
    from pushplan.bench.schema import suite_schema
    from pushplan.scenario.schema import scenario_schema, schema_text

    found = suite_schema() if kind == "suite" else scenario_schema()
    console.say(schema_text(found).rstrip("\n"))
    console.emit(found)
    return 0


@p.command
@click.argument("shell", type=click.Choice(("bash", "zsh", "fish")), metavar="SHELL")
def completion(console: Console, shell: str) -> int:
    r"""Print a completion script for bash, zsh or fish.

    \b
    Install it for new shells:
      pushplan completion bash > ~/.local/share/bash-completion/completions/pushplan
      pushplan completion zsh > FOLDER/_pushplan   (a FOLDER of $fpath)
      pushplan completion fish > ~/.config/fish/completions/pushplan.fish
    """
    from pushplan.cli.main import pushplan

    made = get_completion_class(shell)
    assert made is not None
    script = made(pushplan, {}, "pushplan", "_PUSHPLAN_COMPLETE").source().rstrip("\n")
    console.say(script)
    console.emit({"shell": shell, "script": script})
    return 0
