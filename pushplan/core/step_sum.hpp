// A twist that passes through given levels, one smooth step after the other, several under way at a time.
//
// V(t) = V_0 + sum_j (V_j+1 - V_j) b_j(t), where b_j is a step from 0 to 1 of widths (long, short) around its
// centre c_j: a jump averaged over both windows, so that V is a quadratic of time between the steps' phases.
//
// Where steps overlap, V is still a weighted mean of the levels, the weight of level j being b_j-1 - b_j. The
// weights are not negative if neither width changes faster along the steps than the centres do: b_j is the
// distribution function of X_j = c_j + long_j u + short_j w with the same u, w in [-1/2, 1/2] for all j, and then
// X_j-1 <= X_j whatever u and w are. `wider_steps` sees to that. Hence a convex set that contains the levels
// contains V.
#pragma once

#include "tables.hpp"

#include <array>
#include <vector>

namespace pushplan {

// A twist as a quadratic of time: c[0] + tau c[1] + tau^2 c[2], columns x, y and turn.
struct Quadratic {
    double c[3][3];
};

// A twist as one quadratic of time after the other.
struct Pieces {
    std::vector<double> durations;       // s
    std::vector<Quadratic> coefficients; // from the beginning of each piece on
    std::vector<std::int64_t> level;     // that a piece belongs to: that of the last step that is over
};

// Longest piece (s) on which the twist changes direction: a Magnus step over it is good to about 1e-11 m.
constexpr double FINEST = 0.02;

// Pieces of one phase of a step, at most: 10 s of the finest. A slower step needs no more of them, since the error of
// Magnus steps falls with the fourth power of their number, however long the phase takes.
constexpr std::int64_t MOST_OF_PHASE = 500;

// Phases that begin closer together (s) are one.
constexpr double SAME_TIME = 1e-9;

// The twist through `levels` (m + 1, 3), with steps at `centers` (m,), which never decrease, of `widths` (m, 2).
Pieces step_sum(Table<const double> levels, Row<const double> centers, Table<const double> widths);

// Steps that have to be wider for the levels' weights to stay positive: which, and bounds (w, 2) on their first and
// second derivative under which the fastest ones are just wide enough, 1/s and 1/s^2; row after row.
struct WiderSteps {
    std::vector<std::int64_t> which;
    std::vector<double> bounds;
};

// What is wider of steps at `centers` (m,) of `widths` (m, 2); one without a width is no step.
WiderSteps wider_steps(Row<const double> centers, Table<const double> widths);

// The poses (q + 1, 3) at the ends of pieces with twists `coefficients` (q), from `start` (3,) on; row after row.
std::vector<double> poses_after(const double *start, Row<const Quadratic> coefficients, Row<const double> durations);

} // namespace pushplan
