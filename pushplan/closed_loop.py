"""Executes a plan in a simulated world with disturbances, in closed loop or in open loop.

It also checks a recorded closed loop: the same measurements must lead to the same twists and events.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from pushplan.errors import PlanningError, PushplanError, RunLogError
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.recording import Recording, Where
from pushplan.logging.verify import Check, check_way, series_check
from pushplan.planner import plan as plan_in
from pushplan.plans.execution import Execution
from pushplan.plans.goals import tolerance_of, worst_at_goal
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan
from pushplan.plans.run import Event, Feedback, Replan, segments_of
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.run import fields_of, fields_of_plan
from pushplan.scenario.model import Scenario
from pushplan.sim.control.controller import DEFAULTS, SILENT, Controller
from pushplan.sim.control.sensing import Measurements, Sensor
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.simulated_push import SENSOR, Disturbance, OpenLoop, SimulatedPush, Simulator, simulate_push
from pushplan.sim.report import at_poses, judged
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

CONTROL = "pushplan.control"
"""Name of the metadata in a closed loop's log: settings, sensor and disturbances, as JSON."""
TIME_ROUNDING = 1e-6
"""Tolerance of times in logs, s."""
ROUNDING = 1e-6
"""Tolerance of recomputed twists, m/s and rad/s: measured angles are rounded when they are stored as quaternions."""
JAMMED = "no motion of the objects satisfies all contacts"
STALLED = "pushing takes more than robot.limits.force"
MISSED = "the goal's object is not within its tolerances"


@dataclass(frozen=True, eq=False)
class ClosedLoopRun:
    """Result of executing a plan in a simulated world with disturbances.

    Attributes:
        scenario: The controller's model of the world.
        plan: The first plan.
        simulated: The simulated motion.
        events: Disturbances, and the controller's observations and actions.
        replans: All planning attempts after the first plan.
        outcome: `arrived`, `gave up`, `missed`, `jammed`, `stalled` or `time limit`.
        reason: Reason why the objects did not arrive; empty if they did.
        settings: Settings of the controller; None in open loop.
        sensor: Sensor that measured the objects.
        seed: Seed of the sensor's noise.
        disturbances: Disturbances of the objects.
        measured_error: Last measured goal error (m, rad); None if there is none.
        camera_error: Camera errors (m, rad) that were still possible on arrival; None if the objects did not arrive.
        log: Log that was written during the run; None without a log or if it could not be written.
    """

    scenario: Scenario
    plan: Plan
    simulated: SimulatedPush
    events: tuple[Event, ...]
    replans: tuple[Replan, ...]
    outcome: str
    reason: str
    settings: ControlSettings | None
    sensor: Sensor
    seed: int
    disturbances: tuple[Disturbance, ...]
    measured_error: tuple[float, float] | None = None
    camera_error: tuple[float, float] | None = None
    log: Path | None = None

    @property
    def goal_errors(self) -> tuple[float, float]:
        """Goal error (m, rad) at the end; the largest if there are several goals."""
        return _errors_at_end(self.scenario, self.plan, self.replans, self.simulated.object_poses[-1])

    @property
    def execution(self) -> Execution:
        """The motion in the form that logs and pictures use."""
        made = execution_of(self.scenario, self.plan, self.simulated, self.feedback)
        return replace(made, goal_error=self.goal_errors)

    @property
    def feedback(self) -> Feedback:
        """Measurements, events and replans."""
        return Feedback(self.simulated.measured, self.events, self.replans)

    @property
    def recorded(self) -> RecordedRun:
        """The run as a `RecordedRun`, as if read from its log."""
        path = Path(f"{self.scenario.name}.mcap")
        return RecordedRun(path, self.scenario, self.plan, self.execution, self.feedback)

    def write(self, path: Path | str) -> None:
        """Write the whole log (MCAP): plan, /measured, /events, replans and the motion.

        Raises:
            OutputError: If the file cannot be written.
        """
        setup = self.scenario, self.plan, self.settings, self.sensor, self.seed, self.disturbances
        with _ClosedLoopRecording(*setup, SILENT, None, path, None) as recording:
            recording.begin(self.plan)
            recording.completed(self)


