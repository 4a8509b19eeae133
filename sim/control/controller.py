"""The closed loop: measured poses of the objects in, twists of the plate out.

The controller executes the segments of a plan. A `PushLoop` executes each push: it watches the load, closes contacts
and replans. Before the plate drives to an object, it stands still and measures all objects. It drives to the measured
face instead of the planned one; a short straight push closes the contact and reveals the pose of the plate. Objects
that are not pushed are watched, too. If one has moved, or a load was lost, the controller replans the rest from the
measured poses.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from pushplan.geometry.se2 import compose, exp, inverse, log, relative, twist_of
from pushplan.planners.timing.blending import time_segments
from pushplan.plans.goals import worst_at_goal
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.run import Event, Replan
from pushplan.plans.segment import Segment, standing_obstacles
from pushplan.plans.settings import Observer
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.sim.control.estimator import DOUBT, Estimator
from pushplan.sim.control.following import Following
from pushplan.sim.control.jobs import Phase, PushJob, alone, is_last, push_job
from pushplan.sim.control.pushing import PushLoop
from pushplan.sim.control.replanner import Replanner, bears, first_plan
from pushplan.sim.control.rest import Leg, RestPlanner, legs_to, travel_of
from pushplan.sim.control.sensing import MEMORY, Odometry, Sightings
from pushplan.sim.control.settings import ControlSettings, words
from pushplan.sim.control.standing import Deliveries, Standing
from pushplan.sim.follower import Steering
from pushplan.sim.intake import Intake
from pushplan.util.arrays import FloatArray
from pushplan.util.names import AUTO, RETREAT

DEFAULTS = ControlSettings()
SILENT = Observer()
RESTS = 12
"""Largest number of plans for the rest of a multi-push plan."""
AGAIN = 2
"""Largest number of repeated approaches to a load that the plate met with a lateral offset."""
DOUBTS = {
    "wrong": "{} was seen elsewhere once: a leap counts only if the next measurement confirms it",
    "exchanged": "objects were seen at the poses of others: their names were exchanged back",
    "frozen": "measurements repeat although the plate moves: they are ignored until they change",
}
SURE = 2.0
"""Standard deviations of a camera error that the measurements do not exclude."""
STALLS = 1
"""Number of stalls after which the rest is replanned, if possible through another face; the next one ends the run."""
NEAR = 0.5
"""Largest error of a load from its planned pose, as a share of the slack, for which planned transits are kept."""


class Controller:
    """Executes a plan in closed loop.

    Attributes:
        scenario: Believed scenario: the objects, the room, and the goals.
        settings: Settings of the controller.
        plan: Initial plan.
        events: Observations and actions of the controller.
        replans: All attempts to plan after the first plan.
        reason: Reason for giving up; empty otherwise.
        measured_error: Last measured distance (m) and angle (rad) of the goal's object from the goal; None before.
        camera_error: Camera error (m, rad) that could not be excluded at the arrival; None before.
    """

    def __init__(
        self,
        what: Scenario | Plan,
        settings: ControlSettings | None = None,
        *,
        plan: Plan | None = None,
        observer: Observer = SILENT,
    ) -> None:
        """Prepare the controller and its planners.

        Args:
            what: Scenario, or initial plan. The loads under the objects must be known.
            settings: Settings of the controller; None for the defaults.
            plan: Initial plan in a scenario. None makes one; for a single push one that tolerates
                `settings.friction`, if possible.
            observer: Receiver of messages about slow steps.

        Raises:
            PlanningError: If there is no plan.
            SupportError: If the load under an object is not known.
        """
        scenario, plan = (what.scenario, what) if isinstance(what, Plan) else (what, plan)
        settings = DEFAULTS if settings is None else settings
        plan, self._replanner = first_plan(scenario, plan, settings, observer)
        scenario = plan.aims(scenario)
        self.scenario, self.plan, self.settings = scenario, plan, settings
        self._observer, self._obstacles = observer, scenario.obstacles
        self._phase, self.reason = Phase.PUSHING if plan.segments[0].pushes else Phase.LOOKING, ""
        self.events: list[Event] = []
        self.replans: list[Replan] = []
        self.measured_error: tuple[float, float] | None = None
        self.camera_error: tuple[float, float] | None = None
        self._intake = Intake(partial(self._tell, "dropped"))
        self._sightings = Sightings(np.array([settings.position_noise, settings.angle_noise]))
        self._estimator: Estimator | None = None  # of the last push, with the errors of clock and wheels
        self._standing = Standing(scenario.poses, settings, self._sightings)
        self._delivered = Deliveries(scenario, settings, self._standing)
        planning = self._delivered.tolerance, settings.friction, observer
        wary = self._replanner is None and bears(plan, settings.friction)
        self._rest_planner = RestPlanner(scenario, plan, *planning, wary)
        self._plate = self._told = np.array(scenario.plate_start)
        self._alone = 0.0, 0.0  # distance (m) and angle (rad) that the plate has driven since the last push
        self._odometry = Odometry(self._plate)
        self._wheels = relative(scenario.pusher.plate_pose, scenario.pusher.wheels_pose)
        self._now, self._began, self._since, self._late = 0.0, math.inf, 0.0, False
        self._planned, self._at, self._before, self._rests = plan, 0, 0, 0
        self._again, self._backing, self._lost, self._stalled = 0, False, "", list[str]()
        self._headings = np.zeros((len(self._standing.names), 2))  # constant errors of the measured headings, and
        self._headings[:, 1] = settings.bias[1]  # their standard deviations, rad
        self._blind, self._doubts = False, set[str]()  # whether no object is seen; reported sensor problems
        self._slips: Counter[str] = Counter()  # number of slides of each object, by name, since the plan was made
        self._most = settings.most(travel_of(plan.segments))
        self._push: PushLoop | None = None
        self._legs: deque[Leg] = deque()
        self._following: Following | None = None
        self._tell("plan", f"{plan.cost if plan.path is None else plan.path.cost:.3f} m in {plan.duration:.1f} s")

    @property
    def phase(self) -> Phase:
        """State of the controller."""
        return self._phase if self._push is None else self._push.phase

    @property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """Estimated errors of sensors and wheels, see `Estimator.estimates`; empty before the first push."""
        push = self._push
        of, names = (self._estimator, ()) if push is None else (push.estimator, push.load.names)
        return {} if of is None else of.estimates(names)

    @property
    def over(self) -> bool:
        """Whether it has arrived or given up; the plate then stands still."""
        return self._phase in (Phase.ARRIVED, Phase.GAVE_UP)

    @property
    def load(self) -> Load | None:
        """Load that is pushed, approached or left; None while the plate drives alone."""
        return self._planned.segments[min(self._at, len(self._planned.segments) - 1)].load

    @property
    def segment(self) -> int:
        """Index of the segment among those of the plan and of all plans for the rest, see `plans.run.segments_of`."""
        return self._before + min(self._at, len(self._planned.segments) - 1)

    def step(
        self,
        now: float,
        object_poses: ArrayLike | None = None,
        measured_at: float | None = None,
        plate_pose: ArrayLike | None = None,
        *,
        odometry: ArrayLike | None = None,
        frame: str = "world",
        covariance: ArrayLike | None = None,
    ) -> FloatArray:
        """Return the body twist (3,) of the plate frame until the next step.

        Call it `settings.rate` times a second. Invalid numbers are dropped with an event of the kind `dropped`; an
        invalid time gives the twist 0. While the plate stands still, a step can take long because it plans.

        Args:
            now: Time of a monotonic clock, s.
            object_poses: Measured poses of the objects' frames, (n, 3), None or NaN for unseen objects; None without
                a new measurement.
            measured_at: Time of the measurement, s; None for now. Measurements up to 0.1 s ahead wait.
            plate_pose: Measured pose of the plate frame in the world, (3,); it can jump.
            odometry: Pose of the plate frame by the wheels, in a fixed frame, (3,); it can drift. Without both poses
                the plate is assumed to follow the commanded twists.
            frame: Frame of `object_poses`: `world`, or `plate` for a camera on the robot.
            covariance: Covariance of a pose in x, y, theta, (3, 3), or of each object, (n, 3, 3); the largest counts.
                None for the noise of the settings.

        Raises:
            PushplanError: If the number of poses is wrong, an argument is not numeric, or `frame` is unknown.
        """
        intake, sightings = self._intake, self._sightings
        if not intake.clock(now):
            if intake.bad > self.settings.patience * self.settings.rate and not self.over:
                self._give_up("the times of the steps are invalid")
            return np.zeros(3)
        self._now = intake.now
        if self._began == math.inf:
            self._began = self._since = self._now
            self._begin()
        rolled, pose = intake.pose(odometry, "pose by odometry"), intake.pose(plate_pose, "pose of the plate")
        jump = self._odometry.take(rolled, pose)
        if jump is not None:
            self._tell("jump", f"the plate's measured pose jumped by {words(*jump)}")
        self._moved()
        if object_poses is not None:
            self._late |= measured_at is None and sightings.latest() == -math.inf
            if self._late and self._push is not None and sightings.latest() == -math.inf:
                self._push.estimator.unstamped()
            poses = intake.poses(object_poses, list(self._standing.names), "poses of the objects")
            stamp = intake.stamp(measured_at, sightings.latest(), max(self._began, self._now) - MEMORY)
            poses[:, 2] -= self._headings[:, 0]
            if stamp is not None and not np.isnan(poses).all():
                sightings.see(stamp, poses, frame, intake.deviations(covariance, len(poses)))
        push, plate = self._push, self._plate
        if push is not None:
            plate = compose(push.by_odometry, inverse(push.load.frame_plate))
        for taken, poses in sightings.come(self._now, plate, push is not None and push.carrying, self._doubt):
            self._standing.measured(poses)
            if push is not None:
                push.learn(taken, poses)
        if "noise" not in self._doubts and (more := sightings.noisier()):
            self._doubts.add("noise")
            self._tell("sensor", f"measurements scatter by {more}: the measured noise is used")
        if not self.over:
            self._decide()
        return self._twist()

    def _doubt(self, what: str, k: int) -> None:
        """Report a sensor problem once."""
        if what not in self._doubts:
            self._tell("dropped", DOUBTS[what].format(self._standing.names[k]))
        self._doubts.add(what)

    def _moved(self) -> None:
        """Update the pose of the plate with its motion since the last step."""
        if self._push is not None:
            self._push.moved(self._now)
            self._plate = compose(self._push.plate, inverse(self._push.load.frame_plate))
        else:
            twist = log(relative(self._told, self._odometry.pose))
            if self._estimator is not None:
                twist = self._estimator.scaled(twist, self._wheels)
            self._plate = compose(self._plate, exp(twist))
            self._alone = self._alone[0] + math.hypot(*twist[:2]), self._alone[1] + abs(float(twist[2]))
        self._told = self._odometry.pose

    def _twist(self) -> FloatArray:
        """Return the commanded twist (3,) of the plate frame."""
        command = np.zeros(3)
        if self._push is not None:
            command = twist_of(self._push.load.chain.pusher.plate_pose, self._push.twist())
        elif self._following is not None and not self.over and not self._following.drive.over:
            twist = self._following.twist(self._plate)
            command = twist if self._estimator is None else self._estimator.asked(twist, self._wheels)
        self._odometry.drive(command, 1.0 / self.settings.rate)
        return np.array(command)

    def _spare(self, k: int) -> float:
        """Return the remaining travel, m, without the travel of the segments from k on."""
        return self._most - self._odometry.travel - travel_of(self._planned.segments[k:])

    def notice(self, obstacles: Iterable[Obstacle]) -> None:
        """Set the obstacles in the room.

        In a push, the plate stops and replans if the rest of its path is blocked, or another path has become shorter
        by a tenth. In a transit, it stops and searches a new transit.
        """
        self._obstacles = tuple(obstacles)
        if self._push is not None:
            self._push.notice(self._around(self._push.load))
        elif self._replanner is not None:
            self._replanner.take_obstacles(self._obstacles)
        elif self._following is not None and not self._following.drive.stopping:
            self._tell("room", "the obstacles in the room have changed")
            self._following.drive.stop()

    def _around(self, load: Load) -> tuple[Obstacle, ...]:
        """Return the obstacles, and the objects that are not pushed as obstacles at their believed poses."""
        return (*self._obstacles, *standing_obstacles(self.scenario, self._standing.by_name, load.names))

    def _decide(self) -> None:
        """Continue the push, the transit or the look."""
        if self._replanner is None and self._standing.watch(self._tell):
            if self._push is not None:
                self._push.notice(self._around(self._push.load))
            elif self._following is not None:
                self._following.drive.stop()
        if self._push is not None:
            self._push.decide()
            if self._push.over:
                self._end_push(self._push)
        elif self._phase is Phase.LOOKING:
            self._look()
        elif self._following is not None and self._following.drive.over:
            if self._following.drive.stopping or self._backing:
                self._rest()
            else:
                self._legs.popleft()
                self._go_on()
        elif self._following is not None and not self._sightings.rides and self._is_blind():
            self._following.drive.stop()

    def _begin(self) -> None:
        """Start the next segment: a push, a retreat, or a look before a transit."""
        segments = self._planned.segments
        if self._at < len(segments) and segments[self._at].pushes:
            self._begin_push(segments[self._at])
        elif self._at < len(segments) and segments[self._at].kind == RETREAT:
            self._back_off(segments[self._at])
        else:
            self._rest()

    def _back_off(self, retreat: Segment) -> None:
        """Execute a retreat from the current pose of the plate."""
        back = replace(retreat, path=PushPath(self._plate, retreat.path.twists, retreat.path.lengths))
        (timed,) = time_segments(self.scenario, (back,), self.settings.rate)
        self._set_out([(self._at, timed)])

    def _go_on(self) -> None:
        """Continue after a finished leg or push."""
        if self._legs:
            self._set_out(list(self._legs))
        else:
            self._at, self._following = self._at + 1, None
            self._begin()

    def _set_out(self, legs: list[Leg]) -> None:
        """Drive along the first of some legs."""
        self._legs, (self._at, leg) = deque(legs), legs[0]
        assert leg.trajectory is not None
        if leg.load is not None:
            self._standing.let_go(self._standing.columns(leg.load.names))  # the plate can touch them
        limits, rate = self.scenario.pusher.limits, self.settings.rate
        self._following = Following(leg.trajectory, limits, rate, np.zeros(3), Steering(alone(self._planned, leg)))
        self._phase = Phase.DRIVING

    def _rest(self) -> None:
        """Stand still and measure all objects."""
        self._legs.clear()
        self._backing, self._following, self._phase, self._since = False, None, Phase.LOOKING, self._now

    def _look(self) -> None:
        """Once all poses are known, drive to the next load, plan the rest, or end."""
        standing, segments = self._standing, self._planned.segments
        if self._is_blind():
            self._since = self._now  # wait for the objects that are not seen
            return
        usual = self.settings.late + self.settings.delay_error if self._late else 0.0
        late = usual + 2.0 * self.settings.delay_error if self._estimator is None else self._estimator.late
        if not standing.look(self._since + late, self._now):
            return
        left = self._delivered.left()
        if not left:
            out = f"; not delivered: {', '.join(self.plan.undelivered)}" if self.plan.undelivered else ""
            self.measured_error = worst_at_goal(self.scenario, standing.poses)
            self._end(Phase.ARRIVED, f"{words(*self.measured_error)} off the goal{out}")
            return
        loads = [segment.load for segment in segments[self._at :] if segment.pushes]
        ahead = {name for load in loads if load is not None for name in load.names}
        why = self._lost or ("" if left <= ahead else f"{', '.join(sorted(left - ahead))} must be pushed again")
        legs = [] if why else self._legs_to_next()
        if legs:
            self._set_out(legs)
        else:
            self._plan_rest(why or "there is no short transit to the next planned push")

    def _is_blind(self) -> bool:
        """Return whether no object is seen; report it once, and give up after the outage time."""
        columns = self._standing.columns(self._standing.names)
        unseen = self._now - float(self._sightings.unseen(self._began, columns).max())
        self._blind = self._sightings.is_blind(unseen, self._blind, self.settings.patience, self._tell)
        if unseen > self.settings.outage:
            self._give_up(f"no measurement has come for {unseen:.1f} s")
        return self._blind

    def _legs_to_next(self) -> list[Leg]:
        """Return the legs to the load of the next push; empty if there are none within the remaining travel."""
        settings, standing = self.settings, (self._standing.by_name, self._obstacles)
        near = NEAR * settings.position_slack, NEAR * settings.angle_slack
        legs = legs_to(self._planned, self._at, self._plate, *standing, near, settings.rate)
        if legs and travel_of(leg for _, leg in legs) > self._spare(legs[-1][0] + 1):
            return []
        if legs:
            load = self._planned.segments[legs[-1][0]].load
            where = "" if load is None else f" to {load.names[0]}, at its {load.face}"
            self._tell("drive", f"{sum(leg.path.cost for _, leg in legs):.2f} m{where}")
        return legs

    def _plan_rest(self, why: str) -> None:
        """Plan the rest, and start it."""
        self._rests += 1
        if self._rests > RESTS:
            self._give_up(f"the goal is not reached after {RESTS} plans for the rest: {why}")
            return
        state = self._plate, self._standing.by_name, self._obstacles, self._delivered.names, self._rests
        most = self._most - self._odometry.travel
        replan = self._rest_planner.plan(self._now, *state, most, self._slips, self._stalled)
        self._slips = Counter()
        self.replans.append(replan)
        result = replan.result
        if result is None or not result.solved:
            self._give_up(f"{why}, and there is no plan from here: {replan.reason}")
            return
        self._before += len(self._planned.segments)
        self._planned, self._at, self._lost = result, 0, ""
        if self._spare(0) < 0.0:
            way = f"{self._odometry.travel:.1f} m of {self._most:.1f} m were driven"
            self._give_up(f"{why}; {way}, and the rest takes {travel_of(result.segments):.1f} m")
            return
        self.scenario = result.aims(self.scenario)
        self._delivered.aim_at(self.scenario)
        self._tell("replan", f"{result.cost:.3f} m in {result.duration:.1f} s: {why}")
        legs = [] if result.segments[0].kind == RETREAT else self._legs_to_next()
        if legs:
            self._set_out(legs)
        else:
            self._begin()

    def _begin_push(self, segment: Segment) -> None:
        """Start the push of a segment."""
        load = segment.pushed_load
        replanner = self._replanner
        if replanner is None:
            poses, tolerance = self._standing.by_name, self._delivered.tolerance
            most = min(self.settings.most(segment.path.travel), self._spare(self._at + 1))
            job = push_job(self._planned, segment, self._plate, poses, self._obstacles, tolerance, most)
            # An object in a row can hardly be pushed in another way.
            lowers = self.scenario.task.flush and self.scenario.stability.margin == AUTO
            replanner = Replanner(job.scenario, self.settings, self._observer, lowers)
        else:
            job = PushJob(self.scenario, self.plan, self._standing.columns(load.names), self._most)
        self._push = PushLoop(
            replace(
                job,
                again=self._again < AGAIN,
                alone=self._alone,
                slips=self._slips,
                headings=self._headings[job.columns, 1],
            ),
            replanner,
            self.settings,
            self._sightings,
            self._tell,
            self.replans.append,
            self._now,
            compose(self._plate, load.frame_plate),
            self._odometry,
            self._estimator,
        )
        if self._late and self._estimator is None:
            self._push.estimator.unstamped()
        self._standing.let_go(job.columns)

    def _end_push(self, push: PushLoop) -> None:
        """Continue after a finished push with the next segment, or with a retreat and a look."""
        names = push.load.names
        self._push, self._estimator, self._slips = None, push.estimator, push.slips
        self._plate, self._alone = compose(push.plate_after, inverse(push.load.frame_plate)), (0.0, 0.0)
        self._learn_headings(push)
        if self._replanner is not None:
            self.measured_error = push.error
            self._end(push.phase, push.text)
            return
        self._tell("pushed", f"{', '.join(names)}: {push.phase.value}, {push.text}")
        if push.stalled and len(self._stalled) == STALLS:
            self._give_up(push.text)
            return
        self._stalled += [push.load.face] * push.stalled
        self._standing.put(self._standing.columns(names), compose(push.plate, push.places))
        if push.phase is Phase.GAVE_UP:
            retreat = next(s for s in self._planned.segments[self._at :] if s.kind == RETREAT)
            if push.met_aside:
                self._at -= 1  # repeat the approach
                self._again += 1
            else:
                self._lost = f"the push of {', '.join(names)} gave up ({push.text})"
            self._back_off(retreat)
            self._backing = True
            return
        self._again = 0
        if is_last(self._planned, self._planned.segments[self._at]):
            self._delivered.take(names)
        self._go_on()

    def _learn_headings(self, push: PushLoop) -> None:
        """Record the heading errors of pushed objects, which persist from push to push."""
        columns = self._standing.columns(push.load.names)
        values, deviations = push.estimator.headings
        self._headings[columns, 0] += values
        self._headings[columns, 1] = np.maximum(deviations, DOUBT * self.settings.bias[1])

    def _give_up(self, reason: str) -> None:
        self._end(Phase.GAVE_UP, reason)

    def _end(self, phase: Phase, text: str) -> None:
        """Stop the plate for good."""
        estimator = self._estimator if self._push is None else self._push.estimator
        if estimator is not None and (found := estimator.words()):
            self._tell("sensor", found)
        self._push, self._following, self._phase = None, None, phase
        self.reason = text if phase is Phase.GAVE_UP else ""
        if phase is Phase.ARRIVED:
            self.camera_error = SURE * self.settings.bias[0], SURE * float(self._headings[:, 1].max())
            text += f", as measured; a camera error of up to {words(*self.camera_error)} is not excluded"
        self._tell(phase.value, text)

    def _tell(self, kind: str, text: str) -> None:
        self.events.append(Event(self._now, kind, text))
