"""The errors of the package: one class per cause, each with the data that explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class PushplanError(Exception):
    """Base of every error that pushplan raises on purpose."""


@dataclass(frozen=True)
class Finding:
    """One thing wrong in a file.

    Attributes:
        where: Dotted place in the document, e.g. `objects[1].shape.box`.
        what: What is wrong and what is allowed.
        line: 1-based line, or None when the finding has no place in the text.
        column: 1-based column, or None likewise.
    """

    where: str
    what: str
    line: int | None = None
    column: int | None = None

    def text(self, path: str) -> str:
        """Return the finding as `file:LINE:COLUMN: where: what`."""
        place = "" if self.line is None else f":{self.line}:{self.column}"
        return f"{path}{place}: {self.where}: {self.what}" if self.where else f"{path}{place}: {self.what}"


class ScenarioError(PushplanError, ValueError):
    """A scenario is wrong; `findings` holds everything found, the first one also as `line` and `column`."""

    def __init__(self, path: str, findings: Sequence[Finding]) -> None:
        self.path = path
        self.findings = tuple(findings)
        self.line = self.findings[0].line
        self.column = self.findings[0].column
        super().__init__("\n".join(finding.text(path) for finding in self.findings))


class ImportedFileError(PushplanError, ValueError):
    """An outline or a map that is imported is not what it should be."""


class ChainError(PushplanError, ValueError):
    """Objects and contacts do not form a chain or a tree that the pusher carries."""


class SupportError(PushplanError, ValueError):
    """A support model is impossible or lacks what the question needs (e.g. known loads)."""


class TippingError(SupportError):
    """An object could tip over where it is pushed."""


class UndefinedEcofError(PushplanError, ValueError):
    """The friction force vanishes (the COR lies at the COF), so no line of action exists."""


class EmptyStableSetError(PushplanError):
    """No pusher twist keeps every contact."""


class PlanningError(PushplanError):
    """A planning problem cannot be posed (start or goal in collision, no turning, ...)."""


class ExtensionError(PushplanError):
    """Code that was added (a planner, stable set, simulator or exporter) fails or returns what is not allowed."""


class TimingError(PushplanError):
    """A path cannot be timed within the pusher's limits."""


class OutputError(PushplanError, ValueError):
    """A file cannot be written where `path` says."""

    def __init__(self, path: str, what: str) -> None:
        self.path = path
        super().__init__(f"{path}: {what}")


class RunLogError(PushplanError, ValueError):
    """A run log is damaged, hostile, of another kind or version; `offset` is the byte where it shows."""

    def __init__(self, path: str, what: str, offset: int | None = None) -> None:
        self.path = path
        self.offset = offset
        at = "" if offset is None else f" at byte {offset}"
        super().__init__(f"{path}{at}: {what}")


class OutOfTimeError(PlanningError):
    """The time limit ended while the problem was posed, before there was anything to search."""
