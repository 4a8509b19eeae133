#include "objective.hpp"

#include <algorithm>
#include <cmath>

namespace pushplan {

namespace {

// The table's values for a twist, interpolated.
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

double rest_to_rest_time(double length, double speed, double acceleration, double jerk) {
    const double rise = speed * jerk >= acceleration * acceleration ? speed / acceleration + acceleration / jerk
                                                                    : 2.0 * std::sqrt(speed / jerk);
    if (length >= speed * rise)
        return length / speed + rise;
    const double ramp = acceleration / jerk;
    if (length >= 2.0 * ramp * ramp * acceleration) { // the acceleration is reached, the speed is not
        const double peak = 0.5 * acceleration * (std::sqrt(ramp * ramp + 4.0 * length / acceleration) - ramp);
        return 2.0 * (peak / acceleration + ramp);
    }
    return 4.0 * std::pow(0.5 * length / jerk, 1.0 / 3.0);
}

double arc_value(const Objective &objective, const Twist &twist, double length) {
    if (objective.kind == TRAVEL)
        return length + objective.per_arc;
    const auto found = look_up(objective, twist);
    if (objective.kind == MARGIN)
        return length * found[0] + objective.per_arc;
    if (objective.kind == REST_TO_REST)
        return rest_to_rest_time(length, found[0], found[1], found[2]) + objective.per_arc;
    // A blended corner costs 2 % of the time from rest to full speed.
    const double rise = found[0] / found[1] + found[1] / found[2];
    return length / found[0] + 0.02 * rise + objective.per_arc;
}

} // namespace pushplan
