"""Paths in OMPL's form and back: arcs as the controls of a `PathControl`, and the arcs that controls stand for."""

from __future__ import annotations

from typing import Any

import numpy as np

from ompl import control as oc
from pushplan.errors import PlanningError
from pushplan.geometry.se2 import pose_error
from pushplan.planners.improve.incumbent import path_from
from pushplan.planners.improve.session import Session
from pushplan.planners.ompl.chart import arcs_at, controls_of, poses_along
from pushplan.planners.ompl.posing import PushInformation, free_word, information_of, state_at
from pushplan.planners.problem.posing import ROUNDING
from pushplan.planners.problem.problem import Problem
from pushplan.plans.path import PushPath
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM


def leave_path(definition: Any, arcs: FloatArray, planner: str) -> None:
    """Make arcs (k, 4) from the start to the goal the only solution of a problem.

    Raises:
        PlanningError: When a twist is not in the stable set.
    """
    definition.clearSolutionPaths()
    definition.addSolutionPath(path_control(information_of(definition), arcs), False, 0.0, planner)


def path_control(information: PushInformation, arcs: FloatArray) -> Any:
    """Return arcs (k, 4) from the start as OMPL's path of states, controls and durations."""
    problem, path = information.session.problem, oc.PathControl(information)
    controls = controls_of(problem, arcs)
    if not np.isfinite(controls).all():
        raise PlanningError("a twist of the path is on no segment of the stable set")
    poses, _ = poses_along(problem, information.session.start, arcs)
    control = information.allocControl()
    for pose, (u0, u1, u2, units) in zip(poses[:-1], controls.tolist(), strict=True):
        control[0], control[1], control[2] = u0, u1, u2
        path.append(state_at(information, pose), control, units)
    path.append(state_at(information, poses[-1]))
    return path


def arcs_to_goal(definition: Any) -> FloatArray:
    """Return the arcs (k, 4) of a problem's exact solution, and of the word that leads from its end to the goal.

    Raises:
        PlanningError: When there is none, or it is not what it claims to be: free, and ending in the goal region.
    """
    session = information_of(definition).session
    if not definition.hasExactSolution():
        raise PlanningError("the problem has no exact solution")
    arcs = controlled_arcs(session, definition.getSolutionPath())
    poses, free = poses_along(_proven(session.problem), session.start, arcs)
    if free < len(arcs):
        raise PlanningError(f"the planner left a path whose arc {free + 1} of {len(arcs)} is not free")
    end = poses[-1]
    if max(pose_error(end, session.problem.goal)) <= 1e-9:  # at the goal itself: no word is needed
        return arcs
    word = free_word(session, end, session.problem.goal)
    if word is None:
        raise PlanningError("the planner left a path that ends where no free word leads to the goal")
    return np.concatenate([arcs, word])


def _proven(problem: Problem) -> Problem:
    """Return the problem with the clearance that a search proves for every pose of its arcs.

    A search looks at poses with more clearance than it proves between them. Where neighbours of the same motion have
    been made one arc, other poses are looked at.
    """
    kept = problem.scene.kept
    return problem._replace(
        scene=problem.scene._replace(clearance=kept - ROUNDING, kept=kept - CLEARANCE_ROOM)
    )


def push_path(definition: Any) -> PushPath:
    """Return the path that solves a problem; see `arcs_to_goal`."""
    arcs = arcs_to_goal(definition)
    return path_from(information_of(definition).session.start, arcs)


def controlled_arcs(session: Session, path: Any) -> FloatArray:
    """Return the arcs (k, 4) that the controls of OMPL's path stand for."""
    if not isinstance(path, oc.PathControl):
        raise PlanningError(
            f"the planner left a {type(path).__name__}; allowed: a path with controls (PathControl)"
        )
    units = path.getControlDurations()
    controls = [[u[0], u[1], u[2], unit] for u, unit in zip(path.getControls(), units, strict=True)]
    return np.asarray(arcs_at(session.problem, np.array(controls).reshape(-1, 4)))