def execution_of(scenario: Scenario, plan: Plan, course: SimulatedPush, feedback: Feedback) -> Execution:
    """Return a simulated motion in the form that logs and pictures use, without the goal error."""
    judge, margins = _judged(scenario, plan, feedback, course)
    return Execution(
        course.names,
        judge,
        course.t,
        course.poses,
        course.twists,
        course.object_poses,
        course.segment,
        margins,
        None,
        (math.nan, math.nan),
        wrenches=at_poses(course.wrenches),
    )


def _judged(
    scenario: Scenario, plan: Plan, feedback: Feedback, course: SimulatedPush | Execution
) -> tuple[str, FloatArray]:
    """Return the name of the margins' source and the margins (m, n) of the contacts."""
    loads: list[Load | None] = [s.load if s.pushes else None for s in segments_of(plan, feedback)]
    loads = [Load.of(scenario)] if scenario.task.held else loads
    return judged(loads, scenario.stability.set, course.names, course.segment, course.twists)


def _errors_at_end(
    scenario: Scenario, plan: Plan, replans: Sequence[Replan], objects: FloatArray
) -> tuple[float, float]:
    """Return the largest goal error (m, rad) of objects at poses (n, 3), with the goals of the last whole plan."""
    rests = [one.result for one in replans if one.rest and one.result is not None and one.solved]
    last = [plan, *rests][-1]
    return worst_at_goal(last.aims(plan.aims(scenario)), objects)


def events_until(
    now: float, names: Sequence[str], disturbances: Sequence[Disturbance], controller: Controller | None
) -> tuple[Event, ...]:
    """Return disturbances and the controller's events up to a time, s; at the same time, disturbances come first."""
    happened = [one.event(names) for one in disturbances if one.time <= now]
    noticed = [] if controller is None else controller.events
    return tuple(sorted([*happened, *noticed], key=lambda event: event.time))


class _ClosedLoopRecording(Recording):
    """Records a simulated run while it runs, so that the written part survives if the process is killed."""

    def __init__(
        self,
        scenario: Scenario,
        plan: Plan | None,
        settings: ControlSettings | None,
        sensor: Sensor,
        seed: int,
        disturbances: Sequence[Disturbance],
        observer: Observer,
        progress: Callable[[float], None] | None,
        log: Where,
        runs: Path | str | None,
    ) -> None:
        fields = fields_of(scenario, PlanSettings(seed=seed))
        if plan is not None:
            fields |= {**fields_of_plan(plan), "seed": seed}
        super().__init__(scenario, fields, log, runs, observer.message)
        self._scenario, self._progress, self._disturbances = scenario, progress, disturbances
        found = {
            "settings": None if settings is None else asdict(settings),
            "sensor": asdict(sensor),
            "disturbances": [asdict(disturbance) for disturbance in disturbances],
        }
        control = {name: json.dumps(value) for name, value in found.items()}
        self.write(lambda log: log.note(CONTROL, control))

    def begin(self, plan: Plan, controller: Controller | None = None) -> None:
        """Write the plan that is executed first."""
        self._plan, self._controller = plan, controller
        self.write(lambda log: log.plan(plan))

    def grown(self, course: SimulatedPush) -> None:
        """Write what is new since the last call; this is the `progress` callback of `simulate_push`."""
        moves = np.flatnonzero(course.twists[:-1].any(axis=1))
        known = int(moves[-1]) + 2 if len(moves) else 0  # margins at rest are those of the next twist
        replans = () if self._controller is None else tuple(self._controller.replans)
        events = events_until(float(course.t[-1]), course.names, self._disturbances, self._controller)
        feedback = Feedback(course.measured, events, replans)
        execution = execution_of(self._scenario, self._plan, course, feedback).until(known)
        self.write(lambda log: log.feedback(feedback))
        self.write(lambda log: log.samples(execution))
        if self._progress is not None:
            self._progress(float(course.t[-1]))

    def completed(self, run: ClosedLoopRun) -> ClosedLoopRun:
        """Write the rest and return the run with its log.

        Raises:
            IncompleteLogError: If the named log could not be written.
        """
        self.write(lambda log: log.feedback(run.feedback))
        self.write(lambda log: log.execution(run.execution))
        if run.reason:
            self.write(lambda log: log.log("warning", f"{run.outcome}: {run.reason}"))
        self.finish(run.outcome)
        self.require_whole(run)
        return replace(run, log=self.log)


