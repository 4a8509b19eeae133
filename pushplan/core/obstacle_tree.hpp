// Polygons as the core looks at them: convex pieces, flattened, and the tree over obstacles.
#pragma once

#include "scene.hpp"

#include <utility>
#include <vector>

namespace pushplan {

// Obstacles in a leaf, at most.
constexpr std::int64_t LEAF = 4;

// Return the tree over obstacles, halved at the median along the longer side of their centres' extent, and the order
// that they have to be brought into for the leaves' ranges; the first ones, so many, are polygons, the others circles.
std::pair<std::vector<TreeNode>, std::vector<std::int64_t>> obstacle_tree(const std::vector<Area> &boxes,
                                                                          std::int64_t polygons);

struct Point {
    double x, y;
};

// Polygons one after another: polygon i has the corners from starts[i] to before starts[i + 1].
struct Outlines {
    std::vector<Point> corners;
    Row<const std::int64_t> starts;

    std::int64_t count() const { return starts.size - 1; }
};

// Return convex polygons, counter-clockwise, with edge normals and bounding circles.
Shapes flattened(const Outlines &polygons);

// Return the smallest boxes around polygons.
std::vector<Area> boxes_around(const Outlines &polygons);

// How far the corners of polygons stand out, < 0 inwards, m; and whether these polygons turn left.
struct Bulges {
    std::vector<double> out;
    std::vector<std::int64_t> left;
};
Bulges bulges_of(const Outlines &polygons);

// Corners of polygons as numbers of points, polygon after polygon, and where each begins.
struct Rings {
    std::vector<std::int64_t> corners, starts;
};

// Join triangles to convex pieces (Hertel and Mehlhorn 1983).
//
// Edge i, of three a triangle, begins at the point origin[i], and twin[i] is the edge that runs along it the other way,
// or -1. Taking an edge away leaves every corner as it is but the edge's two ends; so each edge is looked at once.
Rings join_triangles(const std::vector<Point> &points, Row<const std::int64_t> origin, Row<const std::int64_t> twin);

} // namespace pushplan
