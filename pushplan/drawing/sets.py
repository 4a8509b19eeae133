"""The picture of one or several stable sets of a chain, as in Fig. 9 of Harada et al. 2006."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pushplan.drawing.chain import CONE_COLOUR, OBJECT_COLOUR, PLATE_COLOUR, draw_chain, draw_contacts
from pushplan.drawing.cor import LINE_STYLES, SENSE_NAMES, SENSES, draw_region, style_cor_axes
from pushplan.drawing.figure import INK, axes_at, figure_for
from pushplan.mechanics.chain import Chain
from pushplan.sets.cor.cor_region import Window
from pushplan.sets.cor_window import default_window, grown
from pushplan.sets.stable_set import StableSet

# The layout, in inches.
_WIDTH, _MAX_HEIGHT, _LEGEND_WIDTH = 4.4, 7.5, 3.2
_COLUMNS = 2


def plot_stable_sets(
    chain: Chain, sets: Sequence[StableSet], path: str | Path, window: Window | None = None
) -> None:
    """Draw the COR regions of stable sets over one another, with the chain and its friction cones.

    Args:
        chain: The chain that all sets belong to.
        sets: The first is filled, the others are outlined in a line style each.
        path: File to write; its suffix says whether PNG, SVG or PDF.
        window: (xmin, ymin, xmax, ymax) to show in the chain frame, m; without it, the chain and the tightest
            turns to both sides.

    Raises:
        PlotError: On a suffix that is none of these.
    """
    window = default_window(chain, sets) if window is None else window
    size = np.array([window[2] - window[0], window[3] - window[1]])
    width, height = size * min(_WIDTH / size[0], _MAX_HEIGHT / size[1])
    entries = _legend(sets)
    left, bottom = 0.7, 0.55 + 0.19 * -(-len(entries) // _COLUMNS)
    with figure_for(path, left + max(width, _LEGEND_WIDTH) + 0.15, bottom + height + 0.15) as figure:
        axes = axes_at(figure, left, bottom, width, height)
        _draw_with_chain(axes, chain, sets, window)
        corner = (left / figure.get_figwidth(), 0.05 / figure.get_figheight())
        figure.legend(
            handles=entries, loc="lower left", bbox_to_anchor=corner, ncols=_COLUMNS, borderaxespad=0.0
        )


def draw_set(axes: Axes, chain: Chain, stable: StableSet) -> None:
    """Draw a stable set with the chain and its friction cones, in the chain frame, without names of axes."""
    _draw_with_chain(axes, chain, [stable], default_window(chain, [stable]))
    axes.set_xlabel("")
    axes.set_ylabel("")
    axes.set_title(f"stable CORs [m], {stable.name}", loc="left")


def _draw_with_chain(axes: Axes, chain: Chain, sets: Sequence[StableSet], window: Window) -> None:
    draw_sets(axes, sets, window)
    style_cor_axes(axes, window)  # before the chain, whose outlines are as wide as the scale allows
    draw_chain(axes, chain)
    draw_contacts(axes, chain)


def draw_sets(axes: Axes, sets: Sequence[StableSet], window: Window) -> None:
    """Draw the regions of both senses, cut off outside the window so that the cut is not seen."""
    for rank, stable in enumerate(sets):
        for sense in SENSES:
            draw_region(axes, stable.cor_region(sense, grown(window, 0.05)), sense, rank)


def _legend(sets: Sequence[StableSet]) -> list[Artist]:
    """Return the entries, column by column."""
    turns = [Patch(facecolor=SENSES[sense], alpha=0.35, label=SENSE_NAMES[sense]) for sense in SENSES]
    bodies = [
        Patch(facecolor=PLATE_COLOUR, edgecolor=INK, label="pusher"),
        Patch(facecolor=OBJECT_COLOUR, edgecolor=INK, label="objects"),
        Patch(facecolor=CONE_COLOUR, alpha=0.4, label="friction cones"),
    ]
    styles = [
        Line2D(
            [], [], color=INK, linewidth=1.1, linestyle=LINE_STYLES[rank % len(LINE_STYLES)], label=each.name
        )
        for rank, each in enumerate(sets)
    ]
    return [*turns, *bodies, *styles]
