// The cost of an arc for the scenario's `planner.cost`, as a table over the directions of twists.
//
// - `travel`: its length, and `planner.arc_price` for each arc.
// - `time`: duration from rest to rest; for a blended trajectory, duration at full speed plus a share of the time to
//   reach it. Each arc adds the duration of `planner.arc_price` at the pusher's top speed.
// - `margin`: length times 1 + weight (1 - m / m_best), with the twist's margin m and the largest margin m_best.
#pragma once

#include "poses.hpp"

#include <memory>
#include <vector>

namespace pushplan {

// Kinds of objectives.
constexpr int TRAVEL = 0, MARGIN = 1, REST_TO_REST = 2, PASSING = 3;

// Smallest improvement that counts, in the unit of the objective (m or s); less is rounding. Not tuned.
constexpr double GAIN = 1e-9;

// Objective that ranks paths. The table holds the values that its kind needs, for twists scaled to a cost rate of 1.
struct Objective {
    using Entry = std::array<double, 3>;

    int kind;       // TRAVEL (no table), MARGIN (rate), REST_TO_REST or PASSING (see `arc_value`)
    double per_arc; // value of an arc in addition to its length
    double lowest;  // smallest value of a metre of arc
    double length;  // characteristic length of the twist sphere, m
    std::array<double, 4> box; // first and last longitude, first and last latitude of the table, rad
    std::int64_t side;         // entries along each side
    std::shared_ptr<const std::vector<Entry>> table; // (side, side) by longitude and latitude
};

// Return the value of an arc of a twist scaled to a cost rate of 1.
//
// The time over a length follows from Ruckig's results in the table: top speed, time to it from rest, and the exponent
// with which the time grows with the length on arcs too short for the top speed.
double arc_value(const Objective &objective, const Twist &twist, double length);

inline double arc_value(const Objective &objective, const Arc &arc) {
    return arc_value(objective, arc.twist, arc.length);
}

} // namespace pushplan
