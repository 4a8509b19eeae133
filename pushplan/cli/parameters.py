"""The words that commands take: kinds of values, options that several commands share, and their checks."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import update_wrapper
from math import inf, isfinite
from pathlib import Path
from typing import Any, Literal, NamedTuple

import click
from click.shell_completion import CompletionItem

from pushplan.drawing import PANELS
from pushplan.errors import OutputError, PushplanError
from pushplan.util.names import AUTO, LOG_MAGIC


class UsageError(PushplanError, ValueError):
    """Words of the command do not go together."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return `; did you mean '...'?` with the known word most like a word, or nothing."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"; did you mean '{close[0]}'?" if close else ""


# --- kinds of values --------------------------------------------------------------------------------------------


class Number(click.ParamType[Any]):
    """A number within a range, plain or with one of some units.

    Args:
        name: What it is, e.g. `time limit`.
        low: Smallest value.
        high: Largest value.
        units: What a unit stands for.
        whole: Whether it has to be a whole number.
        above: Whether the smallest value itself is refused.
        words: Words that may stand in its place.
    """

    def __init__(
        self,
        name: str,
        low: float,
        high: float = inf,
        units: Mapping[str, float] | None = None,
        *,
        whole: bool = False,
        above: bool = False,
        words: tuple[str, ...] = (),
    ) -> None:
        self.name, self.low, self.high, self.units = name, low, high, units or {}
        self.whole, self.above, self.words = whole, above, words

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number."""
        if not isinstance(value, str) or value in self.words:
            return value
        wrong = f"is no {self.name}"
        with contextlib.suppress(ValueError):
            number = number_from(value, self.units)
            within = (self.low < number if self.above else self.low <= number) and number <= self.high
            whole = not self.whole or number.is_integer()
            if isfinite(number) and within and whole:
                return int(number) if self.whole else number
            if isfinite(number):
                wrong = "is out of range" if whole else "is no whole number"
        self.fail(f"{value!r} {wrong}; allowed: {self.allowed}", param, ctx)

    @property
    def allowed(self) -> str:
        """What may be written, in words."""
        kind = "a whole number" if self.whole else "a number"
        low = f"above {self.low:.12g}" if self.above else f"from {self.low:.12g}"
        high = f" to {self.high:.12g}" if isfinite(self.high) else ""
        unit = f", also with a unit ({', '.join(self.units)})" if self.units else ""
        return f"{''.join(f'{word}, or ' for word in self.words)}{kind} {low}{high}{unit}"


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


class Named(click.ParamType[Any]):
    """Several named values, such as `rate=20,delay=50 ms`.

    Args:
        units: Names, and the units of their numbers; a name with None takes a text.
        make: Makes of them what the command takes.
        needed: Names that have to be there.
    """

    name = "WHAT=HOW"

    def __init__(
        self,
        units: Mapping[str, Mapping[str, float] | None],
        make: Callable[[dict[str, Any]], Any] = dict,
        needed: tuple[str, ...] = (),
    ) -> None:
        self.units, self.make, self.needed = units, make, needed

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return what is made of the values."""
        if not isinstance(value, str):
            return value
        found: dict[str, Any] = {}
        for pair in value.split(","):
            name, equals, text = (piece.strip() for piece in pair.partition("="))
            if name not in self.units or not equals:
                known = ", ".join(self.units)
                self.fail(f"'{pair}' is not NAME=VALUE with a NAME of {known}{nearest(name, self.units)}", param, ctx)
            units = self.units[name]
            try:
                found[name] = text if units is None else number_from(text, units)
            except ValueError:
                allowed = ", ".join(units or ())
                self.fail(f"{name} is '{text}'; allowed: a number, also with a unit ({allowed})", param, ctx)
        for name in self.needed:
            if not found.get(name):
                self.fail(f"'{value}' does not state the {name}", param, ctx)
        try:
            return self.make(found)
        except PushplanError as error:
            self.fail(str(error), param, ctx)


class OpenName(click.ParamType[Any]):
    """A name of what is built in or of an installed package, or `module:attribute`."""

    name = "NAME"

    def __init__(self, known: Callable[[], Any]) -> None:
        self._known = known

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the name."""
        known = self._known()
        if value not in known:
            self.fail(f"{value!r} is not known{nearest(value, known)}; allowed: {known.words}", param, ctx)
        return value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the names that are built in."""
        return [CompletionItem(name) for name in self._known() if name.startswith(incomplete)]


class Scenario(click.ParamType[Any]):
    """A scenario file, or a packaged example's name."""

    name = "SCENARIO"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the examples, and have the shell look for files."""
        from pushplan.scenario.file import example_names

        names = [CompletionItem(name) for name in example_names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


class AnyPath(click.Path):
    """A path; completed as a file."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)


def _planners() -> Any:
    from pushplan.util.naming import planner_names

    return planner_names()


def _sets() -> Any:
    from pushplan.util.naming import stable_set_names

    return stable_set_names()


def _simulators() -> Any:
    from pushplan.util.naming import simulator_names

    return simulator_names()


