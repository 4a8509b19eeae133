"""The planners by name. Each is a function that drives a session until it is finished."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from pushplan.errors import PlanningError
from pushplan.planners.session import Session

Box = tuple[float, float, float, float]
Planner = Callable[[Session, Box, float], None]
"""Takes the session, the box (xmin, ymin, xmax, ymax) to sample from, and the metres that a radian counts as."""

MODULES = {
    "auto": "pushplan.planners.auto",
    "rrt": "pushplan.planners.rrt",
    "est": "pushplan.planners.est",
    "kpiece": "pushplan.planners.kpiece",
    "sst": "pushplan.planners.sst",
    "rrt-dubins": "pushplan.planners.rrt_dubins",
    "bitstar-dubins": "pushplan.planners.bitstar_dubins",
}
"""Module of each planner; it has a function `search` of the kind `Planner`."""


def planner_named(name: str) -> Planner:
    """Return the planner called `name`.

    Raises:
        PlanningError: When there is none.
    """
    if name not in MODULES:
        raise PlanningError(f"no planner is called {name!r}; there are {', '.join(MODULES)}")
    search: Planner = import_module(MODULES[name]).search
    return search
