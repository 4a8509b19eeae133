"""The scenarios that come with the package."""

from __future__ import annotations

import difflib
from importlib.resources import files
from importlib.resources.abc import Traversable

from pushplan.errors import PushplanError

_SUFFIX = ".yaml"


def example_names() -> tuple[str, ...]:
    """Return the names of the packaged scenarios, in alphabetical order."""
    found = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in found if name.endswith(_SUFFIX)))


def example_text(name: str) -> str:
    """Return the file of a packaged scenario.

    Raises:
        PushplanError: When there is none of that name.
    """
    return example_file(name).read_text(encoding="utf-8")


def example_file(name: str) -> Traversable:
    """Return where a packaged scenario is.

    Raises:
        PushplanError: When there is none of that name.
    """
    names = example_names()
    if name not in names:
        close = difflib.get_close_matches(name.lower(), names, n=1)
        meant = f"did you mean '{close[0]}'? " if close else ""
        raise PushplanError(f"no packaged scenario is called '{name}'; {meant}there are {', '.join(names)}")
    return _folder() / (name + _SUFFIX)


def _folder() -> Traversable:
    return files("pushplan") / "scenarios"
