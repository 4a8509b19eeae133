"""Measured pressure distributions as CSV files."""

from __future__ import annotations

import csv
import io
import math
from array import array

import numpy as np

from pushplan.errors import SupportError
from pushplan.util.arrays import FloatArray


def parse_pressure_map(data: bytes, path: str) -> FloatArray:
    """Return the (k, 3) rows x (m), y (m), pressure (>= 0) of a CSV file with those three named columns.

    Args:
        data: What the file holds.
        path: What messages call it.

    Raises:
        SupportError: With file and line, when a value is not allowed.
    """
    try:
        reader = csv.reader(io.StringIO(data.decode("utf-8"), newline=""))
        header = [cell.strip().lower() for cell in next(filter(None, reader), [])]
    except (UnicodeDecodeError, csv.Error) as error:
        raise SupportError(f"{path}: cannot read the pressure map: {error}") from error
    if sorted(header) != ["pressure", "x", "y"]:
        raise SupportError(f"{path}:1: the header is {','.join(header)!r}; it must name x, y and pressure")
    order = [header.index(name) for name in ("x", "y", "pressure")]
    numbers = array("d")  # not a list of lists: a map of 16 MB would take 600
    try:
        for cells in filter(None, reader):
            numbers.extend(_map_row(path, reader.line_num, cells, order))
    except csv.Error as error:
        raise SupportError(f"{path}: cannot read the pressure map: {error}") from error
    return np.array(numbers, dtype=np.float64).reshape(-1, 3)


def _map_row(path: str, number: int, cells: list[str], order: list[int]) -> list[float]:
    if len(cells) != 3:
        raise SupportError(f"{path}:{number}: {len(cells)} cells; there must be 3 (x, y, pressure)")
    try:
        values = [float(cells[i]) for i in order]
    except ValueError as error:
        raise SupportError(f"{path}:{number}: {error}") from error
    if not all(map(math.isfinite, values)) or values[2] < 0.0:
        raise SupportError(f"{path}:{number}: x, y and pressure must be finite and pressure >= 0: {values}")
    return values
