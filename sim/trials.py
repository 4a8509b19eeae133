"""Monte Carlo trials: execute a plan in random samples of the world and count how many arrive."""

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
from pushplan.plans.goals import goal_columns, goal_units, missed_tolerances
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.scenario.model import Scenario
from pushplan.sim.report import ContactLoss, ContactReport, with_margins
from pushplan.sim.slip import slip
from pushplan.slip.world import World
from pushplan.util.arrays import BoolArray, FloatArray
from pushplan.util.naming import name_of, user_code

INERTIA = "inertia"
"""Mode of a contact that holds in a quasi-static trial but would be lost with inertia."""


def sampled_world(scenario: Scenario, uncertainty: TrialUncertainty | None, rng: np.random.Generator) -> World:
    """Draw one Monte Carlo sample of the world.

    Args:
        scenario: Nominal scenario of the plan.
        uncertainty: Size of the deviations. None uses the intervals of the scenario where it specifies any, and the
            defaults of `TrialUncertainty` for the rest.
        rng: Random generator.

    Raises:
        SupportError: If the load under an object is not known.
    """
    world = World.from_scenario(scenario)
    off = uncertainty or TrialUncertainty()
    drawn = []
    for one, load in zip(world.stacks, scenario.loads, strict=True):
        interval, frictions = load.interval, load.contact_friction
        if uncertainty is None and interval is not None:
            one = _from_intervals(one, interval, frictions, rng)
        else:
            one = _perturbed(
                one if frictions is None else _with_contact_frictions(one, frictions.mean(axis=1)), off, rng
            )
        drawn.append(replace(one, offsets=_random_offsets(one.chain, off, rng, world.plate is None)))
    return replace(drawn[0], beside=tuple(drawn[1:]))


def _perturbed(world: World, off: TrialUncertainty, rng: np.random.Generator) -> World:
    for obj in world.chain.objects:
        world = world.with_contact_friction(_random_factor(off.contact_friction, rng), obj.name)
        world = world.with_floor_friction(_random_factor(off.floor_friction, rng), obj.name)
        world = world.with_mass(_random_factor(off.mass, rng), obj.name)
        world = _with_shifted_load(world, obj.name, off.load, rng)
    return world


def _from_intervals(
    world: World, interval: IntervalChain, frictions: FloatArray | None, rng: np.random.Generator
) -> World:
    """Draw every quantity that has an interval; keep all others."""
    if frictions is not None:
        world = _with_contact_frictions(world, _random_values(frictions, rng))
    chain, objects = interval.chain, []
    masses, rubs = _random_values(interval.mass, rng), _random_values(interval.floor_friction, rng)
    for i, obj in enumerate(chain.objects):
        support = obj.support
        if i in interval.fractions and isinstance(support, FeetSupport):
            fractions = _random_values(interval.fractions[i], rng)
            support = FeetSupport(support.positions, fractions / fractions.sum())
        objects.append(replace(obj, mass=float(masses[i]), floor_friction=float(rubs[i]), support=support))
    world = replace(world, chain=replace(chain, objects=tuple(objects), contacts=world.chain.contacts))
    for i, share in interval.pressures.items():
        world = _with_shifted_load(world, chain.objects[i].name, share, rng)
    return world


def _with_contact_frictions(world: World, frictions: FloatArray) -> World:
    """Return the world with the contact friction coefficients (n,) replaced."""
    pairs = zip(world.chain.contacts, frictions, strict=True)
    contacts = tuple(replace(contact, friction=float(mu)) for contact, mu in pairs)
    return replace(world, chain=replace(world.chain, contacts=contacts))


