"""The words that commands take: kinds of values, options that several commands share, and their checks."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import update_wrapper
from math import inf, isfinite
from pathlib import Path
from typing import Any, Literal, NamedTuple

import click
from click.shell_completion import CompletionItem

from pushplan.drawing import PANELS
from pushplan.errors import OutputError, PushplanError
from pushplan.util import naming
from pushplan.util.names import AUTO, GONE_PLANNERS, LOG_MAGIC


class UsageError(PushplanError, ValueError):
    """Words of the command do not go together."""


# --- kinds of values --------------------------------------------------------------------------------------------


class Word(click.ParamType[Any]):
    """A word, and what is made of it.

    Args:
        name: What help calls it.
        read: Returns what the command takes, or raises a ValueError or PushplanError that says what is wrong.
        known: Returns words that shells complete.
        files: Whether shells complete files, too.
    """

    def __init__(
        self, name: str, read: Callable[[str], Any], known: Callable[[], Iterable[str]] = tuple, files: bool = False
    ) -> None:
        self.name, self._read, self._known, self._files = name, read, known, files

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return what is made of a word; a default is taken as it is."""
        try:
            return self._read(value) if isinstance(value, str) else value
        except (PushplanError, ValueError) as error:
            self.fail(str(error), param, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the known words that begin so, and have the shell look for files."""
        names = [CompletionItem(name) for name in self._known() if name.startswith(incomplete)]
        return [*names, *([CompletionItem(incomplete, type="file")] if self._files else [])]


def number(
    name: str,
    low: float,
    high: float = inf,
    units: Mapping[str, float] | None = None,
    *,
    whole: bool = False,
    above: bool = False,
    words: tuple[str, ...] = (),
) -> Word:
    """Return a number within a range, plain or with one of some units.

    Args:
        name: What it is, e.g. `time limit`.
        low: Smallest value.
        high: Largest value.
        units: What a unit stands for.
        whole: Whether it has to be a whole number.
        above: Whether the smallest value itself is refused.
        words: Words that may stand in its place.
    """
    known = units or {}
    allowed = "".join(f"{word}, or " for word in words) + ("a whole number" if whole else "a number")
    allowed += f" above {low:.12g}" if above else f" from {low:.12g}"
    allowed += f" to {high:.12g}" if isfinite(high) else ""
    allowed += f", also with a unit ({', '.join(known)})" if known else ""

    def read(text: str) -> Any:
        if text in words:
            return text
        wrong = f"is no {name}"
        with contextlib.suppress(ValueError):
            value = number_from(text, known)
            within = (low < value if above else low <= value) and value <= high
            if isfinite(value) and within and (value.is_integer() or not whole):
                return int(value) if whole else value
            if isfinite(value):
                wrong = "is no whole number" if whole and not value.is_integer() else "is out of range"
        raise ValueError(f"{text!r} {wrong}; allowed: {allowed}")

    return Word(name, read)


def number_from(text: str, units: Mapping[str, float]) -> float:
    """Return a number, plain or with one of the `units`, which state their size.

    Raises:
        ValueError: When it is neither.
    """
    text = text.strip()
    for unit in sorted(units, key=len, reverse=True):
        if unit and text.endswith(unit):
            with contextlib.suppress(ValueError):
                return float(text.removesuffix(unit)) * units[unit]
    return float(text)


def named(
    units: Mapping[str, Mapping[str, float] | None],
    make: Callable[[dict[str, Any]], Any] = dict,
    needed: tuple[str, ...] = (),
) -> Word:
    """Return several named values, such as `rate=20,delay=50 ms`.

    Args:
        units: Names, and the units of their numbers; a name with None takes a text.
        make: Makes of them what the command takes.
        needed: Names that have to be there.
    """

    def read(value: str) -> Any:
        found: dict[str, Any] = {}
        for pair in value.split(","):
            name, equals, text = (piece.strip() for piece in pair.partition("="))
            if name not in units or not equals:
                hint = naming.nearest(name, units).rstrip(";")
                raise ValueError(f"'{pair}' is not NAME=VALUE with a NAME of {', '.join(units)}{hint}")
            known = units[name]
            try:
                found[name] = text if known is None else number_from(text, known)
            except ValueError:
                what = f"a number, also with a unit ({', '.join(known or ())})"
                raise ValueError(f"{name} is '{text}'; allowed: {what}") from None
        for name in needed:
            if not found.get(name):
                raise ValueError(f"'{value}' does not state the {name}")
        return make(found)

    return Word("WHAT=HOW", read)


def open_name(known: naming.OpenNames) -> Word:
    """Return a name of what is built in or of an installed package, or `module:attribute`."""

    def read(name: str) -> str:
        if known is naming.PLANNER_NAMES and name in GONE_PLANNERS:
            raise ValueError(naming.gone_planner(name))
        if name not in known:
            raise ValueError(f"{name!r} is not known{naming.nearest(name, known)} allowed: {known.words}")
        return name

    return Word("NAME", read, lambda: known)


def some_of(known: tuple[str, ...]) -> Word:
    """Return some of a few words, separated by commas."""

    def read(value: str) -> tuple[str, ...]:
        for word in value.split(","):
            if word not in known:
                hint = naming.nearest(word, known)
                raise ValueError(f"{word!r} is none of them{hint} allowed: {', '.join(known)}")
        return tuple(value.split(","))

    return Word("words", read)


def _export(value: str) -> tuple[str, Path]:
    """Return what an exporter of others is called, and the file that it writes."""
    name, _, path = value.rpartition("=")
    if not name or not path:
        raise ValueError(f"{value!r} is not NAME=FILE")
    return EXPORTER.convert(name, None, None), Path(path)


def _examples() -> tuple[str, ...]:
    from pushplan.scenario.file import example_names

    return example_names()


_TIME = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
PLANNER, STABLE_SET = open_name(naming.PLANNER_NAMES), open_name(naming.STABLE_SET_NAMES)
SIMULATOR, EXPORTER = open_name(naming.SIMULATOR_NAMES), open_name(naming.EXPORTER_NAMES)
SCENARIO, EXPORT, PATH = (
    Word("SCENARIO", str, _examples, True),
    Word("NAME=FILE", _export),
    click.Path(path_type=Path),
)
SECONDS = number("time limit", 0.0, units=_TIME, above=True)
COUNT = number("count", 1, whole=True)
RATE = number("rate", 0.0, 1000.0, above=True)
SHARE = number("share", 0.0, units={"%": 0.01})
MARGIN = number("margin", 0.0, 0.99, words=(AUTO,))
SEED = number("seed", 0, 2**31 - 1, whole=True)
PORT = number("port", 1, 2**16 - 1, whole=True)


# --- options ----------------------------------------------------------------------------------------------------


def command(function: Callable[..., int]) -> click.Command:
    """Return the command that calls a function with the console and its words; its docstring is the help.

    What `log_options` take is one word, `log`.
    """

    def called(json: bool, verbose: bool, **words: Any) -> int:
        from pushplan.cli.console import Console

        words.pop("overwrite", None)  # which `overwriting` tells
        if "no_log" in words:
            words["log"] = log = LogChoice(*(words.pop(name) for name in LogChoice._fields))
            if log.no_log and (log.output or log.runs):
                raise UsageError("--no-log does not go together with -o and --runs; leave one of them out")
        return function(Console(json, verbose), **words)

    update_wrapper(called, function)
    params: list[click.Parameter] = list(reversed(getattr(function, "__click_params__", [])))
    if any(isinstance(one, click.Option) and (one.metavar == "FILE" or one.name == "output") for one in params):
        params.append(click.Option(["--overwrite"], is_flag=True, help="Replace files that pushplan did not write."))
    params += [
        click.Option(["--json"], is_flag=True, help="Print one JSON object on stdout."),
        click.Option(["--verbose"], is_flag=True, help="Show the traceback of an unexpected failure."),
    ]
    return click.Command(function.__name__.replace("_", "-"), callback=called, params=params, help=function.__doc__)


def overwriting() -> bool:
    """Tell whether the command that is running may replace files that pushplan did not write."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.params.get("overwrite"))


def file_option(*names: str, help: str) -> Callable[[Any], Any]:
    """Return an option that names a file to write."""
    return click.option(*names, type=PATH, metavar="FILE", help=help)


plot_option = file_option("--plot", help="Draw a picture (PNG, SVG or PDF by the suffix).")
panels_option = click.option(
    "--panels", type=some_of(PANELS), metavar="P,...", help=f"With --plot: of {', '.join(PANELS)}."
)
scenario_argument = click.argument("scenario", type=SCENARIO, metavar="SCENARIO")
map_option = click.option(
    "--map",
    "maps",
    type=PATH,
    metavar="FILE",
    multiple=True,
    help="Add the obstacles of a ROS map (YAML); may be given again.",
)
runs_option = click.option("--runs", type=PATH, metavar="DIR", help="Folder of the recorded runs.")
no_code_option = click.option(
    "--no-code", is_flag=True, help="Refuse planners and stable sets that a file names as module:attribute."
)
physics_option = click.option(
    "--physics",
    is_flag=True,
    help="Execute the plan in MuJoCo, too, at its own speed with all inertia; exit code 4 when a contact moved.",
)


class LogChoice(NamedTuple):
    """Where a command writes its log and the log's page.

    Attributes:
        output: The file that the user has named.
        runs: Folder of the recorded runs.
        no_log: Write none; else one is recorded in that folder where no file is named.
        no_page: Write no page beside the file that is named.
    """

    output: Path | None
    runs: Path | None
    no_log: bool
    no_page: bool

    @property
    def where(self) -> Path | Literal[False] | None:
        """The file; None for one among the recorded runs, False for none."""
        return False if self.no_log else self.output

    @property
    def paged(self) -> Path | None:
        """The log that gets a page beside it."""
        return None if self.no_page else self.output


def log_options(help: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return the options of a command that writes a log, which takes them as a `LogChoice` called `log`.

    Args:
        help: What `-o` writes.
    """

    def decorated(function: Callable[..., int]) -> Callable[..., int]:
        for option in (
            runs_option,
            click.option("--no-log", is_flag=True, help="Write no log; else one is recorded without -o, too."),
            click.option("--no-page", is_flag=True, help="Write no page beside the log."),
            file_option("-o", "--output", help=help),
        ):
            function = option(function)
        return function

    return decorated


# --- checks before the work -------------------------------------------------------------------------------------


@contextlib.contextmanager
def code_of(source: object, note: Callable[[str], None], forbidden: bool) -> Iterator[Callable[[str], None]]:
    """Say of each module that a file has imported (`module:attribute`) before it is, or refuse it.

    Yields:
        What is called with each such name.
    """
    told: set[str] = set()

    def observer(name: str) -> None:
        module = name.partition(":")[0]
        if module.partition(".")[0] in ("pushplan", "ompl"):  # planners that are built in
            return
        if forbidden:
            raise UsageError(f"{source}: {name} is code, and --no-code refuses to import the module {module}")
        if module not in told:
            told.add(module)
            note(f"{source}: imports the module {module}")

    with naming.before_import(observer):
        yield observer


def only_with(partner: str, wanted: bool, **options: object) -> None:
    """Refuse options that have no meaning without another one."""
    for name, value in options.items():
        if value is not None and not wanted:
            raise UsageError(f"--{name} has no meaning without --{partner}")


_OURS = re.compile(
    rb"\x89PNG|%PDF-|<\?xml|....ftyp|t,segment,|Panels:|# learned by pushplan|"
    rb"\{\s*\"(format\": \"pushplan-trajectory|configById)|<!doctype html>.*\bid=\"run\"",
    re.DOTALL,
)
"""What files begin with that commands write, but for logs."""


def _require_ours(path: Path, what: str) -> None:
    """Refuse to replace a file that is none of pushplan's results.

    Raises:
        OutputError: When it is none.
    """
    with contextlib.suppress(OSError):
        data = path.read_bytes() if path.is_file() else b""
        ours = data.startswith(LOG_MAGIC) or (what != "run log" and _OURS.match(data))
        if data and not ours:
            raise OutputError(
                str(path), f"this file exists and is no {what}; name another one, or replace it with --overwrite"
            )


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
        OutputError: When one cannot be written (see `files.check_output`), is named twice, or is a source, or would
            replace a file that is no result of pushplan.
    """
    from pushplan.util.files import check_output

    if picture is not None:
        from pushplan.drawing import check_picture_path

        check_picture_path(picture)
    taken = {Path(source).resolve() for source in sources}
    for path in (picture, log, *others):
        if path is None:
            continue
        target = check_output(path)
        if path.resolve() in taken and not (target.streamed and path.is_char_device()):
            raise OutputError(str(path), "this file is read or written already; name another one")
        taken.add(path.resolve())
        if not target.streamed and not overwriting():
            _require_ours(path, "run log" if path == log else "result of pushplan")
