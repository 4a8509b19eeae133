"""What each cell of an occupancy map is, from the grey values of its picture, as Nav2's map_server reads them."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from pushplan.errors import ImportedFileError
from pushplan.util.arrays import BoolArray, FloatArray

MOST_CELLS = 1 << 26
"""Cells up to which a map is read."""

FORMATS = ("PPM", "PNG", "BMP")
"""Decoders of Pillow that may be used, PGM is read by PPM's; the one for EPS, for example, starts Ghostscript."""

UNKNOWN_GREY = 205
"""map_saver writes this for what is unknown, with thresholds by which it would be free: 50/255 < 0.25."""

HUNDRED = 100.0
"""In the mode raw the grey value is the occupancy in per cent; larger values say that nothing is known."""


class Cells(NamedTuple):
    """Which cells (rows from the bottom, columns) are occupied, and of which nothing is known for certain."""

    occupied: BoolArray
    unknown: BoolArray


def cells_of(picture: bytes, name: str, mode: str, negate: bool, occupied: float, free: float) -> Cells:
    """Return what the cells of a picture are.

    In the modes trinary and scale the occupancy is the darkness, or the brightness if `negate`; what lies between
    the thresholds is neither known to be free nor to be occupied. A transparent cell is unknown in every mode, one of
    the grey value 205 in trinary, whatever the thresholds say.

    Args:
        picture: A PGM, PPM, PNG or BMP file.
        name: What messages call it.
        mode: trinary, scale or raw.
        negate: Whether bright cells are occupied.
        occupied: Occupancy from 0 to 1 above which a cell is occupied.
        free: Occupancy below which it is free.

    Raises:
        ImportedFileError: When the picture cannot be read.
    """
    grey, hidden = _grey(picture, name)
    shade = grey if negate else 255.0 - grey
    if mode == "raw":
        occupancy, unknown = shade / HUNDRED, shade > HUNDRED
    else:
        occupancy, unknown = shade / 255.0, np.full(shade.shape, False)
    if mode == "trinary":
        unknown |= grey == UNKNOWN_GREY
    unknown |= hidden
    taken = (occupancy > occupied) & ~unknown
    return Cells(taken[::-1], (~taken & ~((occupancy < free) & ~unknown))[::-1])


def _grey(picture: bytes, name: str) -> tuple[FloatArray, BoolArray]:
    """Return the grey values (rows from the top, columns) of a picture, and where it is not opaque."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(picture), formats=FORMATS) as image:
            if image.width * image.height > MOST_CELLS:
                raise ImportedFileError(
                    f"{name}: has {image.width} x {image.height} cells; allowed: {MOST_CELLS} cells"
                )
            values: npt.NDArray[Any] = np.asarray(image.convert("RGBA"), dtype=np.uint8)
    except ImportedFileError:
        raise
    except UnidentifiedImageError as error:
        raise ImportedFileError(f"{name}: is no PGM, PPM, PNG or BMP picture; others are not read") from error
    except Exception as error:  # Pillow's plugins raise whatever they stumble over
        raise ImportedFileError(f"{name}: cannot read the picture: {error}") from error
    return values[:, :, :3].mean(axis=2, dtype=np.float64), values[:, :, 3] < 255
