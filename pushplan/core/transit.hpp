// The robot's way alone between two poses: a direct word, or trees from both ends (Kuffner and LaValle 2000).
#pragma once

#include "driving.hpp"

#include <optional>
#include <vector>

namespace pushplan {

using Way = std::vector<Arc>;

// Arcs of a way, at most.
constexpr int MOST_ARCS = 256;

// What a turn by 1 rad counts when near poses are looked for, m.
constexpr double TURN_LENGTH = 0.3;

// Find a free way between two poses of the robot; it has no arcs where both are the same.
//
// At most `iterations` poses are drawn, from `box` or no farther than `spread` (m) from either pose and the load.
std::optional<Way> find_transit(const Surroundings &around, const Wheels &wheels, const Pose &start, const Pose &goal,
                                const Area &box, double spread, Random &random, int iterations);

// Join random pairs of places on a way anew where that is cheaper; return what the way is then.
Way shortened(const Surroundings &around, const Wheels &wheels, const Pose &start, Way way, Random &random,
              int attempts);

} // namespace pushplan
