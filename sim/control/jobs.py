"""Pushes of a plan as jobs of their own, from where everything stands: where each ends, and what is in its way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from pushplan.geometry.se2 import compose, inverse, relative, wrap_angle
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Poses, Segment, standing_obstacles
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.slip.closing import OFF as CLOSES
from pushplan.util.arrays import FloatArray

PASSING = 2.0
"""Factor of the tolerances for a push after which the load is pushed on from elsewhere."""
SQUARE = 0.5
"""Share of the angle's tolerance by which a load may be turned that closes onto the row: that is turned as much."""
PRESSED = 1e-3
"""A load that closes onto an object is pushed on by so much, m, and by what its face is off square."""


class Phase(Enum):
    """What a controller is doing."""

    DRIVING = "driving"
    PUSHING = "pushing"
    CLOSING = "closing"
    LOOKING = "looking"
    ARRIVED = "arrived"
    GAVE_UP = "gave up"


@dataclass(frozen=True, eq=False)
class PushJob:
    """A push that is to be done.

    Attributes:
        scenario: The push problem: the load, where it shall go, and what stands in the room.
        plan: Of this push alone, to begin with.
        columns: Numbers of the load's objects among all that are measured.
        settle: Length of the straight push that closes the contacts after an approach, m; 0 where they are closed.
        most: Travel of the plate that it may take, m.
        again: Whether the plate may back off and come up to the load once more.
        alone: How far the plate has driven (m) and turned (rad) since it pushed something.
        slips: How often objects have slid, by name, since all that is done was planned.
        will_do: How far off its goal it may end where no plan leads nearer, m and rad.
        straight: Whether it is over after that straight push, wherever it ends: it closes onto an object that rests.
        onto: Name of the object that the load is pushed up to; empty where there is none.
        headings: (n,) standard deviations of what headings are measured wrong, rad; None: as settings have it.
    """

    scenario: Scenario
    plan: Plan
    columns: list[int]
    most: float
    settle: float = 0.0
    again: bool = False
    alone: tuple[float, float] = (0.0, 0.0)
    slips: Mapping[str, int] = field(default_factory=dict)
    will_do: tuple[float, float] = (0.0, 0.0)
    straight: bool = False
    onto: str = ""
    headings: FloatArray | None = None


def push_job(
    plan: Plan,
    segment: Segment,
    plate: FloatArray,
    poses: Poses,
    obstacles: Sequence[Obstacle],
    tolerance: tuple[float, float],
    most: float,
) -> PushJob:
    """Return a push of a plan of several segments as a job of its own; its goal is where the plan ends it.

    Args:
        plan: What is done.
        segment: The push.
        plate: (3,) pose of the plate frame.
        poses: Of all objects, as measured.
        obstacles: What else stands in the room.
        tolerance: Distance (m) and angle (rad) by which an object may be off its goal.
        most: See `PushJob`.
    """
    scenario, load = plan.scenario, segment.pushed_load
    problem, last = segment.problem(scenario), is_last(plan, segment)
    position, turn = tolerance if last else (PASSING * value for value in tolerance)
    will_do = position, turn
    after = plan.segments[plan.segments.index(segment) + 1 :][:1]
    if not last and any(one.onto and is_last(plan, one) for one in after):  # it leads up to a close
        position, turn = tolerance[0], SQUARE * tolerance[1]
    goals = scenario.goals.get(load.names[0], ()) if len(load.names) > 1 else ()  # else the object is the load
    of = goals[0].of if last and goals else None
    goal = replace(problem.goal, of=of, position_tolerance=position, angle_tolerance=turn)
    around = (*obstacles, *standing_obstacles(scenario, poses, (*load.names, segment.onto)))
    problem = replace(problem.push_of(problem.load, goal), obstacles=around)
    length = straight_onto(segment, plate, poses, tolerance) if segment.onto else None
    return PushJob(
        problem,
        alone(plan, replace(segment, load=load.with_problem(problem))),
        [list(scenario.poses).index(name) for name in load.names],
        most,
        scenario.transport.settle if length is None else length,
        will_do=will_do,
        straight=length is not None,
        onto=segment.onto,
    )


def straight_onto(segment: Segment, plate: FloatArray, poses: Poses, tolerance: tuple[float, float]) -> float | None:
    """Return how far a load has to be pushed straight ahead to close onto an object where that was measured, m.

    None where that is too far off or turned to become flush so, or to stand well in the row; see `push_job`.
    """
    onto, away = segment.onto, inverse(segment.path.end)
    flush = compose(poses[onto], inverse(compose(away, segment.before[onto])))
    ahead, aside, _ = (float(value) for value in relative(plate, flush))
    turn, (position, angle) = float(wrap_angle(flush[2] - plate[2])), tolerance
    square = abs(turn) <= max(PASSING * angle, CLOSES[1])
    if not square or abs(aside) > PASSING * position or ahead < -PASSING * position:
        return None
    face = max(contact.length for contact in segment.load.chain.contacts) if segment.load else 0.0
    return max(ahead, 0.0) + 0.5 * face * abs(math.sin(turn)) + PRESSED


def is_last(plan: Plan, segment: Segment) -> bool:
    """Tell whether the objects of a push are not pushed again by the plan."""
    later = plan.segments[plan.segments.index(segment) + 1 :]
    names = {name for s in later if s.pushes and s.load is not None for name in s.load.names}
    return segment.load is not None and not names & set(segment.load.names)


def alone(plan: Plan, segment: Segment) -> Plan:
    """Return a plan of one segment."""
    return Plan(plan.scenario, (segment,), "", plan.planner, plan.stable_set, plan.seed, cost=segment.cost)
