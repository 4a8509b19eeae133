"""Table of the sampled series in a log, of executions and of measurements.

Each entry belongs to an array of `Execution` or `Measured`. Writer, reader, verification, messages, tables, the page
and docs/logs.md use this table. An array without an entry, or an invalid entry, is an error at import.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pushplan.logging.shown import CHAIN
from pushplan.plans.execution import Execution
from pushplan.plans.run import Measured
from pushplan.util.names import PUSHER

MARGINS = "/margins"
"""Topic of margins, forces and further data of all contacts."""


@dataclass(frozen=True)
class Signal:
    """A recorded series: an array whose first axis counts samples.

    Attributes:
        name: Name of the field of `Execution` or `Measured`.
        quantity: Name of the quantity in reports.
        unit: SI units of the columns.
        columns: Columns of the table, behind `NAME.` for objects and contacts; two of a contact end in `_x` and `_y`.
        of: Owner of the series; arrays of objects and contacts have an axis of them behind that of the samples.
        topic: Topic for viewers; empty for none.
        frame: Frame of the messages on a separate topic, with the columns as fields; empty if `topics` builds others.
        page: Whether the page has it; a single number of the plate is shown beside the time.
        decided: Whether it follows from scenario and plan, so that verification compares it.
        since: Revision that introduced it: `schemas.REVISION` plus 1 at that time.
        dtype: Type of the array.
    """

    name: str
    quantity: str
    unit: str
    columns: tuple[str, ...]
    of: Literal["plate", "object", "contact"] = "plate"
    topic: str = ""
    frame: str = ""
    page: bool = False
    decided: bool = True
    since: int = 0
    dtype: type = np.float64

    def shape(self, samples: int | str, objects: int | str) -> tuple[int | str, ...]:
        """Return the shape of the array."""
        own = () if self.of == "plate" else (objects,)
        return (samples, *own, *((len(self.columns),) if len(self.columns) > 1 else ()))

    @property
    def field(self) -> str:
        """Name of the field of a contact's message."""
        return self.columns[0] if len(self.columns) == 1 else self.columns[0].removesuffix("_x")


_POSE = ("m, m, rad", ("x", "y", "theta"))
_TABLE: dict[type, tuple[Signal, ...]] = {
    Execution: (
        Signal("t", "time", "s", ("t",), page=True),
        Signal("segment", "segment", "", ("segment",), page=True, dtype=np.int64),
        Signal("poses", "pose", *_POSE, topic="/tf", page=True),
        Signal("twists", "twist", "m/s, m/s, rad/s", ("vx", "vy", "omega"), topic="/pusher/twist", frame=PUSHER),
        Signal("wrenches", "wrench", "N, N, N m", ("fx", "fy", "torque"), topic="/pusher/wrench", frame=CHAIN),
        Signal("needed_forces", "force of the plate", "N", ("needed_force",)),
        Signal("objects", "pose of an object", *_POSE, "object", "/tf", page=True),
        Signal("margins", "margin", "", ("margin",), "contact", MARGINS, page=True),
        Signal("dynamic_margins", "margin with inertia", "", ("dynamic_margin",), "contact"),
        Signal("friction_margins", "friction margin", "rad", ("friction_margin",), "contact", MARGINS),
        Signal("lambdas", "point of application (lambda)", "", ("lambda",), "contact", MARGINS, page=True),
        Signal("forces", "contact force", "N", ("force_x", "force_y"), "contact", MARGINS, page=True),
    ),
    Measured: (
        Signal("t", "time of a measurement", "s", ("t",), decided=False),
        Signal("poses", "measured pose", *_POSE, "object", "/measured", decided=False),
    ),
}
SIGNALS = {kind: {signal.name: signal for signal in signals} for kind, signals in _TABLE.items()}
"""Series by record and name. New ones must be last, because the fields of a contact's message have this order."""


def series_of(record: Execution | Measured) -> list[tuple[Signal, NDArray[Any]]]:
    """Return the series of a record, in the order of the table."""
    table = SIGNALS[Measured if isinstance(record, Measured) else Execution]
    return [(signal, getattr(record, name)) for name, signal in table.items() if getattr(record, name) is not None]


def check_signals(kind: type, table: Mapping[str, Signal]) -> None:
    """Raise TypeError if an array of a record has no entry, an entry has no array, or an entry is invalid."""
    arrays, latest = {field.name: field for field in fields(kind) if "array" in str(field.type).lower()}, 0
    for name in arrays.keys() ^ table.keys():
        raise TypeError(f"series {name!r} must be a field of {kind.__name__} and in logging/signals.py")
    for name, one in table.items():
        if one.since < latest or (one.since and arrays[name].default is MISSING):
            raise TypeError(f"series {name!r}: newer series must be last and have the default None")
        if (one.topic == MARGINS) != (one.of == "contact" and one.topic != "") or (one.frame and one.of != "plate"):
            raise TypeError(f"series {name!r}: contacts must be on {MARGINS}; only the plate has separate topics")
        latest = one.since


for _kind, _signals in SIGNALS.items():
    check_signals(_kind, _signals)
