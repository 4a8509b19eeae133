// A twist that passes through given levels by a sequence of smooth steps, which can overlap.
//
// V(t) = V_0 + sum_j (V_j+1 - V_j) b_j(t). Here b_j is a step from 0 to 1 with widths (long, short) around its centre
// c_j: a jump averaged over both windows. So V is a quadratic of time between the phases of the steps.
//
// If steps overlap, V is still a weighted mean of the levels, where level j has the weight b_j-1 - b_j. The weights are
// not negative if neither width changes faster along the steps than the centres do. Reason: b_j is the distribution
// function of X_j = c_j + long_j u + short_j w with the same u, w in [-1/2, 1/2] for all j, and then X_j-1 <= X_j for
// all u and w. `wider_steps` ensures this. Hence a convex set that contains the levels contains V.
#pragma once

#include "tables.hpp"

#include <array>
#include <vector>

namespace pushplan {

// A twist as a quadratic of time: c[0] + tau c[1] + tau^2 c[2], columns x, y and turn.
struct Quadratic {
    double c[3][3];
};

// A twist as a sequence of quadratics in time.
struct Pieces {
    std::vector<double> durations;       // s
    std::vector<Quadratic> coefficients; // in the time since the beginning of each piece
    std::vector<std::int64_t> level;     // level of each piece, after the last completed step
};

// Maximum length (s) of a piece on which the twist changes direction. A Magnus step over it is accurate to about 1e-11
// m.
constexpr double FINEST = 0.02;

// Maximum number of pieces of one phase of a step: 10 s of the finest. A slower step needs no more, because the error
// of Magnus steps decreases with the fourth power of their number, for any length of the phase.
constexpr std::int64_t MOST_OF_PHASE = 500;

// Time (s) up to which the beginnings of two phases are one.
constexpr double SAME_TIME = 1e-9;

// Return the twist through `levels` (m + 1, 3), with steps at non-decreasing `centers` (m,) with `widths` (m, 2).
Pieces step_sum(Table<const double> levels, Row<const double> centers, Table<const double> widths);

// Steps that must be wider to keep the levels' weights positive: their indices, and limits (w, 2) of their first and
// second derivative with which the fastest steps are just wide enough, 1/s and 1/s^2, row by row.
struct WiderSteps {
    std::vector<std::int64_t> which;
    std::vector<double> bounds;
};

// Return the wider steps for steps at `centers` (m,) with `widths` (m, 2). A step with zero width is no step.
WiderSteps wider_steps(Row<const double> centers, Table<const double> widths);

// Return the poses (q + 1, 3) at the ends of pieces with twists `coefficients` (q), beginning at `start` (3,), row by
// row.
std::vector<double> poses_after(const double *start, Row<const Quadratic> coefficients, Row<const double> durations);

} // namespace pushplan
