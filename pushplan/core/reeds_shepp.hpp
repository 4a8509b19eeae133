// Words of a car that drives ahead and back (Reeds and Shepp 1990): left and right turns of radius 1, and straight
// parts.
#pragma once

#include "tables.hpp"

#include <array>

namespace pushplan {

// The parts of a word in turning radii and rad: `letters` are signs of the curvature (1 left, 0 straight, -1 right),
// `lengths` are < 0 backwards.
struct ReedsSheppWord {
    static constexpr int MOST_LETTERS = 5;

    int count = 0;
    std::array<double, MOST_LETTERS> letters;
    std::array<double, MOST_LETTERS> lengths;
};

// Each of eleven formulas gives at most four words: a word and its mirror image, ahead and backwards.
struct ReedsSheppWords {
    static constexpr int MOST = 4 * 11;

    int count = 0;
    std::array<ReedsSheppWord, MOST> words;

    const ReedsSheppWord *begin() const { return words.data(); }
    const ReedsSheppWord *end() const { return words.data() + count; }
};

// Return an angle in [-pi, pi).
inline double wrapped(double angle) { return angle - 2.0 * PI * std::floor((angle + PI) / (2.0 * PI)); }

// Find the words that lead from the origin to a pose.
void find_reeds_shepp(double x, double y, double phi, ReedsSheppWords &found);

} // namespace pushplan
