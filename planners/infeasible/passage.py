"""The widest passage between start and goal, and what of the chain has to pass through it.

A disc that fits into the chain goes wherever the chain goes. So where obstacles and walls, grown by its radius and
the clearance, part its centre at the start from its centre at the goal, no motion whatever joins the two.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely

from pushplan.mechanics.body import as_one
from pushplan.planners.infeasible.bounds import between, grown, largest_disc, reached, room
from pushplan.plans.plan import Diagnosis
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

RESOLUTION = 1e-5
"""Widths are found to this accuracy, m."""


def passage_faults(scenario: Scenario, headings: FloatArray) -> Iterator[list[Diagnosis]]:
    """Yield, at last, that the passage between start and goal is too narrow, proven or perhaps, or nothing.

    What is proven is yielded first without the passage's width, which takes longer. Between two looks at the free
    space, each of which takes a tenth of a millisecond for each obstacle, nothing is yielded.

    Args:
        scenario: The problem.
        headings: (k, 2) directions, in the chain frame, in which the chain can be pushed straight.
    """
    disc = largest_disc(scenario.chain.bodies)
    needed = disc.radius + scenario.clearance - CLEARANCE_ROOM
    ends = [disc.at(pose) for pose in (scenario.start, scenario.goal.pose_chain)]

    def joined(radius: float, within: float = 1e-6) -> bool:  # m: ends may lie on the edge of a region
        near = [shapely.distance(shapely.get_parts(room(scenario, radius)), end) <= within for end in ends]
        return bool((near[0] & near[1]).any())

    if not joined(needed):
        between = _between(scenario, needed, ends, 1e-6)
        yield [replace(_proven(2.0 * disc.radius, 2.0 * needed, None), blocking=between)]
        widest = yield from _widest(joined, 0.0, needed)
        yield [replace(_proven(2.0 * disc.radius, 2.0 * needed, 2.0 * widest), blocking=between)]
        return
    yield []
    swept, reach = _swept_width(scenario, headings), _reach(scenario)
    wanted = 0.5 * swept + scenario.clearance
    if wanted <= needed or joined(wanted, reach):
        return
    yield []
    widest = yield from _widest(lambda r: joined(r, reach), needed, wanted)
    guess = _guess(swept, 2.0 * wanted, 2.0 * widest)
    yield [replace(guess, blocking=_between(scenario, wanted, ends, reach))]


def _between(scenario: Scenario, radius: float, ends: Sequence[shapely.Point], within: float) -> tuple[int, ...]:
    """Return the obstacles that part two ends: they bound what a disc can reach from either."""
    free = room(scenario, radius)
    one, other = (reached(free, end, within) for end in ends)
    return between(grown(scenario.obstacles, radius), one, other)


def _widest(joined: Callable[[float], bool], low: float, high: float) -> Generator[list[Diagnosis], None, float]:
    """Find the largest radius that is `joined`, between one that is (or 0) and one that is not.

    To half the resolution; nothing is yielded after each look.
    """
    while high - low > 0.5 * RESOLUTION:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if joined(middle) else (low, middle)
        yield []
    return 0.5 * (low + high)


def _swept_width(scenario: Scenario, headings: FloatArray) -> float:
    """Smallest width (m) of the chain across its straight pushes, or across +x where there is none."""
    corners = shapely.get_coordinates(as_one(scenario.chain.bodies))
    across = corners @ np.stack([-headings[:, 1], headings[:, 0]]) if len(headings) else corners[:, 1:]
    return float(np.ptp(across, axis=0).min())


def _reach(scenario: Scenario) -> float:
    """Size of the chain: the diameter of a circle around it, m."""
    return 2.0 * float(shapely.minimum_bounding_radius(as_one(scenario.chain.bodies)))


def _proven(width: float, needed: float, passage: float | None) -> Diagnosis:
    """Return what is proven; without the passage's width where that is not known."""
    chain = f"the chain, into which a disc of {_mm(width)} fits, needs at least {_mm(needed)} with its clearance"
    if passage is None:
        text = f"the chain cannot pass: no passage from start to goal is wide enough, and {chain}"
        return Diagnosis("gap", text, True, {"disc": width, "needed": needed})
    numbers = {"passage": passage, "disc": width, "needed": needed}
    if passage < RESOLUTION:
        text = "obstacles and walls separate the start from the goal: no passage joins them"
        return Diagnosis("gap", text, True, numbers)
    text = f"the chain cannot pass: the widest passage from start to goal is {_mm(passage)} wide, and {chain}"
    return Diagnosis("gap", text, True, numbers)


def _guess(swept: float, needed: float, passage: float) -> Diagnosis:
    numbers = {"passage": passage, "swept": swept, "needed": needed}
    text = (
        f"perhaps the passage is too narrow: the widest one from start to goal is about {_mm(passage)} wide, and the "
        f"chain is {_mm(swept)} wide across its straight pushes, {_mm(needed)} with its clearance"
    )
    return Diagnosis("gap", text, False, numbers)


def _mm(length: float) -> str:
    return f"{1e3 * length:.4g} mm"
