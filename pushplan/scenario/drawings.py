"""Reads outlines of objects and obstacles from SVG drawings and CSV tables."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapely

from pushplan.errors import ImportedFileError
from pushplan.geometry.polygon import simple_polygon
from pushplan.scenario.maps import bytes_of
from pushplan.util.arrays import FloatArray
from pushplan.util.naming import optional

MOST_BYTES = 16 << 20
"""Largest size of a file, bytes."""

MOST_ELEMENTS = 10_000
"""Largest number of elements of a drawing, including copies by `use`."""

MOST_POINTS = 10_000
"""Largest number of points of a path: 20 times the allowed corners of an object."""

MOST_DEPTH = 100

_DENSE = 1025
"""Number of points of a curve from which the ends of its chords are chosen."""

_NUMBERS = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_POSITIVE = {"width", "height", "r", "rx", "ry"}
_SIZES = _POSITIVE | {"x", "y", "cx", "cy", "x1", "x2", "y1", "y2"}

_PIXELS_PER_METRE = 96.0 / 0.0254  # SVG uses CSS pixels


def read_svg_outlines(path: str | Path, *, tolerance: float = 1e-4, centered: bool = True) -> dict[str, FloatArray]:
    """Read the closed shapes of a drawing, with x to the right and y up.

    Args:
        path: SVG file; its size, e.g. `width="120mm"` with a `viewBox`, defines its units.
        tolerance: Largest distance between a curve and the chords that replace it, m.
        centered: Whether every outline is moved so that its centroid is the origin; otherwise the origin is the
            drawing's upper left corner.

    Returns:
        Counter-clockwise outlines (v, 2), m, by id; shapes without an id are called `shape-1`, `shape-2` and so on.

    Raises:
        MissingExtraError: If svgelements is not installed.
        ImportedFileError: If the file cannot be read, or a shape is not one simple closed outline.
    """
    svg = optional("svgelements", "reading an SVG drawing", "svgelements", "import")
    path = Path(path)
    data = bytes_of(path, MOST_BYTES)
    _check_elements(data, path)
    try:
        drawing = svg.SVG.parse(io.BytesIO(data), ppi=96.0, reify=True)
    except Exception as error:  # the parser and its XML library raise errors of many types
        raise ImportedFileError(f"{path}: cannot read the drawing: {error}") from error
    outlines: dict[str, FloatArray] = {}
    for element in drawing.elements():
        if isinstance(element, svg.Shape) and element.values.get("visibility") != "hidden":
            name = element.id or f"shape-{len(outlines) + 1}"
            corners = _corners(svg.Path(element), f"{path}: {name}", tolerance * _PIXELS_PER_METRE)
            _add(outlines, name, corners * [1.0, -1.0] / _PIXELS_PER_METRE, path, centered)
    if not outlines:
        raise ImportedFileError(f"{path}: the drawing has no shape; needed: a path, polygon, rect, circle or ellipse")
    return outlines


def _check_elements(data: bytes, path: Path) -> None:
    """Check that the drawing can be parsed, does not have too many elements or points, and has valid sizes.

    Raises:
        ImportedFileError: If a check fails.
    """
    if b"<!ENTITY" in data:
        raise ImportedFileError(f"{path}: declares entities, which are not supported; leave them out")
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ImportedFileError(f"{path}: cannot read the drawing: {error}") from error
    named = {element.get("id"): element for element in root.iter() if element.get("id")}
    known: dict[ElementTree.Element, int] = {}

    def count(element: ElementTree.Element, depth: int = 0) -> int:
        """Return the number of elements in an element, including copies by `use`."""
        if depth > MOST_DEPTH:
            raise ImportedFileError(f"{path}: is nested deeper than the {MOST_DEPTH} levels allowed")
        if element not in known:
            href = next((v for k, v in element.attrib.items() if k.rpartition("}")[2] == "href"), "")
            copied = named.get(href.removeprefix("#")) if element.tag.endswith("use") else None
            inner = [*element, *([] if copied is None else [copied])]
            known[element] = 1 + sum(count(child, depth + 1) for child in inner)
        return known[element]

    if count(root) > MOST_ELEMENTS:
        raise ImportedFileError(f"{path}: draws {count(root)} elements; allowed: {MOST_ELEMENTS}")
    for element in root.iter():
        for key in ("d", "points"):
            numbers = len(_NUMBERS.findall(element.get(key, "")))
            if numbers > 2 * MOST_POINTS:
                raise ImportedFileError(
                    f"{path}: {element.get('id', 'a shape')} has {numbers // 2} points; allowed: {MOST_POINTS}; "
                    "simplify the path"
                )
        for key in _SIZES & element.attrib.keys():
            value = element.get(key, "").strip().lower()
            if "nan" in value or "inf" in value or (key in _POSITIVE and value.startswith("-")):
                raise ImportedFileError(
                    f"{path}: {element.get('id', 'a shape')}: {key} is '{value}'; allowed: a finite length"
                    f"{', not below 0' if key in _POSITIVE else ''}"
                )


def read_csv_outlines(path: str | Path, *, centered: bool = False) -> dict[str, FloatArray]:
    """Read outlines from a table with one corner per row: x, y (m) and, for several outlines, name.

    Args:
        path: CSV file.
        centered: Whether every outline is moved so that its centroid is the origin.

    Returns:
        Counter-clockwise outlines (v, 2), m, by name, or by the file's name if there is no such column.

    Raises:
        ImportedFileError: If a value is invalid; the message has file and line.
    """
    path = Path(path)
    corners: dict[str, list[list[float]]] = {}
    for number, row in _rows(path):
        corner = [_number(path, number, column, row[column]) for column in ("x", "y")]
        corners.setdefault((row.get("name") or path.stem).strip(), []).append(corner)
    outlines: dict[str, FloatArray] = {}
    for name, listed in corners.items():
        _add(outlines, name, np.array(listed), path, centered)
    return outlines


def _add(outlines: dict[str, FloatArray], name: str, corners: FloatArray, path: Path, centered: bool) -> None:
    if name in outlines:
        raise ImportedFileError(f"{path}: two shapes are called {name!r}; allowed: each id once")
    try:
        outline = simple_polygon(corners, f"{path}: {name}")
    except ValueError as error:
        raise ImportedFileError(str(error)) from error
    middle = shapely.get_coordinates(shapely.centroid(shapely.Polygon(outline)))[0]
    outlines[name] = outline - middle if centered else np.array(outline)


def _corners(curve: Any, name: str, tolerance: float) -> FloatArray:
    """Return the corners (v, 2) of a closed curve in pixels, with chords in place of arcs and splines."""
    kinds = [type(segment).__name__ for segment in curve]
    if kinds.count("Move") != 1 or kinds[-1] != "Close":
        found = "is open" if kinds.count("Move") == 1 else f"has {kinds.count('Move')} outlines"
        raise ImportedFileError(f"{name}: {found}; allowed: one closed outline")
    corners = np.concatenate([_chords(segment, tolerance) for segment in curve if type(segment).__name__ != "Move"])
    repeated = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) < 1e-6
    distinct: FloatArray = corners[~repeated]
    return distinct


def _chords(segment: Any, tolerance: float) -> FloatArray:
    """Return the ends (k, 2) of chords that approximate a segment, without its first point."""
    if type(segment).__name__ in ("Line", "Close"):
        return np.array([[segment.end.x, segment.end.y]], dtype=np.float64)
    curve = np.asarray(segment.npoint(np.linspace(0.0, 1.0, _DENSE)), dtype=np.float64)
    return np.asarray(shapely.get_coordinates(shapely.simplify(shapely.LineString(curve), tolerance))[1:])


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield the number and the cells of each line below the header."""
    try:
        file = io.StringIO(bytes_of(path, MOST_BYTES).decode("utf-8-sig"), newline="")
        reader = csv.DictReader(file, skipinitialspace=True, restval="")
        header = [name.strip() for name in reader.fieldnames or []]
        if not {"x", "y"} <= set(header):
            raise ImportedFileError(f"{path}:1: the header is {','.join(header)!r}; it must name x and y")
        reader.fieldnames = header
        yield from ((reader.line_num, row) for row in reader)
    except (UnicodeDecodeError, csv.Error) as error:
        raise ImportedFileError(f"{path}: cannot read the table: {error}") from error


def _number(path: Path, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ImportedFileError(f"{path}:{line}: {column} is {text!r}; allowed: a finite number of metres")
    return value
