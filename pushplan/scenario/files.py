"""The files that a scenario is read from or refers to."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from pushplan.errors import SupportError
from pushplan.scenario.yaml.node import shorten
from pushplan.util.regular_file import read_regular

MOST_ATTACHED = 16 << 20
"""Bytes up to which a file that a scenario names is read."""


OUTSIDE = "a file in the scenario's folder"
"""What a name has to be, in words."""


class Attachments:
    """Contents of the files that a scenario names, from its folder or given beforehand.

    Attributes:
        contents: Bytes by name, of all files asked for.
    """

    def __init__(self, given: dict[str, bytes], folder: Path | None = None) -> None:
        self.contents: dict[str, bytes] = {}
        self._given = given
        self._folder = folder

    def read(self, name: str) -> bytes:
        """Return what the file `name` holds.

        Raises:
            SupportError: When the name leads out of the folder or the file cannot be read.
        """
        self.contents[name] = self._given[name] if name in self._given else self._from_folder(name)
        return self.contents[name]

    def _from_folder(self, name: str) -> bytes:
        if self._folder is None:
            raise SupportError(f"the file '{shorten(name)}' is not attached; needed: its contents")
        path = self._inside(name, self._folder)
        try:
            data = read_regular(path, MOST_ATTACHED + 1)
        except OSError as error:
            raise SupportError(f"cannot read '{shorten(name)}': {error.strerror or error}") from error
        if len(data) > MOST_ATTACHED:
            raise SupportError(f"'{shorten(name)}' is larger than the {MOST_ATTACHED} bytes allowed")
        return data

    @staticmethod
    def _inside(name: str, folder: Path) -> Path:
        pure = PurePosixPath(name)
        path = folder / pure
        outside = pure.is_absolute() or ".." in pure.parts or not name.isprintable()
        if outside or not path.resolve().is_relative_to(folder.resolve()):
            raise SupportError(f"is the name '{shorten(name)}'; allowed: {OUTSIDE}")
        return path
