// Polygons in the core's form: flattened convex pieces, and the tree of obstacles.
#pragma once

#include "scene.hpp"

#include <utility>
#include <vector>

namespace pushplan {

// Maximum number of obstacles in a leaf.
constexpr std::int64_t LEAF = 4;

// Return the tree of obstacles, halved at the median along the longer side of their centres' extent, and the order of
// the obstacles for the leaves' ranges. The first `polygons` obstacles are polygons, the others circles.
std::pair<std::vector<TreeNode>, std::vector<std::int64_t>> obstacle_tree(const std::vector<Area> &boxes,
                                                                          std::int64_t polygons);

struct Point {
    double x, y;
};

// A sequence of polygons. Polygon i has the corners [starts[i], starts[i + 1]).
struct Outlines {
    std::vector<Point> corners;
    Row<const std::int64_t> starts;

    std::int64_t count() const { return starts.size - 1; }
};

// Return convex polygons, counter-clockwise, with edge normals and bounding circles.
Shapes flattened(const Outlines &polygons);

// Return the smallest boxes around polygons.
std::vector<Area> boxes_around(const Outlines &polygons);

// How far the corners of polygons stick out, < 0 inwards, m; and whether the polygons turn left.
struct Bulges {
    std::vector<double> out;
    std::vector<std::int64_t> left;
};
Bulges bulges_of(const Outlines &polygons);

// Corners of polygons as indices of points, polygon after polygon, and the first corner of each.
struct Rings {
    std::vector<std::int64_t> corners, starts;
};

// Join triangles to convex pieces (Hertel and Mehlhorn 1983).
//
// Each triangle has three edges. Edge i begins at the point origin[i], and twin[i] is the opposite edge, or -1.
// Removing an edge only changes the corners at its two ends, so each edge is checked once.
Rings join_triangles(const std::vector<Point> &points, Row<const std::int64_t> origin, Row<const std::int64_t> twin);

} // namespace pushplan
