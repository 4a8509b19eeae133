// Upper bounds of a motion's used shares of its limits between samples: speed, acceleration, jerk and contacts.
//
// Let the twist V = (v, omega) be a quadratic of time. Then, in the body's frame, the contact midpoint has the
// acceleration a = v' + omega x v and the jerk j = v'' + 2 omega x v' + omega' x v + omega x (omega x v). Both are
// polynomials of time. A polynomial on [0, 1] lies in the hull of its Bernstein coefficients, so the longest of these
// is a bound.
#pragma once

#include "step_sum.hpp"

#include <vector>

namespace pushplan {

// A limit of the pusher with two sides: for negative and for other values.
struct TwoSided {
    double negative;
    double positive;
};

struct PusherLimits {
    TwoSided speed;
    TwoSided acceleration;
    TwoSided angular_speed;
    TwoSided angular_acceleration;
    double jerk;
    double angular_jerk;
};

// Return the shares (q, 3) of the limits of speed, acceleration and jerk that pieces use, row by row.
std::vector<double> limit_use(Row<const double> durations, Row<const Quadratic> coefficients,
                              const PusherLimits &limits);

// Bounds of the wrenches of n contacts at k instants: the least value (k, n, 4) of each of their four conditions, N,
// and an upper bound (k, n) of their size, N.
struct ContactRows {
    const double *rows;
    const double *size;
};

// Contact use of pieces: the used share of the reserve, and the factor by which the twists must change more slowly so
// that the contacts hold.
struct ContactUse {
    std::vector<double> shares;
    std::vector<double> slowing;
};

// The contact use of q pieces with n contacts, from k instants. Contacts keep `margin`, and inertia can use the share
// `room` of their reserve above it.
struct ContactQuestion {
    std::ptrdiff_t contacts;
    ContactRows floor;   // transmitted without inertia
    ContactRows inertia; // added by inertia
    ContactRows steady;  // added by inertia at a steady twist
    double margin;
    double room;
};
ContactUse contact_use(const ContactQuestion &question, Row<const std::int64_t> piece, std::ptrdiff_t pieces);

} // namespace pushplan
