// What an arc costs under the scenario's `planner.cost`, as a table over the directions of twists.
//
// - `travel`: its length, and `planner.arc_price` for each arc.
// - `time`: how long the pusher takes from rest to rest; for a blended trajectory, at full speed, and a share of the
//   time to reach it; and for each arc what `planner.arc_price` takes at the pusher's top speed.
// - `margin`: its length times 1 + weight (1 - m / m_best), m being the twist's margin and m_best the largest there is.
#pragma once

#include "poses.hpp"

#include <memory>
#include <vector>

namespace pushplan {

// Kinds of objectives.
constexpr int TRAVEL = 0, MARGIN = 1, REST_TO_REST = 2, PASSING = 3;

// What is better by less, in the unit of the objective (m or s), is taken for rounding; not tuned.
constexpr double GAIN = 1e-9;

// What paths are ranked by; the table holds, for twists scaled to a cost rate of 1, what the kind needs.
struct Objective {
    using Entry = std::array<double, 3>;

    int kind;       // TRAVEL (no table), MARGIN (rate), REST_TO_REST or PASSING (top s', s'' and s''')
    double per_arc; // value of an arc beside its length
    double lowest;  // smallest value of a metre of arc
    double length;  // characteristic length of the twist sphere, m
    std::array<double, 4> box; // first and last longitude, first and last latitude of the table, rad
    std::int64_t side;         // entries along either
    std::shared_ptr<const std::vector<Entry>> table; // (side, side) by longitude and latitude
};

// Return the shortest time (s) over a length from rest to rest with bounds on three derivatives.
double rest_to_rest_time(double length, double speed, double acceleration, double jerk);

// Return the value of an arc of a twist scaled to a cost rate of 1.
double arc_value(const Objective &objective, const Twist &twist, double length);

inline double arc_value(const Objective &objective, const Arc &arc) {
    return arc_value(objective, arc.twist, arc.length);
}

} // namespace pushplan
