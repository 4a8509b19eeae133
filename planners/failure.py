"""What is kept of a search that found no path: why, and the path that ends nearest to the goal."""

from __future__ import annotations

from dataclasses import dataclass

from pushplan.geometry.se2 import pose_error
from pushplan.planners.improve.session import Budget, Session
from pushplan.planners.infeasible.diagnosis import InfeasibilityMonitor, diagnose
from pushplan.planners.validation.verdict import flaw
from pushplan.plans.path import PushPath
from pushplan.plans.result import Diagnosis
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet


@dataclass(frozen=True)
class Failure:
    """What is known where no path was found.

    Attributes:
        diagnosis: Why.
        nearest: The path that ends nearest to the goal, None without any.
        error: How far (m, rad) from the goal it ends, or else the start lies.
        budget: Of the search.
    """

    diagnosis: tuple[Diagnosis, ...]
    nearest: PushPath | None
    error: tuple[float, float]
    budget: Budget

    @property
    def reason(self) -> str:
        """The sentences of the diagnosis, after what was allowed unless they prove that no limit would do."""
        words = "; ".join(item.text for item in self.diagnosis)
        if any(item.proven for item in self.diagnosis):
            return words
        limit = "" if self.budget.iterations is None else f" or {self.budget.iterations} iterations"
        return f"no path found within the time limit of {self.budget.time_limit:g} s{limit}: {words}"


def explain_failure(
    session: Session, scenario: Scenario, stable: StableSet, monitor: InfeasibilityMonitor
) -> Failure:
    """Find out why there is no path, and how near to the goal one ends."""
    path = session.nearest_path
    poses = path.sampled(0.01)  # m of cost; the checker refines it
    sound = len(path.twists) > 0 and not flaw(scenario, stable, path, poses)
    error = pose_error(path.end if sound else path.start, scenario.goal.pose_chain)
    # Half a second after the search, as more of it was done meanwhile.
    found = diagnose(monitor, session.extensions, error, 0.5)
    return Failure(found, path if sound else None, error, session.budget)
