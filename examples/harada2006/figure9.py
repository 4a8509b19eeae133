"""Fig. 9: the stable centres of rotation of two blocks by Algorithm 1, filled, and by Algorithm 2, dashed."""

from __future__ import annotations

from pathlib import Path

from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from panels import chain_named, draw_roles, legend_below, row_of_panels, run, sense_entries

from pushplan.drawing.palette import CONE, INK
from pushplan.drawing.sets import LINE_STYLES, draw_contacts, draw_sets
from pushplan.sets.named import stable_set

WINDOW = (-0.06, -0.27, 0.22, 0.27)
PANELS = {"(a) in a row": "two-blocks", "(b) the far one 2 cm to the left": "two-blocks-offset"}
ALGORITHMS = {"ecof": "Algorithm 1, exact friction", "cof": "Algorithm 2, friction at the COF"}


def draw(path: Path) -> None:
    """Draw the figure."""
    with row_of_panels(path, WINDOW, list(PANELS), 0.68, 2.6) as (figure, panels):
        for axes, name in zip(panels, PANELS.values(), strict=True):
            chain = chain_named(name)
            draw_sets(axes, [stable_set(chain, each) for each in ALGORITHMS], WINDOW)
            draw_roles(axes, chain, [0, 1])
            draw_contacts(axes, chain)
        cones: Artist = Patch(facecolor=CONE, alpha=0.5, label="friction cones")
        lines = zip(LINE_STYLES, ALGORITHMS.values(), strict=False)
        algorithms = [Line2D([], [], color=INK, linewidth=1.1, linestyle=s, label=name) for s, name in lines]
        legend_below(figure, [*sense_entries(), cones, *algorithms], columns=2)


if __name__ == "__main__":
    run(draw, __file__)
