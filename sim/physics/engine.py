"""Import of MuJoCo, the optional physics engine, on first use, and the settings of the simulation."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from typing import Any

from pushplan.errors import PushplanError
from pushplan.slip.feet import DEGREE
from pushplan.util.naming import optional


class PhysicsError(PushplanError):
    """A physics simulation is impossible or diverges."""


def engine() -> Any:
    """Return the module `mujoco`.

    Raises:
        MissingExtraError: If it is not installed.
    """
    return optional("mujoco", "a physics simulation", "MuJoCo", "physics")


@dataclass(frozen=True)
class PhysicsSettings:
    """Settings of all simulations; lengths are divided by the chain's characteristic length L.

    Attributes:
        time_step: Time step, s.
        degree: Degree up to which the feet match the moments of a pressure (see `feet_of`).
        softness: Compliance of a foot over that at which the engine's convex contact model lifts a sliding foot.
            Above 1, no foot ever leaves the floor, so each carries exactly its load.
        friction_stiffness: The engine's `impratio`. Friction creeps at sliding speeds below
            softness mu^2 / friction_stiffness times the pusher's speed; above them it is Coulomb friction.
        indentation: Depth to which a corner sinks into a face under the friction of one object, over L.
        slip_time: Time constant of friction over that of the normal force at a contact. At 1, the convex contact
            model lifts sliding faces, and they slide millimetres too far. At 20, with smaller steps, they follow
            Coulomb's law.
        run_in: Number of time steps at rest in which the feet settle.
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
    """Detects a push above a force limit, at which a robot stops.

    The median over `SPAN` counts, so that the impact on an object does not trigger it.

    Args:
        limit: Force limit, N.
        dt: Time step, s.
    """

    SPAN = 0.05
    """Time span of the median, s."""

    def __init__(self, limit: float, dt: float) -> None:
        self._limit, self._forces = limit, deque[float](maxlen=max(3, round(self.SPAN / dt)))

    def reset(self) -> None:
        """Drop all recorded forces."""
        self._forces.clear()

    def exceeded(self, fx: float, fy: float) -> bool:
        """Record the force of a time step, N; return whether the median exceeds the limit."""
        if math.isinf(self._limit):
            return False
        self._forces.append(math.hypot(fx, fy))
        full = len(self._forces) == self._forces.maxlen
        return full and 2 * sum(force > self._limit for force in self._forces) > len(self._forces)
