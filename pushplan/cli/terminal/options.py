"""The words that several commands take, and their checks."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Literal

from pushplan.drawing import check_picture_path
from pushplan.errors import OutputError
from pushplan.util.files import check_output
from pushplan.util.names import AUTO, LOG_MAGIC


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """Declare the SCENARIO argument."""
    parser.add_argument("scenario", metavar="SCENARIO", help="a file, or the name of a packaged example")


def add_maps(parser: argparse.ArgumentParser) -> None:
    """Declare the option that adds maps to what is in the way."""
    words = "add the obstacles of a ROS map (YAML); may be given again"
    parser.add_argument("--map", metavar="FILE", type=Path, action="append", default=[], help=words)


def add_output(parser: argparse.ArgumentParser, *flags: str, help: str) -> None:
    """Declare an option that names a file to write."""
    parser.add_argument(*flags, metavar="FILE", type=Path, help=help)


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare the option that asks for a picture."""
    add_output(parser, "--plot", help=f"{what} (PNG, SVG or PDF by the suffix)")


def add_runs(parser: argparse.ArgumentParser) -> None:
    """Declare the option that names the folder of the recorded runs."""
    parser.add_argument(
        "--runs",
        metavar="DIR",
        type=Path,
        help="folder of the recorded runs (default: $PUSHPLAN_RUNS, else ~/.local/state/pushplan/runs)",
    )


def seconds(text: str) -> float:
    """Return a time limit such as `2`, `2s`, `500 ms` or `1 min`, s; argparse's `type`."""
    value = _time(text)
    if not (isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is no time limit; it must be above 0 s and finite")
    return value


def _time(text: str) -> float:
    """Return a time, s, plain or with a unit."""
    from pushplan.scenario.units import TIME, split_unit

    parts = split_unit(text)
    if parts is not None and parts[1] in TIME:
        return parts[0] * TIME[parts[1]]
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no time; allowed: seconds, or a number with one of {', '.join(TIME)}"
        ) from None


def count(text: str) -> int:
    """Return a number of things, at least one; argparse's `type`."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is too few; it must be at least 1")
    return value


def share(text: str) -> float:
    """Return a share, e.g. `0.05` or `5%`; argparse's `type`."""
    value = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
    if not (isfinite(value) and value >= 0.0):
        raise argparse.ArgumentTypeError(f"{text} is no share; it must be at least 0 and finite")
    return value


def margin(text: str) -> float | Literal["auto"]:
    """Return a margin, or `auto`; argparse's `type`."""
    if text == AUTO:
        return AUTO
    value = float(text)
    if not 0.0 <= value <= 0.99:
        raise argparse.ArgumentTypeError(f"{text} is no margin; it must be {AUTO} or from 0 to 0.99")
    return value


def seed(text: str) -> int:
    """Return a seed of random numbers; argparse's `type`."""
    value = int(text)
    if not 0 <= value < 2**31:
        raise argparse.ArgumentTypeError(f"{text} is no seed; it must be from 0 to {2**31 - 1}")
    return value


def check_outputs(
    sources: Sequence[str | Path], picture: Path | None, *others: Path | None, log: Path | None = None
) -> None:
    """Find out before the work whether its results can be written.

    Args:
        sources: The files that are read; a packaged example's name does no harm.
        picture: Picture to write; None, here as below, when not asked for.
        others: Other files to write.
        log: Run log to write.

    Raises:
        PlotError: When the picture has a suffix that is not known.
        OutputError: When one cannot be written (see `outputs.target.look`), is named twice, or is a source, or when
            the log would replace a file that is none.
    """
    if picture is not None:
        check_picture_path(picture)
    if log is not None:
        _require_log_or_nothing(log)
    taken = {Path(source).resolve() for source in sources}
    for path in (picture, log, *others):
        if path is None:
            continue
        target = check_output(path)
        if path.resolve() in taken and not (target.streamed and path.is_char_device()):
            raise OutputError(str(path), "this file is read or written already; name another one")
        taken.add(path.resolve())


def _require_log_or_nothing(path: Path) -> None:
    """Refuse to replace somebody's scenario or notes: a log is named after what it is of, and so easily like that."""
    with contextlib.suppress(OSError):
        if path.is_file() and path.stat().st_size:
            with path.open("rb") as file:
                if file.read(len(LOG_MAGIC)) != LOG_MAGIC:
                    raise OutputError(
                        str(path), "this file exists and is no run log; name another one or remove it"
                    )
