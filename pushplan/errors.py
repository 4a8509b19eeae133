"""The errors of the package: one class per cause, each with the data that explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class PushplanError(Exception):
    """Base of every error that pushplan raises on purpose."""


@dataclass(frozen=True)
class Finding:
    """One error in a file.

    Attributes:
        where: Path of the entry in the document, e.g. `objects[1].shape.box`.
        what: The error and the allowed values.
        line: Line, from 1; None if the error has no place in the text.
        column: Column, from 1; None if the error has no place in the text.
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
    """A scenario is invalid; `findings` holds all errors, `line` and `column` the place of the first."""

    def __init__(self, path: str, findings: Sequence[Finding]) -> None:
        self.path = path
        self.findings = tuple(findings)
        self.line = self.findings[0].line
        self.column = self.findings[0].column
        super().__init__("\n".join(finding.text(path) for finding in self.findings))


class ImportedFileError(PushplanError, ValueError):
    """An imported outline or map is invalid."""


class ChainError(PushplanError, ValueError):
    """The objects and contacts do not form a chain or tree that starts at the pusher."""


class SupportError(PushplanError, ValueError):
    """A support model is impossible or lacks required data, such as known loads."""


class TippingError(SupportError):
    """A push could tip an object over."""


class UndefinedEcofError(PushplanError, ValueError):
    """The friction force vanishes (the COR lies at the COF), so no line of action exists."""


class EmptyStableSetError(PushplanError):
    """No pusher twist keeps every contact."""


class PlanningError(PushplanError):
    """A planning problem is invalid, for example because the start or the goal is in collision."""


class ExtensionError(PushplanError):
    """User code (a planner, stable set, simulator or exporter) fails or returns an invalid result."""


class TimingError(PushplanError):
    """No trajectory along a path satisfies the pusher's limits."""


class OutputError(PushplanError, ValueError):
    """The file `path` cannot be written."""

    def __init__(self, path: str, what: str) -> None:
        self.path = path
        super().__init__(f"{path}: {what}")


class RunLogError(PushplanError, ValueError):
    """A run log is damaged, malicious, or of another kind or version; `offset` is the byte of the error."""

    def __init__(self, path: str, what: str, offset: int | None = None) -> None:
        self.path = path
        self.offset = offset
        at = "" if offset is None else f" at byte {offset}"
        super().__init__(f"{path}{at}: {what}")


class OutOfTimeError(PlanningError):
    """The time limit was reached during preparation, before the search began."""
