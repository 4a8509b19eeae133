"""Contacts and overlaps of outlines against shapely, and laws of rigid motion."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from pushplan.geometry import se2
from pushplan.geometry.polygon import (
    TOUCH,
    exit_distance,
    find_flaw,
    find_touch,
    overlap_depth,
)
from pushplan.scenario.layout import box_outline
from pushplan.util.arrays import FloatArray

ANGLES = st.floats(-math.pi, math.pi)
COORDINATES = st.floats(-2.0, 2.0)
SIZES = st.floats(0.02, 1.0)
U_SHAPE = np.array([[0, 0], [1, 0], [1, 1], [0.8, 1], [0.8, 0.2], [0.2, 0.2], [0.2, 1], [0, 1]], dtype=float)


@st.composite
def poses(draw: st.DrawFn) -> FloatArray:
    return np.array([draw(COORDINATES), draw(COORDINATES), draw(ANGLES)])


@st.composite
def stars(draw: st.DrawFn) -> FloatArray:
    """Star-shaped outlines about the origin, mostly not convex."""
    radii = np.array(draw(st.lists(st.floats(0.1, 0.5), min_size=3, max_size=9)))
    angles = 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def moved(outline: FloatArray, x: float, y: float) -> FloatArray:
    return se2.transform_points([x, y, 0.0], outline)


def overlap_area(first: FloatArray, second: FloatArray) -> float:
    return float(shapely.intersection(shapely.Polygon(first), shapely.Polygon(second)).area)


@given(SIZES, SIZES, SIZES, st.floats(-0.9, 0.9), poses())
def test_the_contact_of_flush_boxes_is_what_shapely_intersects(
    length: float, width: float, other: float, share: float, pose: FloatArray
) -> None:
    offset = share * 0.5 * (width + other)
    assume(0.5 * (width + other) - abs(offset) > 1e-3)
    first = se2.transform_points(pose, box_outline(length, width))
    second = se2.transform_points(pose, moved(box_outline(0.1, other), 0.5 * length + 0.05, offset))
    touch = find_touch(first, second)
    assert touch is not None
    ((right, left),) = touch
    local = se2.transform_points(se2.inverse(pose), np.array([right, left]))
    line = shapely.LineString([[0.5 * length, -0.5 * width], [0.5 * length, 0.5 * width]])
    facing = shapely.LineString([[0.5 * length, offset - 0.5 * other], [0.5 * length, offset + 0.5 * other]])
    low, high = np.sort(shapely.get_coordinates(shapely.intersection(line, facing))[:, 1])
    np.testing.assert_allclose(local, [[0.5 * length, low], [0.5 * length, high]], atol=1e-9)


@given(stars(), st.integers(0, 8), st.floats(0.1, 0.9), SIZES, poses())
def test_a_box_laid_on_any_edge_touches_along_that_edge(
    outline: FloatArray, edge: int, share: float, width: float, pose: FloatArray
) -> None:
    begin, end = outline[edge % len(outline)], outline[(edge + 1) % len(outline)]
    along = (end - begin) / np.linalg.norm(end - begin)
    heading = math.atan2(-along[0], along[1])  # of the outward normal
    box = se2.transform_points(
        [*(begin + share * (end - begin)), heading], moved(box_outline(1e-3, width), 0.5e-3, 0.0)
    )
    assume(overlap_area(outline, box) < 1e-12)
    touch = find_touch(se2.transform_points(pose, outline), se2.transform_points(pose, box))
    assert touch is not None
    lengths = np.linalg.norm(touch[:, 1] - touch[:, 0], axis=1)
    shared = shapely.intersection(
        shapely.LineString([begin, end]), shapely.Polygon(box).exterior.buffer(1e-8)
    )
    assert lengths.max() == pytest.approx(shared.length, abs=1e-6)
    tangent = (touch[0, 1] - touch[0, 0]) / lengths[0]
    normal = se2.rotate(-pose[2], [tangent[1], -tangent[0]])
    np.testing.assert_allclose(normal, [math.cos(heading), math.sin(heading)], atol=1e-5)


def test_corner_contact_has_no_segment_and_distance_no_contact() -> None:
    first = box_outline(1.0, 1.0)
    corner = find_touch(first, moved(first, 1.0, 1.0))
    assert corner is not None
    assert len(corner) == 0
    assert find_touch(first, moved(first, 1.0 + 2.0 * TOUCH, 0.0)) is None
    assert find_touch(first, moved(first, 1.0 + 0.5 * TOUCH, 0.0)) is not None


@given(stars(), stars(), poses(), ANGLES)
def test_going_the_exit_distance_parts_two_outlines_and_less_does_not(
    fixed: FloatArray, moving: FloatArray, pose: FloatArray, heading: float
) -> None:
    moving = se2.transform_points(pose * [0.2, 0.2, 1.0], moving)
    assume(overlap_area(fixed, moving) > 1e-4)
    direction = np.array([math.cos(heading), math.sin(heading)])
    distance = exit_distance(fixed, moving, direction)
    assert overlap_area(fixed, moving + distance * direction) < 1e-9
    for share in (0.25, 0.5, 0.75, 0.99):
        assert overlap_area(fixed, moving + share * distance * direction) > 0.0


@given(SIZES, SIZES, st.floats(0.01, 0.99), st.floats(-0.5, 0.5), poses())
def test_the_depth_of_boxes_pushed_into_each_other_is_the_push(
    length: float, width: float, share: float, sideways: float, pose: FloatArray
) -> None:
    depth = share * 0.5 * min(length, width)
    first = box_outline(length, width)
    second = moved(first, length - depth, sideways * 0.5 * width)
    assume(depth < (1.0 - 0.5 * abs(sideways)) * width)
    found = overlap_depth(se2.transform_points(pose, first), se2.transform_points(pose, second))
    assert found == pytest.approx(depth, abs=1e-9)


def test_a_shape_inside_a_notch_overlaps_nothing() -> None:
    assert overlap_depth(U_SHAPE, moved(box_outline(0.5, 0.5), 0.5, 0.5)) == 0.0
    assert overlap_depth(U_SHAPE, moved(box_outline(0.62, 0.2), 0.5, 0.5)) == pytest.approx(0.6)


@given(stars(), st.data())
def test_swapping_two_corners_is_found_when_shapely_finds_it(
    outline: FloatArray, data: st.DataObject
) -> None:
    i = data.draw(st.integers(0, len(outline) - 1))
    j = data.draw(st.integers(0, len(outline) - 1))
    swapped = outline.copy()
    swapped[[i, j]] = swapped[[j, i]]
    flaw = find_flaw(swapped)
    assert (flaw is None) == bool(shapely.Polygon(swapped).is_valid)
