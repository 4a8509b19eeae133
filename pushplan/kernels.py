"""Compiled code made ready before it is needed: the first run on a machine compiles, later ones load the cache."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from pushplan.compiled.announcement import announced
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.contacts import contact_state
from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.support import UniformSupport
from pushplan.sets.interval_set import stable_set_over
from pushplan.sets.meridians import margin_peaks
from pushplan.sets.named import stable_set
from pushplan.sim.robustness import robustness_along


def warm_up(
    planner: str,
    tell: Callable[[str], None] | None = None,
    stable: str = "ecof",
    intervals: bool = False,
    multi_push: bool = False,
) -> None:
    """Make all compiled code of a plan ready.

    Args:
        planner: Name of the planner that will run.
        tell: Called with a sentence for the user if that takes long.
        stable: Name of the stable set to plan in.
        intervals: Whether loads or frictions are intervals.
        multi_push: Whether the robot may push several times, and drives in between.
    """
    del planner, multi_push  # searches are in the core
    with announced(tell):
        _compile_mechanics()
        if stable == "robust" or (intervals and stable == "ecof"):
            _compile_worst_case(stable)


@cache
def _compile_mechanics() -> None:
    chain = _one_box()
    stable = stable_set(chain, "ecof")
    stable.meridians(count=8)
    margin_peaks(stable.margin_values, chain.characteristic_length)
    contact_state(chain, np.array([[1.0, 0.0, 0.0]]))
    robustness_along(chain, np.array([[0.1, 0.0, 0.0]]), np.zeros((1, 3)))
    ContactDynamics(chain).margins(np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 3)))


@cache
def _compile_worst_case(name: str) -> None:
    """Run the kernels of a set for all loads once, also those that count inertia."""
    chain = _one_box()
    interval = IntervalChain.from_ranges(chain, mass={"box": (0.9, 1.1)}, pressures={"box": 0.1})
    dynamics = ContactDynamics(chain, worst_case=name == "robust", interval=interval)
    dynamics.margins(np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 3)))
    stable = stable_set_over(interval, name)
    stable.meridians(count=8)
    stable.contact_margins(np.array([[1.0, 0.0, 0.0]]))


def _one_box() -> Chain:
    square = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
    box = PushedObject("box", square, 1.0, 0.3, UniformSupport(square), np.array([0.05, 0.0, 0.0]))
    contact = Contact(np.array([0.0, -0.05]), np.array([0.0, 0.05]), 0.3, 0, -1)
    plate = np.array([[-0.03, -0.05], [0.0, -0.05], [0.0, 0.05], [-0.03, 0.05]])
    return Chain((box,), (contact,), Pusher(plate, 0.3))
