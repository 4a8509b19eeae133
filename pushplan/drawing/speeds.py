"""The picture of how fast a chain may be pushed along one twist: the polygon of speeds and accelerations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pushplan.drawing.figure import FAINT, INK, axes_at, figure_for
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.dynamics.admissible_speeds import AdmissibleSpeeds
from pushplan.util.arrays import FloatArray

_COLOURS = ("#2a6f97", "#b5533c", "#5b8c5a", "#8c6bb1", "#c08a2d", "#4f9da6", "#a34d7c")
_ROWS = ("slips to the right", "slips to the left", "tips about the right end", "tips about the left end")
_STYLES = ("-", "-", "--", "--")
_WIDTH, _HEIGHT = 4.6, 3.4
_TOUCHING = 1e-9


def plot_admissible_speeds(chain: Chain, speeds: AdmissibleSpeeds, path: str | Path) -> None:
    """Draw what `admissible_speeds` found for a twist, each limit named by the contact that would slip or tip.

    Args:
        chain: The chain that was asked about.
        speeds: The answer.
        path: File to write; its suffix says whether PNG, SVG or PDF.

    Raises:
        PlotError: On a suffix that is none of these.
    """
    limits = limiting_rows(speeds)
    below = 0.75 + 0.19 * max(1, len(limits))
    with figure_for(path, _WIDTH + 0.95, _HEIGHT + below + 0.5) as figure:
        axes = axes_at(figure, 0.75, below, _WIDTH, _HEIGHT)
        _draw(axes, speeds, limits)
        handles = [
            Line2D([], [], color=_COLOURS[k % len(_COLOURS)], ls=_STYLES[j], label=_name(chain, k, j))
            for k, j in limits
        ]
        corner = (0.75 / figure.get_figwidth(), 0.03 / figure.get_figheight())
        figure.legend(handles=handles, loc="lower left", bbox_to_anchor=corner, borderaxespad=0.0)


def limiting_rows(speeds: AdmissibleSpeeds) -> list[tuple[int, int]]:
    """Return the contacts and rows that bound the polygon somewhere within its window."""
    rows, vertices = speeds.rows, speeds.vertices
    if not len(vertices):
        return []
    values = (
        rows.alpha[..., None] + rows.gamma[..., None] * vertices[:, 0] + rows.beta[..., None] * vertices[:, 1]
    )
    scale = np.abs(rows.alpha).max()
    touching = np.abs(values) <= _TOUCHING * scale
    along = touching & np.roll(touching, -1, axis=-1)
    return [(int(k), int(j)) for k, j in np.argwhere(along.any(axis=-1))]


def _draw(axes: Axes, speeds: AdmissibleSpeeds, limits: list[tuple[int, int]]) -> None:
    u, a = speeds.window
    if len(speeds.vertices):
        axes.fill(*speeds.vertices.T, color="#dfe7ec", lw=0.0)
    for k, j in limits:
        segment = _segment(speeds, k, j)
        axes.plot(*segment.T, color=_COLOURS[k % len(_COLOURS)], ls=_STYLES[j], lw=1.6, zorder=3)
    axes.axhline(0.0, color=FAINT, lw=0.7)
    axes.set(xlim=(0.0, u), ylim=(-a, a), xlabel="$\\dot s^2$", ylabel="$\\ddot s$")
    top = axes.secondary_xaxis("top", functions=(_root, np.square))
    top.set_xlabel("$\\dot s$", color=INK)
    top.set_xticks([tick for tick in top.get_xticks() if tick == 0.0 or tick**2 > 0.06 * u])


def _segment(speeds: AdmissibleSpeeds, k: int, j: int) -> FloatArray:
    """The part (2, 2) of the polygon's boundary that a row makes."""
    rows, vertices = speeds.rows, speeds.vertices
    values = rows.alpha[k, j] + vertices @ np.array([rows.gamma[k, j], rows.beta[k, j]])
    touching = np.abs(values) <= _TOUCHING * np.abs(rows.alpha).max()
    first = int(np.flatnonzero(touching & np.roll(touching, -1))[0])
    return vertices[[first, (first + 1) % len(vertices)]]


def _root(values: Any) -> Any:  # Any, as Matplotlib takes functions of anything
    return np.sqrt(np.maximum(values, 0.0))


def _name(chain: Chain, k: int, j: int) -> str:
    return f"{chain.contact_name(k)}: {chain.objects[chain.contacts[k].pushed].name} {_ROWS[j]}"
