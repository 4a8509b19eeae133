"""A plan in a simulated world with disturbances: in closed loop, or along the plan whatever happens."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pushplan.errors import PlanningError
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.writer import RunLogWriter
from pushplan.planners.planner import plan as plan_in
from pushplan.plans.events import Event, Feedback, Replan
from pushplan.plans.plan import Load, Plan
from pushplan.plans.run import Execution
from pushplan.plans.settings import Observer
from pushplan.scenario.model import Scenario
from pushplan.sim.control.again import CONTROL
from pushplan.sim.control.controller import DEFAULTS, SILENT, Controller
from pushplan.sim.control.course import SENSOR, Course, Kick, OpenLoop, course_in
from pushplan.sim.control.sensing import Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.report import at_poses, judged, worst_at_goal
from pushplan.sim.world import World

JAMMED = "no motion of the objects satisfies all contacts"
MISSED = "the goal's object is not within its tolerances"


@dataclass(frozen=True, eq=False)
class ClosedLoopRun:
    """A plan in a world with disturbances.

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
    plan: Plan
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
    def goal_errors(self) -> tuple[float, float]:
        """How far (m) and by what angle (rad) the goal's object ends off; the worst where there are several."""
        return worst_at_goal(self.scenario, self.course.object_poses[-1])

    @property
    def execution(self) -> Execution:
        """The course as logs and pictures know it."""
        course, plan = self.course, self.plan
        if self.scenario.kind == "push":
            loads: list[Load | None] = [Load.of(self.scenario)]
        else:
            loads = [segment.load if segment.pushes else None for segment in plan.segments]
        segment = plan.segment_at(course.t)
        judge, margins = judged(loads, self.scenario.stability.set, course.names, segment, course.twists)
        wrenches = at_poses(course.wrenches)
        return Execution(
            course.names,
            judge,
            course.t,
            course.poses,
            course.twists,
            course.object_poses,
            segment,
            margins,
            None,
            self.goal_errors,
            wrenches=wrenches,
        )

    @property
    def feedback(self) -> Feedback:
        """What was measured, noticed and done."""
        return Feedback(self.course.measured, self.events, self.replans)

    @property
    def recorded(self) -> RecordedRun:
        """The run as its log would have it."""
        path = Path(f"{self.scenario.name}.mcap")
        return RecordedRun(path, self.scenario, self.plan, self.execution, self.feedback)

    def write(self, path: Path | str) -> None:
        """Write the log (MCAP): plan, /measured, /events, the plans made on the way, and what happened.

        Raises:
            OutputError: When the file cannot be written.
        """
        told = {"planner": self.plan.planner, "set": self.plan.stable_set, "seed": self.seed}
        with RunLogWriter.create(path, self.scenario, told) as log:
            log.note(CONTROL, self._words())
            log.plan(self.plan)
            log.closed_loop(self.execution, self.feedback)
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
    plan: Plan | None = None,
    settings: ControlSettings = DEFAULTS,
    sensor: Sensor = SENSOR,
    seed: int = 1,
    observer: Observer = SILENT,
    progress: Callable[[float], None] | None = None,
) -> ClosedLoopRun:
    """Push a chain to its goal in a simulated world, watching it.

    Args:
        scenario: What is believed: a single push.
        world: What is there; None for the world as the scenario states it.
        kicks: What happens to objects meanwhile.
        plan: What to do at first; see `Controller`.
        settings: Of the controller.
        sensor: How objects are measured.
        seed: Of the sensor's noise.
        observer: Takes messages about what takes long.
        progress: Called with the simulated time now and then.

    Raises:
        PlanningError: When there is no plan to begin with, or the scenario is not of a single push.
        SupportError: When the load under an object is not known.
    """
    there = World.from_scenario(scenario) if world is None else world
    controller = Controller(scenario, settings, plan=plan, observer=observer)
    course = course_in(there, controller, settings.rate, kicks, sensor, seed, progress=progress)
    outcome, reason = controller.phase.value, controller.reason
    if course.jammed:
        outcome, reason = "jammed", JAMMED
    elif not course.over:
        outcome, reason = "time limit", f"it was not there after {course.t[-1]:.0f} s"
    return ClosedLoopRun(
        scenario,
        controller.plan,
        course,
        tuple(controller.events),
        tuple(controller.replans),
        outcome,
        reason,
        settings,
        sensor,
        seed,
        tuple(kicks),
    )


def run_open_loop(
    scenario: Scenario,
    world: World | None = None,
    kicks: Sequence[Kick] = (),
    *,
    plan: Plan | None = None,
    settings: ControlSettings = DEFAULTS,
    observer: Observer = SILENT,
    progress: Callable[[float], None] | None = None,
) -> ClosedLoopRun:
    """Execute a plan of any kind in a simulated world whatever happens; see `run_closed_loop`.

    Raises:
        PlanningError: When there is no plan.
        SupportError: When the load under an object is not known.
    """
    there = World.from_scenario(scenario) if world is None else world
    plan = plan_in(scenario, observer=observer) if plan is None else plan
    if plan.trajectory is None:
        raise PlanningError(f"there is no plan: {plan.reason}")
    driver = OpenLoop(plan, settings.rate)
    course = course_in(there, driver, settings.rate, kicks, progress=progress)
    goals = [goal for task in scenario.tasks for goal in task.goals]
    tolerance = (
        max(settings.position_tolerance, min(goal.position_tolerance for goal in goals)),
        max(settings.angle_tolerance, min(goal.angle_tolerance for goal in goals)),
    )
    off = worst_at_goal(scenario, course.object_poses[-1])
    reached = off[0] <= tolerance[0] and off[1] <= tolerance[1]
    outcome = "jammed" if course.jammed else "arrived" if reached else "missed"
    reason = {"jammed": JAMMED, "missed": MISSED}.get(outcome, "")
    kicked = tuple(kicks)
    return ClosedLoopRun(scenario, plan, course, (), (), outcome, reason, None, SENSOR, 1, kicked)
