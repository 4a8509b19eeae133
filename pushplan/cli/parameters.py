"""Arguments of the commands: types of values, shared options, and checks."""

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
    """Arguments of the command are wrong or do not go together."""


# --- types of values --------------------------------------------------------------------------------------------


class ValueType(click.ParamType[Any]):
    """Type of an argument: converts its text to a value.

    Args:
        name: Name in the help text.
        read: Function from text to value; it raises a ValueError or PushplanError with the reason.
        known: Function that returns the completions for shells.
        files: Whether shells also complete files.
    """

    def __init__(
        self, name: str, read: Callable[[str], Any], known: Callable[[], Iterable[str]] = tuple, files: bool = False
    ) -> None:
        self.name, self._read, self._known, self._files = name, read, known, files

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the value of a text; other values (defaults) are returned unchanged."""
        try:
            return self._read(value) if isinstance(value, str) else value
        except (PushplanError, ValueError) as error:
            self.fail(str(error), param, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the completions that start with `incomplete`, and files if allowed."""
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
) -> ValueType:
    """Return the type of a number within a range, with an optional unit.

    Args:
        name: Name in messages, e.g. `time limit`.
        low: Smallest value.
        high: Largest value.
        units: Sizes of the units.
        whole: Whether the number must be whole.
        above: Whether `low` itself is excluded.
        words: Words that are allowed instead of a number.
    """
    known = units or {}
    allowed = "".join(f"{word}, or " for word in words) + ("a whole number" if whole else "a number")
    allowed += f" above {low:.12g}" if above else f" from {low:.12g}"
    allowed += f" to {high:.12g}" if isfinite(high) else ""
    allowed += f", also with a unit ({', '.join(known)})" if known else ""

    def read(text: str) -> Any:
        if text in words:
            return text
        wrong = f"is not a {name}"
        with contextlib.suppress(ValueError):
            value = number_from(text, known)
            within = (low < value if above else low <= value) and value <= high
            if isfinite(value) and within and (value.is_integer() or not whole):
                return int(value) if whole else value
            if isfinite(value):
                wrong = "is not a whole number" if whole and not value.is_integer() else "is out of range"
        raise ValueError(f"{text!r} {wrong}; allowed: {allowed}")

    return ValueType(name, read)


def number_from(text: str, units: Mapping[str, float]) -> float:
    """Return the number in a text, with an optional unit.

    Raises:
        ValueError: If the text is not a number.
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
) -> ValueType:
    """Return the type of several named values, such as `rate=20,delay=50 ms`.

    Args:
        units: Names, and the units of their numbers; None for a text.
        make: Function from the values by name to the argument of the command.
        needed: Required names.
    """

    def read(value: str) -> Any:
        found: dict[str, Any] = {}
        for pair in value.split(","):
            name, equals, text = (piece.strip() for piece in pair.partition("="))
            if name not in units or not equals:
                hint = naming.nearest(name, units).rstrip(";")
                raise ValueError(f"'{pair}' is not NAME=VALUE; allowed names: {', '.join(units)}{hint}")
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

    return ValueType("NAME=VALUE", read)


def open_name(known: naming.OpenNames) -> ValueType:
    """Return the type of an extensible name: built in, from an installed package, or `module:attribute`."""

    def read(name: str) -> str:
        if known is naming.PLANNER_NAMES and name in GONE_PLANNERS:
            raise ValueError(naming.gone_planner(name))
        if name not in known:
            raise ValueError(f"{name!r} is unknown{naming.nearest(name, known)} allowed: {known.words}")
        return name

    return ValueType("NAME", read, lambda: known)


def some_of(known: tuple[str, ...]) -> ValueType:
    """Return the type of a list of known words, separated by commas."""

    def read(value: str) -> tuple[str, ...]:
        for word in value.split(","):
            if word not in known:
                hint = naming.nearest(word, known)
                raise ValueError(f"{word!r} is unknown{hint} allowed: {', '.join(known)}")
        return tuple(value.split(","))

    return ValueType("words", read)


def _export(value: str) -> tuple[str, Path]:
    """Return the name of an exporter and the file that it writes."""
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
    ValueType("SCENARIO", str, _examples, True),
    ValueType("NAME=FILE", _export),
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
    """Return the command that calls a function with the console and its arguments; its docstring is the help.

    The values of `log_options` are one argument, `log`.
    """

    def called(json: bool, verbose: bool, **words: Any) -> int:
        from pushplan.cli.console import Console

        words.pop("overwrite", None)  # `overwriting` returns it
        if "no_log" in words:
            words["log"] = log = LogChoice(*(words.pop(name) for name in LogChoice._fields))
            if log.no_log and (log.output or log.runs):
                raise UsageError("--no-log cannot be combined with -o or --runs; leave one of them out")
        return function(Console(json, verbose), **words)

    update_wrapper(called, function)
    params: list[click.Parameter] = list(reversed(getattr(function, "__click_params__", [])))
    if any(isinstance(one, click.Option) and (one.metavar == "FILE" or one.name == "output") for one in params):
        params.append(click.Option(["--overwrite"], is_flag=True, help="Replace files that pushplan did not write."))
    params += [
        click.Option(["--json"], is_flag=True, help="Print one JSON object on stdout."),
        click.Option(["--verbose"], is_flag=True, help="Show the traceback of an unexpected failure."),
    ]
    about = (function.__doc__ or "").replace(r"\b", "\b")  # click keeps the lines of a paragraph after this character
    return click.Command(function.__name__.replace("_", "-"), callback=called, params=params, help=about)


def overwriting() -> bool:
    """Return whether the running command can replace files that pushplan did not write."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.params.get("overwrite"))


