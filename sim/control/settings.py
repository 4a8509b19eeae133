"""Settings of the closed loop: sensor errors, limits and thresholds."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from pushplan.errors import PushplanError
from pushplan.util.arrays import frozen, plain_number

SIGMAS = 6.0
"""Standard deviations of a mean up to which the measured gap of a contact counts as closed."""
LEAST_GAP, LEAST_TURN = 8e-4, 5e-3
"""Gap (m) and turn (rad) that always count as closed, even with exact measurements."""

_LEAST = {"position_noise": 0, "angle_noise": 0, "friction": 0, "replans": 0, "looks": 2}
"""Smallest values of settings that can be 0 or have a larger minimum; all others must be above 0."""
_MOST = {"friction": 1.0, "rate": 1e4, "looks": 1000, "patience": 60.0}
"""Exclusive upper limits; 1e6 for all others."""


@dataclass(frozen=True)
class ControlSettings:
    """Settings of a controller.

    Attributes:
        rate: Twists per second, Hz.
        position_noise: Standard deviation of each coordinate of a measured position, m.
        angle_noise: Standard deviation of a measured angle, rad.
        looks: Number of measurements at rest for a decision; in a push, three quarters of them must agree.
        position_slack: Largest deviation of an object from its planned position in a push, m.
        angle_slack: Largest deviation of an object from its planned angle in a push, rad.
        position_tolerance: Distance from the goal at which the goal's object has arrived, m. A wider tolerance of the
            goal replaces it.
        angle_tolerance: Angle from the goal at which the goal's object has arrived, rad, or a wider one of the goal.
        friction: Relative error of the friction coefficients; closing pushes are tested for it.
        time_limit: Wall-clock time of a search, s.
        replans: Largest number of replans.
        detour: Largest travel of the plate: a factor of the first plan, plus a distance in m. Each push has the
            same limit relative to its own plan.
        worth: Largest travel (m) of a replan that reduces an error by the goal's tolerance. Half a metre is always
            allowed.
        patience: Time without a measurement after which the plate stops, s.
        outage: Time without a measurement after which the controller gives up, s.
        bias: Standard deviation of the constant error of an object's measurements, m and rad.
        start_error: Standard deviation of the start pose of the plate, m and rad.
        approach_error: Standard deviation of the pose of the plate relative to an object after a transit, m and rad.
        delay_error: Standard deviation of the times of measurements, s.
        late: Delay of measurements without times, and its standard deviation, s.
        odometry_error: Standard deviation of the relative error of the wheels, ahead and sideways.
    """

    rate: float = 50.0
    position_noise: float = 1e-3
    angle_noise: float = math.radians(0.3)
    looks: int = 16
    position_slack: float = 2.5e-3
    angle_slack: float = math.radians(0.5)
    position_tolerance: float = 5e-3
    angle_tolerance: float = math.radians(1.0)
    friction: float = 0.2
    time_limit: float = 0.06
    replans: int = 30
    detour: tuple[float, float] = (2.0, 1.0)
    worth: float = 2.0
    patience: float = 0.5
    outage: float = 60.0
    bias: tuple[float, float] = (2e-3, math.radians(0.6))
    start_error: tuple[float, float] = (4e-3, math.radians(0.6))
    approach_error: tuple[float, float] = (4e-3, math.radians(1.5))
    delay_error: float = 0.03
    late: float = 0.1
    odometry_error: float = 0.015

    @property
    def room(self) -> float:
        """Clearance of cautious plans, m: unnoticed deviation of objects plus twice the error of the camera."""
        return self.position_slack + 2.0 * self.bias[0]

    @property
    def gap(self) -> float:
        """Largest measured gap of a closed contact, m."""
        return max(LEAST_GAP, SIGMAS / math.sqrt(self.looks) * self.position_noise)

    @property
    def turn(self) -> float:
        """Largest measured turn of a closed contact, rad."""
        return max(LEAST_TURN, SIGMAS / math.sqrt(self.looks) * self.angle_noise)

    def most(self, travel: float) -> float:
        """Return the largest travel, m, for a plan with `travel`, m."""
        return self.detour[0] * travel + self.detour[1]

    def __post_init__(self) -> None:
        for field in fields(self):
            value, least = plain_number(getattr(self, field.name)), _LEAST.get(field.name)
            object.__setattr__(self, field.name, value)
            if field.name in ("detour", "bias", "start_error", "approach_error"):
                object.__setattr__(self, field.name, tuple(frozen(value, (2,), field.name).tolist()))
                value = min(getattr(self, field.name))
            whole = field.name in ("looks", "replans")
            number = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
            most = _MOST.get(field.name, 1e6)
            if not (number and (value > 0.0 if least is None else value >= least) and value < most):
                allowed = "> 0" if least is None else f">= {least}"
                raise PushplanError(
                    f"{field.name} of the control settings is {value}; it must be {'whole, ' * whole}{allowed} and "
                    f"below {most:g}"
                )


def words(distance: float, angle: float) -> str:
    """Return a distance (m) and an angle (rad) as text in mm and deg."""
    return f"{1e3 * distance:.1f} mm and {math.degrees(angle):.2f} deg"
