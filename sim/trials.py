"""Monte Carlo trials: a plan executed in sampled worlds, and in what share of them it arrives."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Integral
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pushplan.errors import ExtensionError, PushplanError
from pushplan.geometry.se2 import compose, rotate, transform_points
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.mechanics.dynamics import ContactDynamics
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.support import FeetSupport
from pushplan.plans.execution import TrialEnd, wilson
from pushplan.plans.goals import goal_columns, goal_units
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.scenario.model import Scenario
from pushplan.sim.report import ContactLoss, ContactReport, with_margins
from pushplan.sim.slip import slip
from pushplan.slip.world import World
from pushplan.util.arrays import BoolArray, FloatArray
from pushplan.util.naming import code_of_others, name_of

INERTIA = "inertia"
"""What a contact does, in a trial without inertia, that holds there and would not with it."""


def sampled_world(scenario: Scenario, uncertainty: TrialUncertainty | None, rng: np.random.Generator) -> World:
    """Draw a world.

    Args:
        scenario: What the plan believes.
        uncertainty: By how much that may be off. None takes the intervals of the scenario where it states any, and
            the defaults of `TrialUncertainty` for the rest.
        rng: Where the random numbers come from.

    Raises:
        SupportError: When the load under an object is not known.
    """
    world = World.from_scenario(scenario)
    off = uncertainty or TrialUncertainty()
    drawn = []
    for one, load in zip(world.stacks, scenario.loads, strict=True):
        interval, frictions = load.interval, load.contact_friction
        if uncertainty is None and interval is not None:
            one = _within_intervals(one, interval, frictions, rng)
        else:
            one = _within_shares(one if frictions is None else _with_frictions(one, frictions.mean(axis=1)), off, rng)
        drawn.append(replace(one, offsets=_offsets(one.chain, off, rng, world.plate is None)))
    return replace(drawn[0], beside=tuple(drawn[1:]))


def _within_shares(world: World, off: TrialUncertainty, rng: np.random.Generator) -> World:
    for obj in world.chain.objects:
        world = world.with_contact_friction(_factor(off.contact_friction, rng), obj.name)
        world = world.with_floor_friction(_factor(off.floor_friction, rng), obj.name)
        world = world.with_mass(_factor(off.mass, rng), obj.name)
        world = _leaning(world, obj.name, off.load, rng)
    return world


def _within_intervals(
    world: World, interval: IntervalChain, frictions: FloatArray | None, rng: np.random.Generator
) -> World:
    """Draw what is stated as intervals from them; everything else stays."""
    if frictions is not None:
        world = _with_frictions(world, _between(frictions, rng))
    chain, objects = interval.chain, []
    masses, rubs = _between(interval.mass, rng), _between(interval.floor_friction, rng)
    for i, obj in enumerate(chain.objects):
        support = obj.support
        if i in interval.fractions and isinstance(support, FeetSupport):
            fractions = _between(interval.fractions[i], rng)
            support = FeetSupport(support.positions, fractions / fractions.sum())
        objects.append(replace(obj, mass=float(masses[i]), floor_friction=float(rubs[i]), support=support))
    world = replace(world, chain=replace(chain, objects=tuple(objects), contacts=world.chain.contacts))
    for i, share in interval.pressures.items():
        world = _leaning(world, chain.objects[i].name, share, rng)
    return world


def _with_frictions(world: World, frictions: FloatArray) -> World:
    """Return a world with a coefficient for each contact (n,)."""
    pairs = zip(world.chain.contacts, frictions, strict=True)
    contacts = tuple(replace(contact, friction=float(mu)) for contact, mu in pairs)
    return replace(world, chain=replace(world.chain, contacts=contacts))


def _between(spans: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw a number from each of the intervals (k, 2)."""
    return np.asarray(rng.uniform(spans[:, 0], spans[:, 1]))


def _factor(share: float, rng: np.random.Generator) -> float:
    return float(1.0 + share * rng.uniform(-1.0, 1.0))


def _leaning(world: World, name: str, share: float, rng: np.random.Generator) -> World:
    angle, part = rng.uniform(-np.pi, np.pi), share * rng.uniform()
    if part == 0.0:
        return world
    direction, obj = np.array([np.cos(angle), np.sin(angle)]), world.chain.objects[world.chain.index_of(name)]
    most = obj.support.most_lean(rotate(-float(obj.pose_chain[2]), direction))
    # A pressure that leans already is 0 at its lightest corner for less than the share.
    return world.with_load_shifted(direction, min(part, most * (1.0 - 1e-9)), name)


