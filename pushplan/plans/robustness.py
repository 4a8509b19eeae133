"""How far single numbers of a chain may be off before a plan loses a contact, as numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import degrees, floor, log10, pi, radians

from pushplan.errors import PushplanError
from pushplan.util.arrays import plain_number

MOST_SHARE = 1.0
"""Share of a floor friction, or of a load, up to which changes are looked at."""

MOST_ANGLE = pi / 2
"""Angle up to which turned objects are looked at, rad."""


SHARES = "contact_friction", "floor_friction", "mass", "load"
"""Of what may be off, those that are shares."""


@dataclass(frozen=True)
class TrialUncertainty:
    """By how much sampled worlds differ; every number is drawn evenly from its interval, each on its own.

    Shares are of what a scenario states, of the middle where it states an interval.

    Attributes:
        contact_friction: Share by which every contact's coefficient may be off, below 1.
        floor_friction: The same of every object's coefficient with the floor.
        mass: The same of every object's mass.
        load: Largest share by which the outermost pressure under an object is off: its load leans to a random side.
        position: How far an object may stand aside along its contact, m.
        angle: How far an object may be turned so that one end of its contact still touches, rad.
    """

    contact_friction: float = 0.2
    floor_friction: float = 0.2
    mass: float = 0.0
    load: float = 0.1
    position: float = 1e-3
    angle: float = 0.005

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0.0 <= value < 1.0:
                units = {"position": " m: 5 mm is 5mm", "angle": " rad: a degree is 1deg"}
                unit = units.get(field.name, "; it is a share: 20 % is 0.2, or 20% in a command")
                raise PushplanError(
                    f"{field.name} of the trials' uncertainty is {value}; it must be from 0 to below 1{unit}"
                )
            object.__setattr__(self, field.name, plain_number(value))

    @property
    def words(self) -> str:
        """The intervals for people, of what may be off."""
        shares = {name.replace("_", " "): getattr(self, name) for name in SHARES}
        told = [f"{name} ±{100 * share:.3g} %" for name, share in shares.items() if share]
        told += [f"objects aside ±{1e3 * self.position:.3g} mm"] if self.position else []
        told += [f"objects turned ±{degrees(self.angle):.2g} deg"] if self.angle else []
        return ", ".join(told) or "nothing is off"


BOX = TrialUncertainty(contact_friction=0.2, floor_friction=0.2, load=0.1, position=3e-3, angle=radians(2.0))
"""What `Robustness.joint` is a multiple of, where the scenario states no intervals."""

BOX_WORDS = (
    f"(friction {100.0 * BOX.contact_friction:.3g} %, load {100.0 * BOX.load:.3g} %, "
    f"{1e3 * BOX.position:.3g} mm, {degrees(BOX.angle):.3g} deg)"
)
"""The same for people."""


@dataclass(frozen=True)
class Robustness:
    """How far numbers of the chain may be off before a contact's margin is used up on the way.

    With inertia, at the planned speeds and whatever lower ones.

    But for `joint` each alone, all others nominal; None where the loads on the floor are not known, or where a push
    may lift a part: any pressure with the load's centre may be the real one then, and no nominal one is off. A plan
    on which a contact does not hold even with the nominal numbers tolerates nothing: 1 for the contact friction, 0
    for the others.

    Attributes:
        contact_friction: Smallest factor, in [0, 1], of all contact frictions together, the plate's included.
        floor_friction: Largest share by which the floor friction of any single object may be higher or lower; at
            `MOST_SHARE` it may be more.
        load: Largest share by which the outermost load of any single object may be higher or lower when its load
            leans to either side, the front or the back, its centre of mass with it; at `MOST_SHARE` it may be more.
        position: How far any single object may stand aside along its contact, what it carries staying in
            place, m.
        angle: How far any single object may be turned about the middle of its contact, with all that it carries,
            rad; at `MOST_ANGLE` it may be more.
        joint: Largest scale of `BOX`, or of the intervals that the scenario states, at which all of its numbers may
            be off at once, in any combination.
    """

    contact_friction: float | None = None
    floor_friction: float | None = None
    load: float | None = None
    position: float | None = None
    angle: float | None = None
    joint: float | None = None

    @property
    def used_up(self) -> bool:
        """Whether a contact does not hold even with the nominal numbers."""
        return self.contact_friction == 1.0 and self.floor_friction == 0.0

    @property
    def known(self) -> bool:
        """Whether it could be worked out."""
        return self.contact_friction is not None

    def sentence(self, beyond: bool = False) -> str:
        """Return the numbers for people, in lines; bounds are rounded towards what holds.

        Args:
            beyond: Whether intervals were stated: the contact friction is the lowest one then, which holds already,
                and all other numbers are the middle ones.
        """
        if (
            self.contact_friction is None
            or self.floor_friction is None
            or self.load is None
            or self.position is None
            or self.angle is None
        ):
            return "not known, as the loads on the floor are not, or may lift"
        if self.used_up:
            return "none: with inertia, a contact does not hold even with the stated numbers"
        of = " of the lowest stated" if beyond else ""
        turned = f"{_down(degrees(self.angle))} deg{' or more' if self.angle >= MOST_ANGLE else ''}"
        lines = [
            f"one at a time: contact friction -{_share(1.0 - self.contact_friction)}{of},",
            f"floor friction ±{_share(self.floor_friction)}, load ±{_share(self.load)},",
            f"position {_down(1e3 * self.position)} mm, heading {turned}",
        ]
        if self.joint is not None:
            lines[-1] += ";"
            lines.append(f"all together: {_down(self.joint)} x {'the stated intervals' if beyond else BOX_WORDS}")
        return "\n".join(lines)


USED_UP = Robustness(contact_friction=1.0, floor_friction=0.0, load=0.0, position=0.0, angle=0.0, joint=0.0)
"""What a plan tolerates on which a contact does not hold with the nominal numbers."""


def _down(value: float) -> str:
    """Return a number in two digits, never higher than it is but for rounding."""
    if value < 1e-9:
        return "0"
    unit = 10.0 ** (floor(log10(value)) - 1)
    lower = floor(value / unit * (1.0 + 1e-12)) * unit
    return f"{lower:.0f}" if lower >= 10.0 else f"{lower:.2g}"


def _share(value: float) -> str:
    return f"{_down(100.0 * value)} %{' or more' if value >= MOST_SHARE else ''}"