def _random_values(spans: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw one number from each of the intervals (k, 2)."""
    return np.asarray(rng.uniform(spans[:, 0], spans[:, 1]))


def _random_factor(share: float, rng: np.random.Generator) -> float:
    return float(1.0 + share * rng.uniform(-1.0, 1.0))


def _with_shifted_load(world: World, name: str, share: float, rng: np.random.Generator) -> World:
    angle, part = rng.uniform(-np.pi, np.pi), share * rng.uniform()
    if part == 0.0:
        return world
    direction, obj = np.array([np.cos(angle), np.sin(angle)]), world.chain.objects[world.chain.index_of(name)]
    most = obj.support.most_lean(rotate(-float(obj.pose_chain[2]), direction))
    # If the load is already shifted, its lightest corner reaches zero pressure before the full share.
    return world.with_load_shifted(direction, min(part, most * (1.0 - 1e-9)), name)


def _random_offsets(chain: Chain, off: TrialUncertainty, rng: np.random.Generator, touched: bool) -> FloatArray:
    """Draw the pose errors of the objects (n, 3), in m and rad.

    Each object is shifted sideways and turned relative to the object or plate that pushes it. If the plate does not
    touch the objects yet (`touched` is false), those that it will push are also shifted along the contact normal.
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
    """Return the motion (3,) that shifts an object along a contact and turns it about the end that keeps touching."""
    pivot = contact.left if turn > 0.0 else contact.right
    shift = pivot + aside * contact.tangent - rotate(turn, pivot)
    return np.append(shift, turn)


class InertiaLoss(NamedTuple):
    """First loss of a contact once inertia is counted.

    Attributes:
        object: Name of the pushed object.
        contact: Name of the contact.
        time: Time of the loss, s.
        point: Midpoint of the contact segment in the world, m.
    """

    object: str
    contact: str
    time: float
    point: tuple[float, float]


def inertia_loss(plan: Plan, world: World) -> InertiaLoss | None:
    """Return the first point of the timed plan where a margin with inertia is not positive; None if there is none.

    The margins use the frictions, masses and loads of the world, and the object poses of the plan.
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
"""Function that executes a plan in a world where contacts can slip."""


@dataclass(frozen=True, eq=False)
class Trials:
    """Results of a plan in k Monte Carlo samples.

    Attributes:
        plan: Executed plan, with its nominal scenario.
        uncertainty: Uncertainty that the samples were drawn with; None for the scenario's own intervals.
        seed: Seed of the random numbers; sample i depends on it and on i only.
        simulator: Simulator that executed the plan.
        ends: Outcome of each sample.
        log: Path of the log; None if none was written.
    """

    plan: Plan
    uncertainty: TrialUncertainty | None
    seed: int
    simulator: Simulator
    ends: tuple[TrialEnd, ...]
    log: Path | None = None

    @property
    def scenario(self) -> Scenario:
        """Nominal scenario of the plan."""
        return self.plan.scenario

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.ends)

    @cached_property
    def errors(self) -> FloatArray:
        """Final distance (m) and angle (rad) of every object from its goal pose, (k, n, 2)."""
        return np.array([end.errors for end in self.ends])

    @cached_property
    def object_poses(self) -> FloatArray:
        """Final object poses in the world, (k, n, 3)."""
        return np.array([end.objects for end in self.ends])

    @cached_property
    def arrived(self) -> BoolArray:
        """Whether all objects that have a goal end within its tolerances, (k,)."""
        return np.array([end.arrived for end in self.ends])

    @cached_property
    def jammed(self) -> BoolArray:
        """Whether the push ended early because the objects jammed or the robot lacked the force, (k,)."""
        return np.array([end.jammed for end in self.ends])

    @property
    def missed(self) -> dict[str, int]:
        """Number of samples beyond the goal's tolerance of `position` and of `angle`; zeros are left out."""
        return dict(Counter(name for errors in self.errors for name in missed_tolerances(self.scenario, errors)))

    @property
    def success(self) -> float:
        """Share of the samples that arrive."""
        return float(self.arrived.mean())

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the success rate."""
        return wilson(int(self.arrived.sum()), self.samples)

    @property
    def with_inertia(self) -> bool:
        """Whether `held` and `lost` count inertia.

        With pushplan's own simulator, this depends on the scenario. The physics engine and simulators of users are
        assumed to count it.
        """
        return self.simulator is not slip or _counts_inertia(self.scenario)

    @property
    def held(self) -> float:
        """Share of the samples in which every contact holds to the end; see `with_inertia`."""
        return float(np.mean(~self.lost & ~self.jammed))

    @property
    def lost(self) -> BoolArray:
        """Whether a contact slid or opened, or would with inertia, (k,)."""
        return np.array([bool(end.contact) for end in self.ends])

    @property
    def first_failures(self) -> dict[str, int]:
        """Number of samples in which each contact, by name, was the first to be lost; zeros are left out."""
        return dict(Counter(end.contact for end in self.ends if end.contact).most_common())

    @property
    def goal_errors(self) -> FloatArray:
        """Largest final position (m) and angle (rad) error of the objects that have a goal, (k, 2)."""
        return np.asarray(self.errors[:, goal_columns(self.scenario)].max(axis=1))

    @property
    def worst(self) -> int:
        """Index of the sample that ends farthest from the goal, in units of its tolerances; jams rank first."""
        units = np.array([goal_units(self.scenario, errors).max() for errors in self.errors])
        return int(np.argmax(units + 1e9 * self.jammed))

    def world(self, i: int) -> World:
        """Return the world of sample i."""
        return sampled_world(self.scenario, self.uncertainty, np.random.default_rng([self.seed, i]))

    def report(self, i: int) -> ContactReport:
        """Simulate sample i again and return its report."""
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
    """Execute a plan in Monte Carlo samples of the world.

    Args:
        plan: Timed plan of any kind of scenario.
        samples: Number of samples.
        uncertainty: Size of the deviations; see `sampled_world`.
        seed: Seed of the random numbers; the same seed gives the same samples.
        simulator: Function that executes a plan in a world; several threads call it.
        jobs: Number of threads; None for one per processor.
        progress: Callback with the outcome of each sample, in order.

    Raises:
        PushplanError: If `samples` is below 1, or the plan is not timed.
        SupportError: If the load under an object is not known.
    """
    for name, number, least in (("number of samples", samples, 1), ("seed", seed, 0)):
        if not (isinstance(number, Integral) and number >= least):
            raise PushplanError(f"the {name} is {number!r:.40}; it must be a whole number from {least}")
    if not callable(simulator):
        raise PushplanError(f"{simulator!r:.40} is not a simulator; allowed: a function of a plan and a world")

    def one(i: int) -> tuple[ContactReport, bool, InertiaLoss | None]:
        world = sampled_world(plan.scenario, uncertainty, np.random.default_rng([seed, i]))
        with user_code("simulator", simulator):
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
