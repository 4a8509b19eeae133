"""MuJoCo, the optional physics engine, imported when it is first needed; and how pushes are simulated with it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from typing import Any

from pushplan.errors import PushplanError
from pushplan.slip.feet import DEGREE
from pushplan.util.naming import optional


class PhysicsError(PushplanError):
    """A physics simulation is impossible or did not stay finite."""


def engine() -> Any:
    """Return the module `mujoco`.

    Raises:
        MissingExtraError: When it is not installed.
    """
    return optional("mujoco", "a physics simulation", "MuJoCo", "physics")


@dataclass(frozen=True)
class PhysicsSettings:
    """Settings that all simulations share; lengths are over a chain's characteristic length L, so that they suit all.

    Attributes:
        time_step: s.
        degree: Degree up to which the feet have the moments of a pressure (see `feet_of`).
        softness: How much softer a foot rests on the floor than the convex contact model of the engine lifts a
            sliding one: above 1 no foot ever loses the floor, so that each carries exactly its load.
        friction_stiffness: The engine's `impratio`: friction creeps below the share
            softness mu^2 / friction_stiffness of the pusher's speed; above it, it is Coulomb's.
        indentation: How deep a corner sinks into a face under the friction of one object, over L.
        slip_time: Time in which friction takes hold of what slides at a contact, over that in which its normal force
            takes hold of what sinks in. At 1 the convex contact model lifts sliding faces off, and they slide
            millimetres too far; at 20, with smaller steps, they slide as Coulomb's law says.
        run_in: Time steps in which everything rests while the feet settle.
    """

    time_step: float = 5e-4
    degree: int = DEGREE
    softness: float = 5.0
    friction_stiffness: float = 1e4
    indentation: float = 1e-4
    slip_time: float = 1.0
    run_in: int = 40

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise PushplanError(f"{field.name} of the physics settings is {value}; it must be > 0")


class ForceMeter:
    """Tells when the plate has pushed with more than a force for a while: it stops there, as a robot does.

    The median over `SPAN` counts, so that the few steps in which objects are met do not.

    Args:
        limit: N.
        dt: Time step, s.
    """

    SPAN = 0.05
    """s."""

    def __init__(self, limit: float, dt: float) -> None:
        self._limit, self._forces = limit, deque[float](maxlen=max(3, round(self.SPAN / dt)))

    def reset(self) -> None:
        """Forget what was counted."""
        self._forces.clear()

    def exceeded(self, fx: float, fy: float) -> bool:
        """Take the force of a time step, N; tell whether it has been too much for a while."""
        if math.isinf(self._limit):
            return False
        self._forces.append(math.hypot(fx, fy))
        full = len(self._forces) == self._forces.maxlen
        return full and 2 * sum(force > self._limit for force in self._forces) > len(self._forces)
