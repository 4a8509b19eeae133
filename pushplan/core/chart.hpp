// The stable set as coordinates in [0, 1], which OMPL's controls are.
#pragma once

#include "problem.hpp"

#include <array>
#include <vector>

namespace pushplan {

// Two coordinates for `choose_twist`, the length as a share of the longest arc, and the duration in units.
using Control = std::array<double, 4>;

Arc arc_of(const Problem &problem, const Control &control);

// Return the control of an arc, with a whole number of units; not finite if its twist is on no segment.
Control control_of(const Problem &problem, const Arc &arc);

// Poses at the ends of arcs, and the number of arcs before the first one that is not free.
struct Followed {
    std::vector<Pose> poses;
    std::int64_t free;
};
Followed follow(const Scene &scene, const Pose &start, const std::vector<Arc> &arcs);

} // namespace pushplan
