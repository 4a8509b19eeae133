"""Single pushes of a plan as separate jobs from the measured poses, each with its goal and its obstacles."""

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
"""Factor of the tolerances of a push if a later push moves the same load again."""
SQUARE = 0.5
"""Share of the angle tolerance for a load that closes onto a row, because it turns the row by its own error."""
PRESSED = 1e-3
"""Extra length of a push that closes a load onto an object, m, beside the length that squares its face."""


class Phase(Enum):
    """State of a controller."""

    DRIVING = "driving"
    PUSHING = "pushing"
    CLOSING = "closing"
    LOOKING = "looking"
    ARRIVED = "arrived"
    GAVE_UP = "gave up"


@dataclass(frozen=True, eq=False)
class PushJob:
    """A push to execute.

    Attributes:
        scenario: Push problem: the load, its goal, and the obstacles.
        plan: Initial plan of this push alone.
        columns: Indices of the load's objects among all measured ones.
        settle: Length of the straight push that closes the contacts after an approach, m; 0 if they are closed.
        most: Largest travel of the plate, m.
        again: Whether the plate can back off and approach the load again.
        alone: Distance (m) and angle (rad) that the plate has driven since the last push.
        slips: Number of slides of each object, by name, since the plan was made.
        will_do: Accepted error at the goal (m, rad) if no plan leads nearer.
        straight: Whether the push ends after the straight push, which closes onto a resting object.
        onto: Name of the object that the load is pushed up to; empty without one.
        headings: Standard deviations of the measured headings' constant errors, rad, (n,); None for the settings'.
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
    """Return a push of a multi-push plan as a separate job; its goal is the end of the planned push.

    Args:
        plan: Executed plan.
        segment: Push of the plan.
        plate: Pose of the plate frame, (3,).
        poses: Measured poses of all objects.
        obstacles: Obstacles in the room.
        tolerance: Largest distance (m) and angle (rad) of an object from its goal.
        most: Largest travel of the plate, m.
    """
    scenario, load = plan.scenario, segment.pushed_load
    problem, last = segment.problem(scenario), is_last(plan, segment)
    position, turn = tolerance if last else (PASSING * value for value in tolerance)
    will_do = position, turn
    after = plan.segments[plan.segments.index(segment) + 1 :][:1]
    if not last and any(one.onto and is_last(plan, one) for one in after):  # a close follows
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
    """Return the length of the straight push that closes a load onto an object at its measured pose, m.

    None if the object is too far off or turned to become flush in this way; see `push_job` for the arguments.
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
    """Return whether the plan does not push the objects of a push again."""
    later = plan.segments[plan.segments.index(segment) + 1 :]
    names = {name for s in later if s.pushes and s.load is not None for name in s.load.names}
    return segment.load is not None and not names & set(segment.load.names)


def alone(plan: Plan, segment: Segment) -> Plan:
    """Return a plan of this segment alone."""
    return Plan(plan.scenario, (segment,), "", plan.planner, plan.stable_set, plan.seed, cost=segment.cost)
