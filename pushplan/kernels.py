"""Compiled code made ready before it is needed: the first run on a machine compiles, later ones load the cache."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np

from pushplan.chain import Chain, Contact, PushedObject, Pusher
from pushplan.contact_state import contact_state
from pushplan.planners.collision import Scene
from pushplan.planners.scene import build_scene
from pushplan.planners.search import Problem
from pushplan.planners.session import Budget, Session
from pushplan.stable_set import stable_set
from pushplan.support import UniformSupport

PATIENCE = 1.5
"""Seconds after which the user is told what takes so long; loading the cache takes less."""

ANNOUNCEMENT = "compiling for this machine (only before the first run, about 20 s) ..."


def warm_up(tell: Callable[[str], None] | None = None) -> None:
    """Make all compiled code of a plan ready.

    Args:
        tell: Called with a sentence for the user if that takes long.
    """
    with _announced(tell):
        _compile()


@contextmanager
def _announced(tell: Callable[[str], None] | None) -> Iterator[None]:
    """Tell the user, after a while, that something is being compiled."""
    if tell is None:
        yield
        return
    timer = threading.Timer(PATIENCE, tell, [ANNOUNCEMENT])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@cache
def _compile() -> None:
    """Run every kernel once on a single box in the open."""
    chain = _one_box()
    stable = stable_set(chain, "ecof")
    stable.meridians(count=8)
    contact_state(chain, np.array([[1.0, 0.0, 0.0]]))
    session = Session(_problem(chain), np.zeros(3), Budget(time_limit=1.0), seed=0)
    session.grow(0, 0.5, 0.5, 0.5)


def _one_box() -> Chain:
    square = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
    box = PushedObject("box", square, 1.0, 0.3, UniformSupport(square), np.array([0.05, 0.0, 0.0]))
    contact = Contact(np.array([0.0, -0.05]), np.array([0.0, 0.05]), 0.3, 0, -1)
    plate = np.array([[-0.03, -0.05], [0.0, -0.05], [0.0, 0.05], [-0.03, 0.05]])
    return Chain((box,), (contact,), Pusher(plate, 0.3))


def _problem(chain: Chain) -> Problem:
    scene: Scene = build_scene(
        chain,
        [np.array([[5.0, 5.0], [6.0, 5.0], [5.0, 6.0]])],
        [(9.0, 9.0, 1.0)],
        (-10.0, -10.0, 10.0, 10.0),
        1e-4,
    )
    family = np.array([[[0.4, 0.0, 1.0], [1.0, 0.0, 0.0], [0.4, 0.0, -1.0]]])
    segments = np.array([[0.4, 0.0, 1.0, 0.4, 0.0, -1.0]])
    return Problem(scene, segments, family, np.array([1.0, 0.5, 1.0]), 0.5)
