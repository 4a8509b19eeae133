// The stable set as coordinates in [0, 1], which OMPL's controls are.
#pragma once

#include "problem.hpp"

#include <array>
#include <vector>

namespace pushplan {

// Coordinates that `choose_twist` takes, the length as a share of the longest arc's, and units that it goes on for.
using Control = std::array<double, 4>;

Arc arc_of(const Problem &problem, const Control &control);

// Return the control of an arc, with whole units; not finite where its twist is on no segment.
Control control_of(const Problem &problem, const Arc &arc);

// Poses at the ends of arcs, and how many arcs come before one that is not free.
struct Followed {
    std::vector<Pose> poses;
    std::int64_t free;
};
Followed follow(const Scene &scene, const Pose &start, const std::vector<Arc> &arcs);

} // namespace pushplan
