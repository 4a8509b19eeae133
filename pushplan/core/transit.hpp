// Transits of the robot between two poses: a direct path, or trees from both ends (Kuffner and LaValle 2000).
#pragma once

#include "driving.hpp"

#include <optional>
#include <vector>

namespace pushplan {

using Way = std::vector<Arc>;

// Maximum number of arcs of a transit.
constexpr int MOST_ARCS = 256;

// Distance that a turn of 1 rad counts as in the search for near poses, m.
constexpr double TURN_LENGTH = 0.3;

// Find a free transit between two poses of the robot. It has no arcs if both are the same.
//
// At most `iterations` poses are drawn, from `box` or within `spread` (m) of either pose or the load.
std::optional<Way> find_transit(const Surroundings &around, const Wheels &wheels, const Pose &start, const Pose &goal,
                                const Area &box, double spread, Random &random, int iterations);

// Return a transit shortened by cheaper paths between random pairs of places.
Way shortened(const Surroundings &around, const Wheels &wheels, const Pose &start, Way way, Random &random,
              int attempts);

} // namespace pushplan
