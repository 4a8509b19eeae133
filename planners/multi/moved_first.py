"""One object of a row is moved first, out of where nothing brings it to the row from.

It is pushed straight away from a face, by several pushes where that takes them, and by a plate that is set aside on a
face where what stands beside that leaves no room for the whole of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pushplan.errors import EmptyStableSetError
from pushplan.geometry import se2
from pushplan.mechanics.faces import ways_through
from pushplan.planners.multi.multi_push import MultiPushSearch
from pushplan.planners.multi.row_steps import Steps
from pushplan.planners.multi.search import Limits
from pushplan.planners.multi.transfers import Piece, Situation, find_transfer
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Goal
from pushplan.util.arrays import FloatArray

AWAY = (0.3, 0.6, 1.0)
"""How far an object is pushed that has to be moved first, m."""

TRIES = 6
"""So many places are tried for it, those first that cost least."""

ELSEWHERE = 0.2
"""Places farther than this from those tried, m, are others."""

EFFORT = 3
"""Batches of poses that the search for a place may take."""


def with_one_moved(steps: Steps, settings: PlanSettings, until: float) -> Iterator[Steps]:
    """Yield the steps once an object was moved: the least accessible ones first.

    Args:
        steps: From where everything is.
        settings: Complete.
        until: `time.perf_counter` at which it is over.
    """
    scenario = steps.scenario
    assert settings.seed is not None
    names = tuple(scenario.bodies)
    poses = np.array([body.start for body in scenario.bodies.values()])
    now = Situation(steps.begin.plate, poses, frozenset())
    limits = Limits(until, first=True, iterations=EFFORT, stop=settings.observer.cancelled)
    resting = tuple(Piece(name, MultiPushSearch(scenario.alone(name), ()), ()) for name in names)
    for name in steps.least_accessible():
        k = names.index(name)
        try:
            moved = Piece(name, MultiPushSearch.of(_set_aside(scenario.alone(name)), settings), ())
            goals = _places(moved, poses[k])
        except EmptyStableSetError:
            continue
        pieces = (*resting[:k], moved, *resting[k + 1 :])
        for _ in range(TRIES):
            found = find_transfer(pieces, now, k, limits, settings.seed, goals, delivers=False) if goals else None
            if found is None:
                break
            steps.floor.looked_at += found.found.looked_at
            yield steps.after(found.segments(scenario.poses))
            end = found.end[:2]
            goals = tuple(goal for goal in goals if np.hypot(*(goal.pose_chain[:2] - end)) > ELSEWHERE)


def _set_aside(alone: Scenario) -> Scenario:
    """Return the problem of an object whose faces the plate may also take with one of its ends at theirs."""
    assert alone.pushes is not None
    plate = float(np.ptp(alone.chain.pusher.outline[:, 1]))
    over = {0.5 * (plate - way.length) for way in ways_through(alone.chain.objects[0].outline)}
    aside = sorted(round(one, 9) for one in over if one > 0.0)
    offsets = dict.fromkeys((*alone.pushes.offsets, *(sign * one for one in aside for sign in (1.0, -1.0))))
    return replace(alone, pushes=replace(alone.pushes, offsets=tuple(offsets)))


def _places(piece: Piece, pose: FloatArray) -> tuple[Goal, ...]:
    """Return where straight pushes lead from a pose (3,), nearest first."""
    stated = piece.search.scenario.goal
    ahead = {
        tuple(np.round(se2.rotate(contact.packed.contact[2], contact.packed.settling[:2]), 9))
        for contact in piece.search.room(0).contacts
    }
    places = [se2.compose(pose, [away * x, away * y, 0.0]) for away in AWAY for x, y in sorted(ahead)]
    return tuple(replace(stated, pose=place, of=None, pose_chain=place) for place in places)
