"""What contacts ask of a blend: how much more slowly its twist has to change for them to hold."""

from __future__ import annotations

import numpy as np
from plain import load_plain

from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import Pieces, bounds_use
from pushplan.planners.timing.parts import step_windows


def fast_blend(bounds: Bounds) -> Pieces:
    """From rest through a turn to a straight push and to rest, with steps that ask too much of the contacts."""
    levels = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.2], [0.3, 0.02, 0.0], [0.0, 0.0, 0.0]])
    return Pieces.through(levels, np.array([1.0, 3.0, 5.0]), 0.1 * step_windows(levels, bounds.limits))


def slower(pieces: Pieces, factor: np.ndarray) -> Pieces:
    """The same twists, passed through more slowly by a factor (q,)."""
    powers = factor[:, None, None] ** np.arange(3)[:, None]
    return Pieces(pieces.durations * factor, pieces.coefficients / powers, pieces.level)


def test_twists_that_change_more_slowly_by_what_is_told_just_keep_the_contacts() -> None:
    scenario = load_plain("three-boxes-clutter")
    bounds = Bounds(scenario.chain.pusher.limits, ContactDynamics(scenario.chain))
    pieces = fast_blend(bounds)
    use = bounds_use(pieces, bounds)
    strained = use.shares[:, 3] > 1.0
    assert 0 < strained.sum() < len(strained)
    assert (use.slowing[~strained] == 1.0).all()
    eased = bounds_use(slower(pieces, use.slowing), bounds).shares[:, 3]
    np.testing.assert_allclose(eased[strained], 1.0, rtol=1e-9)
