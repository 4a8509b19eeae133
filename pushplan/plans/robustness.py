"""Robustness: the model errors that a plan tolerates before it loses a contact, as numbers and as text."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import degrees, floor, log10, pi, radians

from pushplan.errors import PushplanError
from pushplan.util.arrays import plain_number

MOST_SHARE = 1.0
"""Largest examined change of a floor friction or a load, as a share."""

MOST_ANGLE = pi / 2
"""Largest examined angle of an object, rad."""


SHARES = "contact_friction", "floor_friction", "mass", "load"
"""Uncertain quantities that are given as shares."""


@dataclass(frozen=True)
class TrialUncertainty:
    """Half widths of the intervals from which Monte Carlo samples draw, uniformly and independently.

    Shares refer to the scenario's value, or to the middle of its interval.

    Attributes:
        contact_friction: Share of every contact's friction coefficient, below 1.
        floor_friction: Share of every object's friction coefficient with the floor, below 1.
        mass: Share of every object's mass, below 1.
        load: Largest share by which the outermost pressure under an object changes: its load shifts to a random side.
        position: Largest lateral offset of an object along its contact, m.
        angle: Largest angle of an object, turned so that one end of its contact still touches, rad.
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
                units = {"position": " m (5 mm is 5mm)", "angle": " rad (a degree is 1deg)"}
                unit = units.get(field.name, "; it is a share: 20 % is 0.2, or 20% in a command")
                raise PushplanError(
                    f"{field.name} of the trials' uncertainty is {value}; it must be from 0 to below 1{unit}"
                )
            object.__setattr__(self, field.name, plain_number(value))

    @property
    def words(self) -> str:
        """Text of the intervals."""
        shares = {name.replace("_", " "): getattr(self, name) for name in SHARES}
        parts = [f"{name} ±{100 * share:.3g} %" for name, share in shares.items() if share]
        parts += [f"object position ±{1e3 * self.position:.3g} mm"] if self.position else []
        parts += [f"object heading ±{degrees(self.angle):.2g} deg"] if self.angle else []
        return ", ".join(parts) or "no model errors"


BOX = TrialUncertainty(contact_friction=0.2, floor_friction=0.2, load=0.1, position=3e-3, angle=radians(2.0))
"""Unit of `Robustness.joint` if the scenario states no intervals."""

BOX_WORDS = (
    f"(friction {100.0 * BOX.contact_friction:.3g} %, load {100.0 * BOX.load:.3g} %, "
    f"{1e3 * BOX.position:.3g} mm, {degrees(BOX.angle):.3g} deg)"
)
"""Text of `BOX`."""


@dataclass(frozen=True)
class Robustness:
    """Largest model errors at which every contact of the plan keeps a positive margin.

    Inertia is included, at the planned speeds and all lower ones.

    Except for `joint`, each error is alone and all other numbers are nominal. Values are None if the loads on the
    floor are unknown, or if a push can lift a part: then there is no nominal pressure to vary. If a contact does not
    hold even with the nominal numbers, the factor of the contact friction is 1 and the other values are 0.

    Attributes:
        contact_friction: Smallest factor, in [0, 1], on all contact frictions together, including the plate's.
        floor_friction: Largest change of the floor friction of any single object, as a share; `MOST_SHARE` means that
            or more.
        load: Largest change of the outermost load of any single object, as a share, if its load and centre of mass
            shift to any side; `MOST_SHARE` means that or more.
        position: Largest lateral offset of any single object along its contact, m; the objects that it pushes stay
            in place.
        angle: Largest rotation of any single object about the middle of its contact, with all objects that it
            pushes, rad; `MOST_ANGLE` means that or more.
        joint: Largest factor on `BOX`, or on the scenario's intervals, within which all errors together, in any
            combination, are tolerated.
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
        """Whether the robustness could be computed."""
        return self.contact_friction is not None

    def sentence(self, beyond: bool = False) -> str:
        """Return the robustness as text in lines; numbers are rounded down to be safe.

        Args:
            beyond: Whether the scenario states intervals: errors then start from the lowest contact friction and
                from the middles of all other intervals.
        """
        if (
            self.contact_friction is None
            or self.floor_friction is None
            or self.load is None
            or self.position is None
            or self.angle is None
        ):
            return "unknown, because a load on the floor is unknown or can lift"
        if self.used_up:
            return "none: with inertia, a contact does not hold even with the nominal numbers"
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
"""Robustness of a plan on which a contact does not hold with the nominal numbers."""


def _down(value: float) -> str:
    """Return a number with two digits, rounded down."""
    if value < 1e-9:
        return "0"
    unit = 10.0 ** (floor(log10(value)) - 1)
    lower = floor(value / unit * (1.0 + 1e-12)) * unit
    return f"{lower:.0f}" if lower >= 10.0 else f"{lower:.2g}"


def _share(value: float) -> str:
    return f"{_down(100.0 * value)} %{' or more' if value >= MOST_SHARE else ''}"
