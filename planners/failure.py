"""What is kept of a search that found no path: why, and the path that ends nearest to the goal."""

from __future__ import annotations

from dataclasses import dataclass

from pushplan.path import PushPath
from pushplan.planners.diagnosis import diagnose
from pushplan.planners.session import Session
from pushplan.planners.verdict import flaw
from pushplan.result import Diagnosis
from pushplan.scenario import Scenario
from pushplan.sim.kinematic import pose_error
from pushplan.stable_sets.stable_set import StableSet

SPACING = 0.01
"""Spacing (m of cost) of the poses handed to the checker, which refines them itself."""


@dataclass(frozen=True)
class Failure:
    """What is known where there is no path: why, the path that ends nearest to the goal, and how far from it."""

    diagnosis: tuple[Diagnosis, ...]
    nearest: PushPath | None
    error: tuple[float, float]

    @property
    def words(self) -> str:
        """The sentences of the diagnosis."""
        return "; ".join(item.text for item in self.diagnosis)


def explain_failure(session: Session, scenario: Scenario, stable: StableSet) -> Failure:
    """Find out why there is no path, and how near to the goal one ends."""
    path = session.closest_path
    sound = len(path.twists) > 0 and not flaw(scenario, stable, path, path.sampled(SPACING))
    error = pose_error(path.end if sound else path.start, scenario.goal.pose_chain)
    found = diagnose(scenario, stable, session.problem, session.extensions, error)
    return Failure(found, path if sound else None, error)
