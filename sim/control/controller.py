"""The closed loop: measured poses of the objects in, twists of the plate out.

The plate follows a plan. When measurements say that an object is off its place, it slows down along the path and
stands still: objects on the floor then stand still, too, and every measurement from then on tells the same, so that
noise averages out and delay does not matter. From what was seen the controller closes contacts that are open, plans
again, or gives up.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import ChainError, PlanningError
from pushplan.geometry.se2 import compose, log, relative
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.perturb import slid
from pushplan.planners.timing.arc_limits import motion_bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.events import Event, Replan
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.plan import Load, Plan
from pushplan.plans.settings import Observer
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Obstacle, Scenario
from pushplan.sim.control.closing import ClosingPush, Contacts, Spread, closing_push, contacts_at, off_places
from pushplan.sim.control.replanner import Replanner
from pushplan.sim.control.sensing import Sightings
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.follower import Drive
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
CLEARLY, BARELY = 0.8, 0.95
"""Shares of the tolerances within which nothing need be better, and within which it has arrived for all the noise."""
SLOW, QUICK = 4.0, 5.0
"""Standard deviations of the mean of many measurements, and of two, by which an object has to be off."""


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
        self._intake, self._bad_clock = Intake(lambda words: self._tell("dropped", words)), 0
        self._sightings = Sightings()
        self._plate, self._now, self._began = np.array(scenario.start), 0.0, math.inf
        self._places = scenario.chain.places
        self._since, self._closings = 0.0, 0
        self._path: PushPath = plan.path
        self._start(plan.segments[0].contact_trajectory, Phase.PUSHING)
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
            found = intake.pose(plate_pose, "pose of the plate")
            self._plate = self._plate if found is None else found
        sightings.plate_at(self._now, self._plate)
        if object_poses is not None:
            names = [obj.name for obj in self.scenario.chain.objects]
            poses = intake.poses(object_poses, names, "poses of the objects")
            stamp = intake.stamp(measured_at, sightings.latest(), sightings.oldest)
            if stamp is not None and not np.isnan(poses).all():
                sightings.see(stamp, poses)
        if not self.over:
            self._decide()
        return self._twist()

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
        if self.over or self._driving.over:
            return np.zeros(3)
        after = self._driving.advance(1.0 / self.settings.rate)
        twist = log(relative(self._plate, after)) * self.settings.rate
        self._plate = after
        return np.asarray(twist)

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
            chain = self._replanner.chain
            kind, what = "left", departure(self._sightings, chain, self._places, self._since, self.settings)
        if what and (kind == "left" or unseen > self.settings.patience):
            self._tell(kind, what)
            self._driving.stop()

    def _look(self) -> None:
        """Once there are enough measurements at rest, decide."""
        places = self._sightings.places(self._places, self.settings.looks, self._since)
        if places is None:
            return
        self._places = places
        contacts, poses = contacts_at(self.scenario.chain, places), compose(self._plate, places)
        off = _words(*self.goal_errors(poses))
        open_by = _words(max(float(contacts.opening.max()), 0.0), float(np.abs(contacts.rotation).max()))
        self._tell("look", f"the goal is {off} away; contacts are open by up to {open_by}")
        nearer = self._could_be_nearer(poses, contacts.slide)
        aim = self._replanner.aim
        if aim.reached(poses, CLEARLY) or (aim.reached(poses, BARELY) and not nearer):
            self._end(Phase.ARRIVED, f"{off} off the goal")
        elif sum(replan.solved for replan in self.replans) >= self.settings.replans:
            self._give_up(f"{self.settings.replans} plans were made on the way, and it is not there")
        elif not contacts.flush(self.settings.gap, self.settings.turn):
            self._close(poses)
        elif not nearer:
            self._give_up(f"objects have slid against one another: they cannot all be nearer than {off}")
        else:
            self._replan(contacts)

    def _could_be_nearer(self, poses: FloatArray, slides: FloatArray) -> bool:
        """Tell whether the objects, where they have slid to, could stand much nearer to the goal than they do."""
        aim = self._replanner.aim
        try:
            best = aim.best(slid(self.scenario.chain, slides))
        except ChainError:
            return True
        return bool(((aim.errors(poses) - best) / aim.tolerance).max() > 1.0 - CLEARLY)

    def _replan(self, contacts: Contacts) -> None:
        """Go on with a new plan, from objects that are flush and have slid."""
        self._closings = 0
        for attempt in range(ATTEMPTS):
            replan = self._replanner.replan(self._now, self._plate, self._path, contacts.slide, attempt)
            self.replans.append(replan)
            if replan.solved:
                break
        result = replan.result
        if result is not None and result.path is not None and result.trajectory is not None:
            self._tell("replan", f"{result.path.cost:.3f} m in {result.trajectory.duration:.1f} s")
            self._path, self._places = result.path, self._replanner.chain.places
            self._start(result.segments[0].contact_trajectory, Phase.PUSHING)
        elif self._replanner.aim.reached(compose(self._plate, self._places), BARELY):
            self._end(Phase.ARRIVED, "within the tolerances, and there is no plan to come nearer")
        else:
            self._give_up(f"there is no plan from here: {replan.reason}")

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
        self._start(time_path(path, bounds), Phase.CLOSING)

    def _start(self, trajectory: Trajectory, phase: Phase) -> None:
        self._driving = Drive(trajectory, self.scenario.chain.pusher.limits)
        self.phase, self._since = phase, self._now

    def _give_up(self, reason: str) -> None:
        self.reason = reason
        self._end(Phase.GAVE_UP, reason)

    def _end(self, phase: Phase, text: str) -> None:
        self.phase = phase
        self._tell(phase.value, text)

    def _tell(self, kind: str, text: str) -> None:
        self.events.append(Event(self._now, kind, text))


def _words(distance: float, angle: float) -> str:
    return f"{1e3 * distance:.1f} mm and {np.degrees(angle):.2f} deg"


def departure(
    sightings: Sightings, chain: Chain, around: FloatArray, since: float, settings: ControlSettings
) -> str:
    """Return which object has left its place and by how much; empty if none has.

    Half of the measurements of a look tell of a slow departure, two of a quick one.

    Args:
        sightings: What was measured.
        chain: With the objects where they are to be.
        around: (n, 3) places about which angles are taken.
        since: Measurements from this time on count, s.
        settings: See there.
    """
    for last, sigmas in ((max(2, settings.looks // 2), SLOW), (2, QUICK)):
        places = sightings.places(around, last, since)
        if places is None:
            continue
        share = sigmas / math.sqrt(last)
        distance, angle = off_places(chain, places)
        excess = np.maximum(
            distance / max(settings.position_slack, share * settings.position_noise),
            angle / max(settings.angle_slack, share * settings.angle_noise),
        )
        i = int(np.argmax(excess))
        if excess[i] > 1.0:
            off = f"{1e3 * distance[i]:.1f} mm and {math.degrees(angle[i]):.1f} deg"
            return f"{chain.objects[i].name} is {off} off its place in the plan"
    return ""
