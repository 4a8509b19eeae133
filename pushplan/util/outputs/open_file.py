"""A file that is open for writing: unbuffered, with errors that name it."""

from __future__ import annotations

import contextlib
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path

from pushplan.errors import OutputError


class OpenFile(ABC):
    """A stream of bytes; every write goes to the operating system at once.

    Attributes:
        path: As the user named it; errors begin with it.
        partial: The name under which it can be found until `publish`.
    """

    def __init__(self, path: Path, partial: Path) -> None:
        self.path, self.partial = path, partial
        self._descriptor = -1
        self._size = 0
        self._full: OSError | None = None

    @contextlib.contextmanager
    def _reporting(self, action: str) -> Iterator[None]:
        """Turn an error of the operating system into an OutputError."""
        try:
            yield
        except OSError as error:
            busy = isinstance(error, BlockingIOError)
            why = "another process is writing it" if busy else error.strerror
            raise OutputError(str(self.path), f"cannot {action} the file: {why}") from error

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Append `data`.

        Raises:
            OutputError: When the operating system takes no more (disk full, ...), and ever after.
        """
        rest = memoryview(data)
        with self._reporting("write"):
            try:
                if self._full is not None:
                    raise self._full
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
            except OSError as error:
                self._full = error
                self._give_back(self._size)
                raise
        self._size += len(data)
        return len(data)

    @abstractmethod
    def _give_back(self, size: int) -> None:
        """Take back what was written beyond `size` bytes, as far as that can be done."""

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._size

    def close(self) -> None:
        """Release the file under the name that it has."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    @abstractmethod
    def discard(self) -> None:
        """Close the file and leave nothing of it behind, as far as that can be done."""

    @abstractmethod
    def publish(self) -> None:
        """End the file, which is whole.

        Raises:
            OutputError: When the operating system refuses.
        """