def file_option(*names: str, help: str) -> Callable[[Any], Any]:
    """Return an option for an output file."""
    return click.option(*names, type=PATH, metavar="FILE", help=help)


plot_option = file_option("--plot", help="Draw a picture: .png, .svg or .pdf.")
panels_option = click.option(
    "--panels", type=some_of(PANELS), metavar="P,...", help=f"With --plot: panels, of {', '.join(PANELS)}."
)
scenario_argument = click.argument("scenario", type=SCENARIO, metavar="SCENARIO")
map_option = click.option(
    "--map",
    "maps",
    type=PATH,
    metavar="MAP",
    multiple=True,
    help="Add the obstacles of a ROS map (YAML); can be repeated.",
)
runs_option = click.option("--runs", type=PATH, metavar="DIR", help="Folder of the recorded runs.")
no_code_option = click.option(
    "--no-code", is_flag=True, help="Refuse files that name planners or stable sets as module:attribute."
)
physics_option = click.option(
    "--physics",
    is_flag=True,
    help="Also execute the plan in MuJoCo, at full speed with inertia; exit code 4 if a contact moves.",
)


class LogChoice(NamedTuple):
    """Destination of a command's log and of its page.

    Attributes:
        output: Log file that the user named; without one the log goes into `runs`.
        runs: Folder of the recorded runs.
        no_log: Whether no log is written.
        no_page: Whether no page is written beside `output`.
    """

    output: Path | None
    runs: Path | None
    no_log: bool
    no_page: bool

    @property
    def where(self) -> Path | Literal[False] | None:
        """Log file; None for a new one in the folder of runs, False for no log."""
        return False if self.no_log else self.output

    @property
    def paged(self) -> Path | None:
        """Log with a page beside it; None without a page."""
        return None if self.no_page else self.output


def log_options(help: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return the options of a command that writes a log; the command gets them as a `LogChoice` named `log`.

    Args:
        help: Help text of `-o`.
    """

    def decorated(function: Callable[..., int]) -> Callable[..., int]:
        for option in (
            runs_option,
            click.option("--no-log", is_flag=True, help="Write no log; by default a log is written even without -o."),
            click.option("--no-page", is_flag=True, help="Write no page beside the log."),
            file_option("-o", "--output", help=help),
        ):
            function = option(function)
        return function

    return decorated


# --- checks before a command starts -----------------------------------------------------------------------------


@contextlib.contextmanager
def code_of(source: object, note: Callable[[str], None], forbidden: bool) -> Iterator[Callable[[str], None]]:
    """Announce each module that a file imports (`module:attribute`) before the import, or refuse it.

    Yields:
        Function that is called with each such name.
    """
    announced: set[str] = set()

    def observer(name: str) -> None:
        module = name.partition(":")[0]
        if module.partition(".")[0] in ("pushplan", "ompl"):  # built-in planners
            return
        if forbidden:
            raise UsageError(f"{source}: {name} is code, and --no-code refuses to import the module {module}")
        if module not in announced:
            announced.add(module)
            note(f"{source}: imports the module {module}")

    with naming.before_import(observer):
        yield observer


def only_with(partner: str, wanted: bool, **options: object) -> None:
    """Refuse options that have no effect without option `partner`."""
    for name, value in options.items():
        if value is not None and not wanted:
            raise UsageError(f"--{name} has no effect without --{partner}; add --{partner} or leave --{name} out")


_OURS = re.compile(
    rb"\x89PNG|%PDF-|<\?xml|....ftyp|t,segment,|Panels:|# learned by pushplan|"
    rb"\{\s*\"(format\": \"pushplan-trajectory|configById)|<!doctype html>.*\bid=\"run\"",
    re.DOTALL,
)
"""First bytes of all files that commands write, except logs."""


def _require_ours(path: Path, what: str) -> None:
    """Refuse to replace a file that pushplan did not write.

    Raises:
        OutputError: If it is such a file.
    """
    with contextlib.suppress(OSError):
        data = path.read_bytes() if path.is_file() else b""
        ours = data.startswith(LOG_MAGIC) or (what != "run log" and _OURS.match(data))
        if data and not ours:
            raise OutputError(
                str(path), f"this file exists and is not a {what}; name another one, or replace it with --overwrite"
            )


def check_outputs(
    sources: Sequence[str | Path], picture: Path | None, *others: Path | None, log: Path | None = None
) -> None:
    """Check before a command starts that its results can be written.

    Args:
        sources: Files to read; names of packaged examples have no effect.
        picture: Picture to write, or None.
        others: Other files to write, or None.
        log: Run log to write, or None.

    Raises:
        PlotError: If the suffix of the picture is unknown.
        OutputError: If a file cannot be written (see `files.check_output`), is named twice, is a source, or would
            replace a file that pushplan did not write.
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
            raise OutputError(str(path), "the command also reads or writes this file elsewhere; name another one")
        taken.add(path.resolve())
        if not target.streamed and not overwriting():
            _require_ours(path, "run log" if path == log else "result of pushplan")
