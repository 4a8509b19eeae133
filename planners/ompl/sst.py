"""Stable Sparse RRT (Li, Littlefield and Bekris 2016) as an OMPL planner with a compiled core.

Rounds as in their SST*: each begins anew with witnesses closer together and more extensions, so that costs fall
towards the optimum of the sampled arcs; paths are polished, and every further one has to be cheaper.
"""

from __future__ import annotations

from pushplan.planners.ompl.anytime import AnytimePlanner
from pushplan.planners.ompl.posing import PushInformation
from pushplan.planners.search.sparse_rounds import SparseRounds


class StableSparseRRT(AnytimePlanner):
    """Rounds of sparse trees."""

    name = "SST"

    def improve(self, information: PushInformation) -> None:
        """Run rounds until the search is over."""
        session = information.session
        rounds = SparseRounds(session, information.box, information.heading_length)
        while not session.finished:
            rounds.run_next(session.stop)
            session.refine()
