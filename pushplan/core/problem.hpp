// A push problem, and the tree of arcs that a search grows in it.
#pragma once

#include "objective.hpp"
#include "steering.hpp"

#include <cmath>
#include <vector>

namespace pushplan {

// Stable twists between two end twists: every positive combination of them is stable.
struct Segment {
    Twist low, high;
};

static_assert(sizeof(Segment) == 6 * sizeof(double), "a row of NumPy's table");

// A push problem: the input of a search.
struct Problem {
    Scene scene;                    // the body and the obstacles
    std::vector<Segment> segments;  // the stable set
    std::vector<Family> families;   // for exact connections
    Pose goal;                      // goal pose of the chain frame in the world
    double longest;                 // longest arc sampled, m of cost
    Objective objective;            // ranks paths

    Row<const Family> all_families() const { return {families.data(), static_cast<std::ptrdiff_t>(families.size())}; }
    // The family for steering in searches. The others only shorten paths.
    Row<const Family> first_family() const { return {families.data(), 1}; }
};

// Share of sampled controls that are twists of a steering family: turns and straight pushes.
constexpr double LETTER_SHARE = 0.3;

// Share of the other controls at each end of their segment, the boundary of the stable set.
constexpr double END_SHARE = 0.25;

// Return the combination (1 - b, b) of a segment's ends, a twist scaled to a cost rate of 1.
inline Twist between(const Segment &segment, double b) {
    const double vx = (1.0 - b) * segment.low.vx + b * segment.high.vx;
    const double vy = (1.0 - b) * segment.low.vy + b * segment.high.vy;
    const double omega = (1.0 - b) * segment.low.omega + b * segment.high.omega;
    const double rate = cost_rate({vx, vy, omega});
    return {vx / rate, vy / rate, omega / rate};
}

// Map two numbers in [0, 1] onto the stable set: a twist scaled to a cost rate of 1.
Twist choose_twist(const Problem &problem, double u0, double u1);

// A node of a tree: pose, cost from the root, row of the parent (-1 for a root), and the arc from the parent. A row of
// a table (n, 9).
struct Node {
    Pose pose;
    double cost;
    double parent;
    Arc arc;
};

static_assert(sizeof(Node) == 9 * sizeof(double), "a row of NumPy's table");

// Append the arcs from the root of a tree to a node to a path.
void trace(const std::vector<Node> &nodes, std::int64_t node, std::vector<Arc> &path);

// Append the arcs of a steering path to a path, except empty ones.
void append_word(const std::array<Arc, 3> &word, std::vector<Arc> &path);

} // namespace pushplan
