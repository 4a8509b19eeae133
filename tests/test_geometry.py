"""Planar poses and polygons: group laws, contacts and overlaps of outlines against shapely."""

import math

import numpy as np
import pytest
import shapely
from conftest import there
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import expm

from pushplan.geometry import se2
from pushplan.geometry.polygon import exit_distance, find_flaw, find_touch, overlap_depth, symmetries
from pushplan.scenario.layout import box_outline
from pushplan.util.arrays import FloatArray

numbers = st.one_of(st.floats(-5.0, 5.0), st.floats(-1e-9, 1e-9), st.just(0.0))
poses = st.tuples(numbers, numbers, numbers).map(np.array)


def _matrix(pose: FloatArray) -> FloatArray:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


@given(poses, poses)
def test_composition_is_the_matrix_product(a: FloatArray, b: FloatArray) -> None:
    np.testing.assert_allclose(_matrix(se2.compose(a, b)), _matrix(a) @ _matrix(b), atol=1e-12)


@given(poses)
def test_exponential_is_the_matrix_exponential(twist: FloatArray) -> None:
    algebra = np.array([[0.0, -twist[2], twist[0]], [twist[2], 0.0, twist[1]], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(_matrix(se2.exp(twist)), expm(algebra), atol=1e-11)


@given(poses)
def test_logarithm_undoes_the_exponential(pose: FloatArray) -> None:
    twist = np.append(pose[:2], se2.wrap_angle(pose[2]))
    assert se2.log(se2.exp(twist)) == pytest.approx(twist, abs=1e-9)


@given(poses, st.lists(poses, max_size=4))
def test_a_chain_of_poses_is_composed_pose_by_pose(start: FloatArray, steps: list[FloatArray]) -> None:
    expected = [start]
    for step in steps:
        expected.append(se2.compose(expected[-1], step))
    np.testing.assert_allclose(se2.chained(start, np.array(steps).reshape(-1, 3)), expected, atol=1e-12)


ANGLES = st.floats(-math.pi, math.pi)
COORDINATES = st.floats(-2.0, 2.0)
SIZES = st.floats(0.02, 1.0)


@st.composite
def placements(draw: st.DrawFn) -> FloatArray:
    return np.array([draw(COORDINATES), draw(COORDINATES), draw(ANGLES)])


@st.composite
def stars(draw: st.DrawFn) -> FloatArray:
    """Return star-shaped outlines about the origin, mostly non-convex."""
    radii = np.array(draw(st.lists(st.floats(0.1, 0.5), min_size=3, max_size=9)))
    angles = 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def moved(outline: FloatArray, x: float, y: float) -> FloatArray:
    return se2.transform_points([x, y, 0.0], outline)


def overlap_area(first: FloatArray, second: FloatArray) -> float:
    return float(shapely.intersection(shapely.Polygon(first), shapely.Polygon(second)).area)


@given(stars(), st.integers(0, 8), st.floats(0.1, 0.9), SIZES, placements())
def test_a_box_placed_on_any_edge_touches_along_that_edge(
    outline: FloatArray, edge: int, share: float, width: float, pose: FloatArray
) -> None:
    begin, end = outline[edge % len(outline)], outline[(edge + 1) % len(outline)]
    along = (end - begin) / np.linalg.norm(end - begin)
    heading = math.atan2(-along[0], along[1])  # of the outward normal
    box = se2.transform_points(
        [*(begin + share * (end - begin)), heading], moved(box_outline(1e-3, width), 0.5e-3, 0.0)
    )
    assume(overlap_area(outline, box) < 1e-12)
    touch = there(find_touch(se2.transform_points(pose, outline), se2.transform_points(pose, box)))
    lengths = np.linalg.norm(touch[:, 1] - touch[:, 0], axis=1)
    shared = shapely.intersection(shapely.LineString([begin, end]), shapely.Polygon(box).exterior.buffer(1e-8))
    assert lengths.max() == pytest.approx(shared.length, abs=1e-6)
    tangent = (touch[0, 1] - touch[0, 0]) / lengths[0]
    normal = se2.rotate(-pose[2], [tangent[1], -tangent[0]])
    np.testing.assert_allclose(normal, [math.cos(heading), math.sin(heading)], atol=1e-5)


@given(stars(), stars(), placements(), ANGLES)
def test_the_exit_distance_is_the_smallest_that_separates_two_outlines(
    fixed: FloatArray, moving: FloatArray, pose: FloatArray, heading: float
) -> None:
    moving = se2.transform_points(pose * [0.2, 0.2, 1.0], moving)
    assume(overlap_area(fixed, moving) > 1e-4)
    direction = np.array([math.cos(heading), math.sin(heading)])
    distance = exit_distance(fixed, moving, direction)
    assert overlap_area(fixed, moving + distance * direction) < 1e-9
    for share in (0.25, 0.5, 0.75, 0.99):
        assert overlap_area(fixed, moving + share * distance * direction) > 0.0


@given(SIZES, SIZES, st.floats(0.01, 0.99), st.floats(-0.5, 0.5), placements())
def test_the_depth_of_overlapping_boxes_is_their_overlap(
    length: float, width: float, share: float, sideways: float, pose: FloatArray
) -> None:
    depth = share * 0.5 * min(length, width)
    first = box_outline(length, width)
    second = moved(first, length - depth, sideways * 0.5 * width)
    assume(depth < (1.0 - 0.5 * abs(sideways)) * width)
    found = overlap_depth(se2.transform_points(pose, first), se2.transform_points(pose, second))
    assert found == pytest.approx(depth, abs=1e-9)


@given(stars(), st.data())
def test_outlines_with_swapped_corners_are_invalid_as_in_shapely(outline: FloatArray, data: st.DataObject) -> None:
    i = data.draw(st.integers(0, len(outline) - 1))
    j = data.draw(st.integers(0, len(outline) - 1))
    swapped = outline.copy()
    swapped[[i, j]] = swapped[[j, i]]
    flaw = find_flaw(swapped)
    assert (flaw is None) == bool(shapely.Polygon(swapped).is_valid)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6])
def test_every_turn_that_takes_a_polygon_onto_itself_is_found(count: int) -> None:
    """About a centroid off the origin; a notch in each part breaks all other symmetries."""
    part = np.array([[0.1, 0.0], [0.06, 0.015], [0.08, 0.02]])
    turns = 2.0 * np.pi * np.arange(max(count, 3)) / max(count, 3)
    corners = np.concatenate([se2.rotate(turn, part) for turn in turns])
    if count < 3:
        corners = np.array([[-0.1, -0.05], [0.1, -0.03], [0.1, 0.05], [-0.1, 0.03]]) * (
            [1.0, count - 1.0] if count > 1 else 1
        )
        corners[0] -= [0.0, 0.03 * (count == 1)]
    outline = np.add(corners, [0.3, -0.2])
    found = symmetries(outline)
    assert sorted(pose[2] for pose in found) == pytest.approx(2.0 * np.pi * np.arange(count) / count)
    for pose in found:
        seen = shapely.Polygon(se2.transform_points(pose, outline))
        assert seen.symmetric_difference(shapely.Polygon(outline)).area < 1e-12
