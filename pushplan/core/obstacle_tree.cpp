#include "obstacle_tree.hpp"

#include <algorithm>
#include <functional>

namespace pushplan {

namespace {

// Minimum length (m) of an edge in divisions.
constexpr double SHORTEST_EDGE = 1e-300;

using Members = Row<std::int64_t>;

struct Growth {
    const std::vector<Area> &boxes;
    std::int64_t polygons;
    std::vector<TreeNode> tree;
    std::int64_t polygons_met = 0, circles_met = 0;

    // Sort obstacles by their centres along the longer side of these centres' extent.
    void sort(Members members) const {
        // Twice the centre, because only the order counts.
        const auto x = [this](std::int64_t i) { return boxes[i].xmin + boxes[i].xmax; };
        const auto y = [this](std::int64_t i) { return boxes[i].ymin + boxes[i].ymax; };
        const auto extent = [members](auto &&center) {
            double low = INF, high = -INF;
            for (const std::int64_t i : members)
                low = std::min(low, center(i)), high = std::max(high, center(i));
            return high - low;
        };
        if (extent(x) >= extent(y))
            std::stable_sort(members.begin(), members.end(), [&](auto i, auto j) { return x(i) < x(j); });
        else
            std::stable_sort(members.begin(), members.end(), [&](auto i, auto j) { return y(i) < y(j); });
    }

