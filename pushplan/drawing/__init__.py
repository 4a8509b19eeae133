"""Pictures: the palette, the scene that all viewers draw, and figures of plans, stable sets and trials.

Importing this module does not load Matplotlib.
"""

from __future__ import annotations

from pathlib import Path

from pushplan.errors import PushplanError

PICTURE_SUFFIXES = (".png", ".svg", ".pdf")

PANELS = ("floor", "set", "margin", "steps")
"""Parts of the picture of a plan."""


class PlotError(PushplanError, ValueError):
    """A picture cannot be drawn, or its file format is not supported."""


def check_picture_path(path: str | Path) -> Path:
    """Return `path` if its suffix is one of `PICTURE_SUFFIXES`.

    Raises:
        PlotError: For any other suffix.
    """
    path = Path(path)
    if path.suffix.lower() not in PICTURE_SUFFIXES:
        ends = f"the suffix {path.suffix} is not a picture format" if path.suffix else "the name has no suffix"
        raise PlotError(f"{path}: {ends}; allowed: {', '.join(PICTURE_SUFFIXES)}")
    return path
