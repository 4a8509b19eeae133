"""A pipe or a character device that takes an output byte by byte, and stays what it is."""

from __future__ import annotations

import errno
import os

from pushplan.errors import OutputError
from pushplan.util.outputs.open_file import OpenFile
from pushplan.util.outputs.target import Target


class Stream(OpenFile):
    """A pipe or character device; whoever reads it gets the bytes as they come.

    Raises:
        OutputError: When nobody reads the pipe, it is a terminal, or it cannot be opened.
    """

    def __init__(self, target: Target) -> None:
        super().__init__(target.path, target.path)
        with self._reporting("open"):
            try:  # without O_NONBLOCK this would wait for a reader, perhaps for ever
                self._descriptor = os.open(target.path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
            except OSError as error:
                if error.errno == errno.ENXIO:
                    what = "nobody reads this pipe; begin with its reader, or name a file"
                    raise OutputError(str(target.path), what) from error
                raise
        if os.isatty(self._descriptor):
            self.close()
            raise OutputError(str(target.path), "this is a terminal; name a file or a pipe")
        os.set_blocking(self._descriptor, True)

    def _give_back(self, size: int) -> None:
        """Do nothing: what was sent is gone."""

    def discard(self) -> None:
        """Close the stream: its reader finds that it ends too soon."""
        self.close()

    def publish(self) -> None:
        """Close the stream, which is whole."""
        self.close()
