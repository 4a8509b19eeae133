#include "chart.hpp"

#include <cmath>

namespace pushplan {

namespace {

// Return the length of the cross product of two vectors.
double span(const Twist &a, const Twist &b) {
    const double x = a.vy * b.omega - a.omega * b.vy;
    const double y = a.omega * b.vx - a.vx * b.omega;
    const double z = a.vx * b.vy - a.vy * b.vx;
    return std::sqrt(x * x + y * y + z * z);
}

struct Place {
    std::int64_t segment;
    double share;
};

// Return the segment that a twist t lies on, and the share b of its second end; b is NaN if there is none.
//
// Up to a factor, t = (1 - b) a + b c. If t is in the plane of the ends a and c, b = |a x t| / (|a x t| + |t x c|).
Place place_of(const std::vector<Segment> &segments, const Twist &t) {
    // A twist is not in the set if its distance from every segment exceeds 1e-9 of its size.
    double nearest = 1e-18 * (t.vx * t.vx + t.vy * t.vy + t.omega * t.omega);
    Place found{0, std::nan("")};
    for (std::size_t i = 0; i < segments.size(); ++i) {
        const auto &[a, c] = segments[i];
        const double before = span(a, t), behind = span(t, c);
        const double b = before + behind > 0.0 ? before / (before + behind) : 0.0;
        const double mx = a.vx + b * (c.vx - a.vx), my = a.vy + b * (c.vy - a.vy);
        const double mz = a.omega + b * (c.omega - a.omega);
        const double factor = (mx * t.vx + my * t.vy + mz * t.omega) / (mx * mx + my * my + mz * mz);
        const double dx = factor * mx - t.vx, dy = factor * my - t.vy, dz = factor * mz - t.omega;
        const double away = dx * dx + dy * dy + dz * dz;
        if (factor > 0.0 && away < nearest) {
            nearest = away;
            found = {static_cast<std::int64_t>(i), b};
        }
    }
    return found;
}

} // namespace

Arc arc_of(const Problem &problem, const Control &control) {
    return {choose_twist(problem, control[0], control[1]), control[2] * control[3] * problem.longest};
}

Control control_of(const Problem &problem, const Arc &arc) {
    const auto [segment, share] = place_of(problem.segments, arc.twist);
    const double whole = std::ceil(arc.length / problem.longest), units = whole > 1.0 ? whole : 1.0;
    const double middle = static_cast<double>(segment) + 0.5, count = static_cast<double>(problem.segments.size());
    return {LETTER_SHARE + (1.0 - LETTER_SHARE) * middle / count, END_SHARE + (1.0 - 2.0 * END_SHARE) * share,
            arc.length / (units * problem.longest), units};
}

Followed follow(const Scene &scene, const Pose &start, const std::vector<Arc> &arcs) {
    const auto count = static_cast<std::int64_t>(arcs.size());
    Followed followed{{start}, count};
    for (std::int64_t i = 0; i < count; ++i) {
        const Arc &arc = arcs[i];
        const Pose pose = followed.poses.back();
        if (followed.free > i && arc.length > 0.0 && !sweep_is_free(scene, pose, arc.twist, arc.length))
            followed.free = i;
        followed.poses.push_back(step(pose, arc.twist, arc.length));
    }
    return followed;
}

} // namespace pushplan
