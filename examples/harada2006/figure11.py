"""Fig. 11 as an experiment: which centres of rotation keep a block on the plate, by simulation with real contacts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from agreement import Agreement, compare
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from panels import chain_named, draw_roles, row_of_panels, run
from scipy.stats import qmc

from pushplan.drawing.palette import INK
from pushplan.drawing.sets import LINE_STYLES, draw_contacts, draw_sets
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.sphere import twists_about
from pushplan.sets.named import stable_set
from pushplan.util.arrays import BoolArray, FloatArray

WINDOW = (-0.1, -0.2, 0.16, 0.2)
PANELS = {"(a) 14 deg at the plate": "one-block-14deg", "(b) 29 deg at the plate": "one-block-29deg"}
ALGORITHMS = {"ecof": "Algorithm 1", "cof": "Algorithm 2"}
HELD, MOVED = "#1d7a4c", "#b5352c"
SEED = 2006


def draw(path: Path, count: int, tell: Callable[[str], None]) -> None:
    """Simulate `count` centres of rotation for either friction angle and draw the figure.

    Args:
        path: To write to.
        count: Number of centres of rotation.
        tell: Called with what comes out.
    """
    with row_of_panels(path, WINDOW, list(PANELS), 1.25, 2.6) as (figure, panels):
        for axes, (title, name) in zip(panels, PANELS.items(), strict=True):
            chain = chain_named(name)
            cors = sample_cors(count)
            result = compare(chain, forward_twists(cors))
            _draw_panel(axes, chain, cors, result)
            verdict = table(chain, result)
            axes.text(0.0, -0.145, verdict, transform=axes.transAxes, va="top", fontsize=7.5, family="monospace")
            tell(f"Fig. 11 {title}\n{verdict}")
        figure.legend(handles=_legend(), loc="lower left", bbox_to_anchor=(0.1, 0.01), ncols=4, borderaxespad=0.0)


def sample_cors(count: int) -> FloatArray:
    """Return centres of rotation (count, 2) spread evenly over the window."""
    unit = qmc.Halton(2, seed=SEED).random(count)
    low, high = np.array(WINDOW[:2]), np.array(WINDOW[2:])
    return np.asarray(low + unit * (high - low))


def forward_twists(cors: FloatArray) -> FloatArray:
    """Return twists (k, 3) about centres of rotation, turning such that the middle of the plate moves forward."""
    left, right = twists_about(cors, +1), twists_about(cors, -1)
    return np.where(cors[:, 1:] > 0.0, left, right)


def table(chain: Chain, result: Agreement) -> str:
    """Return the confusion matrices of both algorithms as text."""
    lines = [f"{'':21}{'held':>6}{'moved':>6}"]
    for name, title in ALGORITHMS.items():
        inside = stable_set(chain, name).contains(result.twists)
        for label, said in (("stable", inside), ("unstable", ~inside)):
            held, moved = (int((said & each).sum()) for each in (result.kept, ~result.kept))
            lines.append(f"{title:12}{label:>9}{held:6d}{moved:6d}")
    return "\n".join(lines)


def _draw_panel(axes: Axes, chain: Chain, cors: FloatArray, result: Agreement) -> None:
    draw_sets(axes, [stable_set(chain, name) for name in ALGORITHMS], WINDOW)
    draw_roles(axes, chain, [0])
    draw_contacts(axes, chain)
    for chosen, marker in _markers(result.kept):
        axes.plot(*cors[chosen].T, linestyle="none", zorder=7.0, **marker)


def _markers(kept: BoolArray) -> list[tuple[BoolArray, dict[str, object]]]:
    return [
        (kept, {"marker": "o", "markersize": 2.4, "color": HELD, "markeredgewidth": 0.0}),
        (~kept, {"marker": "x", "markersize": 2.2, "color": MOVED, "markeredgewidth": 0.6}),
    ]


def _legend() -> list[Artist]:
    nothing = np.array([True])
    markers = zip(_markers(nothing), ("contact held", "contact moved"), strict=True)
    entries: list[Artist] = [
        Line2D([], [], linestyle="none", label=label, **marker) for (_, marker), label in markers
    ]
    lines = zip(LINE_STYLES, ALGORITHMS.values(), strict=False)
    return entries + [Line2D([], [], color=INK, linewidth=1.1, linestyle=s, label=name) for s, name in lines]


if __name__ == "__main__":
    run(lambda path: draw(path, 400, print), __file__)
