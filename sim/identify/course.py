"""What was measured of one push: where the plate and the objects were."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.basics.arrays import FloatArray, frozen
from pushplan.errors import PushplanError
from pushplan.geometry import se2


@dataclass(frozen=True, eq=False)
class Course:
    """Poses in the world, measured at the same times.

    Attributes:
        plate_poses: (m, 3) of the chain frame, that is of the plate.
        object_poses: (m, n, 3) of the objects' own frames.
        name: What messages call it.

    Raises:
        PushplanError: When there are fewer than three, or they are not finite.
    """

    plate_poses: FloatArray
    object_poses: FloatArray
    name: str = "course"

    def __post_init__(self) -> None:
        plate, objects = np.asarray(self.plate_poses), np.asarray(self.object_poses)
        if objects.ndim != 3 or plate.shape != (len(objects), 3) or objects.shape[2] != 3:
            raise PushplanError(
                f"{self.name}: poses of the plate have shape {plate.shape} and those of the objects "
                f"{objects.shape}; they must be (m, 3) and (m, n, 3)"
            )
        if len(plate) < 3:
            raise PushplanError(f"{self.name}: there are {len(plate)} measured poses; 3 is the least")
        object.__setattr__(self, "plate_poses", frozen(plate, (None, 3), f"{self.name}: poses of the plate"))
        shape = (len(plate), objects.shape[1], 3)
        object.__setattr__(self, "object_poses", frozen(objects, shape, f"{self.name}: poses of the objects"))

    def thinned(self, reach: float, step: float) -> Course:
        """Return the course with poses between which no point within `reach` of the plate moves less than `step`."""
        moved = se2.log(se2.relative(self.plate_poses[:-1], self.plate_poses[1:]))
        way = np.cumsum(np.hypot(moved[:, 0], moved[:, 1]) + reach * np.abs(moved[:, 2]))
        marks = np.floor(way / step * (1.0 + 1e-9))
        kept = np.flatnonzero(np.diff(np.concatenate([[-1.0], np.concatenate([[0.0], marks])])) > 0)
        kept = np.union1d(kept, [len(self.plate_poses) - 1])
        return Course(self.plate_poses[kept], self.object_poses[kept], self.name) if len(kept) > 2 else self

    def slip(self) -> float:
        """Return how far objects moved on the plate at most, m and rad as if a rad were 0.1 m: what tells anything."""
        on_plate = se2.relative(self.plate_poses[:, None], self.object_poses)
        off = on_plate - on_plate[0]
        off[..., 2] = 0.1 * se2.wrap_angle(off[..., 2])
        return float(np.linalg.norm(off, axis=-1).max())