def _offsets(chain: Chain, off: TrialUncertainty, rng: np.random.Generator, touched: bool) -> FloatArray:
    """Draw how the objects stand off their places (n, 3): each aside and turned on the one that pushes it.

    Where the plate does not touch them yet, objects that it may push are off to any side.
    """
    motions = {PLATE: np.zeros(3)}
    offsets = np.zeros((len(chain.objects), 3))
    for i, contact in enumerate(chain.contacts):
        aside, turn = off.position * rng.uniform(-1.0, 1.0), off.angle * rng.uniform(-1.0, 1.0)
        motion = _local_motion(contact, aside, turn)
        if contact.pusher == PLATE and not touched:
            middle, ahead = chain.objects[i].pose_chain[:2], off.position * rng.uniform(-1.0, 1.0)
            shift = aside * contact.tangent + ahead * contact.normal
            motion = np.append(middle + shift - rotate(turn, middle), turn)
        motions[i] = compose(motions[contact.pusher], motion)
        place = chain.objects[i].pose_chain
        offsets[i] = compose(motions[i], place) - place
    return offsets


def _local_motion(contact: Contact, aside: float, turn: float) -> FloatArray:
    """Return the motion (3,) that shifts along a contact and turns about the end that keeps touching."""
    pivot = contact.left if turn > 0.0 else contact.right
    shift = pivot + aside * contact.tangent - rotate(turn, pivot)
    return np.append(shift, turn)


class InertiaLoss(NamedTuple):
    """The first moment at which a contact does not hold with inertia.

    Attributes:
        object: Name of what the contact pushes.
        contact: What it is called.
        time: s.
        point: Middle of its segment in the world, m.
    """

    object: str
    contact: str
    time: float
    point: tuple[float, float]


def inertia_loss(plan: Plan, world: World) -> InertiaLoss | None:
    """Return where a margin with inertia is not positive on a plan that is executed as timed; None if nowhere.

    Counted are frictions, masses and loads of the world; objects are where the plan has them.
    """
    begin = 0.0
    for segment in plan.segments:
        if segment.pushes and segment.load is not None:
            own, chain = segment.contact_trajectory, world.pushed(segment.load.chain)
            fresh = own.changes_at(own.t)
            margins = ContactDynamics(chain).margins(own.directions[fresh], own.rates_at(own.t[fresh]))
            lost = np.flatnonzero((margins <= 0.0).any(axis=1))
            if len(lost):
                k, at = int(margins[lost[0]].argmin()), own.t[fresh][lost[0]]
                middle = 0.5 * (chain.contacts[k].left + chain.contacts[k].right)
                x, y = transform_points(own.poses_at([at])[0], middle).tolist()
                name = chain.objects[k].name
                return InertiaLoss(name, segment.load.contact_name(name), begin + float(at), (x, y))
        begin += segment.duration
    return None


Simulator = Callable[[Plan, World], ContactReport]
"""Executes a plan in a world where contacts may slip."""


@dataclass(frozen=True, eq=False)
class Trials:
    """A plan in k sampled worlds.

    Attributes:
        plan: What the plate is made to do, and what is believed.
        uncertainty: What the worlds were drawn from; None for the scenario's own intervals.
        seed: Of the random numbers; sample i depends on it and on i only.
        simulator: What executed it.
        ends: How each sample ended.
        log: The log that was written meanwhile; None where there is none, or it could not be written.
    """

    plan: Plan
    uncertainty: TrialUncertainty | None
    seed: int
    simulator: Simulator
    ends: tuple[TrialEnd, ...]
    log: Path | None = None

    @property
    def scenario(self) -> Scenario:
        """What the plan believes."""
        return self.plan.scenario

    @property
    def samples(self) -> int:
        """Number of worlds."""
        return len(self.ends)

    @cached_property
    def errors(self) -> FloatArray:
        """(k, n, 2) how far (m) and by what angle (rad) every object ends away from its pose at the goal."""
        return np.array([end.errors for end in self.ends])

    @cached_property
    def object_poses(self) -> FloatArray:
        """(k, n, 3) where they end, in the world."""
        return np.array([end.objects for end in self.ends])

    @cached_property
    def arrived(self) -> BoolArray:
        """(k,) whether the goal's object, or every object, ends within the goal's tolerances."""
        return np.array([end.arrived for end in self.ends])

    @cached_property
    def jammed(self) -> BoolArray:
        """(k,) whether nothing could give way, or the robot had not the force, so that the push ended early."""
        return np.array([end.jammed for end in self.ends])

    @property
    def missed(self) -> dict[str, int]:
        """In how many worlds a goal's tolerance of `position` and of `angle` was exceeded; 0 is left out."""
        beyond = np.array([(goal_units(self.scenario, errors) > 1.0).any(axis=0) for errors in self.errors])
        counts = zip(("position", "angle"), beyond.sum(axis=0).tolist(), strict=True)
        return {name: count for name, count in counts if count}

    @property
    def success(self) -> float:
        """Share of the worlds in which it arrives."""
        return float(self.arrived.mean())

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the rate of success."""
        return wilson(int(self.arrived.sum()), self.samples)

    @property
    def with_inertia(self) -> bool:
        """Whether contacts that hold do so with inertia: not if the scenario leaves it out.

        A simulator of the user's own, or the physics engine, is taken at its word.
        """
        return self.simulator is not slip or _counts_inertia(self.scenario)

    @property
    def held(self) -> float:
        """Share of the worlds in which every contact holds to the end, see `with_inertia`."""
        return float(np.mean(~self.lost & ~self.jammed))

    @property
    def lost(self) -> BoolArray:
        """(k,) whether a contact moved or opened, or would with inertia."""
        return np.array([bool(end.contact) for end in self.ends])

    @property
    def first_failures(self) -> dict[str, int]:
        """How often each contact, by name, was the first to move; those that never were are left out."""
        return dict(Counter(end.contact for end in self.ends if end.contact).most_common())

    @property
    def goal_errors(self) -> FloatArray:
        """(k, 2) of the goal's object, or the largest of all objects that have a goal: m, rad."""
        return np.asarray(self.errors[:, goal_columns(self.scenario)].max(axis=1))

    @property
    def worst(self) -> int:
        """Number of the sample that ends farthest from the goal, in units of its tolerances; jams come first."""
        units = np.array([goal_units(self.scenario, errors).max() for errors in self.errors])
        return int(np.argmax(units + 1e9 * self.jammed))

    def world(self, i: int) -> World:
        """Return the world of sample i."""
        return sampled_world(self.scenario, self.uncertainty, np.random.default_rng([self.seed, i]))

    def report(self, i: int) -> ContactReport:
        """Return the course of sample i, simulated anew."""
        return with_margins(self.simulator(self.plan, self.world(i)), self.plan)


