"""One push in closed loop: measured poses of its objects in, twists of the plate out.

The plate follows a path. When measurements say that an object is away from its pose, it slows down along the path and
stands still: objects on the floor then stand still, too, and every measurement from then on tells the same, so that
noise averages out and delay does not matter. From what was seen the controller closes contacts that are open, plans
again, or gives up.
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
from pushplan.sim.control.closing import (
    LONGEST,
    ClosingPush,
    Closings,
    Contacts,
    Touch,
    contacts_at,
    shift_at_contact,
)
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
"""Travel (m) that any error beyond the tolerances is worth, and after which contacts are closed that were open."""
TOLD = 2.0
"""Standard deviations by which the plate has to stand aside to be taken for that where a push tells it badly."""
REFIT = 0.25
"""Time between two fits, s."""
LONGER, UNDECIDED = 2.0, 3.0
"""Time (s) for which it is looked where an error is at its tolerance, to so many standard deviations of a look. More
noise than stated takes longer, as long as measurements are kept."""


class PushLoop:
    """Pushes a load to its goal and watches it.

    Args:
        job: What to do.
        replanner: Of its scenario.
        settings: See there.
        sightings: What was measured of all objects.
        tell: Takes kind and text of events.
        record: Takes attempts to plan.
        now: Time, s.
        plate: (3,) pose of the contact's frame in the world, as believed.
        odometry: Where the plate is by that, and how far it has travelled.
        known: Of a push before: what it found of clocks and wheels holds on.

    Attributes:
        load: What is pushed: twists are of its contact's frame.
        phase: What it is doing.
        text: How it ended: what is left, or why it gave up.
        plate: (3,) pose of the contact's frame in the world, as believed.
        places: (n, 3) poses of the objects in that frame, as believed.
        estimator: What sensors and wheels err by.
        slips: See `PushJob`, those of this push included.
        met_aside: It is over because the load was met where it takes a long way round from.
        stalled: It is over because the load is too heavy.
        error: How far (m) and by what angle (rad) the goal's object was measured off it last.
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
        """Whether it arrived or gave up."""
        return self.phase in (Phase.ARRIVED, Phase.GAVE_UP)

    def _take_place(self, plate: FloatArray) -> None:
        """Go on from a pose (3,) of the contact's frame."""
        self.plate = plate
        self._from_odometry = compose(plate, inverse(compose(self._odometry.pose, self.load.frame_plate)))

    @property
    def by_odometry(self) -> FloatArray:
        """(3,) pose of the contact's frame from where the push began, by odometry alone."""
        return compose(compose(self._from_odometry, self._odometry.pose), self.load.frame_plate)

    @property
    def _way(self) -> float:
        """Travel of the plate so far, m."""
        return self._odometry.travel - self._before

    @property
    def _aside(self) -> tuple[float, float]:
        """How far the load is along the plate from where it is taken to be, and the standard deviation of that, m."""
        if self._job.settle == 0.0:
            return 0.0, 0.0
        return self.estimator.aside(self._replanner.chain.places)

    @property
    def plate_after(self) -> FloatArray:
        """(3,) pose of the contact's frame that the plate drives on from.

        What a push has hardly told of where the plate stands along the load leaves it where it was believed to be.
        """
        aside, deviation = self._aside
        if deviation <= self.settings.approach_error[0] or abs(aside) > TOLD * deviation:
            return self.plate
        return compose(self.plate, [0.0, aside, 0.0])

    @property
    def _share(self) -> float:
        """Share of the tolerances that the error at the goal is."""
        return float(self._replanner.aim.share(compose(self.plate, self.places)))

    @property
    def _most(self) -> float:
        """Travel that a plan may take, m: what is left, and no more than coming nearer to the goal is worth."""
        return min(self._job.most - self._way, max(LITTLE, self.settings.worth * (self._share - 1.0)))

    @property
    def driving(self) -> bool:
        """Whether it follows a path, and nothing has made it stop."""
        return self.phase is Phase.PUSHING and not self._following.drive.stopping

    @property
    def carrying(self) -> bool:
        """Whether it pushes a load that was met, its contacts closed."""
        return self._touch.over and self.phase is Phase.PUSHING

    def moved(self, now: float) -> None:
        """Take down where the plate is by odometry."""
        self._now = now
        self.estimator.moved(now, self.by_odometry)
        if self._odometry.watched:
            self.plate = self.estimator.plate(now)

    def _sample(self, time: float, poses: FloatArray) -> Sample:
        return Sample(time, poses, self._replanner.chain.places, self._sightings.noise)

    def learn(self, time: float, poses: FloatArray) -> None:
        """Take a measurement (n, 3) of all objects into account while contacts are taken for closed."""
        sample = self._sample(time, poses[self._job.columns])
        self._recent.append(sample)
        self._stall.see(time, sample.poses, float(sample.noise[0]))
        if not self.driving:
            return
        self.estimator.add(sample)
        if not self._settled and self._way > SETTLE:
            self._settled = True
            self.estimator.forget(-math.inf, self._now)  # gaps were closing
        if self._now >= self._fitted + REFIT:
            self._fitted = self._now
            self.estimator.fit(self._now)
            self.plate = self.estimator.plate(self._now)
            if self._settled:
                self._slide = find_slide(self.estimator, self._replanner.chain, self._since)

    def notice(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Take over what stands in the way now.

        Where the rest of the path is not free any more, or another one has become shorter by a tenth, the plate stops
        and plans again.
        """
        self._replanner.take_obstacles(obstacles)
        if not self.driving:
            return
        why = self._replanner.reason_to_replan(*self._following.ahead())
        if why:
            self._tell("room", why)
            self._following.drive.stop()

    def twist(self) -> FloatArray:
        """Return the twist (3,) to tell the plate: what leads it along the path, and back to it as contacts bear."""
        if self.over or self._following.drive.over:
            return np.zeros(3)
        period = 1.0 / self.settings.rate
        led = compose(self.plate, [0.0, self._aside[0], 0.0])  # where the load stands along the plate is only seen
        twist = self._following.twist(led)
        self.plate = compose(self.plate, exp(twist * period))
        self._stall.driven(self._now, twist * period, self.plate)
        return self.estimator.asked(twist, self._wheels)

    def decide(self) -> None:
        """Stop where something is not as it should be, and decide what to do once it has been looked at."""
        # While it comes up to the load or closes contacts, the plate, millimetres off where it believes to be, may
        # not have met it.
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
                self._stall.restart()  # only a part of the load may have had to move
            self.phase, self._since = Phase.LOOKING, self._now
        elif not self._following.drive.stopping:
            self._watch(unseen)

    def _end_stall(self, heavy: tuple[str, ...]) -> None:
        """Give up as the plate cannot push what it is driven against."""
        limit, self.stalled = self.scenario.pusher.limits.force, True
        force = "" if math.isinf(limit) else f", and has {limit:.3g} N"
        stands = f"{heavy[0]} stands" if len(heavy) == 1 else f"{', '.join(heavy)} stand"
        self._tell("stall", f"{stands} still in the measurements though the plate is driven on")
        around, since = compose(self.plate, self.places), self._now - WINDOWS[0]
        seen = self._sightings.mean(around, 2, since, self._job.columns)
        if seen is not None:  # the plate stands, too, where it touches the load
            ahead = float(shift_at_contact(self.scenario.chain, self.plate, seen)[0])
            self._take_place(compose(self.plate, [min(ahead, 0.0), 0.0, 0.0]))
        self._give_up(f"the plate stalls: it cannot push {', '.join(heavy)}{force}")

    def _watch(self, unseen: float) -> None:
        """Stop when an object has left its place, or nothing is seen any more."""
        what, since, slide = "", self._now - 2.0 * HOLD, self._slide
        if unseen <= self.settings.patience and self.phase is Phase.PUSHING:
            recent = [sample for sample in self._recent if sample.time >= self._since]
            what = off_place(self.estimator, recent, self.load.names, self._settled)
            if not what and slide is not None:
                far, name = f"{1e3 * abs(slide.size):.1f} mm along what pushes it", self.load.names[slide.contact]
                what, since = f"{name} has slid by {far}", min(since, slide.since)
                self.slips[name] += 1
        if what or self._blind:
            self.estimator.forget(since, self._now)
            if what:
                self._tell("deviation", what)
                self.estimator.doubt(self._now)  # what it took for constants is none
            self._slide = None
            self._following.drive.stop()
            self._heed_slides()

    def _heed_slides(self) -> None:
        """Plan for the least friction once an object has slid often, if the plate may let go of it."""
        often = [name for name in self.load.names if self.slips[name] >= OFTEN]
        if often and self._job.settle > 0.0 and not self._replanner.wary:
            self._replanner.wary = True
            self._tell("grip", f"{', '.join(often)} has slid {OFTEN} times: it is pushed as with the least friction")

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
            self._give_up(f"{self.settings.replans} plans were made on the way, and it is not there")
        elif not flush:
            self._close(poses)
        elif not nearer:
            self._give_up(f"objects have slid against one another: they cannot all be nearer than {off}")
        else:
            self._replan(contacts, measured, off)

    @property
    def _longer(self) -> float:
        noise = max(float(self._sightings.noise[0]), 1e-6)
        return min(LONGER * max(1.0, noise / max(self.settings.position_noise, 1e-6)), MEMORY - LATE)

    def _unbiased(self, measured: FloatArray) -> FloatArray:
        if self._job.settle > 0.0:  # where a contact tells where the plate is, goals are where the camera sees them
            return measured - np.outer(self.estimator.headings[0], [0.0, 0.0, 1.0])
        return self.estimator.unbiased(measured, self._replanner.chain.places)

    def _is_undecided(self, measured: FloatArray) -> bool:
        """Tell whether the noise of a look (n, 3) leaves open on which side of the tolerances the errors are."""
        noise = self.estimator.noise([self._sample(self._now, measured)])[0] / math.sqrt(self.settings.looks)
        return self._replanner.aim.at_limit(self._unbiased(measured), UNDECIDED * noise)

    def _closed(self) -> tuple[float, float]:
        """Return the gap (m) and turn (rad) up to which contacts count as closed, by all that is not known."""
        share = SIGMAS / math.sqrt(self.settings.looks)
        resting = self._sample(self._now, np.zeros_like(self.places))
        noise, unsure = self.estimator.noise([resting])[0], self.estimator.spread(resting).max(axis=0)
        gap, turn = share * noise + 2.0 * unsure
        return max(self.settings.gap, float(gap)), max(self.settings.turn, float(turn))

    def _persists(self, contacts: Contacts, open_by: str) -> bool:
        """Tell whether contacts seem as open as before a push that closes them: that is the camera's error."""
        most, cause = [SIGMAS * value for value in self.settings.bias], "cameras err so"
        if self._job.settle > 0.0:
            # Pushed on and as open as before it is in contact, however far off the plate has driven up to it.
            most, cause = [LONGEST, math.inf], "the plate is elsewhere"
        if not (self._closings.change_nothing(contacts, *self._closed()) and contacts.flush(*most)):
            return False
        self._tell("sensor", f"a push does not change that contacts seem open by {open_by}: {cause}")
        return True

    def _replan(self, contacts: Contacts, measured: FloatArray, off: str) -> None:
        """Go on with a new plan, from objects that are flush and have slid, unless it costs more than it gains."""
        self._closings.restart()
        given = self._now, self.plate, self._path, contacts.slide
        # Where the plate lets go, another push may bring the load to the goal if this one cannot.
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
        """End where a plan takes more travel (m) than it may."""
        if travel <= self._most:
            return False
        why = f"coming nearer takes {travel:.1f} m, and may take {max(self._most, 0.0):.1f} m"
        self.met_aside = self._job.again and self._touch.aside and self._replans == 1
        if self._share <= 1.0 and not self.met_aside:
            self._end(Phase.ARRIVED, f"{off} off the goal; {why}")
        else:
            self._give_up(f"{off} remain to the goal; {why}")
        return True

    def _take_for_closed(self, measured: FloatArray) -> None:
        """Take the objects for being in contact at their new places; what they still seem off is the sensor's."""
        self._settled |= self._job.settle > 0.0
        resting = self._sample(self._now, measured)
        self.estimator.take_for_closed(resting, self._recent)

    def _come_up(self, measured: FloatArray, sure: bool = False) -> None:
        """Go on from where the load, measured like all (n, 3), tells that the plate is; see `Touch.told`."""
        told = self._touch.told(self.plate, measured, sure)
        if told is None:
            return
        shift, text = told
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
        """Follow a plan, with corrections that its contacts bear."""
        self._start(plan.segments[0].contact_trajectory, Phase.PUSHING, Steering(plan))

    def _close(self, poses: FloatArray) -> None:
        """Push so that open contacts close."""
        twists = self._replanner.planner(BOLD).twists
        push = self._closings.next(self.plate, poses, twists, self._sightings.noise)
        if isinstance(push, ClosingPush) and push.length > self._job.most - self._way:
            push = f"contacts are open, and {self._job.most:.1f} m, all that the push may take, were driven"
        if isinstance(push, str):
            self._give_up(push)
            return
        self._tell("close", f"a push of {1e3 * push.length:.0f} mm closes the contacts")
        self._straight(push.twist, push.length)

    def _straight(self, twist: FloatArray, length: float) -> None:
        """Push along one twist (3,) by a length (m of path cost), to close contacts."""
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
