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

// What a search needs to know.
struct Problem {
    Scene scene;                    // the body and what it must not touch
    std::vector<Segment> segments;  // the stable set
    std::vector<Family> families;   // for exact connections
    Pose goal;                      // of the chain frame in the world
    double longest;                 // longest arc sampled, m of cost
    Objective objective;            // what makes one path better than another

    Row<const Family> all_families() const { return {families.data(), static_cast<std::ptrdiff_t>(families.size())}; }
    // The family that the searches steer by; the others only shorten.
    Row<const Family> first_family() const { return {families.data(), 1}; }
};

// Share of the sampled controls that are the twists of a steering family: turns and straight pushes.
constexpr double LETTER_SHARE = 0.3;

// Share of the other controls that lie on either end of their segment, the boundary of the stable set.
constexpr double END_SHARE = 0.25;

// Combine a segment's ends as (1 - b, b): a twist scaled to a cost rate of 1.
inline Twist between(const Segment &segment, double b) {
    const double vx = (1.0 - b) * segment.low.vx + b * segment.high.vx;
    const double vy = (1.0 - b) * segment.low.vy + b * segment.high.vy;
    const double omega = (1.0 - b) * segment.low.omega + b * segment.high.omega;
    const double rate = cost_rate({vx, vy, omega});
    return {vx / rate, vy / rate, omega / rate};
}

// Map two numbers in [0, 1] onto the stable set: a twist scaled to a cost rate of 1.
Twist choose_twist(const Problem &problem, double u0, double u1);

// A node of a tree: a pose, the cost from the root, the row of the parent (-1 of a root), and the arc that led here. As
// numbers, a row of a table (n, 9).
struct Node {
    Pose pose;
    double cost;
    double parent;
    Arc arc;
};

static_assert(sizeof(Node) == 9 * sizeof(double), "a row of NumPy's table");

// Append the arcs from the root of a tree to a node to a path.
void trace(const std::vector<Node> &nodes, std::int64_t node, std::vector<Arc> &path);

// Append the arcs of a word that are not empty to a path.
void append_word(const std::array<Arc, 3> &word, std::vector<Arc> &path);

} // namespace pushplan
