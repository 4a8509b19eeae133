// Shortening of paths: steering paths join random pairs of points and cut corners.
#pragma once

#include "problem.hpp"

#include <vector>

namespace pushplan {

// Return the value of a path.
double objective_value(const Objective &objective, const std::vector<Arc> &path);

// Return a path without empty arcs and with neighbouring arcs of the same motion merged.
std::vector<Arc> merged(const std::vector<Arc> &arcs);

// Return a left turn, a straight push and a right turn drawn from the stable set.
//
// Turns are drawn from the ends of segments, where they are tightest, as often as from the inside. A motion that the
// drawn segment lacks is zero.
Family random_family(const std::vector<Segment> &segments, Random &random);

// Return a path from `start` to the goal after some attempts to shorten it, each by a steering path between two places
// or by a local change.
std::vector<Arc> shorten(const Problem &problem, const Pose &start, const std::vector<Arc> &arcs, Random &random,
                         std::int64_t attempts);

// Return a path from `start` with pieces replaced by free steering paths that are shorter or have fewer arcs. An arc
// counts `per_arc` (m) in addition to its length.
std::vector<Arc> cut_short(const Problem &problem, const Pose &start, const std::vector<Arc> &arcs, double per_arc);

} // namespace pushplan
