"""Algorithm 1 on a grid against the exact set."""

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.errors import PushplanError, SupportError
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import UnknownSupport
from pushplan.sets.grid_cor_set import grid_cor_set
from pushplan.sets.named import stable_set


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_cells_agree_with_the_exact_set(make_chain: ChainMaker, seed: int) -> None:
    """Every cell that is not within the error of 400 elements of the boundary."""
    chain = make_chain.random(seed, 1 + seed, tree=seed == 3, feet=seed == 1)
    length = chain.characteristic_length
    grid = grid_cor_set(chain, (-3.0 * length, -4.0 * length, 3.0 * length, 4.0 * length), (50, 60), 400)
    cors = np.stack(np.meshgrid(grid.x, grid.y), axis=-1).reshape(-1, 2)
    exact = stable_set(chain, "ecof")
    for sense, cells in ((+1, grid.counter_clockwise), (-1, grid.clockwise)):
        assert cells.shape == (60, 50)
        margin = exact.margin(twists_about(cors, sense))
        assert ((margin > 0.0) == cells.ravel())[np.abs(margin) > 2e-3].all()
        assert cells.any()


def test_what_the_grid_cannot_answer_is_refused(make_chain: ChainMaker) -> None:
    window = (-1.0, -1.0, 1.0, 1.0)
    with pytest.raises(PushplanError, match="must be at least 1"):
        grid_cor_set(make_chain.boxes(1), window, (0, 5))
    with pytest.raises(PushplanError, match="contact_height must be 0"):
        grid_cor_set(make_chain.boxes(1, contact_height=0.01), window)
    with pytest.raises(PushplanError, match="window is"):
        grid_cor_set(make_chain.boxes(1), (1.0, -1.0, -1.0, 1.0))
    with pytest.raises(SupportError, match="the load under 'box0' is unknown"):
        grid_cor_set(make_chain.boxes(1, support=UnknownSupport), window)
