#include "objective.hpp"

#include <algorithm>
#include <cmath>

namespace pushplan {

namespace {

// Return the table's interpolated values for a twist.
Objective::Entry look_up(const Objective &objective, const Twist &twist) {
    const std::int64_t n = objective.side;
    const auto &box = objective.box;
    const double longitude = std::atan2(twist.vy, twist.vx);
    const double latitude = std::atan2(objective.length * twist.omega, std::hypot(twist.vx, twist.vy));
    const double u = (longitude - box[0]) / (box[1] - box[0]) * static_cast<double>(n - 1);
    const double w = (latitude - box[2]) / (box[3] - box[2]) * static_cast<double>(n - 1);
    const std::int64_t i = std::clamp<std::int64_t>(static_cast<std::int64_t>(u), 0, n - 2);
    const std::int64_t j = std::clamp<std::int64_t>(static_cast<std::int64_t>(w), 0, n - 2);
    const double a = std::clamp(u - static_cast<double>(i), 0.0, 1.0);
    const double b = std::clamp(w - static_cast<double>(j), 0.0, 1.0);
    const Objective::Entry *here = objective.table->data() + i * n + j, *there = here + n;
    Objective::Entry found;
    for (int k = 0; k < 3; ++k) {
        const double low = (1.0 - b) * here[0][k] + b * here[1][k];
        const double high = (1.0 - b) * there[0][k] + b * there[1][k];
        found[k] = (1.0 - a) * low + a * high;
    }
    return found;
}

} // namespace

double arc_value(const Objective &objective, const Twist &twist, double length) {
    if (objective.kind == TRAVEL)
        return length + objective.per_arc;
    const auto found = look_up(objective, twist);
    if (objective.kind == MARGIN)
        return length * found[0] + objective.per_arc;
    const auto [speed, rise, power] = found;
    if (objective.kind == PASSING) // a blended corner costs 2 % of the time from rest to full speed
        return length / speed + 0.02 * rise + objective.per_arc;
    const double ramps = speed * rise; // m
    return (length >= ramps ? length / speed + rise : 2.0 * rise * std::pow(length / ramps, power)) + objective.per_arc;
}

} // namespace pushplan