def run_closed_loop(
    scenario: Scenario,
    world: World | None = None,
    disturbances: Sequence[Disturbance] = (),
    *,
    watched: bool = True,
    plan: Plan | None = None,
    settings: ControlSettings = DEFAULTS,
    sensor: Sensor = SENSOR,
    seed: int = 1,
    log: Where = False,
    runs: Path | str | None = None,
    observer: Observer = SILENT,
    progress: Callable[[float], None] | None = None,
    simulator_of: Callable[[World], Simulator] = SlipSimulator,
) -> ClosedLoopRun:
    """Push objects to their goals in a simulated world, in closed or open loop.

    Args:
        scenario: The controller's model of the world.
        world: The simulated world; None for the nominal world of the scenario.
        disturbances: Disturbances of the objects during the run.
        watched: Close the loop: measure, correct and replan. If False, the plan is executed without feedback.
        plan: First plan; see `Controller`.
        settings: Settings of the controller.
        sensor: Sensor that measures the objects.
        seed: Seed of the sensor's noise.
        log: File of the log, written during the run; None for a file in the folder `runs`, False for no log.
        runs: See `pushplan.run`.
        observer: Callbacks for messages about long operations and about the recording.
        progress: Called from time to time with the simulated time, s.
        simulator_of: Function that creates the simulator of a world; see `simulate_push`.

    Raises:
        MissingExtraError: See `simulate_push`.
        PlanningError: If there is no first plan.
        SupportError: If the load under an object is not known.
        OutputError: See `pushplan.run`.
    """
    world = World.from_scenario(scenario) if world is None else world
    setup = settings if watched else None, sensor, seed, tuple(disturbances)
    with _ClosedLoopRecording(scenario, plan, *setup, observer, progress, log, runs) as recording:
        driver: Controller | OpenLoop
        if watched:
            driver = controller = Controller(scenario, settings, plan=plan, observer=observer)
            plan = controller.plan
        else:
            controller, plan = None, plan_in(scenario, observer=observer) if plan is None else plan
            if plan.trajectory is None:
                raise PlanningError(f"there is no plan: {plan.reason}")
            driver = OpenLoop(plan, settings.rate)
        recording.begin(plan, controller)
        course = simulate_push(
            world,
            driver,
            settings.rate,
            disturbances,
            sensor,
            seed,
            progress=recording.grown,
            simulator_of=simulator_of,
        )
        if controller is None:
            outcome, reason = _end_of_plan(scenario, plan, settings, course)
        else:
            outcome, reason = _end_of(controller, course)
        events = events_until(float(course.t[-1]), course.names, disturbances, controller)
        replans = () if controller is None else tuple(controller.replans)
        known = (None, None) if controller is None else (controller.measured_error, controller.camera_error)
        done = ClosedLoopRun(scenario, plan, course, events, replans, outcome, reason, *setup, *known)
        return recording.completed(done)


def _end_of(controller: Controller, course: SimulatedPush) -> tuple[str, str]:
    """Return outcome and reason of a closed-loop run."""
    if course.jammed:
        return "jammed", JAMMED
    if not course.over:
        return "time limit", f"the objects had not arrived after {course.t[-1]:.0f} s"
    return controller.phase.value, controller.reason


def _end_of_plan(scenario: Scenario, plan: Plan, settings: ControlSettings, course: SimulatedPush) -> tuple[str, str]:
    """Return outcome and reason of an open-loop run."""
    if course.jammed:
        return "jammed", JAMMED
    placed = plan.aims(scenario)
    tolerance = tolerance_of(placed, settings.position_tolerance, settings.angle_tolerance)
    if all(np.less_equal(worst_at_goal(placed, course.object_poses[-1]), tolerance)):
        return "arrived", ""
    return ("stalled", STALLED) if course.stalled else ("missed", MISSED)


