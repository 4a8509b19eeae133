"""What trials of a plan come to: how many arrive, which contacts fail first, how far off the objects end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sim.slip.report import ContactLoss, SlipReport
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.slip.simulate import simulate
from pushplan.sim.trials.uncertain import TrialUncertainty, sampled_world
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import BoolArray, FloatArray
from pushplan.util.wilson import wilson


@dataclass(frozen=True, eq=False)
class Trials:
    """A plan in k sampled worlds.

    Attributes:
        scenario: What the plan believes.
        trajectory: What the plate is made to do.
        uncertainty: What the worlds were drawn from; None for the scenario's own intervals.
        seed: Of the random numbers; sample i depends on it and on i only.
        settings: Of the simulator.
        errors: (k, n, 2) how far (m) and by what angle (rad) every object ends off its place at the goal.
        object_poses: (k, n, 3) where they end, in the world.
        arrived: (k,) whether the goal's object, or every object, ends within the goal's tolerances.
        losses: The first contact that moved in each sample, or None.
        jammed: (k,) whether nothing could give way, so that the push ended early.
    """

    scenario: Scenario
    trajectory: Trajectory
    uncertainty: TrialUncertainty | None
    seed: int
    settings: SlipSettings
    errors: FloatArray
    object_poses: FloatArray
    arrived: BoolArray
    losses: tuple[ContactLoss | None, ...]
    jammed: BoolArray

    @property
    def samples(self) -> int:
        """Number of worlds."""
        return len(self.arrived)

    @property
    def success(self) -> float:
        """Share of the worlds in which it arrives."""
        return float(self.arrived.mean())

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the rate of success."""
        return wilson(int(self.arrived.sum()), self.samples)

    @property
    def held(self) -> float:
        """Share of the worlds in which every contact holds to the end."""
        return float(np.mean([loss is None for loss in self.losses] & ~self.jammed))

    @property
    def first_failures(self) -> dict[str, int]:
        """How often each contact, by name, was the first to move; those that never were are left out."""
        found: dict[str, int] = {}
        for loss in self.losses:
            if loss is not None:
                name = self.scenario.chain.contact_name(loss.contact)
                found[name] = found.get(name, 0) + 1
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    @property
    def goal_errors(self) -> FloatArray:
        """(k, 2) of the goal's object, or the largest of all objects where the goal names none: m, rad."""
        of = self.scenario.goal.of
        if of is None:
            return np.asarray(self.errors.max(axis=1))
        return self.errors[:, self.scenario.chain.index_of(of)]

    @property
    def worst(self) -> int:
        """Number of the sample that ends farthest from the goal, in units of its tolerances; jams come first."""
        goal = self.scenario.goal
        units = self.goal_errors / [goal.position_tolerance, goal.angle_tolerance]
        return int(np.argmax(units.max(axis=1) + 1e9 * self.jammed))

    def world(self, i: int) -> World:
        """Return the world of sample i."""
        return sampled_world(self.scenario, self.uncertainty, np.random.default_rng([self.seed, i]))

    def report(self, i: int) -> SlipReport:
        """Return the course of sample i, simulated anew."""
        return simulate(self.trajectory, self.world(i), self.settings)
