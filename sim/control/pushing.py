"""One push in closed loop: measured poses of its objects in, twists of the plate out.

The plate follows a path. If an object leaves its pose, the plate slows down along the path and stops. The objects
rest, too: averaging then reduces the noise of measurements, and their delay does not matter. The controller then
closes open contacts, replans, or gives up.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable

import numpy as np

from pushplan.geometry.se2 import compose, exp, inverse, relative
from pushplan.planners.timing.arc_limits import motion_bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.run import Replan
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.parts import Obstacle
from pushplan.sim.control.closing import ClosingPush, Closings, Contacts, Touch, contacts_at, shift_at_contact
from pushplan.sim.control.departures import Slide, find_slide, off_place
from pushplan.sim.control.estimator import HOLD, Estimator, Sample
from pushplan.sim.control.following import Following
from pushplan.sim.control.jobs import Phase, PushJob
from pushplan.sim.control.replanner import BARELY, BOLD, CLEARLY, OFTEN, Replanner
from pushplan.sim.control.sensing import MEMORY, Odometry, Sightings
from pushplan.sim.control.settings import SIGMAS, ControlSettings, words
from pushplan.sim.control.stall import LATE, WINDOWS, StallWatch
from pushplan.sim.follower import Steering
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

LITTLE, SETTLE = 0.5, 0.02
"""Travel (m) that is always allowed for an error beyond the tolerances, and that closes initially open contacts."""
TOLD = 2.0
"""Standard deviations from which a poorly known lateral offset of the plate is used."""
REFIT = 0.25
"""Time between two fits, s."""
LONGER, UNDECIDED = 2.0, 3.0
"""Extra time of a look (s) if an error is close to its tolerance, and this closeness in standard deviations. Noise
above the nominal one extends the time, up to the memory of measurements."""


class PushLoop:
    """Pushes a load to its goal in closed loop.

    Args:
        job: Push to execute.
        replanner: Replanner of its scenario.
        settings: Settings of the controller.
        sightings: Recent measurements of all objects.
        tell: Receiver of kind and text of events.
        record: Receiver of attempts to plan.
        now: Time, s.
        plate: Believed pose of the contact frame in the world, (3,).
        odometry: Pose and travel of the plate by odometry.
        known: Estimator of an earlier push; its values of clock and wheels are the prior.

    Attributes:
        load: Pushed load; twists refer to its contact frame.
        phase: State of the push.
        text: Outcome: the remaining error, or the reason for giving up.
        plate: Believed pose of the contact frame in the world, (3,).
        places: Believed poses of the objects in that frame, (n, 3).
        estimator: Estimator of the errors of sensors and wheels.
        slips: Slides by name as in `PushJob`, with those of this push.
        met_aside: Whether it gave up because the plate met the load with a lateral offset that needs a long detour.
        stalled: Whether it gave up because the load is too heavy.
        error: Last measured distance (m) and angle (rad) of the goal's object from the goal.
    """

    def __init__(
        self,
        job: PushJob,
        replanner: Replanner,
        settings: ControlSettings,
        sightings: Sightings,
        tell: Callable[[str, str], None],
        record: Callable[[Replan], None],
        now: float,
        plate: FloatArray,
        odometry: Odometry,
        known: Estimator | None = None,
    ) -> None:
        scenario, plan = job.scenario, job.plan
        assert plan.path is not None
        self.scenario, self.settings = scenario, settings
        self._job, self._replanner, self._sightings = job, replanner, sightings
        self._tell, self._record, self._replans = tell, record, 0
        segment = plan.segments[0]
        self.load, self.phase, self.text = segment.pushed_load, Phase.PUSHING, ""
        self._closings = Closings(World.from_scenario(scenario), settings)
        self._wheels = scenario.pusher.wheels_pose
        self._normals = np.array([contact.normal for contact in scenario.chain.contacts])
        self.estimator = Estimator(settings, self._normals, self._wheels, known, headings=job.headings)
        self._odometry, self._before = odometry, odometry.travel
        self._take_place(plate)
        self._now, self._began, self._fitted, self._blind = now, now, -math.inf, False
        self._recent: deque[Sample] = deque(maxlen=max(2, 3 * settings.looks // 4))
        self.places = scenario.chain.places
        self._slide: Slide | None = None
        self._since, self._settled = now, False
        self._path: PushPath = plan.path
        self.slips = Counter(job.slips)
        self._heed_slides()
        self._touch = Touch(scenario.chain, job.settle, job.straight, settings)
        self._ahead = plan.path.twists[0]
        self.met_aside, self.stalled, self.error = False, False, (math.inf, math.inf)
        self._stall = StallWatch([obj.name for obj in scenario.chain.objects], job.onto)
        if not self._touch.over:
            self._straight(self._ahead, self._touch.length)
        else:
            self._drive_on(plan)

    @property
    def over(self) -> bool:
        """Whether it has arrived or given up."""
        return self.phase in (Phase.ARRIVED, Phase.GAVE_UP)

    def _take_place(self, plate: FloatArray) -> None:
        """Set the pose (3,) of the contact frame."""
        self.plate = plate
        self._from_odometry = compose(plate, inverse(compose(self._odometry.pose, self.load.frame_plate)))

    @property
    def by_odometry(self) -> FloatArray:
        """Pose of the contact frame by odometry alone since the beginning of the push, (3,)."""
        return compose(compose(self._from_odometry, self._odometry.pose), self.load.frame_plate)

    @property
    def _way(self) -> float:
        """Travel of the plate so far, m."""
        return self._odometry.travel - self._before

    @property
    def _aside(self) -> tuple[float, float]:
        """Lateral offset of the load on the plate and its standard deviation, m."""
        if self._job.settle == 0.0:
            return 0.0, 0.0
        return self.estimator.aside(self._replanner.chain.places)

    @property
    def plate_after(self) -> FloatArray:
        """Pose of the contact frame after the push, (3,).

        If the push has hardly determined the lateral offset of the plate, the believed offset stays.
        """
        aside, deviation = self._aside
        if deviation <= self.settings.approach_error[0] or abs(aside) > TOLD * deviation:
            return self.plate
        return compose(self.plate, [0.0, aside, 0.0])

    @property
    def _share(self) -> float:
        """Error at the goal as a share of the tolerances."""
        return float(self._replanner.aim.share(compose(self.plate, self.places)))

    @property
    def _most(self) -> float:
        """Largest travel of a plan, m: at most the remaining travel and the worth of the reduced error."""
        return min(self._job.most - self._way, max(LITTLE, self.settings.worth * (self._share - 1.0)))

    @property
    def driving(self) -> bool:
        """Whether it follows a path and does not stop."""
        return self.phase is Phase.PUSHING and not self._following.drive.stopping

    @property
    def carrying(self) -> bool:
        """Whether it pushes the load with closed contacts."""
        return self._touch.over and self.phase is Phase.PUSHING

    def moved(self, now: float) -> None:
        """Update the pose of the plate with odometry."""
        self._now = now
        self.estimator.moved(now, self.by_odometry)
        if self._odometry.watched:
            self.plate = self.estimator.plate(now)

    def _sample(self, time: float, poses: FloatArray) -> Sample:
        return Sample(time, poses, self._replanner.chain.places, self._sightings.noise)

    def learn(self, time: float, poses: FloatArray) -> None:
        """Use a measurement (n, 3) of all objects; the fit uses it only while contacts are assumed to be closed."""
        sample = self._sample(time, poses[self._job.columns])
        self._recent.append(sample)
        self._stall.see(time, sample.poses, float(sample.noise[0]))
        if not self.driving:
            return
        self.estimator.add(sample)
        if not self._settled and self._way > SETTLE:
            self._settled = True
            self.estimator.forget(-math.inf, self._now)  # contacts were closing until now
        if self._now >= self._fitted + REFIT:
            self._fitted = self._now
            self.estimator.fit(self._now)
            self.plate = self.estimator.plate(self._now)
            if self._settled:
                self._slide = find_slide(self.estimator, self._replanner.chain, self._since)

    def notice(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Set the obstacles.

        The plate stops and replans if the rest of the path is blocked, or another path has become shorter by a tenth.
        """
        self._replanner.take_obstacles(obstacles)
        if not self.driving:
            return
        why = self._replanner.reason_to_replan(*self._following.ahead())
        if why:
            self._tell("room", why)
            self._following.drive.stop()

    def twist(self) -> FloatArray:
        """Return the commanded twist (3,): along the path, with the correction that the contacts allow."""
        if self.over or self._following.drive.over:
            return np.zeros(3)
        period = 1.0 / self.settings.rate
        led = compose(self.plate, [0.0, self._aside[0], 0.0])  # with the measured lateral offset of the load
        twist = self._following.twist(led)
        self.plate = compose(self.plate, exp(twist * period))
        self._stall.driven(self._now, twist * period, self.plate)
        return self.estimator.asked(twist, self._wheels)

    def decide(self) -> None:
        """Check for a stall, a departure or missing measurements; at rest, decide how to continue."""
        # During the approach and while contacts close, the plate, millimetres off its believed pose, might not touch
        # the load yet.
        meeting = not self._touch.over or (self.phase is Phase.CLOSING and not self._job.straight)
        heavy = () if meeting else self._stall.stalled(self.places)
        if heavy:
            self._end_stall(heavy)
            return
        unseen = self._now - float(self._sightings.unseen(self._began, self._job.columns).min())
        self._blind = self._sightings.is_blind(unseen, self._blind, self.settings.patience, self._tell)
        if unseen > self.settings.outage:
            self._give_up(f"no measurement has come for {unseen:.1f} s")
        elif self.phase is Phase.LOOKING:
            self._look()
        elif self._following.drive.over:
            if self.phase is Phase.CLOSING:
                self._stall.restart()  # a closing push can move only a part of the load
            self.phase, self._since = Phase.LOOKING, self._now
        elif not self._following.drive.stopping:
            self._watch(unseen)

    def _end_stall(self, heavy: tuple[str, ...]) -> None:
        """Give up because the plate cannot push its load."""
        limit, self.stalled = self.scenario.pusher.limits.force, True
        force = "" if math.isinf(limit) else f", and has {limit:.3g} N"
        stands = f"{heavy[0]} stands" if len(heavy) == 1 else f"{', '.join(heavy)} stand"
        self._tell("stall", f"{stands} still in the measurements although the plate moves")
        around, since = compose(self.plate, self.places), self._now - WINDOWS[0]
        seen = self._sightings.mean(around, 2, since, self._job.columns)
        if seen is not None:  # the plate stands at the face of the load
            ahead = float(shift_at_contact(self.scenario.chain, self.plate, seen)[0])
            self._take_place(compose(self.plate, [min(ahead, 0.0), 0.0, 0.0]))
        self._give_up(f"the plate stalls: it cannot push {', '.join(heavy)}{force}")

    def _watch(self, unseen: float) -> None:
        """Stop if an object has left its place, or no object is seen."""
        what, since, slide = "", self._now - 2.0 * HOLD, self._slide
        if unseen <= self.settings.patience and self.phase is Phase.PUSHING:
            recent = [sample for sample in self._recent if sample.time >= self._since]
            what = off_place(self.estimator, recent, self.load.names, self._settled)
            if not what and slide is not None:
                far, name = f"{1e3 * abs(slide.size):.1f} mm along its contact", self.load.names[slide.contact]
                what, since = f"{name} has slid by {far}", min(since, slide.since)
                self.slips[name] += 1
        if what or self._blind:
            self.estimator.forget(since, self._now)
            if what:
                self._tell("deviation", what)
                self.estimator.doubt(self._now)  # the slide has disturbed the estimates
            self._slide = None
            self._following.drive.stop()
            self._heed_slides()

    def _heed_slides(self) -> None:
        """Plan for the least friction once an object has slid often, if the plate can leave it."""
        often = [name for name in self.load.names if self.slips[name] >= OFTEN]
        if often and self._job.settle > 0.0 and not self._replanner.wary:
            self._replanner.wary = True
            self._tell("grip", f"{', '.join(often)} has slid {OFTEN} times: plans now assume the least friction")

    def _look(self) -> None:
        """Once there are enough measurements at rest, decide."""
        self.plate = self.estimator.plate(self._now)
        since = self._since + self.estimator.late
        around, looks = compose(self.plate, self.places), self.settings.looks
        measured = self._sightings.mean(around, looks, since, self._job.columns)
        if measured is None:
            return
        if not self._touch.over:
            self._come_up(measured)
            if not self._touch.over:
                return
            self._stall.restart()
        elif self._now < since + self._longer and self._is_undecided(measured):
            return
        poses = self._unbiased(measured)
        self.places = places = relative(self.plate, poses)
        contacts = contacts_at(self.scenario.chain, places)
        distance, angle = self._replanner.aim.errors(poses)
        self.error = float(distance), float(angle)
        off = words(*self.error)
        open_by = words(max(float(contacts.opening.max()), 0.0), float(np.abs(contacts.rotation).max()))
        self._tell("re-localisation", f"the goal is {off} away; contacts are open by up to {open_by}")
        aim = self._replanner.aim
        nearer = self._replanner.could_be_nearer(poses, contacts.slide)
        flush = bool(contacts.flush(*self._closed()))
        if not flush and self._persists(contacts, open_by):
            flush = True
            if self._job.settle > 0.0:
                self._come_up(measured, sure=True)
                self.places = relative(self.plate, measured)
                contacts = contacts_at(self.scenario.chain, self.places)
        if self._job.straight:
            self._end(Phase.ARRIVED, "closed")
        elif aim.share(poses) <= (CLEARLY if nearer else 1.0):
            self._end(Phase.ARRIVED, f"{off} off the goal")
        elif self._replans >= self.settings.replans:
            self._give_up(f"the goal is not reached after {self.settings.replans} replans")
        elif not flush:
            self._close(poses)
        elif not nearer:
            self._give_up(f"objects have slid relative to one another: they cannot all come nearer than {off}")
        else:
            self._replan(contacts, measured, off)

    @property
    def _longer(self) -> float:
        noise = max(float(self._sightings.noise[0]), 1e-6)
        return min(LONGER * max(1.0, noise / max(self.settings.position_noise, 1e-6)), MEMORY - LATE)

    def _unbiased(self, measured: FloatArray) -> FloatArray:
        if self._job.settle > 0.0:  # if a contact gives the pose of the plate, goals are in the frame of the camera
            return measured - np.outer(self.estimator.headings[0], [0.0, 0.0, 1.0])
        return self.estimator.unbiased(measured, self._replanner.chain.places)

    def _is_undecided(self, measured: FloatArray) -> bool:
        """Return whether the noise of a look (n, 3) is too large to compare the errors with the tolerances."""
        noise = self.estimator.noise([self._sample(self._now, measured)])[0] / math.sqrt(self.settings.looks)
        return self._replanner.aim.at_limit(self._unbiased(measured), UNDECIDED * noise)

    def _closed(self) -> tuple[float, float]:
        """Return the gap (m) and turn (rad) up to which contacts count as closed, given noise and uncertainty."""
        share = SIGMAS / math.sqrt(self.settings.looks)
        resting = self._sample(self._now, np.zeros_like(self.places))
        noise, unsure = self.estimator.noise([resting])[0], self.estimator.spread(resting).max(axis=0)
        gap, turn = share * noise + 2.0 * unsure
        return max(self.settings.gap, float(gap)), max(self.settings.turn, float(turn))

    def _persists(self, contacts: Contacts, open_by: str) -> bool:
        """Return whether contacts seem as open as before a closing push: a camera or plate error explains that."""
        most, cause = [SIGMAS * value for value in self.settings.bias], "a camera error explains them"
        if self._job.settle > 0.0:
            # A load that seems as open after the push is in contact; the pose of the plate is wrong.
            most, cause = [self._closings.longest, math.inf], "the plate is elsewhere"
        if not (self._closings.change_nothing(contacts, *self._closed()) and contacts.flush(*most)):
            return False
        self._tell("sensor", f"contacts still seem open by {open_by} after a closing push: {cause}")
        return True

    def _replan(self, contacts: Contacts, measured: FloatArray, off: str) -> None:
        """Replan with the slid objects, all flush, and follow the plan unless its travel exceeds its worth."""
        self._closings.restart()
        given = self._now, self.plate, self._path, contacts.slide
        # If the plate can leave the load, a later push can bring it to the goal if this one cannot.
        attempts = self._replanner.best(*given, self._most, BARELY if self._job.settle > 0.0 else math.inf)
        for replan in attempts:
            self._record(replan)
        self._replans += replan.solved
        result = replan.result
        if result is not None and result.path is not None and result.trajectory is not None:
            if self._is_too_far(result.segments[0].path.travel, off):
                return
            aim, places = self._replanner.aim, self._replanner.chain.places
            left = aim.errors(compose(result.path.end, places))
            where = f", which ends {words(*left)} off the goal" if (left > aim.tolerance).any() else ""
            if (margin := result.margin) is not None and margin < self._replanner.planner(BOLD).margin:
                where += f", with a margin of {margin:.2g}"
            self._tell("replan", f"{result.path.cost:.3f} m in {result.trajectory.duration:.1f} s{where}")
            self._path, self.places = result.path, places
            self._take_for_closed(measured)
            self._drive_on(result)
        elif self._share <= 1.0 or (self._replanner.aim.errors(measured) <= self._job.will_do).all():
            self._end(Phase.ARRIVED, f"{off} off the goal, and there is no plan to come nearer")
        else:
            self._give_up(f"{off} remain to the goal, and there is no plan from here: {attempts[0].reason}")

    def _is_too_far(self, travel: float, off: str) -> bool:
        """End if a plan exceeds the largest travel (m); return whether it does."""
        if travel <= self._most:
            return False
        why = f"the next plan takes {travel:.1f} m, and {max(self._most, 0.0):.1f} m are allowed"
        self.met_aside = self._job.again and self._touch.aside and self._replans == 1
        if self._share <= 1.0 and not self.met_aside:
            self._end(Phase.ARRIVED, f"{off} off the goal; {why}")
        else:
            self._give_up(f"{off} remain to the goal; {why}")
        return True

    def _take_for_closed(self, measured: FloatArray) -> None:
        """Assume contact at the new places of the objects; the remaining errors become sensor errors."""
        self._settled |= self._job.settle > 0.0
        resting = self._sample(self._now, measured)
        self.estimator.take_for_closed(resting, self._recent)

    def _come_up(self, measured: FloatArray, sure: bool = False) -> None:
        """Correct the pose of the plate by the measured poses of the load (n, 3); see `Touch.told`."""
        correction = self._touch.told(self.plate, measured, sure)
        if correction is None:
            return
        shift, text = correction
        self._tell("touch", text)
        self._take_place(compose(self.plate, shift))
        known, places = self.estimator, self.scenario.chain.places
        off = known.astray(*self._job.alone)
        self.estimator = Estimator(
            self.settings,
            self._normals,
            self._wheels,
            known,
            aside_deviation=off,
            places=places,
            headings=self._job.headings,
        )
        self.moved(self._now)
        if not self._touch.over:
            self._straight(self._ahead, self._touch.length)

    def _drive_on(self, plan: Plan) -> None:
        """Follow a plan, with corrections that its contacts allow."""
        self._start(plan.segments[0].contact_trajectory, Phase.PUSHING, Steering(plan))

    def _close(self, poses: FloatArray) -> None:
        """Start a push that closes open contacts, or give up."""
        twists = self._replanner.planner(BOLD).twists
        push = self._closings.next(self.plate, poses, twists, self._sightings.noise)
        if isinstance(push, ClosingPush) and push.length > self._job.most - self._way:
            push = f"contacts are open, and the allowed travel of {self._job.most:.1f} m is used up"
        if isinstance(push, str):
            self._give_up(push)
            return
        self._tell("close", f"a push of {1e3 * push.length:.0f} mm closes the contacts")
        self._straight(push.twist, push.length)

    def _straight(self, twist: FloatArray, length: float) -> None:
        """Start a closing push along one twist (3,) with a length (m of path cost)."""
        planner = self._replanner.planner(BOLD)
        path = PushPath(self.plate, twist[None], np.array([length]))
        bounds = motion_bounds(planner.scenario.with_margin(planner.margin), planner.stable)
        self._start(time_path(path, bounds), Phase.CLOSING, None)

    def _start(self, trajectory: Trajectory, phase: Phase, steering: Steering | None) -> None:
        limits, rate = self.scenario.chain.pusher.limits, self.settings.rate
        self._following = Following(trajectory, limits, rate, self.load.frame_plate, steering)
        self.phase, self._since = phase, self._now
        self._stall.restart()

    def _give_up(self, reason: str) -> None:
        self._end(Phase.GAVE_UP, reason)

    def _end(self, phase: Phase, text: str) -> None:
        self.phase, self.text = phase, text
