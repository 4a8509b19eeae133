"""OMPL's control EST (Hsu et al. 1997) on the stable set."""

from __future__ import annotations

from ompl import control as oc

from pushplan.planners import control_planners
from pushplan.planners.session import Session


def search(session: Session, box: tuple[float, float, float, float], heading_length: float) -> None:
    """Run EST until the session is finished; see `control_planners.search`."""
    control_planners.search(session, box, heading_length, oc.EST)
