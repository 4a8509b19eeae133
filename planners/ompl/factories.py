"""The planners by name: the project's own and OMPL's, those of installed packages, and any `module:attribute`."""

from __future__ import annotations

from pushplan.errors import PlanningError
from pushplan.planners.ompl.search import Factory
from pushplan.util.naming import attribute_named, name_of, planner_names

PLANNERS = {
    "auto": "pushplan.planners.ompl.auto:Auto",
    "rrt": "ompl.control:RRT",
    "est": "ompl.control:EST",
    "kpiece": "ompl.control:KPIECE1",
    "sst": "pushplan.planners.search.sst:StableSparseRRT",
}
"""Where each of `names.PLANNERS` is."""


def planner_named(planner: str | Factory) -> tuple[str, Factory]:
    """Return a planner's name and what makes it.

    Args:
        planner: A name, `module:attribute`, or what makes an `ompl.base.Planner` from a space information.

    Raises:
        PlanningError: When nothing is called so, or it cannot be called.
    """
    found = (
        attribute_named(PLANNERS.get(planner, planner), planner_names().group)
        if isinstance(planner, str)
        else planner
    )
    if found is None:
        raise PlanningError(
            f"no planner is called {planner!r}; there are {', '.join(PLANNERS)}, those of installed packages, and "
            "any other as module:attribute"
        )
    if not callable(found):
        raise PlanningError(
            f"the planner {planner!r} is a {type(found).__name__}; allowed: what makes an ompl.base.Planner from a "
            "space information"
        )
    return planner if isinstance(planner, str) else name_of(planner), found
