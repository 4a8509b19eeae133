"""Pictures: the palette, the scene that all viewers draw, and figures of plans, stable sets and trials.

What is here is known without loading the drawing library.
"""

from __future__ import annotations

from pathlib import Path

from pushplan.errors import PushplanError

PICTURE_SUFFIXES = (".png", ".svg", ".pdf")

PANELS = ("floor", "set", "margin", "steps")
"""Parts of the picture of a plan."""


class PlotError(PushplanError, ValueError):
    """A picture cannot be drawn, or not written in the asked form."""


def check_picture_path(path: str | Path) -> Path:
    """Return `path`, checked for a suffix that pictures can have.

    Raises:
        PlotError: On any other suffix.
    """
    path = Path(path)
    if path.suffix.lower() not in PICTURE_SUFFIXES:
        ends = f"this one ends in {path.suffix}" if path.suffix else "this name has no ending"
        raise PlotError(f"{path}: {ends}; allowed for a picture: {', '.join(PICTURE_SUFFIXES)}")
    return path
