"""What is imported by its name when it is needed: what others add, and packages that only some exports need.

What others add is called `module:attribute`, or as an entry point of an installed package.
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
    """Return `; did you mean '...'?` with the known word most like a word, or `;`."""
    import difflib  # which takes longer to load than most commands have for words that are right

    close = difflib.get_close_matches(word.lower(), list(known), n=1, cutoff=0.65)
    return f"; did you mean '{close[0]}'?" if close else ";"


_before_import: ContextVar[Callable[[str], None] | None] = ContextVar("before_import", default=None)


@contextmanager
def before_import(observer: Callable[[str], None]) -> Iterator[None]:
    """Have an observer called with each `module:attribute` before its import, which it forbids by raising."""
    token = _before_import.set(observer)
    try:
        yield
    finally:
        _before_import.reset(token)


class OpenNames(tuple[str, ...]):
    """The names of what is built in, for whom `in` is true of all that may be named: those of others too."""

    group: str

    def __new__(cls, built_in: tuple[str, ...], group: str) -> OpenNames:
        """Return the names.

        Args:
            built_in: What is built in.
            group: Entry points under which installed packages add to it.
        """
        made = super().__new__(cls, built_in)
        made.group = group
        return made

    def __contains__(self, name: object) -> bool:
        """Return whether this is a name of what is built in or installed, or has the form `module:attribute`."""
        if not isinstance(name, str):
            return False
        return super().__contains__(name) or self.adds(name)

    def adds(self, name: str) -> bool:
        """Return whether this names something that is not built in."""
        return PLACE.fullmatch(name) is not None or _entry_point(self.group, name) is not None

    @property
    def words(self) -> str:
        """All names, for users."""
        return ", or ".join([*([", ".join(self)] if self else []), "module:attribute"])


PLANNER_NAMES = OpenNames(names.PLANNERS, "pushplan.planners")
STABLE_SET_NAMES = OpenNames(names.STABLE_SETS, "pushplan.sets")
SIMULATOR_NAMES = OpenNames(names.SIMULATORS, "pushplan.simulators")
EXPORTER_NAMES = OpenNames((), "pushplan.exporters")


def gone_planner(name: str) -> str:
    """Return what has become of a planner of `names.GONE_PLANNERS`, and what to use."""
    what, instead = names.GONE_PLANNERS[name]
    return f"{name!r} is {what}; allowed: {instead}"


"""What planners, stable sets, simulators of trials and exporters of others may be called."""


def function_named(name: str, known: OpenNames, what: str) -> Callable[..., Any]:
    """Return the function of others that a name stands for.

    Args:
        name: `module:attribute`, or the name of an entry point.
        known: Names that there are.
        what: What the function is, for messages.

    Raises:
        PushplanError: If there is none, or it is no function.
    """
    found = attribute_named(name, known.group)
    if found is None:
        raise PushplanError(f"no {what} is called {name!r}; allowed: {known.words}")
    if not callable(found):
        raise PushplanError(f"the {what} {name!r} is a {type(found).__name__}; allowed: a function")
    return found  # type: ignore[no-any-return]


def attribute_named(name: str, group: str) -> Any:
    """Return what `module:attribute` names, or an entry point, None where there is neither.

    A module is looked for in the working directory too.

    Raises:
        PushplanError: If it cannot be imported or has no such attribute.
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
    """Return what an installed package adds under a name."""
    from importlib.metadata import entry_points  # as slow to load as all that the help needs

    return next(iter(entry_points(group=group, name=name)), None)


def name_of(made: Any) -> str:
    """Return `module:attribute` of a class or function, as far as it has one."""
    kind = made if hasattr(made, "__qualname__") else type(made)
    return f"{kind.__module__}:{kind.__qualname__}"


def is_of_others(made: Any) -> bool:
    """Return whether a class or function is neither pushplan's nor OMPL's."""
    return name_of(made).partition(":")[0].partition(".")[0] not in ("ompl", "pushplan")


@contextmanager
def code_of_others(kind: str, made: Any) -> Iterator[None]:
    """Turn an error of code that was added into one that names it, its file and its line.

    Args:
        kind: What it is: planner, stable set, simulator or exporter.
        made: The class or function.

    Raises:
        ExtensionError: If the code raises anything but an error of pushplan's own.
    """
    try:
        yield
    except PushplanError:
        raise
    except Exception as error:
        if not is_of_others(made):
            raise
        what = f"the {kind} {name_of(made)} fails{_place(error)}"
        raise ExtensionError(f"{what}: {type(error).__name__}: {error}") from error


def _place(error: BaseException) -> str:
    """Return file and line of the innermost code that is neither pushplan's nor a library's, if there is any."""
    found = ""
    for frame, line in traceback.walk_tb(error.__traceback__):
        path = frame.f_code.co_filename
        ours = frame.f_globals.get("__name__", "").partition(".")[0] == "pushplan"
        if not ours and "site-packages" not in path and Path(path).parent != Path(traceback.__file__).parent:
            found = f" in {path}, line {line}"
    return found


class MissingExtraError(PushplanError, ImportError):
    """An optional package is not installed; `extra` is the name under which pushplan offers it."""

    def __init__(self, what: str, package: str, extra: str) -> None:
        self.extra = extra
        super().__init__(f"{what} needs the package {package}: pip install 'pushplan[{extra}]'")


def optional(module: str, what: str, package: str, extra: str) -> Any:
    """Return the module.

    Args:
        module: Name to import.
        what: What needs it, for the error.
        package: Name of the package that has it.
        extra: Name of pushplan's extra that installs it.

    Raises:
        MissingExtraError: If it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != module.partition(".")[0]:
            raise  # the package is there, but something that it needs is not
        raise MissingExtraError(what, package, extra) from error
