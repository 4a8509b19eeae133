"""What no plan of several pushes beats.

A push costs |v| + 0.1 |omega| for each unit of time, v being the velocity of the contact's middle. A point of the
load at distance r from it moves no faster than |v| + r |omega|, so over the way no farther than max(1, r / 0.1) times
what the push costs, whichever contact is used; and the load turns by no more than the cost over 0.1.
"""

from __future__ import annotations

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.multi.room import PushRoom, Question
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray


def lower_bounds(room: PushRoom, question: Question, through: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what no plan costs less than until the load is at poses (k, 3), (k,), and from there on, m."""
    pushes = room.scenario.pushes
    assert pushes is not None
    contacts = np.array([contact.packed.contact[:2] for contact in room.contacts])
    middle = contacts.mean(axis=0)
    faster = max(1.0, float(np.linalg.norm(contacts - middle, axis=1).max()) / TURN_WEIGHT)
    to = _bounds(question.load[None], through, middle, faster)[0]
    on = _bounds(through, question.goals, middle, faster).min(axis=1)
    alone = pushes.transit_weight * (pushes.approach + pushes.retreat)
    return to, on + alone


def _bounds(starts: FloatArray, goals: FloatArray, middle: FloatArray, faster: float) -> FloatArray:
    """Return what no pushes from starts (n, 3) to goals (m, 3) cost less than, (n, m)."""
    first, last = (se2.compose(poses, np.append(middle, 0.0))[:, :2] for poses in (starts, goals))
    away = np.linalg.norm(first[:, None] - last[None], axis=2) / faster
    turn = TURN_WEIGHT * np.abs(se2.wrap_angle(goals[None, :, 2] - starts[:, None, 2]))
    return np.asarray(np.maximum(away, turn))
