"""What a simulated world remembers from step to step, and what a step leaves behind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.util.arrays import FloatArray, IntArray

OPEN, STICK, SLIDE, ROLL, ROLL_SLIDE = 0, 1, 2, 3, 4
"""What a contact does: nothing; both ends hold; both touch and slide; one end holds; one touches and slides."""

CONVERGED, FALLBACK, UNSOLVED, JAMMED, CROWDED = 0, 1, 2, 3, 4
"""How a step ended: by Newton's method; with the fallback's help; no motion was found that balances all forces; no
motion satisfies all contacts; more manifolds than there is room for. After the last three nothing has moved."""


class State(NamedTuple):
    """Where everything is, and the last step's solution, with which the next one begins.

    Attributes:
        poses: (n + 1, 3) poses of the objects and, last, of the chain frame (the plate), in the world.
        twists: (n, 3) U of the last step over the plate's size of step, in the plate's axes.
        command: (3,) the plate's own, likewise.
        drag: (n, 2) force that every object drags over the floor with, in the object's axes, N.
        change: (1,) by how much `twists` changed in the last step.
        steps: (1,) steps since the beginning.
    """

    poses: FloatArray
    twists: FloatArray
    command: FloatArray
    drag: FloatArray
    change: FloatArray
    steps: IntArray


class Trace(NamedTuple):
    """What m steps leave behind.

    Attributes:
        poses: (m, n, 3) of the objects after every step.
        modes: (m, n) of the chain's contacts, `OPEN` to `ROLL_SLIDE`.
        forces: (m, n, 3) of the chain's contacts: normal force at the right and the left end, tangential force, N.
        wrenches: (m, 3) with which the plate pushes on all that it touches, in the chain frame: N, N, N m.
        others: (m, n) number of other active contacts of every object: with obstacles, walls, or bodies it was not
            stacked on.
        residual: (m,) of the balance, over the sum of mu N of all objects.
        end: (m,) how every step ended, `CONVERGED` to `CROWDED`.
        switched: (m,) 1 where a motion jumped though no contact closed: another branch of solutions.
    """

    poses: FloatArray
    modes: IntArray
    forces: FloatArray
    wrenches: FloatArray
    others: IntArray
    residual: FloatArray
    end: IntArray
    switched: IntArray


def make_state(poses: FloatArray) -> State:
    """Return the state of objects and plate (n + 1, 3) that have not moved yet."""
    n = len(poses) - 1
    return State(
        poses=np.array(poses, dtype=np.float64),
        twists=np.zeros((n, 3)),
        command=np.zeros(3),
        drag=np.zeros((n, 2)),
        change=np.zeros(1),
        steps=np.zeros(1, dtype=np.int64),
    )


def make_trace(steps: int, objects: int) -> Trace:
    """Return room for what `steps` steps leave behind."""
    return Trace(
        np.zeros((steps, objects, 3)),
        np.zeros((steps, objects), dtype=np.int64),
        np.zeros((steps, objects, 3)),
        np.zeros((steps, 3)),
        np.zeros((steps, objects), dtype=np.int64),
        np.zeros(steps),
        np.zeros(steps, dtype=np.int64),
        np.zeros(steps, dtype=np.int64),
    )
