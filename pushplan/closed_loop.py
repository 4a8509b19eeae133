"""A push in a simulated world with disturbances: in closed loop, or along the plan whatever happens."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pushplan.basics.arrays import FloatArray
from pushplan.control.aims import Aim
from pushplan.control.controller import DEFAULTS, Controller
from pushplan.control.course import SENSOR, Course, course_in
from pushplan.control.events import Event
from pushplan.control.replanner import Replan
from pushplan.control.sensor import Sensor
from pushplan.control.settings import ControlSettings
from pushplan.result import PlanResult
from pushplan.scenario import Scenario
from pushplan.sim.worlds.kick import Kick
from pushplan.sim.worlds.world import World


@dataclass(frozen=True, eq=False)
class ClosedLoopRun:
    """A push in closed loop.

    Attributes:
        scenario: What was believed.
        plan: What was planned at first.
        course: What happened in the world.
        events: What the controller noticed and did.
        replans: All attempts to plan after the first one.
        outcome: `arrived`, `gave up`, `jammed` or `time limit`.
        reason: Why it did not arrive; empty if it did.
    """

    scenario: Scenario
    plan: PlanResult
    course: Course
    events: tuple[Event, ...]
    replans: tuple[Replan, ...]
    outcome: str
    reason: str

    @property
    def goal_errors(self) -> FloatArray:
        """(2,) how far (m) and by what angle (rad) the goal's object ends off; the worst where it names none."""
        aim = Aim.of(self.scenario.goal, self.scenario.chain, 0.0, 0.0)
        return aim.errors(self.course.object_poses[-1])


def run_closed_loop(
    scenario: Scenario,
    world: World | None = None,
    kicks: Sequence[Kick] = (),
    *,
    plan: PlanResult | None = None,
    settings: ControlSettings = DEFAULTS,
    sensor: Sensor = SENSOR,
    seed: int = 1,
    tell: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> ClosedLoopRun:
    """Push a chain to its goal in a simulated world, watching it.

    Args:
        scenario: What is believed.
        world: What is there; None for the world as the scenario states it.
        kicks: What happens to objects meanwhile.
        plan: What to do at first; see `Controller`.
        settings: Of the controller.
        sensor: How objects are measured.
        seed: Of the sensor's noise.
        tell: Takes sentences about what takes long.
        progress: Called with the simulated time now and then.

    Raises:
        PlanningError: When there is no plan to begin with.
        SupportError: When the load under an object is not known.
    """
    there = World.from_scenario(scenario) if world is None else world
    controller = Controller(scenario, plan, settings, tell)
    course = course_in(there, controller, settings.rate, kicks, sensor, seed, progress=progress)
    outcome = "jammed" if course.jammed else controller.phase.value if course.over else "time limit"
    reason = {"jammed": "no motion of the objects satisfies all contacts", "time limit": "it took too long"}
    why = reason.get(outcome, controller.reason)
    return ClosedLoopRun(
        scenario, controller.plan, course, tuple(controller.events), tuple(controller.replans), outcome, why
    )
