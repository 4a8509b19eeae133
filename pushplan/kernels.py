"""Compiled code made ready before it is needed: the first run on a machine compiles, later ones load the cache."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from pushplan.compiled.announcement import announced
from pushplan.compiled.second_compiler import second_compiler
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.contacts import contact_state
from pushplan.mechanics.dynamics import ContactDynamics, dynamic_margins
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.support import UniformSupport
from pushplan.planners.blending.parts import make_part
from pushplan.planners.blending.sweep import find_touches
from pushplan.planners.collision.scene import build_scene, convex_pieces
from pushplan.planners.collision.separation import separation
from pushplan.planners.improve.session import Budget, Session
from pushplan.planners.improve.shortening import shorten
from pushplan.planners.infeasible.pockets import LEVELS, make_steps, push_hull, reached
from pushplan.planners.multi.multi_push import MultiPushSearch
from pushplan.planners.multi.room import Question, joined
from pushplan.planners.multi.samples import MOVES, descend, pack_modes, pushed_at_random, random_descent
from pushplan.planners.multi.search import Limits
from pushplan.planners.multi.search import search as search_pushes
from pushplan.planners.multi.transit import transit_is_free
from pushplan.planners.ompl.factories import PLANNERS, planner_named
from pushplan.planners.ompl.form import arcs_at, controls_of, poses_along
from pushplan.planners.ompl.search import search
from pushplan.planners.problem.objective import travel_objective
from pushplan.planners.problem.problem import Problem, kept_distances
from pushplan.planners.search.lattice_rounds import LatticeRounds
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.file import scenario_from_document
from pushplan.sets.interval_set import stable_set_over
from pushplan.sets.meridians import margin_peaks
from pushplan.sets.named import stable_set
from pushplan.sim.robustness import robustness_along

_BOX = (-2.0, -2.0, 3.0, 4.0)
"""Where the search may look, m: around a start and a goal that a wall keeps apart."""
_HEADING_LENGTH = 0.1
"""What a turn by 1 rad counts in that search, m."""


def warm_up(
    planner: str,
    tell: Callable[[str], None] | None = None,
    stable: str = "ecof",
    intervals: bool = False,
    multi_push: bool = False,
) -> None:
    """Make all compiled code of a plan ready.

    Args:
        planner: Name of the planner that will run; one that is not the project's own needs what OMPL's need.
        tell: Called with a sentence for the user if that takes long.
        stable: Name of the stable set to plan in.
        intervals: Whether loads or frictions are intervals.
        multi_push: Whether the robot may push several times, and drives in between.
    """
    with announced(tell):
        _compile(planner if planner in PLANNERS else "rrt")
        if stable == "robust" or (intervals and stable == "ecof"):
            _compile_worst_case(stable)
        if multi_push:
            _compile_multi_push()


@cache
def _compile_multi_push() -> None:
    """Search for several pushes of a box with something between it and the robot."""
    scenario = scenario_from_document(_BOX_ANYWHERE)
    search = MultiPushSearch.of(scenario, PlanSettings().completed(scenario))
    room = search.room(0)
    question = Question(scenario.robot_start, scenario.start, scenario.goal.pose_chain[None])
    search_pushes(room, question, Limits(time.perf_counter() + 3600.0, iterations=2), seed=1)
    modes, state = pack_modes([contact.packed for contact in room.contacts]), np.ones(1, dtype=np.uint64)
    changes, poses = np.zeros_like(room.shortest), np.zeros((1, 3))
    every = np.arange(len(modes.contact))
    random_descent(modes, question.load, question.goals, every, every, 2, changes, np.inf, state, poses)
    poses[0] = pushed_at_random(modes, 0, question.load, 1.0, state)
    ends, sequence = np.stack([question.load, question.goals[0]]), np.zeros(2, dtype=np.int64)
    descend(modes, sequence, ends, poses, 0.1, MOVES, state)
    joined(question.load, room.contacts[0].packed.contact)
    way = room.transit_around(0, 1)
    transit_is_free(room.around(question.load), question.robot, np.zeros((1, 4)) if way is None else way)


_BOX_ANYWHERE: dict[str, Any] = {
    "format": "pushplan/1",
    "floor": {"friction": 0.3},
    "objects": [{"name": "box", "shape": {"box": [0.1, 0.1]}, "mass": 1.0}],
    "pusher": {"width": 0.1, "friction": 0.3, "faces": ["rear", "left"]},
    "robot": {"start": [-0.2, 0.3, 0.0]},
    "goal": {"pose": [0.3, 0.2, 0.0]},
    "pushes": {"most": 3},
    "obstacles": [{"box": [0.1, 0.1], "pose": [-0.1, 0.2, 0.0]}],
}


@cache
def _compile(planner: str) -> None:
    """Run every kernel once, on a single box that an obstacle keeps from its goal."""
    with second_compiler(planner):
        _compile_mechanics()
        _compile_polish()
        _compile_timing()
        _compile_pockets()
    compile_search(planner)


def _compile_mechanics() -> None:
    chain = _one_box()
    stable = stable_set(chain, "ecof")
    stable.meridians(count=8)
    margin_peaks(stable.margin_values, chain.characteristic_length)
    contact_state(chain, np.array([[1.0, 0.0, 0.0]]))
    robustness_along(chain, np.array([[0.1, 0.0, 0.0]]), np.zeros((1, 3)))


@cache
def _compile_worst_case(name: str) -> None:
    """Run the kernels of a set for all loads once, also those that count inertia."""
    chain = _one_box()
    interval = IntervalChain.from_ranges(chain, mass={"box": (0.9, 1.1)}, pressures={"box": 0.1})
    dynamics = ContactDynamics(chain, worst_case=name == "robust", interval=interval)
    dynamics.margins(np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 3)))
    stable = stable_set_over(interval, name)
    stable.meridians(count=8)
    stable.contact_margins(np.array([[1.0, 0.0, 0.0]]))


def _compile_polish() -> None:
    arcs, state = np.array([[1.0, 0.0, 0.0, 0.5]]), np.zeros(1, dtype=np.uint64)
    shorten(_problem(_one_box()), np.zeros(3), arcs, state, 1)


def _compile_timing() -> None:
    """Time a path of two arcs, blend it, and look what its motion is away from."""
    path = PushPath(np.zeros(3), np.array([[1.0, 0.0, 0.0], [0.8, 0.0, 2.0]]), np.array([0.5, 0.2]))
    chain = _one_box()
    bounds = Bounds(chain.pusher.limits, ContactDynamics(chain))
    trajectory = time_path(path, bounds)
    make_part(path, np.arange(2), bounds).eased(path.lengths).motion(path.lengths)
    find_touches(_problem(chain).scene, trajectory, chain.reach)
    dynamic_margins(chain, trajectory.directions, trajectory.rates_at(trajectory.t))
    list(convex_pieces([np.array([[0.0, 0.0], [2.0, 0.0], [0.5, 0.5], [0.0, 2.0]])]))


def _compile_pockets() -> None:
    problem = _problem(_one_box())
    hull = push_hull(problem.segments[:, :3], problem.scene.body_bound[:2])
    steps = make_steps(problem.scene, hull, LEVELS[0], 0.0, back=False)
    reached(problem.scene, np.zeros(3), problem.goal, steps, 4)


def compile_search(planner: str) -> None:
    """Run every kernel of a planner once."""
    session = Session(_problem(_one_box()), np.zeros(3), Budget(time_limit=3600.0, first=True), seed=0)
    gap = separation(session.problem.scene, 0.0, 0.0, 0.0, 1.0)  # of the ends of a problem that is posed
    kept_distances(gap, 1.0)
    arcs = arcs_at(session.problem, np.full((1, 4), 0.5))  # of a path in OMPL's form
    controls_of(session.problem, arcs)
    poses_along(session.problem, session.start, arcs)
    search(session, planner_named(planner)[1], _BOX, _HEADING_LENGTH)
    if planner == "auto":  # it seeks no better path than the first here
        again = Session(
            session.problem, np.zeros(3), replace(session.budget, first=False, iterations=1), seed=0
        )
        LatticeRounds(again, _BOX).run(1)


def _one_box() -> Chain:
    square = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
    box = PushedObject("box", square, 1.0, 0.3, UniformSupport(square), np.array([0.05, 0.0, 0.0]))
    contact = Contact(np.array([0.0, -0.05]), np.array([0.0, 0.05]), 0.3, 0, -1)
    plate = np.array([[-0.03, -0.05], [0.0, -0.05], [0.0, 0.05], [-0.03, 0.05]])
    return Chain((box,), (contact,), Pusher(plate, 0.3))


def _problem(chain: Chain) -> Problem:
    wall = np.array([[0.7, -5.0], [0.8, -5.0], [0.8, 1.2], [0.7, 1.2]])
    scene = build_scene(chain, [wall], [(9.0, 9.0, 1.0)], (-10.0, -10.0, 10.0, 10.0), 1e-4)
    family = np.array([[[0.8, 0.0, 2.0], [1.0, 0.0, 0.0], [0.8, 0.0, -2.0]]])
    segments = np.array([[0.8, 0.0, 2.0, 0.8, 0.0, -2.0]])
    return Problem(scene, segments, family, np.array([1.5, 0.0, 0.0]), 0.5, travel_objective(0.03))
