"""What a controller is told about its sensor, and when it acts."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from pushplan.errors import PushplanError
from pushplan.util.arrays import frozen, plain_number

SIGMAS = 6.0
"""Standard deviations of a mean by which a contact may seem to be open and count as closed."""
LEAST_GAP, LEAST_TURN = 8e-4, 5e-3
"""Gap (m) and turn (rad) that count as closed however well objects are measured."""

_LEAST = {"position_noise": 0, "angle_noise": 0, "friction": 0, "replans": 0, "looks": 2}
"""Least values of what need not be above 0."""
_MOST = {"friction": 1.0, "rate": 1e4, "looks": 1000, "patience": 60.0}
"""What values have to be below."""


@dataclass(frozen=True)
class ControlSettings:
    """Settings of a controller.

    Attributes:
        rate: Twists per second, Hz.
        position_noise: Standard deviation of each coordinate of a measured position, m.
        angle_noise: Standard deviation of a measured angle, rad.
        looks: Measurements at rest that a decision rests on; while it pushes, three quarters of them have to agree.
        position_slack: How far an object may be away from its pose in the plan while the plan goes on, m.
        angle_slack: By what angle it may be, rad.
        position_tolerance: Distance from its goal within which the goal's object has arrived, m. The goal's own
            tolerance counts where it is wider.
        angle_tolerance: The same of the angle, rad.
        friction: Share by which coefficients of friction may be off; pushes that close contacts are proven for it.
        time_limit: Wall-clock time that the search of a plan may take, s.
        replans: So many plans are made after the first one, at most.
        detour: Travel of the plate in all, at most: so many times that of the first plan, and m beyond. The same
            holds of each push against its own plan.
        worth: Travel (m) that it is worth to come nearer to the goal by as much as its tolerance; less error beyond
            is worth less, but always half a metre.
        patience: Time without a measurement after which the plate stands still until one comes, s.
        outage: Time without a measurement after which the controller gives up, s.
        bias: Standard deviation of what is measured of an object beside its noise, always the same, m and rad.
        start_error: Likewise of where the plate is at first, m and rad.
        approach_error: Likewise of where it is against an object that it has driven up to, m and rad.
        delay_error: Likewise of the times of measurements, s.
        late: By how much measurements without times come late, and by what that may be off, s.
        odometry_error: Standard deviation of the share that the plate goes too far, or aside.
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
        """Clearance of cautious plans, m: what objects may be off unnoticed, and twice the error of a camera."""
        return self.position_slack + 2.0 * self.bias[0]

    @property
    def gap(self) -> float:
        """Gap up to which a contact that was looked at counts as closed, m."""
        return max(LEAST_GAP, SIGMAS / math.sqrt(self.looks) * self.position_noise)

    @property
    def turn(self) -> float:
        """Turn up to which it does, rad."""
        return max(LEAST_TURN, SIGMAS / math.sqrt(self.looks) * self.angle_noise)

    def most(self, travel: float) -> float:
        """Return what travel is allowed where a plan takes so much, m."""
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
    """Return a distance (m) and an angle (rad) for people."""
    return f"{1e3 * distance:.1f} mm and {math.degrees(angle):.2f} deg"
