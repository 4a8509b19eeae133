"""Robustness of a plan: the smallest parameter error that loses a contact at any of its moments.

Each object in turn gets another floor friction, a shifted load, another position along its contact or another heading
(`mechanics.perturb`), with both signs. Then all errors act together (`joint_robustness`).
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
    """Return the robustness of pushing `chain` along `trajectory`.

    It covers the samples that an execution checks, with the commanded twist and twist rate and with any slower
    motion. At rest it uses the direction of the next motion.

    Args:
        chain: Chain whose contacts lie on edges of both bodies.
        trajectory: Commanded trajectory.
        box: Errors that act together; None for `ErrorBox.fixed`.
        least: Robustness of the plan's other pushes; the result is the minimum of both, number by number.

    Returns:
        The robustness; its numbers are None if a load is not known, or a push above the floor could lift a part.

    Raises:
        ChainError: If a contact does not lie on an edge of both bodies.
    """
    if not chain.loads_known or not is_pressed(chain):
        return Robustness()
    return robustness_along(chain, trajectory.directions, trajectory.rates_at(trajectory.t), box, least)


def least_robustness(segments: Sequence[Segment]) -> Robustness:
    """Return the robustness of all pushes of a plan; unknown if that of one push is, or without a push."""
    least: Robustness | None = None
    for push in reversed(segments):  # the last push carries most objects, so its result bounds the other searches
        if push.pushes and push.load is not None:
            least = robustness_of(push.load.chain, push.contact_trajectory, ErrorBox.of(push.load), least)
            if not least.known:
                return least
    return least or Robustness()


def robustness_along(
    chain: Chain, twists: FloatArray, rates: FloatArray, box: ErrorBox | None = None, least: Robustness | None = None
) -> Robustness:
    """Return the robustness of a motion with nonzero body twists (m, 3) and rates (m, 3); see `robustness_of`."""
    moments = thinned(twists, rates, chain.characteristic_length)
    motion = ChainMotion(chain, moments)
    if not motion.nominal.min() > 0.0:
        return USED_UP
    length = 2.0 * chain.characteristic_length  # longer than any contact
    least = least or Robustness(0.0, MOST_SHARE, MOST_SHARE, length, MOST_ANGLE, MOST_SCALE)
    friction, floor, load, position, angle, scale = astuple(least)

    def alone(kind: str, most: float) -> float:
        return JointErrors(motion, ErrorBox.of_kind(chain, kind)).alone(most)

    floor, load = alone("floor_friction", floor), alone("lean_y", alone("lean_x", load))
    position, angle = alone("position", position), alone("angle", angle)
    below, above = motion.nominal[..., 0], motion.nominal[..., 1]  # mu f_n - f_t and mu f_n + f_t
    box = ErrorBox.fixed(chain) if box is None else box
    about = motion if box.chain is chain else ChainMotion(box.chain, moments)
    if about is motion:  # an error that loses a contact alone does so together with others, too
        scale = min(scale, floor / BOX.floor_friction, load / BOX.load, position / BOX.position, angle / BOX.angle)
    friction = max(friction, float(np.max(np.abs(above - below) / (above + below))))
    return Robustness(friction, floor, load, position, angle, JointErrors(about, box).worst(scale)[0])
