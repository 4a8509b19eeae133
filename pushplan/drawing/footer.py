"""What stands below a picture: the key of its colours, in as many rows as it takes, and a sentence above it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.patches import Patch

from pushplan.drawing.chain import GOAL_COLOUR, OBJECT_COLOUR, PLATE_COLOUR, ROBOT_COLOUR
from pushplan.drawing.cor import SENSE_NAMES, SENSES
from pushplan.drawing.figure import INK
from pushplan.mechanics.chain import Chain

_EDGE, _GAP = 0.04, 0.05  # below the key, and between key and sentence, inches
_STYLE: Any = {"handlelength": 1.4, "columnspacing": 1.4, "handletextpad": 0.5, "borderaxespad": 0.0}


def draw_footer(figure: Figure, left: float, entries: Sequence[Artist], sentence: str = "") -> float:
    """Draw the key at the figure's lower edge, and a sentence above it; return the height of both, inches.

    Args:
        figure: Its width is final; its height may still change.
        left: Where both begin, inches.
        entries: Of the key; they take as few rows as the figure's width allows.
        sentence: Broken into lines where it is longer than the figure is wide.
    """
    legend = _key(figure, left, entries)
    top = float(legend.get_window_extent().y1) / figure.dpi
    if not sentence:
        return top
    inches = figure.dpi_scale_trans
    style: Any = {"fontsize": 5.0, "color": INK, "va": "bottom", "wrap": True}
    text = figure.text(left, top + _GAP, sentence, transform=inches, **style)
    return float(text.get_window_extent().y1) / figure.dpi


def chain_keys(chain: Chain) -> list[Patch]:
    """Return the entries for the chain: what pushes, and the objects at start and goal."""
    colours = {"pusher": PLATE_COLOUR, "start": OBJECT_COLOUR, "goal": GOAL_COLOUR}
    if chain.pusher.footprint:
        colours = {"robot": ROBOT_COLOUR, **colours}
    return [Patch(facecolor=colour, edgecolor=INK, label=label) for label, colour in colours.items()]


def turn_keys() -> list[Patch]:
    """Return the entries for centres of rotation to the left and to the right."""
    return [Patch(facecolor=SENSES[sense], alpha=0.35, label=SENSE_NAMES[sense]) for sense in SENSES]


def _key(figure: Figure, left: float, entries: Sequence[Artist]) -> Legend:
    """Return the key in as few rows as the figure has room for, all of them about equally long."""
    for rows in range(1, len(entries) + 1):
        legend = figure.legend(
            handles=entries,
            ncols=-(-len(entries) // rows),
            loc="lower left",
            bbox_to_anchor=(left, _EDGE),
            bbox_transform=figure.dpi_scale_trans,
            **_STYLE,
        )
        if rows == len(entries) or legend.get_window_extent().x1 <= figure.bbox.x1:
            break
        legend.remove()
    return legend