    // Append the nodes above some obstacles, and sort these.
    void add(Members members) {
        const std::size_t row = tree.size();
        TreeNode node{INF, INF, -INF, -INF, 0, 0, 0, 0, 0};
        for (const std::int64_t i : members) {
            node.xmin = std::min(node.xmin, boxes[i].xmin), node.ymin = std::min(node.ymin, boxes[i].ymin);
            node.xmax = std::max(node.xmax, boxes[i].xmax), node.ymax = std::max(node.ymax, boxes[i].ymax);
        }
        tree.push_back(node);
        if (members.size <= LEAF) {
            // Leaves are visited in the order of rows, so that their polygons and circles are numbered consecutively.
            node.first_polygon = polygons_met, node.first_circle = circles_met;
            for (const std::int64_t i : members)
                ++(i < polygons ? polygons_met : circles_met);
            node.last_polygon = polygons_met, node.last_circle = circles_met;
        } else {
            sort(members);
            const std::ptrdiff_t half = members.size / 2;
            add({members.data, half});
            add({members.data + half, members.size - half});
        }
        node.after = static_cast<std::int64_t>(tree.size());
        tree[row] = node;
    }
};

// Return whether the path along an edge `into` a corner and an edge `out` of it does not turn right.
bool is_convex(const std::vector<Point> &points, Row<const std::int64_t> origin, std::int64_t into, std::int64_t out,
               const std::vector<std::int64_t> &after) {
    const Point &a = points[origin[into]], &b = points[origin[out]], &c = points[origin[after[out]]];
    return (b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x) >= 0.0;
}

} // namespace

std::pair<std::vector<TreeNode>, std::vector<std::int64_t>> obstacle_tree(const std::vector<Area> &boxes,
                                                                          std::int64_t polygons) {
    std::vector<std::int64_t> order(boxes.size());
    for (std::size_t i = 0; i < order.size(); ++i)
        order[i] = static_cast<std::int64_t>(i);
    Growth growth{boxes, polygons, {}};
    if (!boxes.empty())
        growth.add({order.data(), static_cast<std::ptrdiff_t>(order.size())});
    return {std::move(growth.tree), std::move(order)};
}

Shapes flattened(const Outlines &polygons) {
    Shapes shapes;
    shapes.starts.assign(polygons.starts.begin(), polygons.starts.end());
    const std::vector<Area> boxes = boxes_around(polygons);
    for (std::int64_t i = 0; i < polygons.count(); ++i) {
        const Area &box = boxes[i];
        Circle bound{0.5 * (box.xmin + box.xmax), 0.5 * (box.ymin + box.ymax), 0.0};
        for (std::int64_t k = polygons.starts[i]; k < polygons.starts[i + 1]; ++k) {
            const Point &p = polygons.corners[k];
            const Point &next = polygons.corners[k + 1 < polygons.starts[i + 1] ? k + 1 : polygons.starts[i]];
            const double ex = next.x - p.x, ey = next.y - p.y, length = std::sqrt(ex * ex + ey * ey);
            const double dx = p.x - bound.x, dy = p.y - bound.y;
            shapes.corners.push_back({p.x, p.y, ey / length, -ex / length});
            bound.radius = std::max(bound.radius, std::sqrt(dx * dx + dy * dy));
        }
        shapes.bounds.push_back(bound);
    }
    return shapes;
}

std::vector<Area> boxes_around(const Outlines &polygons) {
    std::vector<Area> boxes(static_cast<std::size_t>(polygons.count()), {INF, INF, -INF, -INF});
    for (std::int64_t i = 0; i < polygons.count(); ++i) {
        Area &box = boxes[i];
        for (std::int64_t k = polygons.starts[i]; k < polygons.starts[i + 1]; ++k) {
            const auto &[x, y] = polygons.corners[k];
            box = {std::min(box.xmin, x), std::min(box.ymin, y), std::max(box.xmax, x), std::max(box.ymax, y)};
        }
    }
    return boxes;
}

Bulges bulges_of(const Outlines &polygons) {
    Bulges bulges;
    for (std::int64_t i = 0; i < polygons.count(); ++i) {
        const Point *first = &polygons.corners[polygons.starts[i]];
        const std::int64_t count = polygons.starts[i + 1] - polygons.starts[i];
        double area = 0.0; // relative to a corner, which keeps precision far from the origin
        for (std::int64_t k = 0; k < count; ++k) {
            const Point &before = first[(k + count - 1) % count], &p = first[k], &after = first[(k + 1) % count];
            const double ax = p.x - before.x, ay = p.y - before.y, bx = after.x - p.x, by = after.y - p.y;
            area += (p.x - first->x) * (after.y - first->y) - (p.y - first->y) * (after.x - first->x);
            const double longer = std::max({std::hypot(ax, ay), std::hypot(bx, by), SHORTEST_EDGE});
            bulges.out.push_back((ax * by - ay * bx) / longer);
        }
        bulges.left.push_back(area > 0.0);
        if (!(area > 0.0))
            std::transform(bulges.out.end() - count, bulges.out.end(), bulges.out.end() - count, std::negate<>());
    }
    return bulges;
}

Rings join_triangles(const std::vector<Point> &points, Row<const std::int64_t> origin, Row<const std::int64_t> twin) {
    const std::int64_t edges = origin.size;
    std::vector<std::int64_t> after(edges), before(edges);
    for (std::int64_t i = 0; i < edges; ++i) {
        after[i] = i - i % 3 + (i + 1) % 3;
        before[i] = i - i % 3 + (i + 2) % 3;
    }
    std::vector<bool> gone(edges, false);
    for (std::int64_t h = 0; h < edges; ++h) {
        const std::int64_t t = twin[h];
        if (h >= t || !is_convex(points, origin, before[h], after[t], after) ||
            !is_convex(points, origin, before[t], after[h], after))
            continue;
        for (const auto &[one, other] : {std::pair(h, t), std::pair(t, h)}) {
            after[before[one]] = after[other];
            before[after[other]] = before[one];
            gone[one] = true;
        }
    }
    Rings rings{{}, {0}};
    for (std::int64_t h = 0; h < edges; ++h) {
        for (std::int64_t i = h; !gone[i]; i = after[i]) {
            rings.corners.push_back(origin[i]);
            gone[i] = true;
        }
        if (static_cast<std::int64_t>(rings.corners.size()) > rings.starts.back())
            rings.starts.push_back(static_cast<std::int64_t>(rings.corners.size()));
    }
    return rings;
}

} // namespace pushplan
