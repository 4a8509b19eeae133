"""How far a benchmark has come, and how its runs ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from pushplan.bench.processes.outcome import NO_PLAN, OK, Outcome


@dataclass(frozen=True)
class Tally:
    """Numbers of runs.

    Attributes:
        total: Asked for.
        before: Of them, those that had a result already.
        counts: How those ended that were done now, by status.
        seconds: Time that they took, s.
    """

    total: int
    before: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0

    def with_one(self, outcome: Outcome, seconds: float) -> Tally:
        """Return the numbers with one more run, after so many seconds."""
        counts = {**self.counts, outcome.status: self.counts.get(outcome.status, 0) + 1}
        return replace(self, counts=counts, seconds=seconds)

    @property
    def done(self) -> int:
        """Runs done now."""
        return sum(self.counts.values())

    @property
    def left(self) -> int:
        """Runs without a result."""
        return self.total - self.before - self.done

    @property
    def solved(self) -> int:
        """Runs done now that ended with a valid solution."""
        return self.counts.get(OK, 0)

    @property
    def failed(self) -> int:
        """Runs done now that were neither solved nor just without a plan."""
        return self.done - self.solved - self.counts.get(NO_PLAN, 0)

    @property
    def to_end(self) -> float | None:
        """Seconds until all is done if it goes on as so far; None before the first run."""
        return self.seconds / self.done * self.left if self.done else None
