// Newton and Euler: forces of motion and acceleration, in addition to floor friction.
#pragma once

#include "friction.hpp"

namespace pushplan::mechanics {

// The force m a(c) on a mass at c = (x, y) in a frame with a twist and its time derivative:
//
//     a(c) = dv/dt + domega/dt J c + omega J (v + omega J c).
//
// Its moment about the origin is c x m a(c). Its moment about the centre of mass is the moment of inertia times
// domega/dt.
struct Force {
    double x, y;
};

inline Force inertia_force(double mass, double x, double y, const Twist &twist, const Twist &rate) {
    const auto [vx, vy, omega] = twist;
    return {mass * (rate.vx - rate.omega * y - omega * vy - omega * omega * x),
            mass * (rate.vy + rate.omega * x + omega * vx - omega * omega * y)};
}

} // namespace pushplan::mechanics