class Export(click.ParamType[Any]):
    """What an exporter of others is called, and the file that it writes: `NAME=FILE`."""

    name = "NAME=FILE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return name and path."""
        if not isinstance(value, str):
            return value
        name, equals, path = value.rpartition("=")
        if not equals or not name or not path:
            self.fail(f"{value!r} is not NAME=FILE", param, ctx)
        from pushplan.util.naming import exporter_names

        return OpenName(exporter_names).convert(name, param, ctx), Path(path)


class Words(click.ParamType[Any]):
    """Some of a few words, separated by commas."""

    name = "words"

    def __init__(self, known: tuple[str, ...]) -> None:
        self.known = known

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the words."""
        words = tuple(value.split(",")) if isinstance(value, str) else value
        for word in words:
            if word not in self.known:
                hint = nearest(word, self.known) or ";"
                self.fail(f"{word!r} is none of them{hint} allowed: {', '.join(self.known)}", param, ctx)
        return words


_TIME = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
PLANNER, STABLE_SET, SCENARIO, PATH = OpenName(_planners), OpenName(_sets), Scenario(), AnyPath()
SIMULATOR, EXPORT = OpenName(_simulators), Export()
SECONDS = Number("time limit", 0.0, units=_TIME, above=True)
COUNT = Number("count", 1, whole=True)
RATE = Number("rate", 0.0, 1000.0, above=True)
SHARE = Number("share", 0.0, units={"%": 0.01})
MARGIN = Number("margin", 0.0, 0.99, words=(AUTO,))
SEED = Number("seed", 0, 2**31 - 1, whole=True)
PORT = Number("port", 1, 2**16 - 1, whole=True)


# --- options ----------------------------------------------------------------------------------------------------


def command(function: Callable[..., int]) -> click.Command:
    """Return the command that calls a function with the console and its words; its docstring is the help."""

    def called(json: bool, verbose: bool, **words: Any) -> int:
        from pushplan.cli.console import Console

        return function(Console(json, verbose), **words)

    update_wrapper(called, function)
    params: list[click.Parameter] = list(reversed(getattr(function, "__click_params__", [])))
    params += [
        click.Option(["--json"], is_flag=True, help="Print one JSON object on stdout."),
        click.Option(["--verbose"], is_flag=True, help="Show the traceback of an unexpected failure."),
    ]
    return click.Command(function.__name__.replace("_", "-"), callback=called, params=params, help=function.__doc__)


def file_option(*names: str, help: str) -> Callable[[Any], Any]:
    """Return an option that names a file to write."""
    return click.option(*names, type=PATH, metavar="FILE", help=help)


plot_option = file_option("--plot", help="Draw a picture (PNG, SVG or PDF by the suffix).")
panels_option = click.option(
    "--panels", type=Words(PANELS), metavar="P,...", help=f"With --plot: of {', '.join(PANELS)}."
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
    """Return the options of a command that writes a log, which takes them as one `LogChoice` called `log`.

    Args:
        help: What `-o` writes.
    """

    def decorated(function: Callable[..., int]) -> Callable[..., int]:
        def called(*args: Any, **words: Any) -> int:
            log = LogChoice(*(words.pop(name) for name in LogChoice._fields))
            if log.no_log and (log.output or log.runs):
                raise UsageError("--no-log does not go together with -o and --runs; leave one of them out")
            return function(*args, log=log, **words)

        update_wrapper(called, function)
        for option in (
            runs_option,
            click.option("--no-log", is_flag=True, help="Write no log; else one is recorded without -o, too."),
            click.option("--no-page", is_flag=True, help="Write no page beside the log."),
            file_option("-o", "--output", help=help),
        ):
            called = option(called)
        return called

    return decorated


# --- checks before the work -------------------------------------------------------------------------------------


@contextlib.contextmanager
def code_of(source: object, note: Callable[[str], None], forbidden: bool) -> Iterator[Callable[[str], None]]:
    """Say of each module that a file has imported (`module:attribute`) before it is, or refuse it.

    Yields:
        What is called with each such name.
    """
    from pushplan.util.naming import before_import

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

    with before_import(observer):
        yield observer


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
        OutputError: When one cannot be written (see `files.check_output`), is named twice, or is a source, or when
            the log would replace a file that is none.
    """
    from pushplan.util.files import check_output

    if picture is not None:
        from pushplan.drawing import check_picture_path

        check_picture_path(picture)
    if log is not None:
        with contextlib.suppress(OSError):
            if log.is_file() and log.stat().st_size and log.open("rb").read(len(LOG_MAGIC)) != LOG_MAGIC:
                raise OutputError(str(log), "this file exists and is no run log; name another one or remove it")
    taken = {Path(source).resolve() for source in sources}
    for path in (picture, log, *others):
        if path is None:
            continue
        target = check_output(path)
        if path.resolve() in taken and not (target.streamed and path.is_char_device()):
            raise OutputError(str(path), "this file is read or written already; name another one")
        taken.add(path.resolve())
