// Poses of the load between which pushes may lead: where random pushes lead, and where descents that shorten whole
// sequences end.
#pragma once

#include "pushes.hpp"

#include <vector>

namespace pushplan {

using Modes = std::vector<const PackedMode *>;

// Return where a random push brings a load, or, with sense -1, brings it from.
Pose pushed_at_random(const PackedMode &mode, const Pose &pose, double sense, Random &random);

// Move the poses (k - 1) between the pushes (k) of a sequence so that these get cheaper; return the sum of the pushes'
// costs. The first moves have a given scale, m; at most so many `moves` are tried.
double descend(const Modes &sequence, const std::array<Pose, 2> &ends, Row<Pose> poses, double scale, int moves,
               Random &random);

// What sequences are drawn from.
struct Draws {
    Pose start;
    std::vector<Pose> goals;
    std::vector<std::int64_t> firsts; // modes that a first push can have
    std::vector<std::int64_t> lasts;  // likewise a last one
    Table<const double> changes;      // (m, m) the least that changes of the mode cost
    std::int64_t most;                // pushes
    double below;                     // what the whole has to cost less than, m
};

// Draw a sequence of modes and the poses between its pushes, and descend; return these poses, none where the sequence
// costs too much.
std::vector<Pose> random_descent(const Modes &modes, const Draws &draws, Random &random);

} // namespace pushplan
