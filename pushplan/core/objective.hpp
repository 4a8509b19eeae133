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

    int kind;       // TRAVEL (no table), MARGIN (rate), REST_TO_REST or PASSING (see `arc_value`)
    double per_arc; // value of an arc beside its length
    double lowest;  // smallest value of a metre of arc
    double length;  // characteristic length of the twist sphere, m
    std::array<double, 4> box; // first and last longitude, first and last latitude of the table, rad
    std::int64_t side;         // entries along either
    std::shared_ptr<const std::vector<Entry>> table; // (side, side) by longitude and latitude
};

// Return the value of an arc of a twist scaled to a cost rate of 1.
//
// The time over a length is made from Ruckig's answers in the table: top speed, time from rest to it, and the power of
// the length with which the time grows on arcs too short for the top speed.
double arc_value(const Objective &objective, const Twist &twist, double length);

inline double arc_value(const Objective &objective, const Arc &arc) {
    return arc_value(objective, arc.twist, arc.length);
}

} // namespace pushplan
