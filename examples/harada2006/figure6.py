"""Fig. 6, Algorithm 2: directions allowed at each centre of friction, turned by +-90 degrees, and what is common."""

from __future__ import annotations

from pathlib import Path

from matplotlib.patches import Patch
from panels import (
    allowed_directions,
    carried_center,
    chain_named,
    draw_directions,
    draw_roles,
    draw_wedge,
    legend_below,
    row_of_panels,
    run,
    sense_entries,
    wedge,
)

from pushplan.drawing.palette import CONE, TURNS
from pushplan.drawing.sets import draw_region
from pushplan.sets.named import stable_set

WINDOW = (-0.05, -0.25, 0.2, 0.25)
TITLES = ("(a) object 2 pushes object 1", "(b) the plate pushes both", "(c) common to both")
NEAR, FAR = 0, 1
"""The contacts: of the plate with object 2, of object 2 with object 1."""


def draw(path: Path) -> None:
    """Draw the figure."""
    chain = chain_named("two-blocks")
    with row_of_panels(path, WINDOW, TITLES, 0.5, 2.05) as (figure, panels):
        for axes, k, pushed in zip(panels, (FAR, NEAR), ([1], [0, 1]), strict=False):
            draw_roles(axes, chain, pushed)
            center, directions = carried_center(chain, k), allowed_directions(chain, k)
            draw_directions(axes, center, directions, 0.06)
            for sense in TURNS:
                draw_wedge(axes, wedge(center, directions, sense), sense, fill=True)
                draw_wedge(panels[2], wedge(center, directions, sense), sense, fill=False)
        draw_roles(panels[2], chain, [0, 1])
        cof = stable_set(chain, "cof")
        for sense in TURNS:
            draw_region(panels[2], cof.cor_region(sense, (-0.1, -0.3, 0.3, 0.3)), sense)
        cones = Patch(facecolor=CONE, alpha=0.5, label="directions of motion at the centre of friction")
        legend_below(figure, [*sense_entries(), cones], columns=2)


if __name__ == "__main__":
    run(draw, __file__)
