"""The robot that carries the plate, in a scenario file; its frame is the plate's."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, model_validator

from pushplan.scenario.schema import types as t
from pushplan.scenario.schema.objects import DRIVE, POLYGON, Drive

MOST_PARTS = 50


class FootprintPart(t.Strict):
    """A box about its frame's origin, or a polygon in its frame; the pose of the frame is stated in the plate's."""

    model_config = t.exactly_one("box", "polygon")

    box: t.Box | None = Field(default=None, description="[length along x, width along y]")
    polygon: t.Polygon | None = Field(default=None, description=POLYGON)
    pose: t.Pose = Field(
        default=(0.0, 0.0, 0.0), description="[x, y, theta] in the frame of the plate's front edge"
    )

    @model_validator(mode="after")
    def _one(self) -> FootprintPart:
        t.require_one(self, "box", "polygon")
        return self


def _one_or_several(value: Any) -> str:
    return "<list>" if isinstance(value, list | tuple) else "<mapping>"


Footprint = Annotated[
    Annotated[FootprintPart, Tag("<mapping>")]
    | Annotated[Annotated[tuple[FootprintPart, ...], t.Several(1, MOST_PARTS)], Tag("<list>")],
    Discriminator(_one_or_several),
]


class Robot(t.Strict):
    """What carries the plate, its shape and its drive."""

    footprint: Footprint | None = Field(
        default=None,
        description=f"{{box: [length, width], pose: [x, y, theta]}}, {{polygon: [[x, y], ...]}} or a list of 1 to "
        f"{MOST_PARTS} of these",
    )
    drive: Drive | None = Field(default=None, description=DRIVE)
    start: t.Pose | None = Field(
        default=None, description="[x, y, theta] of the plate's frame in the world; asks for several pushes"
    )
    base: t.Pose | None = Field(
        default=None,
        description="[x, y, theta] in the plate's frame of the frame that path followers steer; default: the axle",
    )
