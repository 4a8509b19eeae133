"""Compiled code of several pushes made ready before it is needed; see `pushplan.kernels`."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from pushplan.compiled.announcement import announced
from pushplan.kernels import warm_up
from pushplan.planners.multi.room import PushRoom, Question, joined
from pushplan.planners.multi.samples import MOVES, descend, pack_modes, pushed_at_random, random_descent
from pushplan.planners.multi.search import Limits, search
from pushplan.planners.multi.transit import transit_is_free
from pushplan.scenario.file import scenario_from_document
from pushplan.several.prepared import Prepared

_PROBLEM: dict[str, Any] = {
    "format": "pushplan/1",
    "floor": {"friction": 0.3},
    "objects": [{"name": "box", "shape": {"box": [0.1, 0.1]}, "mass": 1.0}],
    "pusher": {"width": 0.1, "friction": 0.3, "faces": ["rear", "left"]},
    "robot": {"start": [-0.2, 0.3, 0.0]},
    "goal": {"pose": [0.3, 0.2, 0.0]},
    "pushes": {"most": 3},
    "obstacles": [{"box": [0.1, 0.1], "pose": [-0.1, 0.2, 0.0]}],
}
"""A box with something between it and the robot."""


def warm_up_several(tell: Callable[[str], None] | None, stable: str, intervals: bool) -> None:
    """Make all compiled code of a plan of several pushes ready.

    Args:
        tell: Called with a sentence for the user if that takes long.
        stable: Name of the stable set to plan in.
        intervals: Whether loads or frictions are intervals.
    """
    warm_up("auto", tell, stable, intervals)
    with announced(tell):
        _compile()


@cache
def _compile() -> None:
    """Run every kernel once."""
    scenario = scenario_from_document(_PROBLEM)
    room = Prepared.of(scenario).room(0)
    question = Question(scenario.robot_start, scenario.start, scenario.goal.pose_chain[None])
    search(room, question, Limits(time.perf_counter() + 3600.0, iterations=2), seed=1)
    _compile_descents(room, question)


def _compile_descents(room: PushRoom, question: Question) -> None:
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
