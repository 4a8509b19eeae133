// Planar poses, body twists, and arcs of constant twist.
#pragma once

#include "tables.hpp"

#include <array>
#include <cmath>

namespace pushplan {

// Position (m) and heading (rad) of a frame.
struct Pose {
    double x, y, theta;
};

// Velocity of a body in its own frame, in m and rad per metre of cost if scaled to a cost rate of 1.
struct Twist {
    double vx, vy, omega;

    // Zeros mark an unused motion.
    bool is_zero() const { return vx == 0.0 && vy == 0.0 && omega == 0.0; }
    Twist reversed() const { return {-vx, -vy, -omega}; }
};

// A twist and its length, m of cost; a row of a path (k, 4).
struct Arc {
    Twist twist;
    double length;
};

// A box in the plane, m.
struct Area {
    double xmin, ymin, xmax, ymax;
};

// The left turn, the straight push and the right turn that steering paths are made of, scaled to a cost rate of 1.
using Family = std::array<Twist, 3>;
constexpr int LEFT = 0, STRAIGHT = 1, RIGHT = 2;

static_assert(sizeof(Pose) == 3 * sizeof(double) && sizeof(Arc) == 4 * sizeof(double), "rows of NumPy's tables");
static_assert(sizeof(Family) == 9 * sizeof(double), "a block (3, 3) of NumPy's tables");

// Cost of a radian of turning, m; `pushplan.plans.path.TURN_WEIGHT`.
constexpr double TURN_WEIGHT = 0.1;

// Return the cost of a twist per second, m.
inline double cost_rate(const Twist &twist) {
    return std::hypot(twist.vx, twist.vy) + TURN_WEIGHT * std::abs(twist.omega);
}

inline Pose pose_at(const double *row) { return {row[0], row[1], row[2]}; }
inline Twist twist_at(const double *row) { return {row[0], row[1], row[2]}; }
inline Arc arc_at(const double *row) { return {twist_at(row), row[3]}; }

inline void put(double *row, const Pose &pose) { row[0] = pose.x, row[1] = pose.y, row[2] = pose.theta; }
inline void put(double *row, const Arc &arc) {
    row[0] = arc.twist.vx, row[1] = arc.twist.vy, row[2] = arc.twist.omega, row[3] = arc.length;
}

// Return the pose after moving along a constant body twist for `length` (exact exponential).
inline Pose step(const Pose &pose, const Twist &twist, double length) {
    const auto &[vx, vy, omega] = twist;
    const double half = 0.5 * omega * length;
    // The chord of an arc with angle 2 half points along half, and |chord| = length sin(half) / half.
    const double chord = std::abs(half) < 1e-8 ? length : length * std::sin(half) / half;
    const double c = chord * std::cos(pose.theta + half), s = chord * std::sin(pose.theta + half);
    return {pose.x + c * vx - s * vy, pose.y + s * vx + c * vy, pose.theta + 2.0 * half};
}

// Return the world pose of `inner`, a pose in the frame at `place`.
inline Pose joined(const Pose &place, const Pose &inner) {
    const double c = std::cos(place.theta), s = std::sin(place.theta);
    return {place.x + c * inner.x - s * inner.y, place.y + s * inner.x + c * inner.y, place.theta + inner.theta};
}

// Return a pose relative to the frame at `place`.
inline Pose seen_from(const Pose &place, const Pose &pose) {
    const double c = std::cos(place.theta), s = std::sin(place.theta);
    const double dx = pose.x - place.x, dy = pose.y - place.y;
    return {c * dx + s * dy, -s * dx + c * dy, pose.theta - place.theta};
}

// Return the distance of two poses, m: straight travel plus the smallest turn times `heading_length` (m/rad).
inline double apart(const Pose &a, const Pose &b, double heading_length) {
    const double turn = std::abs(floored_mod(a.theta - b.theta + PI, 2.0 * PI) - PI);
    return std::hypot(a.x - b.x, a.y - b.y) + heading_length * turn;
}

// Return a lower bound of the cost from a pose to the goal: straight travel plus the smallest turn.
inline double remaining(const Pose &pose, const Pose &goal) { return apart(goal, pose, TURN_WEIGHT); }

} // namespace pushplan
