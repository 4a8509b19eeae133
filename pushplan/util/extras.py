"""Packages that only some exports need, imported when they are."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from pushplan.errors import PushplanError


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
        MissingExtraError: When it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != module.partition(".")[0]:
            raise  # the package is there, but something that it needs is not
        raise MissingExtraError(what, package, extra) from error
