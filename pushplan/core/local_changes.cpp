#include "local_changes.hpp"

#include <algorithm>

namespace pushplan {

namespace {

// Share of the new twists that keep a property: on the boundary of the stable set, or without rotation.
constexpr double KEEP_SHARE = 0.75;

// Share of a segment up to which a twist counts as being at its end.
constexpr double AT_END = 1e-9;

// End error (m, rad) that counts as rounding. Remaining errors add up from change to change.
constexpr double CLOSED = 1e-13;

// Volume below which the three motions that close a path are nearly dependent, and lengths would change without bound.
constexpr double DEPENDENT = 1e-9;

// A tenth of `GAIN`, not tuned. With `GAIN` itself, one of three plans of five-objects was 0.04 % longer.
constexpr double WORTH = 1e-10;

using Vector = std::array<double, 3>;

Vector cross(const Vector &a, const Vector &b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Vector &a, const Vector &b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector vector_of(const Twist &twist) { return {twist.vx, twist.vy, twist.omega}; }

// Return a log-uniform size from 1e-4 to 1, with a random sign.
double draw_size(Random &random) {
    const double size = std::exp(std::log(1e-4) * random());
    return random() < 0.5 ? size : -size;
}

// Return a random number of further arcs, up to three.
int draw_margin(Random &random) { return static_cast<int>(random() * 4.0); }

// Return three different arcs between the first and the last one.
std::array<int, 3> draw_three(int first, int last, Random &random) {
    const int count = last - first + 1;
    const int a = static_cast<int>(random() * count);
    int b = static_cast<int>(random() * (count - 1));
    int c = static_cast<int>(random() * (count - 2));
    b += b >= a;
    const int low = std::min(a, b), high = std::max(a, b);
    c += c >= low;
    c += c >= high;
    return {first + a, first + b, first + c};
}

// Return the motion of the last pose per metre of an arc's length: the rest of the path moves as a rigid body with the
// arc's twist, in the world frame.
Vector effect_of(const Twist &twist, const Pose &after, const Pose &last) {
    const double c = std::cos(after.theta), s = std::sin(after.theta);
    return {c * twist.vx - s * twist.vy - twist.omega * (last.y - after.y),
            s * twist.vx + c * twist.vy + twist.omega * (last.x - after.x), twist.omega};
}

} // namespace

LocalChanges::LocalChanges(const Problem &problem) : problem_(problem) {
    normals_.reserve(problem.segments.size());
    for (const Segment &segment : problem.segments) {
        const auto [x, y, z] = cross(vector_of(segment.low), vector_of(segment.high));
        const double size = std::sqrt(x * x + y * y + z * z);
        normals_.push_back(size > 1e-12 ? Vector{x / size, y / size, z / size} : Vector{0.0, 0.0, 0.0});
    }
}

bool LocalChanges::vary(const Pose &start, std::vector<Arc> &path, Random &random) {
    int m = static_cast<int>(path.size());
    int k = static_cast<int>(random() * m);
    // Splitting an arc gives a path a new form. Leaving one out makes it simpler to drive.
    const bool split = m < 3 || random() < 0.2;
    if (!split && m > 3 && random() < 0.15) {
        const bool better = leave_out(start, path, k, random);
        if (better)
            path.swap(trial_);
        return better;
    }
    trial_ = path;
    if (split) {
        trial_.insert(trial_.begin() + k, path[static_cast<std::size_t>(k)]);
        const double share = random();
        trial_[static_cast<std::size_t>(k)].length *= share;
        trial_[static_cast<std::size_t>(k + 1)].length *= 1.0 - share;
        k += random() < 0.5;
        m += 1;
    }
    Window window{std::max(0, k - 1 - draw_margin(random)), 0, problem_.goal, 0.0};
    window.last = std::min(m - 1, k + 1 + draw_margin(random));
    if (window.is_too_small())
        return false;
    poses_.resize(static_cast<std::size_t>(m + 1));
    poses_[0] = start;
    find_poses(trial_, 0, window.last);
    if (window.last < m - 1)
        window.target = poses_[static_cast<std::size_t>(window.last + 1)];
    window.value =
        value_of(trial_, window.first, window.last) - (split ? problem_.objective.per_arc : 0.0);
    Arc &changed = trial_[static_cast<std::size_t>(k)];
    if (random() < 0.15)
        changed.length *= 1.0 + 0.5 * draw_size(random);
    else if (!change_twist(changed.twist, random))
        return false;
    if (!closes(window, random))
        return false;
    path.swap(trial_);
    return true;
}

// Return whether the path without arc k can be closed and is cheaper. If so, it is the trial path.
bool LocalChanges::leave_out(const Pose &start, const std::vector<Arc> &path, int k, Random &random) {
    const int m = static_cast<int>(path.size()) - 1;
    Window window{std::max(0, k - 1 - draw_margin(random)), 0, problem_.goal, 0.0};
    window.last = std::min(m - 1, k + draw_margin(random));
    if (window.is_too_small())
        return false;
    poses_.resize(static_cast<std::size_t>(m + 2));
    poses_[0] = start;
    find_poses(path, 0, window.last + 1);
    if (window.last < m - 1)
        window.target = poses_[static_cast<std::size_t>(window.last + 2)];
    window.value = value_of(path, window.first, window.last + 1);
    trial_ = path;
    trial_.erase(trial_.begin() + k);
    return closes(window, random);
}

// Change three lengths so that the trial's arcs end at the target. Return whether they are cheaper than before, and
// free.
bool LocalChanges::closes(const Window &window, Random &random) {
    if (!close(window, draw_three(window.first, window.last, random)))
        return false;
    if (value_of(trial_, window.first, window.last) > window.value - WORTH)
        return false;
    return is_free(window);
}

// Solve the three equations by Newton's method with Cramer's rule.
bool LocalChanges::close(const Window &window, const std::array<int, 3> &chosen) {
    const auto arc = [&](int which) -> Arc & { return trial_[static_cast<std::size_t>(chosen[which])]; };
    const Pose &last = poses_[static_cast<std::size_t>(window.last + 1)];
    const auto column = [&](int which) {
        return effect_of(arc(which).twist, poses_[static_cast<std::size_t>(chosen[which] + 1)], last);
    };
    for (int round = 0; round < 6; ++round) {
        find_poses(trial_, window.first, window.last);
        const double x = window.target.x - last.x, y = window.target.y - last.y;
        const double t = floored_mod(window.target.theta - last.theta + PI, 2.0 * PI) - PI;
        if (std::abs(x) + std::abs(y) + std::abs(t) < CLOSED)
            return true;
        const Vector a = column(0), b = column(1), c = column(2);
        const Vector bc = cross(b, c);
        const double whole = dot(a, bc);
        if (std::abs(whole) < DEPENDENT)
            return false;
        const double da = (x * bc[0] + y * bc[1] + t * bc[2]) / whole;
        const double db =
            (a[0] * (y * c[2] - t * c[1]) + a[1] * (t * c[0] - x * c[2]) + a[2] * (x * c[1] - y * c[0])) / whole;
        const double dc =
            (a[0] * (b[1] * t - b[2] * y) + a[1] * (b[2] * x - b[0] * t) + a[2] * (b[0] * y - b[1] * x)) / whole;
        arc(0).length += da;
        arc(1).length += db;
        arc(2).length += dc;
        if (arc(0).length < 0.0 || arc(1).length < 0.0 || arc(2).length < 0.0)
            return false;
    }
    return false;
}

// Return whether the trial's arcs are collision-free.
bool LocalChanges::is_free(const Window &window) const {
    for (auto k = static_cast<std::size_t>(window.first); k <= static_cast<std::size_t>(window.last); ++k)
        if (trial_[k].length > 0.0 && !sweep_is_free(problem_.scene, poses_[k], trial_[k].twist, trial_[k].length))
            return false;
    return true;
}

// Replace a twist by a stable one near it; return false if there is none.
bool LocalChanges::change_twist(Twist &twist, Random &random) const {
    auto [i, b] = place_of(twist);
    if (i < 0)
        return false;
    const int k = static_cast<int>(problem_.segments.size());
    // Segments are ordered by longitude, so a small step stays near the twist.
    i = std::min(k - 1, std::max(0, i + static_cast<int>(std::lrint(draw_size(random) * 0.25 * k))));
    const Segment &segment = problem_.segments[static_cast<std::size_t>(i)];
    const double low = segment.low.omega, high = segment.high.omega;
    // Translations and twists at the end of a segment (the tightest turns) are good but have measure zero: random
    // sampling would never find them again.
    if (twist.omega == 0.0 && low * high < 0.0 && random() < KEEP_SHARE)
        b = low / (low - high);
    else if (std::min(b, 1.0 - b) > AT_END || random() > KEEP_SHARE)
        b = std::min(1.0, std::max(0.0, b + draw_size(random)));
    twist = between(segment, b);
    return true;
}

LocalChanges::Place LocalChanges::place_of(const Twist &twist) const {
    const Vector t = vector_of(twist);
    double best = INF;
    Place found{-1, 0.0};
    for (std::size_t i = 0; i < normals_.size(); ++i) {
        const Vector &normal = normals_[i];
        // Twists on a segment lie in its plane. Take the nearest plane with the twist between the segment's ends.
        const double away = std::abs(dot(t, normal));
        if (!(away < best) || (normal[0] == 0.0 && normal[1] == 0.0 && normal[2] == 0.0))
            continue;
        // t = alpha a + beta b in the plane of a and b: alpha = (t x b).n / (a x b).n, beta = (a x t).n / (a x b).n.
        const Vector a = vector_of(problem_.segments[i].low), b = vector_of(problem_.segments[i].high);
        const double size = dot(cross(a, b), normal);
        const double alpha = dot(cross(t, b), normal) / size, beta = dot(cross(a, t), normal) / size;
        if (alpha > -AT_END && beta > -AT_END) {
            best = away;
            found = {static_cast<int>(i), beta / (alpha + beta)};
        }
    }
    found.share = std::min(1.0, std::max(0.0, found.share));
    return found;
}

double LocalChanges::value_of(const std::vector<Arc> &path, int first, int last) const {
    double total = 0.0;
    for (int k = first; k <= last; ++k)
        total += arc_value(problem_.objective, path[static_cast<std::size_t>(k)]);
    return total;
}

// Compute the pose after each arc from the first to the last one.
void LocalChanges::find_poses(const std::vector<Arc> &path, int first, int last) {
    for (auto k = static_cast<std::size_t>(first); k <= static_cast<std::size_t>(last); ++k)
        poses_[k + 1] = step(poses_[k], path[k].twist, path[k].length);
}

} // namespace pushplan
