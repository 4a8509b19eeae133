// Upper bounds of what a motion uses of its limits between samples: of speeds, accelerations, jerks, and contacts.
//
// Of a twist V = (v, omega) that is a quadratic of time, the contact midpoint has, in the body's frame, the
// acceleration a = v' + omega x v and the jerk j = v'' + 2 omega x v' + omega' x v + omega x (omega x v): polynomials
// of time. A polynomial on [0, 1] lies in the hull of its Bernstein coefficients, so the longest of these bounds it.
#pragma once

#include "step_sum.hpp"

#include <vector>

namespace pushplan {

// Limits of the pusher that have two sides: where the quantity is negative, and where it is not.
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

// Shares (q, 3) that pieces use of the limits of speed, acceleration and jerk; row after row.
std::vector<double> limit_use(Row<const double> durations, Row<const Quadratic> coefficients,
                              const PusherLimits &limits);

// What is known of the wrenches of n contacts at k instants: the least value of each of their four conditions, N,
// (k, n, 4), and a bound (k, n) on their size, N.
struct ContactRows {
    const double *rows;
    const double *size;
};

// What pieces use of their contacts: the share of what there is to spare, and by which factor the same twists have to
// change more slowly for the contacts to hold.
struct ContactUse {
    std::vector<double> shares;
    std::vector<double> slowing;
};

// What q pieces use of n contacts, from instants on them (k,); `margin` is what contacts keep, and inertia may use up
// the share `room` of what they have to spare above it.
struct ContactQuestion {
    std::ptrdiff_t contacts;
    ContactRows floor;   // what contacts transmit without inertia
    ContactRows inertia; // what inertia adds
    ContactRows steady;  // what it adds where the twist does not change
    double margin;
    double room;
};
ContactUse contact_use(const ContactQuestion &question, Row<const std::int64_t> piece, std::ptrdiff_t pieces);

} // namespace pushplan
