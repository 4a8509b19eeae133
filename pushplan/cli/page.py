"""The page that plays a run: written beside a log that is asked for by name, or where `--html` says."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pushplan.cli.console import Console
from pushplan.errors import OutputError

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun
    from pushplan.plans.run import Run


def write_page(done: Run | RecordedRun, html: Path | None, log: Path | None, console: Console) -> Path | None:
    """Write the page of a run and return where it is.

    Args:
        done: What the page plays.
        html: Where the user wants it; what hinders that is an error.
        log: Of the run, asked for by name: the page goes beside it where `html` is None, and what hinders that is
            only a remark. None where there is none, or no page is wanted.
        console: Takes remarks.

    Raises:
        OutputError: When the page that the user asked for cannot be written.
    """
    page = html or (None if log is None else _beside(log, console))
    if page is None:
        return None
    from pushplan.logging.page import write_html

    try:
        with console.working(f"writing {page}"):
            write_html(done, page)
    except OutputError as error:
        if html is not None:
            raise
        console.note(f"no page: {error}")
        return None
    return page


def _beside(log: Path, console: Console) -> Path | None:
    """Return where the page goes that is written beside a log; None where something else is there."""
    from pushplan.util.files import check_output

    page = log.with_suffix(".html")
    if check_output(log).streamed or page == log:
        return None
    if page.is_file() and b'id="run"' not in page.read_bytes():
        console.note(f"{page} exists and is no page of a run; --html names another one")
        return None
    return page
