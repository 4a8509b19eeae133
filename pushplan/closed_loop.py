"""A push in a simulated world with disturbances: in closed loop, or along the plan whatever happens."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pushplan.errors import PlanningError
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.writer import RunLogWriter
from pushplan.plan import plan as plan_push
from pushplan.plans.events import Event, Feedback, Replan
from pushplan.plans.execution import Execution
from pushplan.plans.judge import judging_set
from pushplan.plans.result import PlanResult
from pushplan.scenario.model import Scenario
from pushplan.sim.control.again import CONTROL
from pushplan.sim.control.aims import Aim
from pushplan.sim.control.controller import DEFAULTS, Controller
from pushplan.sim.control.course import SENSOR, Course, OpenLoop, course_in
from pushplan.sim.control.sensor import Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.slip.executed import executed
from pushplan.sim.worlds.kick import Kick
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray

JAMMED = "no motion of the objects satisfies all contacts"


@dataclass(frozen=True, eq=False)
class ClosedLoopRun:
    """A push in a world with disturbances.

    Attributes:
        scenario: What was believed.
        plan: What was planned at first.
        course: What happened in the world.
        events: What the controller noticed and did; empty in open loop.
        replans: All attempts to plan after the first one.
        outcome: `arrived`, `gave up`, `missed`, `jammed` or `time limit`.
        reason: Why it did not arrive; empty if it did.
        settings: Of the controller; None in open loop.
        sensor: How objects were measured.
        seed: Of the sensor's noise.
        kicks: What happened to objects.
    """

    scenario: Scenario
    plan: PlanResult
    course: Course
    events: tuple[Event, ...]
    replans: tuple[Replan, ...]
    outcome: str
    reason: str
    settings: ControlSettings | None
    sensor: Sensor
    seed: int
    kicks: tuple[Kick, ...]

    @property
    def goal_errors(self) -> FloatArray:
        """(2,) how far (m) and by what angle (rad) the goal's object ends off; the worst where it names none."""
        aim = Aim.of(self.scenario.goal, self.scenario.chain, 0.0, 0.0)
        return aim.errors(self.course.object_poses[-1])

    @property
    def execution(self) -> Execution:
        """The course as logs and players know it."""
        judge = judging_set(self.scenario, self.scenario.stability.set)
        course = self.course
        return executed(course.t, course.poses, course.object_poses, course.wrenches, judge, self.goal_errors)

    @property
    def recorded(self) -> RecordedRun:
        """The run as its log would have it."""
        feedback = Feedback(self.course.measured, self.events, self.replans)
        path = Path(f"{self.scenario.name}.mcap")
        return RecordedRun(path, self.scenario, self.plan, self.execution, (), {}, (), feedback=feedback)

    def write(self, path: Path | str) -> None:
        """Write the log (MCAP): plan, /measured, /events, the plans made on the way, and what happened.

        Raises:
            OutputError: When the file cannot be written.
        """
        told = {"planner": self.plan.planner, "set": self.plan.stable_set, "seed": self.seed}
        with RunLogWriter.create(path, self.scenario, told) as log:
            log.note(CONTROL, self._words())
            log.plan(self.plan)
            log.closed_loop(self.execution, Feedback(self.course.measured, self.events, self.replans))
            log.finish(self.outcome)

    def _words(self) -> dict[str, str]:
        settings = None if self.settings is None else asdict(self.settings)
        kicks = [asdict(kick) for kick in self.kicks]
        found = {"settings": settings, "sensor": asdict(self.sensor), "kicks": kicks}
        return {name: json.dumps(value) for name, value in found.items()} | {"reason": self.reason}


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
    outcome, reason = controller.phase.value, controller.reason
    if course.jammed:
        outcome, reason = "jammed", JAMMED
    elif not course.over:
        outcome, reason = "time limit", f"it was not there after {course.t[-1]:.0f} s"
    return ClosedLoopRun(
        scenario=scenario,
        plan=controller.plan,
        course=course,
        events=tuple(controller.events),
        replans=tuple(controller.replans),
        outcome=outcome,
        reason=reason,
        settings=settings,
        sensor=sensor,
        seed=seed,
        kicks=tuple(kicks),
    )


def run_open_loop(
    scenario: Scenario,
    world: World | None = None,
    kicks: Sequence[Kick] = (),
    *,
    plan: PlanResult | None = None,
    settings: ControlSettings = DEFAULTS,
    tell: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> ClosedLoopRun:
    """Execute a plan in a simulated world whatever happens; see `run_closed_loop`.

    Raises:
        PlanningError: When there is no plan.
        SupportError: When the load under an object is not known.
    """
    there = World.from_scenario(scenario) if world is None else world
    plan = plan_push(scenario, tell=tell) if plan is None else plan
    if plan.trajectory is None:
        raise PlanningError(f"there is no plan: {plan.reason}")
    driver = OpenLoop(plan.trajectory, settings.rate)
    course = course_in(there, driver, settings.rate, kicks, progress=progress)
    aim = Aim.of(scenario.goal, scenario.chain, settings.position_tolerance, settings.angle_tolerance)
    reached = aim.reached(course.object_poses[-1])
    outcome = "jammed" if course.jammed else "arrived" if reached else "missed"
    return ClosedLoopRun(
        scenario=scenario,
        plan=plan,
        course=course,
        events=(),
        replans=(),
        outcome=outcome,
        reason={"jammed": JAMMED, "missed": "the goal's object is not within its tolerances"}.get(
            outcome, ""
        ),
        settings=None,
        sensor=SENSOR,
        seed=1,
        kicks=tuple(kicks),
    )
