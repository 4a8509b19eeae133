"""The closed loop: measured poses of the objects in, twists of the plate out.

The plate follows a plan. When measurements say that an object is away from its pose, it slows down along the path and
stands still: objects on the floor then stand still, too, and every measurement from then on tells the same, so that
noise averages out and delay does not matter. From what was seen the controller closes contacts that are open, plans
again, or gives up.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from enum import Enum
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import ChainError, PlanningError
from pushplan.geometry.se2 import compose, exp, log, pose_error, relative
from pushplan.mechanics.perturb import slid
from pushplan.planners.timing.arc_limits import motion_bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.events import Event, Replan
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.plan import Load, Plan
from pushplan.plans.settings import Observer
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Obstacle, Scenario
from pushplan.sim.control.closing import ClosingPush, Contacts, Spread, closing_push, contacts_at
from pushplan.sim.control.estimator import HOLD, Estimator, Sample
from pushplan.sim.control.replanner import Replanner
from pushplan.sim.control.sensing import MEMORY, Sightings
from pushplan.sim.control.settings import SIGMAS, ControlSettings
from pushplan.sim.follower import Drive, Steering
from pushplan.sim.intake import Intake
from pushplan.sim.slip.simulator import SlipSimulator
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray

DEFAULTS = ControlSettings()
SILENT = Observer()
CLOSINGS = 3
"""Pushes in a row that may fail to close contacts."""
ATTEMPTS = 24
"""Replans in a row that may find nothing."""
CLEARLY, BARELY, HARDLY = 0.8, 0.95, 0.05
"""Shares of the tolerances: nothing need be better, arrived for all the noise, hardly more than asked for."""
FREE = 3
"""Plans on the way that are made whatever they cost; later ones only up to twice the first plan, and 1 m."""
WORTH = 0.5
"""Way (m) that it is worth to come nearer by no more than that."""
SLOW, QUICK, UNSURE = 4.0, 5.0, 3.0
"""Standard deviations of the mean of many measurements, of two, and of what is expected, by which an object has to be
off."""
SETTLE, UNSETTLED = 0.02, (1.5e-3, math.radians(0.4))
"""Way after which contacts that were open at first are closed, m, and by what they may have been (m, rad)."""
REFIT = 0.25
"""Time between two fits, s."""
JUMP = (0.01, math.radians(0.5))
"""What (m, rad) the measured pose of the plate may be off from one to the next."""
EXACT = 1e-7
"""Up to here (m, rad) the plate is on its path."""
SHIFT = 0.2
"""Share of a period by which time goes faster or slower where the plate is ahead or behind."""


class Phase(Enum):
    """What a controller is doing."""

    PUSHING = "pushing"
    CLOSING = "closing"
    LOOKING = "looking"
    ARRIVED = "arrived"
    GAVE_UP = "gave up"


class Controller:
    """Pushes a chain to its goal and watches it.

    Attributes:
        scenario: What is believed: the chain, the room, and the goal.
        settings: See there.
        plan: What it does at first.
        load: What is pushed: twists are of its contact's frame.
        phase: What it is doing.
        events: All that it noticed and did.
        replans: All attempts to plan after the first one.
        reason: Why it gave up; empty while it has not.
    """

    def __init__(
        self,
        what: Scenario | Plan,
        settings: ControlSettings | None = None,
        *,
        plan: Plan | None = None,
        observer: Observer = SILENT,
    ) -> None:
        """Get ready: what replans need is made, and compiled code loaded.

        Args:
            what: What is believed, or the plan to begin with; loads under the objects have to be known.
            settings: See there.
            plan: What to do at first in a scenario; None makes a plan that holds for `settings.friction`, if there is
                one.
            observer: Takes messages about what takes long.

        Raises:
            PlanningError: When there is no plan.
            SupportError: When the load under an object is not known.
        """
        scenario, plan = (what.scenario, what) if isinstance(what, Plan) else (what, plan)
        settings = DEFAULTS if settings is None else settings
        if scenario.kind != "push":
            raise PlanningError(
                f"the closed loop replans a single push; this is a {scenario.kind}, in which the robot would have to "
                "plan its way to other contacts anew: execute it in open loop, or lead a robot with Follower"
            )
        self._closer = World.from_scenario(scenario)
        SlipSimulator(self._closer)  # before anything takes long: loads have to be known
        self._replanner = Replanner(scenario, settings, observer)
        plan = self._replanner.first() if plan is None else plan
        if plan.trajectory is None or plan.path is None:
            raise PlanningError(f"there is no plan to begin with: {plan.reason}")
        self.scenario, self.plan, self.settings = scenario, plan, settings
        self.load = Load.of(scenario)
        self.phase, self.reason = Phase.PUSHING, ""
        self.events: list[Event] = []
        self.replans: list[Replan] = []
        self._replanner.rehearse(plan.path)
        self._intake, self._bad_clock = Intake(partial(self._tell, "dropped")), 0
        self._sightings, self._estimator = Sightings(), Estimator(settings, len(scenario.chain.objects))
        self._normals = np.array([contact.normal for contact in scenario.chain.contacts])
        self._plate = self._odometry = np.array(scenario.start)
        self._localised: tuple[FloatArray, FloatArray] | None = None
        self._now, self._began, self._fitted, self._way = 0.0, math.inf, -math.inf, 0.0
        self._recent: deque[Sample] = deque(maxlen=max(2, settings.looks // 2))
        self._places = scenario.chain.places
        self._open: Contacts | None = None
        self._since, self._closings, self._settled = 0.0, 0, False
        self._path: PushPath = plan.path
        self._drive_on(plan)
        self._tell("plan", f"{plan.path.cost:.3f} m in {plan.trajectory.duration:.1f} s")

    @property
    def over(self) -> bool:
        """Whether it arrived or gave up: the plate stands still from now on."""
        return self.phase in (Phase.ARRIVED, Phase.GAVE_UP)

    def goal_errors(self, object_poses: FloatArray) -> tuple[float, float]:
        """Return how far (m) and by what angle (rad) the goal's object is off, or the worst where it names none."""
        distance, angle = self._replanner.aim.errors(object_poses)
        return float(distance), float(angle)

    def step(
        self,
        now: float,
        object_poses: ArrayLike | None = None,
        measured_at: float | None = None,
        plate_pose: ArrayLike | None = None,
    ) -> FloatArray:
        """Return the body twist (3,) in the chain frame that the plate is to have until the next step.

        Steps come `settings.rate` times a second. Numbers that cannot be are dropped with an event of the kind
        `dropped`; where time is none, the twist is 0.

        Args:
            now: Time by any clock, s.
            object_poses: (n, 3) measured poses of the objects' frames in the world, None or NaN for objects that were
                not seen; None where there is nothing new.
            measured_at: When they were measured, not when they came, s; None stands for now. Up to 0.1 s ahead of
                `now` they wait until then.
            plate_pose: (3,) pose of the chain frame in the world, where that is measured, too; None stands for where
                the twists so far have brought it.

        Raises:
            PushplanError: When there are more or fewer poses than objects, or words instead of numbers.
        """
        intake, sightings = self._intake, self._sightings
        if not intake.clock(now):
            self._bad_clock += 1
            if self._bad_clock > self.settings.patience * self.settings.rate and not self.over:
                self._give_up("the times of steps cannot be")
            return np.zeros(3)
        self._now, self._bad_clock = intake.now, 0
        if self._began == math.inf:
            self._began = self._since = self._now
        if plate_pose is not None:
            self._localise(intake.pose(plate_pose, "pose of the plate"))
        self._estimator.moved(self._now, self._odometry)
        if self._localised is not None:
            self._plate = self._estimator.plate(self._now)
        if object_poses is not None:
            if measured_at is None and sightings.latest() == -math.inf:
                self._estimator.unstamped()
            names = [obj.name for obj in self.scenario.chain.objects]
            poses = intake.poses(object_poses, names, "poses of the objects")
            stamp = intake.stamp(measured_at, sightings.latest(), max(self._began, self._now) - MEMORY)
            if stamp is not None and not np.isnan(poses).all():
                sightings.see(stamp, poses)
        for time, poses in sightings.come(self._now):
            self._learn(Sample(time, poses, self._replanner.chain.places))
        if not self.over:
            self._decide()
        return self._twist()

    def _localise(self, pose: FloatArray | None) -> None:
        """Take a measured pose of the plate (3,) for how it has moved; a jump is one of the measurement."""
        if pose is None:
            return
        if self._localised is None:
            self._odometry = pose
        else:
            before, odometry = self._localised
            told, moved = relative(odometry, self._odometry), relative(before, pose)
            apart = pose_error(moved, told)
            if apart[0] > JUMP[0] or apart[1] > JUMP[1]:
                self._tell("jump", f"the plate's measured pose jumped by {_words(*apart)}")
                moved = told
            self._odometry = compose(odometry, moved)
        self._localised = pose, self._odometry

    def _learn(self, sample: Sample) -> None:
        """Take a measurement into account while contacts are taken for closed."""
        self._recent.append(sample)
        if self.phase is not Phase.PUSHING or self._driving.stopping or self.over:
            return
        self._estimator.add(sample)
        if not self._settled and self._way > SETTLE:
            self._settled = True
            self._estimator.forget(-math.inf, self._now)  # gaps were closing
        if self._now >= self._fitted + REFIT:
            self._fitted = self._now
            self._estimator.fit(self._now)
            self._plate = self._estimator.plate(self._now)

    def notice(self, obstacles: Iterable[Obstacle]) -> None:
        """Take over what stands in the room now.

        Where the rest of the plan is not free any more, or another way has become shorter by a tenth, the plate stops
        and plans again.
        """
        self._replanner.take_obstacles(tuple(obstacles))
        if self.phase is not Phase.PUSHING or self._driving.stopping:
            return
        trajectory = self._driving.trajectory
        ahead = trajectory.poses_at(np.arange(self._driving.at, trajectory.duration, 0.02))
        if len(ahead) < 2:
            return
        rest = float(cost_rate(log(relative(ahead[:-1], ahead[1:]))).sum())
        why = self._replanner.reason_to_replan(ahead, rest)
        if why:
            self._tell("room", why)
            self._driving.stop()

    def _twist(self) -> FloatArray:
        """Return the twist to tell the plate: what leads it along the path, and back to it as contacts bear."""
        if self.over or self._driving.over:
            return np.zeros(3)
        driving, period = self._driving, 1.0 / self.settings.rate
        before = driving.at
        wanted = driving.advance(period)
        twist = log(relative(self._plate, wanted)) * self.settings.rate
        off = np.abs(relative(driving.trajectory.poses_at([before])[0], self._plate))
        if off.max() > EXACT and self._steering is not None:
            twist = self._steered(self._steering, before, driving.at - before)
        told = self._estimator.asked(twist)
        self._odometry = compose(self._odometry, exp(told * period))
        self._plate = compose(self._plate, exp(twist * period))
        self._way += float(np.hypot(twist[0], twist[1])) * period
        return np.asarray(told)

    def _steered(self, steering: Steering, before: float, ahead: float) -> FloatArray:
        """Return the planned twist (3,) and what correction contacts bear; an error along the path is one of time."""
        driving, period = self._driving, 1.0 / self.settings.rate
        frame = self.load.frame_plate
        base = compose(self._plate, driving.trajectory.base)
        error = steering.error(before, base)
        twist = steering.corrected(steering.planned(before, ahead, period), error, before)
        if not driving.stopping:
            shift = steering.delay(before, error)
            driving.at += min(max(shift, -SHIFT * period), SHIFT * period)
            driving.at = min(max(driving.at, before), driving.trajectory.duration)
        return steering.of(frame, twist)

    def _decide(self) -> None:
        """Stop where something is not as it should be, and decide what to do once it has been looked at."""
        unseen = self._now - float(self._sightings.unseen(self._began).min())
        if unseen > 10.0 * self.settings.patience:
            self._give_up(f"no measurement has come for {unseen:.1f} s")
        elif self.phase is Phase.LOOKING:
            self._look()
        elif self._driving.over:
            self.phase, self._since = Phase.LOOKING, self._now
        elif not self._driving.stopping:
            self._watch(unseen)

    def _watch(self, unseen: float) -> None:
        """Stop when an object has left its place, or nothing is seen any more."""
        kind, what = "unseen", f"no measurement has come for {unseen:.2f} s"
        if unseen <= self.settings.patience and self.phase is Phase.PUSHING:
            kind, what = "deviation", self._departure()
        if what and (kind == "deviation" or unseen > self.settings.patience):
            self._tell(kind, what)
            self._estimator.forget(self._now - 2.0 * HOLD, self._now)
            self._driving.stop()

    def _departure(self) -> str:
        """Return which object has left its place and by how much; empty if none has.

        Half of the measurements of a look tell of a slow departure, two of a quick one: the mean of what they are off
        what was expected from all that was learned before.
        """
        recent = [sample for sample in self._recent if sample.time >= self._since]
        if len(recent) < 2:
            return ""
        names, settings, noise = self.scenario.chain.objects, self.settings, self._estimator.noise
        slack, gaps = np.array([settings.position_slack, settings.angle_slack]), UNSURE * np.array(UNSETTLED)
        off = self._estimator.residuals(recent)
        for i, obj in enumerate(names):
            own = off[~np.isnan(off[:, i, 0]), i]
            for last, sigmas in ((self._recent.maxlen, SLOW), (2, QUICK)):
                if last is None or len(own) < last:
                    continue
                mean = own[-last:].mean(axis=0)
                apart = np.array([np.hypot(mean[0], mean[1]), abs(mean[2])])
                most = np.maximum(slack, sigmas / math.sqrt(last) * noise)
                if (apart > most).any():
                    spread = UNSURE * self._estimator.spread(recent[-1])[i]
                    most = most + (spread if self._settled else np.hypot(spread, gaps))
                if (apart > most).any():
                    return f"{obj.name} is {_words(*apart)} away from its pose in the plan"
        return ""

    def _look(self) -> None:
        """Once there are enough measurements at rest, decide."""
        estimator = self._estimator
        late = max(0.0, estimator.values[3] + 2.0 * math.sqrt(estimator.covariance[3, 3]))
        self._plate = estimator.plate(self._now)
        expected = compose(self._plate, self._places)
        measured = self._sightings.mean(expected, self.settings.looks, self._since + late)
        if measured is None:
            return
        chain = self._replanner.chain
        poses = estimator.unbiased(measured, chain.places, self._normals)
        self._places = places = relative(self._plate, poses)
        contacts = contacts_at(self.scenario.chain, places)
        off = _words(*self.goal_errors(poses))
        open_by = _words(max(float(contacts.opening.max()), 0.0), float(np.abs(contacts.rotation).max()))
        self._tell("re-localisation", f"the goal is {off} away; contacts are open by up to {open_by}")
        nearer = self._could_be_nearer(poses, contacts.slide)
        aim = self._replanner.aim
        flush = contacts.flush(*self._closed()) or self._persists(contacts, open_by)
        if aim.reached(poses, CLEARLY) or (aim.reached(poses, 1.0) and not nearer):
            self._end(Phase.ARRIVED, f"{off} off the goal")
        elif sum(replan.solved for replan in self.replans) >= self.settings.replans:
            self._give_up(f"{self.settings.replans} plans were made on the way, and it is not there")
        elif not flush:
            self._close(poses)
        elif not nearer:
            self._give_up(f"objects have slid against one another: they cannot all be nearer than {off}")
        else:
            self._replan(contacts, measured, off)

    def _closed(self) -> tuple[float, float]:
        """Return the gap (m) and turn (rad) up to which contacts count as closed, by all that is not known."""
        share = SIGMAS / math.sqrt(self.settings.looks)
        resting = Sample(self._now, np.zeros_like(self._places), self._replanner.chain.places)
        gap, turn = share * self._estimator.noise + 2.0 * self._estimator.spread(resting).max(axis=0)
        return max(self.settings.gap, float(gap)), max(self.settings.turn, float(turn))

    def _persists(self, contacts: Contacts, open_by: str) -> bool:
        """Tell whether contacts seem as open as before a push that closes them: that is the camera's error."""
        before, self._open = self._open, contacts
        if before is None or self._closings == 0:
            return False
        gap, turn = self._closed()
        same = np.abs(contacts.opening - before.opening) <= gap
        same &= np.abs(contacts.rotation - before.rotation) <= turn
        most = [SIGMAS * value for value in self.settings.bias]
        if not (same.all() and contacts.flush(*most)):
            return False
        self._tell("sensor", f"a push does not change that contacts seem open by {open_by}: cameras err so")
        return True

    def _could_be_nearer(self, poses: FloatArray, slides: FloatArray) -> bool:
        """Tell whether the objects, where they have slid to, could stand much nearer to the goal than they do."""
        aim = self._replanner.aim
        try:
            best = aim.best(slid(self.scenario.chain, slides))
        except ChainError:
            return True
        return bool(((aim.errors(poses) - best) / aim.tolerance).max() > 1.0 - CLEARLY)

    def _replan(self, contacts: Contacts, measured: FloatArray, off: str) -> None:
        """Go on with a new plan, from objects that are flush and have slid, unless it costs more than it gains."""
        self._closings, self._open = 0, None
        for attempt in range(ATTEMPTS):
            replan = self._replanner.replan(self._now, self._plate, self._path, contacts.slide, attempt)
            self.replans.append(replan)
            if replan.solved:
                break
        result = replan.result
        if result is not None and result.path is not None and result.trajectory is not None:
            if self._is_too_far(result.path.cost, off):
                return
            self._tell("replan", f"{result.path.cost:.3f} m in {result.trajectory.duration:.1f} s")
            self._path, self._places = result.path, self._replanner.chain.places
            self._take_for_closed(measured)
            self._drive_on(result)
        elif self._replanner.aim.reached(compose(self._plate, self._places), BARELY):
            self._end(Phase.ARRIVED, "within the tolerances, and there is no plan to come nearer")
        else:
            self._give_up(f"there is no plan from here: {replan.reason}")

    def _is_too_far(self, cost: float, off: str) -> bool:
        """End where a plan costs more than it gains, m, or too much was driven already."""
        aim = self._replanner.aim
        errors = np.array(self.goal_errors(compose(self._plate, self._places)))
        excess = float((errors / aim.tolerance).max()) - 1.0
        first = self.plan.path.cost if self.plan.path is not None else 0.0
        if excess < HARDLY and cost > WORTH:
            why = f"coming nearer takes {cost:.1f} m"
        elif self._way + cost > 2.0 * first + 1.0 and sum(replan.solved for replan in self.replans) > FREE:
            why = f"{self._way:.1f} m were driven, and it takes another {cost:.1f} m"
        else:
            return False
        if aim.reached(compose(self._plate, self._places)):
            self._end(Phase.ARRIVED, f"{off} off the goal; {why}")
        else:
            self._give_up(f"{off} remain to the goal; {why}")
        return True

    def _take_for_closed(self, measured: FloatArray) -> None:
        """Take the objects for being in contact at their new places; what they still seem off is the sensor's."""
        places = self._replanner.chain.places
        self._estimator.take_slides(places, self._normals)
        (rest,) = self._estimator.residuals([Sample(self._now, measured, places)])
        self._estimator.absorb(rest)

    def _drive_on(self, plan: Plan) -> None:
        """Follow a plan, with corrections that its contacts bear."""
        self._steering: Steering | None = Steering(plan)
        self._start(plan.segments[0].contact_trajectory, Phase.PUSHING)

    def _close(self, poses: FloatArray) -> None:
        """Push so that open contacts close."""
        planner = self._replanner.planner(0.0)
        push: ClosingPush | str = f"{CLOSINGS} pushes did not close the contacts"
        if self._closings < CLOSINGS:
            push = closing_push(self._closer, self._plate, poses, planner.twists, Spread.of(self.settings))
        if isinstance(push, str):
            self._give_up(push)
            return
        self._closings += 1
        self._tell("close", f"a push of {1e3 * push.length:.0f} mm closes the contacts")
        path = PushPath(self._plate, push.twist[None], np.array([push.length]))
        bounds = motion_bounds(planner.scenario.with_margin(planner.margin), planner.stable)
        self._steering = None
        self._start(time_path(path, bounds), Phase.CLOSING)

    def _start(self, trajectory: Trajectory, phase: Phase) -> None:
        self._driving = Drive(trajectory, self.scenario.chain.pusher.limits)
        self.phase, self._since = phase, self._now

    def _give_up(self, reason: str) -> None:
        self.reason = reason
        self._end(Phase.GAVE_UP, reason)

    def _end(self, phase: Phase, text: str) -> None:
        found = self._estimator.words()
        if found:
            self._tell("sensor", found)
        self.phase = phase
        self._tell(phase.value, text)

    def _tell(self, kind: str, text: str) -> None:
        self.events.append(Event(self._now, kind, text))


def _words(distance: float, angle: float) -> str:
    return f"{1e3 * distance:.1f} mm and {np.degrees(angle):.2f} deg"
