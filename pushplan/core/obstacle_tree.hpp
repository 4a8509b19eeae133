// The tree over obstacles, and the convex pieces of polygons.
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
