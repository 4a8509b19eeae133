// Shorten paths: random pairs of points are joined by steering paths, and corners are cut.
#pragma once

#include "problem.hpp"

#include <vector>

namespace pushplan {

// Value of a path.
double objective_value(const Objective &objective, const std::vector<Arc> &path);

// A path without empty arcs and with neighbours of the same motion made one.
std::vector<Arc> merged(const std::vector<Arc> &arcs);

// A left turn, a straight push and a right turn drawn from the stable set.
//
// Turns are drawn from the ends of the segments, where they are tightest, as often as from within. A motion of which
// the drawn segment has none is zero.
Family random_family(const std::vector<Segment> &segments, Random &random);

// A path from `start` to the goal shortened by so many attempts, each a word between two of its places or a local
// change.
std::vector<Arc> shorten(const Problem &problem, const Pose &start, const std::vector<Arc> &arcs, Random &random,
                         std::int64_t attempts);

// A path from `start` with pieces exchanged for free words that are shorter, or of fewer arcs, where an arc counts
// `per_arc` (m) beside its length.
std::vector<Arc> cut_short(const Problem &problem, const Pose &start, const std::vector<Arc> &arcs, double per_arc);

} // namespace pushplan
