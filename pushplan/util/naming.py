"""Imports by name: extensions of users, and optional packages that only some exports need.

An extension is named as `module:attribute`, or as an entry point of an installed package.
"""

from __future__ import annotations

import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pushplan.errors import ExtensionError, PushplanError
from pushplan.util import names

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PLACE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
"""The form of `module:attribute`."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return `; did you mean '...'?` with the known word most similar to a word, or `;`."""
    import difflib  # imported here because it loads slowly and is rarely needed

    close = difflib.get_close_matches(word.lower(), list(known), n=1, cutoff=0.65)
    return f"; did you mean '{close[0]}'?" if close else ";"


_before_import: ContextVar[Callable[[str], None] | None] = ContextVar("before_import", default=None)


@contextmanager
def before_import(observer: Callable[[str], None]) -> Iterator[None]:
    """Call an observer with each `module:attribute` before its import; it can prevent the import by an exception."""
    token = _before_import.set(observer)
    try:
        yield
    finally:
        _before_import.reset(token)


class OpenNames(tuple[str, ...]):
    """Names of built-in extensions; `in` is also true for names of installed extensions and `module:attribute`."""

    group: str

    def __new__(cls, built_in: tuple[str, ...], group: str) -> OpenNames:
        """Return the names.

        Args:
            built_in: Names of the built-in extensions.
            group: Group of entry points for the extensions of installed packages.
        """
        made = super().__new__(cls, built_in)
        made.group = group
        return made

    def __contains__(self, name: object) -> bool:
        """Return whether a name is built in or installed, or has the form `module:attribute`."""
        if not isinstance(name, str):
            return False
        return super().__contains__(name) or self.adds(name)

    def adds(self, name: str) -> bool:
        """Return whether a name stands for an extension that is not built in."""
        return PLACE.fullmatch(name) is not None or _entry_point(self.group, name) is not None

    @property
    def words(self) -> str:
        """All names, for messages."""
        return ", or ".join([*([", ".join(self)] if self else []), "module:attribute"])


PLANNER_NAMES = OpenNames(names.PLANNERS, "pushplan.planners")
STABLE_SET_NAMES = OpenNames(names.STABLE_SETS, "pushplan.sets")
SIMULATOR_NAMES = OpenNames(names.SIMULATORS, "pushplan.simulators")
EXPORTER_NAMES = OpenNames((), "pushplan.exporters")


def gone_planner(name: str) -> str:
    """Return the message for a removed planner, with its replacement."""
    what, instead = names.GONE_PLANNERS[name]
    return f"{name!r} is {what}; allowed: {instead}"


def function_named(name: str, known: OpenNames, what: str) -> Callable[..., Any]:
    """Return the function of an extension by its name.

    Args:
        name: `module:attribute`, or the name of an entry point.
        known: Known names.
        what: Noun for the function, for messages.

    Raises:
        PushplanError: If there is no such function.
    """
    found = attribute_named(name, known.group)
    if found is None:
        raise PushplanError(f"no {what} is called {name!r}; allowed: {known.words}")
    if not callable(found):
        raise PushplanError(f"the {what} {name!r} is a {type(found).__name__}; allowed: a function")
    return found  # type: ignore[no-any-return]


def attribute_named(name: str, group: str) -> Any:
    """Return the object of a `module:attribute` or an entry point; None if the name is neither.

    Modules are also searched for in the working directory.

    Raises:
        PushplanError: If the module cannot be imported or has no such attribute.
    """
    if PLACE.fullmatch(name) is None:
        found = _entry_point(group, name)
        if found is None:
            return None
        name = found.value
    elif (observer := _before_import.get()) is not None:
        observer(name)
    module, _, path = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        value: Any = import_module(module)
        for part in path.split("."):
            value = getattr(value, part)
    except (ImportError, AttributeError) as error:
        raise PushplanError(f"cannot load {name!r}: {error}; allowed: module:attribute") from error
    except Exception as error:
        raise ExtensionError(f"cannot load {name!r}{_place(error)}: {type(error).__name__}: {error}") from error
    return value


def _entry_point(group: str, name: str) -> EntryPoint | None:
    """Return the entry point of an installed package by its name."""
    from importlib.metadata import entry_points  # imported here because it would double the time of `--help`

    return next(iter(entry_points(group=group, name=name)), None)


def name_of(made: Any) -> str:
    """Return `module:attribute` of a class or function; for another object, that of its class."""
    kind = made if hasattr(made, "__qualname__") else type(made)
    return f"{kind.__module__}:{kind.__qualname__}"


def is_user_code(made: Any) -> bool:
    """Return whether a class or function is neither pushplan's nor OMPL's."""
    return name_of(made).partition(":")[0].partition(".")[0] not in ("ompl", "pushplan")


@contextmanager
def user_code(kind: str, made: Any) -> Iterator[None]:
    """Convert an error of an extension to one with its name, file and line.

    Args:
        kind: Kind of the extension: planner, stable set, simulator or exporter.
        made: Class or function of the extension.

    Raises:
        ExtensionError: If the code raises an error that is not pushplan's own.
    """
    try:
        yield
    except PushplanError:
        raise
    except Exception as error:
        if not is_user_code(made):
            raise
        what = f"the {kind} {name_of(made)} fails{_place(error)}"
        raise ExtensionError(f"{what}: {type(error).__name__}: {error}") from error


def _place(error: BaseException) -> str:
    """Return file and line of the innermost code that belongs to neither pushplan nor a library; empty if none."""
    found = ""
    for frame, line in traceback.walk_tb(error.__traceback__):
        path = frame.f_code.co_filename
        ours = frame.f_globals.get("__name__", "").partition(".")[0] == "pushplan"
        if not ours and "site-packages" not in path and Path(path).parent != Path(traceback.__file__).parent:
            found = f" in {path}, line {line}"
    return found


class MissingExtraError(PushplanError, ImportError):
    """An optional package is not installed; `extra` is the extra of pushplan that installs it."""

    def __init__(self, what: str, package: str, extra: str) -> None:
        self.extra = extra
        super().__init__(f"{what} needs the package {package}: pip install 'pushplan[{extra}]'")


def optional(module: str, what: str, package: str, extra: str) -> Any:
    """Import an optional module.

    Args:
        module: Name of the module.
        what: Operation that needs the module, for the error.
        package: Package that provides the module.
        extra: Extra of pushplan that installs the package.

    Raises:
        MissingExtraError: If the package is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != module.partition(".")[0]:
            raise  # the package is installed, but one of its dependencies is not
        raise MissingExtraError(what, package, extra) from error
