"""Fig. 7: Algorithm 3. The directions of translation that each contact allows, and what is common to both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from panels import allowed_directions, carried_center, chain_named, draw_directions, draw_roles, row_of_panels, run

from pushplan.drawing.palette import FAINT
from pushplan.mechanics.chain import Chain
from pushplan.sets.named import stable_set

WINDOW = (-0.04, -0.08, 0.24, 0.08)
TITLES = ("(a) object 2 pushes object 1", "(b) the plate pushes both", "(c) common to both")
NEAR, FAR = 0, 1
"""The contacts: of the plate with object 2, of object 2 with object 1."""
LENGTH = 0.11


def draw(path: Path) -> None:
    """Draw the figure."""
    chain = chain_named("two-blocks")
    with row_of_panels(path, WINDOW, TITLES, 0.0, 2.25) as (_, panels):
        for axes, k, pushed in zip(panels, (FAR, NEAR), ([1], [0, 1]), strict=False):
            draw_roles(axes, chain, pushed)
            center, directions = carried_center(chain, k), allowed_directions(chain, k)
            for end in (chain.contacts[k].right, chain.contacts[k].left):
                axes.plot(*np.stack([end, center]).T, color=FAINT, linewidth=0.8, linestyle="dotted", zorder=5.0)
            draw_directions(axes, center, directions, LENGTH)
        draw_roles(panels[2], chain, [0, 1])
        draw_directions(panels[2], carried_center(chain, NEAR), common_cone(chain), LENGTH)


def common_cone(chain: Chain) -> np.ndarray:
    """Return the right-most and left-most translation (2, 2) that all contacts allow."""
    cone = stable_set(chain, "translation").translation_cone()
    assert cone is not None
    return cone


if __name__ == "__main__":
    run(draw, __file__)
