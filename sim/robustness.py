"""How far numbers of a chain may be off on a plan: the least change that loses a contact at any of its moments.

Each object in turn gets another floor friction, a load that leans, another place along its contact or another
heading (`mechanics.perturb`), in both senses, and then all are off at once (`joint_robustness`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.heights import is_pressed
from pushplan.plans.robustness import BOX, MOST_ANGLE, MOST_SHARE, USED_UP, Robustness
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.joint_robustness import MOST_SCALE, ErrorBox, JointErrors
from pushplan.sim.moments import ChainMotion, thinned
from pushplan.util.arrays import FloatArray


def robustness_of(
    chain: Chain, trajectory: Trajectory, box: ErrorBox | None = None, least: Robustness | None = None
) -> Robustness:
    """Return how far numbers of `chain` may be off when it is pushed along `trajectory`.

    Looked at are the trajectory's samples, those that an execution checks, with the twist and the twist rate as
    commanded, and however much slower; where the pusher rests, the direction that comes next.

    Args:
        chain: The objects, their contacts on edges of both bodies.
        trajectory: As commanded.
        box: What may be off at once; None for `ErrorBox.fixed`.
        least: What other pushes of the plan tolerate; then the less of either is returned, number by number.

    Returns:
        The robustness, its numbers None where a load is not known, or a push above the floor could lift a part.

    Raises:
        ChainError: When a contact does not lie on an edge of both bodies.
    """
    if not chain.loads_known or not is_pressed(chain):
        return Robustness()
    return robustness_along(chain, trajectory.directions, trajectory.rates_at(trajectory.t), box, least)


def least_robustness(segments: Sequence[Segment]) -> Robustness:
    """Return what all pushes among the segments of a plan tolerate; unknown where one of them is, or without any."""
    least: Robustness | None = None
    for push in reversed(segments):  # the last push of a row carries most: then others are asked up to its least only
        if push.pushes and push.load is not None:
            least = robustness_of(push.load.chain, push.contact_trajectory, ErrorBox.of(push.load), least)
            if not least.known:
                return least
    return least or Robustness()


def robustness_along(
    chain: Chain, twists: FloatArray, rates: FloatArray, box: ErrorBox | None = None, least: Robustness | None = None
) -> Robustness:
    """Return that of a motion with body twists (m, 3), none zero, and rates (m, 3); see `robustness_of`."""
    moments = thinned(twists, rates, chain.characteristic_length)
    motion = ChainMotion(chain, moments)
    if not motion.nominal.min() > 0.0:
        return USED_UP
    length = 2.0 * chain.characteristic_length  # more than any contact is long
    least = least or Robustness(0.0, MOST_SHARE, MOST_SHARE, length, MOST_ANGLE, MOST_SCALE)
    friction, floor, load, position, angle, scale = astuple(least)

    def alone(kind: str, most: float) -> float:
        return JointErrors(motion, ErrorBox.of_kind(chain, kind)).alone(most)

    floor, load = alone("floor_friction", floor), alone("lean_y", alone("lean_x", load))
    position, angle = alone("position", position), alone("angle", angle)
    below, above = motion.nominal[..., 0], motion.nominal[..., 1]  # mu f_n - f_t and mu f_n + f_t
    box = ErrorBox.fixed(chain) if box is None else box
    about = motion if box.chain is chain else ChainMotion(box.chain, moments)
    if about is motion:  # what one number alone loses, all lose together
        scale = min(scale, floor / BOX.floor_friction, load / BOX.load, position / BOX.position, angle / BOX.angle)
    friction = max(friction, float(np.max(np.abs(above - below) / (above + below))))
    return Robustness(friction, floor, load, position, angle, JointErrors(about, box).worst(scale)[0])
