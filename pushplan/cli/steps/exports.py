"""The files that `replay` makes of a run: one option and one writer each, loaded when they are asked for."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console
from pushplan.cli.terminal.options import add_output
from pushplan.errors import PushplanError, RunLogError
from pushplan.util.files import check_output
from pushplan.util.names import BESIDE_A_BAG

if TYPE_CHECKING:
    from pushplan.logging.messages.recorded import RecordedRun
    from pushplan.plans.execution import Execution
    from pushplan.plans.result import PlanResult
    from pushplan.scenario.model import Scenario

WRITERS = {
    "html": ("page", "write_html", "write a page that plays the run"),
    "csv": ("tables", "write_csv", "write the executed samples as a table"),
    "trajectory": (
        "tables",
        "write_trajectory",
        "write the timed motion as JSON, of chain and robot",
    ),
    "mp4": ("film", "write_mp4", "write a film of the run"),
    "ros2": (
        "bag",
        "write_ros2",
        "write a bag that `ros2 bag play` takes (MCAP, CDR), and beside it .rviz",
    ),
    "layout": (
        "layout",
        "write_layout",
        "write a layout that makes Foxglove and Lichtblick show the run",
    ),
}
"""Module in `pushplan.logging`, function and help of each option."""


class ExportsError(PushplanError):
    """Some of the files asked for cannot be had of this run."""

    def __init__(self, failures: Mapping[str, PushplanError], written: list[str]) -> None:
        done = f"written: {', '.join(written)}; " if written else ""
        reasons = (f"--{name}: {error}" for name, error in failures.items())
        super().__init__(f"{done}not written: " + "; ".join(reasons))


def declare_exports(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    for name, (_, _, about) in WRITERS.items():
        add_output(parser, f"--{name}", help=about)
    group = parser.add_argument_group("with --ros2")
    group.add_argument(
        "--frames",
        metavar="MAP,BASE",
        help="names of the frames above the chain, or MAP,ODOM,BASE (map,odom,base_link)",
    )
    group.add_argument(
        "--epoch", metavar="S", type=_epoch, help="ROS time at which the run begins (when it was begun)"
    )


def _epoch(text: str) -> float:
    """Return a time of the bag's beginning, s; argparse's `type`."""
    value = float(text)
    if not (isfinite(value) and 0.0 < value < 2.0**31):
        raise argparse.ArgumentTypeError(f"{text} is no time for ROS; it must be above 0 and below 2^31 s")
    return value


def asked_for(args: argparse.Namespace) -> dict[str, Path]:
    """Return the files asked for, by option."""
    return {name: path for name in WRITERS if (path := getattr(args, name)) is not None}


def outputs(args: argparse.Namespace) -> list[Path]:
    """Return all files that are written for those asked for."""
    bag = asked_for(args).get("ros2")
    beside = [] if bag is None or check_output(bag).streamed else [bag.with_suffix(BESIDE_A_BAG)]
    return [*asked_for(args).values(), *beside]


def write_exports(recorded: RecordedRun, args: argparse.Namespace, console: Console) -> None:
    """Write the files asked for: all that can be, then say which cannot.

    Raises:
        PushplanError: When a package is missing, or a file cannot be written or cannot be made of this run.
    """
    tasks: dict[str, Callable[[], None]] = {}
    if args.plot is not None:
        tasks["plot"] = partial(_draw_recorded, recorded, args.plot, console)
    tasks |= {name: _task(name, path, recorded, args, console) for name, path in asked_for(args).items()}
    failures: dict[str, PushplanError] = {}
    for name, task in tasks.items():
        try:
            task()
        except PushplanError as error:
            failures[name] = error
    if len(tasks) == 1 and failures:
        raise next(iter(failures.values()))
    if failures:
        raise ExportsError(failures, [f"--{name}" for name in tasks if name not in failures])


def _draw_recorded(recorded: RecordedRun, path: Path, console: Console) -> None:
    if recorded.plan is None:
        raise RunLogError(str(recorded.path), "the log ends before a plan, so there is nothing to draw")
    draw(recorded.scenario, recorded.plan, recorded.execution, path, console)


def draw(
    scenario: Scenario, plan: PlanResult, execution: Execution | None, path: Path, console: Console
) -> None:
    """Draw a plan into a file."""
    with console.computing(f"drawing {path}"):
        from pushplan.drawing.plans import plot_plan

        plot_plan(plan.as_plan(scenario, execution), path)


def _task(
    name: str, path: Path, recorded: RecordedRun, args: argparse.Namespace, console: Console
) -> Callable[[], None]:
    def write() -> None:
        module, function, _ = WRITERS[name]
        with console.working(f"writing {path}"):
            writer = getattr(import_module(f"pushplan.logging.{module}"), function)
            writer(recorded, path, **_how(name, args))

    return write


def _how(name: str, args: argparse.Namespace) -> dict[str, object]:
    """Return what else is asked of a writer."""
    if name != "ros2":
        return {}
    from pushplan.logging.bag import Frames

    return {"frames": Frames.from_text(args.frames) if args.frames else None, "epoch": args.epoch}