def execute_trials(
    plan: Plan,
    samples: int = 200,
    uncertainty: TrialUncertainty | None = None,
    seed: int = 1,
    simulator: Simulator = slip,
    jobs: int | None = None,
    progress: Callable[[TrialEnd], None] | None = None,
) -> Trials:
    """Execute a plan in sampled worlds.

    Args:
        plan: Of any kind of scenario, timed.
        samples: Number of worlds.
        uncertainty: See `sampled_world`.
        seed: Of the random numbers: the same seed gives the same worlds.
        simulator: What executes it: any function of a plan and a world, called from several threads.
        jobs: Threads; None for one a processor.
        progress: Called with the end of each sample, in their order.

    Raises:
        PushplanError: When `samples` is below 1, or the plan is not timed.
        SupportError: When the load under an object is not known.
    """
    for name, number, least in (("number of samples", samples, 1), ("seed", seed, 0)):
        if not (isinstance(number, Integral) and number >= least):
            raise PushplanError(f"the {name} is {number!r:.40}; it must be a whole number from {least}")
    if not callable(simulator):
        raise PushplanError(f"{simulator!r:.40} is no simulator: a function of a plan and a world")

    def one(i: int) -> tuple[ContactReport, bool, InertiaLoss | None]:
        world = sampled_world(plan.scenario, uncertainty, np.random.default_rng([seed, i]))
        with code_of_others("simulator", simulator):
            report = simulator(plan, world)
        if not isinstance(report, ContactReport):
            what = f"the simulator {name_of(simulator)} returns a {type(report).__name__}"
            raise ExtensionError(f"{what}; allowed: a ContactReport, as pushplan.simulate returns it")
        checked = simulator is slip and report.loss is None and _counts_inertia(plan.scenario)
        return report, report.arrived(plan.scenario), inertia_loss(plan, world) if checked else None

    ends: list[TrialEnd] = []
    with ThreadPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        for report, arrived, lost in pool.map(one, range(samples)):
            end = _end(len(ends), plan.scenario, report, arrived)
            ends.append(end if lost is None else replace(end, mode=INERTIA, **lost._asdict()))
            if progress is not None:
                progress(ends[-1])
    return Trials(plan, uncertainty, seed, simulator, tuple(ends))


def _counts_inertia(scenario: Scenario) -> bool:
    return scenario.pusher.limits.contact == "dynamic"


def _end(sample: int, scenario: Scenario, report: ContactReport, arrived: bool) -> TrialEnd:
    loss = report.loss
    return TrialEnd(
        sample=sample,
        arrived=arrived,
        jammed=report.jammed_at is not None or report.stalled_at is not None,
        errors=report.goal_errors(scenario),
        objects=report.objects[-1],
        contact="" if loss is None else loss.contact,
        mode=loss.mode.name.lower() if isinstance(loss, ContactLoss) else "",
        time=np.nan if loss is None else loss.time,
        object="" if loss is None else loss.object,
        point=loss.point if isinstance(loss, ContactLoss) else (np.nan, np.nan),
    )
