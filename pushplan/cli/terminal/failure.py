"""What a user is told, and the exit code, when a command fails."""

from __future__ import annotations

import traceback

from pushplan.cli.terminal.console import Console
from pushplan.errors import PushplanError, ScenarioError
from pushplan.util.interruption import INTERRUPTED

DONE = 0
DEFECT = 1
WRONG_INPUT = 2
NO_PLAN = 3
MISMATCH = 4
PIPE_CLOSED = 141
"""What a shell reports for a program that writes to a closed pipe."""

_WRONG_PATH = (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError, PermissionError)


def report_failure(error: BaseException, console: Console) -> int:
    """Tell people, and in JSON mode the caller, what went wrong; return the exit code."""
    if isinstance(error, BrokenPipeError):
        return PIPE_CLOSED
    code, message = _explain(error)
    try:
        if console.verbose and code == DEFECT:
            console.note("".join(traceback.format_exception(error)).rstrip())
        console.note(message)
        console.emit({"error": error_document(error)})
    except BrokenPipeError:
        return PIPE_CLOSED
    return code


def _explain(error: BaseException) -> tuple[int, str]:
    match error:
        case KeyboardInterrupt():
            return INTERRUPTED, "interrupted"
        case ScenarioError():
            return WRONG_INPUT, str(error)
        case PushplanError():
            return WRONG_INPUT, f"error: {error}"
        case OSError():
            place = f"{error.filename}: " if error.filename else ""
            code = WRONG_INPUT if isinstance(error, _WRONG_PATH) else DEFECT
            return code, f"error: {place}{error.strerror or error}"
        case MemoryError():
            return DEFECT, "error: out of memory"
    return DEFECT, (
        f"error: {type(error).__name__}: {error}\n"
        "This is a defect of pushplan, not of your input. Please report it with the command and its scenario; "
        "--verbose shows where it happened."
    )


def error_document(error: BaseException) -> dict[str, object]:
    """Return what went wrong as a JSON object."""
    return {"kind": type(error).__name__, "message": str(error), **_details(error)}


def _details(error: BaseException) -> dict[str, object]:
    if not isinstance(error, ScenarioError):
        return {}
    return {"findings": [vars(finding) | {"path": error.path} for finding in error.findings]}