def check_closed_loop(run: RecordedRun) -> list[Check]:
    """Recompute a recorded closed loop from its measurements and compare: twists, events, replans and plate poses.

    Object motion cannot be recomputed, because the log does not hold the simulated world.

    Raises:
        RunLogError: If the log holds no closed loop or its settings cannot be read.
    """
    if run.feedback is None or run.execution is None or run.plan is None:
        raise RunLogError(str(run.path), "the log holds no closed loop")
    try:
        fields = run.fields[CONTROL]
        stated, sensor = json.loads(fields["settings"]), Sensor(**json.loads(fields["sensor"]))
        settings = None if stated is None else ControlSettings(**stated)
    except (KeyError, TypeError, ValueError, PushplanError) as error:
        raise RunLogError(str(run.path), f"the settings of the closed loop cannot be read: {error}") from error
    execution, feedback = run.execution, run.feedback
    _, margins = _judged(run.scenario, run.plan, feedback, execution)
    cut = math.isnan(execution.goal_error[0])
    if cut:  # the last margin is of a twist that came later; events of that time are in the log before the samples
        margins[-1:] = execution.margins[-1:]
        until = execution.t[-1:].max(initial=-math.inf) + TIME_ROUNDING
        events = tuple(event for event in feedback.events if event.time <= until)
        replans = tuple(replan for replan in feedback.replans if replan.time <= until)
        feedback = Feedback(feedback.measured, events, replans)
    checks = [check_way(execution), series_check("margin", execution.t, execution.margins, margins)]
    if not cut:
        off = _errors_at_end(run.scenario, run.plan, feedback.replans, execution.objects[-1])
        checks.append(Check("goal error", float(np.abs(np.subtract(off, execution.goal_error)).max())))
    if settings is not None:
        controller = Controller(run.scenario, settings, plan=run.plan)
        twists = _twists(controller, execution, feedback, sensor)
        checks.append(series_check("twist", execution.t, execution.twists, twists, ROUNDING))
        checks += _event_checks(controller, feedback)
        if run.outcome in ("arrived", "gave up"):
            ended = controller.phase.value
            what = "" if ended == run.outcome else f"{run.outcome!r} instead of {ended!r}"
            checks.append(Check("outcome", math.inf if what else 0.0, what=what))
    return checks


def _twists(controller: Controller, execution: Execution, feedback: Feedback, sensor: Sensor) -> FloatArray:
    """Return the controller's twists (m, 3) of the plate frame, recomputed from the recorded measurements."""
    seen = Measurements.recorded(sensor, feedback.measured)
    twists = []
    for now in execution.t:
        came = seen.arrived(float(now))
        twists.append(controller.step(float(now)) if came is None else controller.step(float(now), *came))
    return np.array(twists)


def _event_checks(controller: Controller, feedback: Feedback) -> Iterator[Check]:
    """Compare the events and the replanned paths."""
    observed = [event for event in feedback.events if event.kind != "disturbance"]  # unknown to the controller
    found, expected = ([(e.kind, e.text) for e in events] for events in (observed, controller.events))
    differs = next((k for k, pair in enumerate(zip(found, expected, strict=False)) if pair[0] != pair[1]), None)
    if differs is not None:
        what = f"{': '.join(found[differs])!r} instead of {': '.join(expected[differs])!r}"
        yield Check("events", math.inf, 0.0, observed[differs].time, what)
    else:
        yield Check("number of events", abs(len(found) - len(expected)), 0.0)
    yield Check("number of replans", abs(len(feedback.replans) - len(controller.replans)), 0.0)
    for k, (recorded, made) in enumerate(zip(feedback.replans, controller.replans, strict=False)):
        yield Check(f"replan {k + 1}", _apart(recorded.result, made.result), time=recorded.time)


def _apart(first: Plan | None, second: Plan | None) -> float:
    """Return the largest difference of the arc ends and numbers of two plans; infinite if their segments differ."""
    if first is None or second is None:
        return 0.0 if first is second else math.inf
    forms = [[(s.kind, s.path.knots.shape) for s in plan.segments] for plan in (first, second)]
    if forms[0] != forms[1] or first.reason != second.reason:
        return math.inf
    knots = [[s.path.knots for s in plan.segments] for plan in (first, second)]
    stated = [(plan.cost, plan.duration, plan.margin, plan.margin_asked) for plan in (first, second)]
    if [one is None for one in stated[0]] != [one is None for one in stated[1]]:
        return math.inf
    numbers = [np.array([0.0 if one is None else one for one in each]) for each in stated]
    return max(float(np.abs(a - b).max()) for a, b in [*zip(*knots, strict=True), tuple(numbers)])
