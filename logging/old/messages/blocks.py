"""Arrays of doubles in a message, bit for bit and small: byte planes, as Parquet's BYTE_STREAM_SPLIT.

The columns of an (m, ...) array are laid one after another as little-endian doubles; then byte 0 of every
number is stored, byte 1 of every number, and so on. Neighbouring samples share their high bytes, so the
planes compress well, and one line of NumPy reads them back.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.logging.old.messages.schemas import Array, MessageClass
from pushplan.util.arrays import FloatArray

_WIDTH = 8


def encode(name: str, values: FloatArray) -> MessageClass:
    """Return the `Array` message that holds `values` (m, ...), not empty, under `name`."""
    columns = np.ascontiguousarray(values.reshape(len(values), -1).T, dtype="<f8")
    planes = columns.view(np.uint8).reshape(-1, _WIDTH).T.tobytes()
    return Array(name=name, shape=values.shape, planes=planes)


def decode(message: MessageClass) -> FloatArray:
    """Return the array (m, ...) that `message` holds.

    Raises:
        ValueError: When the number of bytes does not fit the shape, or the array is empty.
    """
    shape = tuple(message.shape[:4])
    needed = math.prod(shape) * _WIDTH
    if not 1 <= len(shape) <= 3 or needed == 0 or needed != len(message.planes):
        raise ValueError(f"array {message.name!r} of shape {shape} cannot have {len(message.planes)} bytes")
    planes = np.frombuffer(message.planes, dtype=np.uint8).reshape(_WIDTH, -1)
    columns = np.ascontiguousarray(planes.T).view("<f8").reshape(-1, shape[0])
    return np.ascontiguousarray(columns.T, dtype=np.float64).reshape(shape)
