"""What was measured of one push: where the plate and the objects were, and with which force the plate pushed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class Course:
    """Poses in the world, and wrenches, measured at the same times.

    Attributes:
        plate_poses: (m, 3) of the chain frame, that is of the plate.
        object_poses: (m, n, 3) of the objects' own frames.
        name: What messages call it.
        wrenches: (m, 3) with which the plate pushes on all that it touches, in the chain frame, about its origin:
            N, N, N m. None where nobody measured.

    Raises:
        PushplanError: When there are fewer than three, or they are not finite.
    """

    plate_poses: FloatArray
    object_poses: FloatArray
    name: str = "course"
    wrenches: FloatArray | None = None

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
        if self.wrenches is not None:
            wrenches = frozen(self.wrenches, (len(plate), 3), f"{self.name}: wrenches of the plate")
            object.__setattr__(self, "wrenches", wrenches)

    def pieces(self, reach: float, step: float, way: float) -> list[Course]:
        """Return the course cut into shorter ones, of poses between which something moves.

        What is predicted over a long way depends on the last bit of where it began; every piece begins anew where
        the objects were seen.

        Args:
            reach: Distance of the farthest corner from the plate's reference, m.
            step: Way of that corner between two poses at least, m.
            way: Its way in a piece at most, about, m.
        """
        moved = se2.log(se2.relative(self.plate_poses[:-1], self.plate_poses[1:]))
        gone = np.concatenate(
            [[0.0], np.cumsum(np.hypot(moved[:, 0], moved[:, 1]) + reach * np.abs(moved[:, 2]))]
        )
        # Poses at every multiple of the step of the way gone, also where rounding puts one just before it.
        marks = np.floor(gone / step * (1.0 + 1e-9))
        kept = np.flatnonzero(np.diff(marks, prepend=-1.0) > 0)
        count = max(1, int(np.ceil(gone[-1] / way)))
        cuts = np.unique(
            np.searchsorted(gone[kept], gone[-1] * np.arange(count + 1) / count).clip(max=len(kept) - 1)
        )
        return [
            Course(
                self.plate_poses[these],
                self.object_poses[these],
                self.name,
                None if self.wrenches is None else self.wrenches[these],
            )
            for a, b in pairwise(cuts)
            if len(these := kept[a : b + 1]) > 2
        ]
