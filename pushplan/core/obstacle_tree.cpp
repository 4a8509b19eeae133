#include "obstacle_tree.hpp"

#include <algorithm>

namespace pushplan {

namespace {

using Members = Row<std::int64_t>;

struct Growth {
    const std::vector<Area> &boxes;
    std::int64_t polygons;
    std::vector<TreeNode> tree;
    std::int64_t polygons_met = 0, circles_met = 0;

    // Sort obstacles by their centres along the longer side of these centres' extent.
    void sort(Members members) const {
        // Twice the centre: only the order counts.
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

    // Append the nodes above some obstacles, and bring these into order.
    void add(Members members) {
        const std::size_t row = tree.size();
        TreeNode node{INF, INF, -INF, -INF, 0, 0, 0, 0, 0};
        for (const std::int64_t i : members) {
            node.xmin = std::min(node.xmin, boxes[i].xmin), node.ymin = std::min(node.ymin, boxes[i].ymin);
            node.xmax = std::max(node.xmax, boxes[i].xmax), node.ymax = std::max(node.ymax, boxes[i].ymax);
        }
        tree.push_back(node);
        if (members.size <= LEAF) {
            // Leaves are met in the order of rows, so that polygons and circles get consecutive numbers in it.
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

// Whether the way from an edge `into` a corner on to an edge `out` of it does not turn right.
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
