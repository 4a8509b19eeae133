// The boundary of a stable set between meridians of the twist sphere: latitudes to evaluate, and their results.
//
// Between two meridians, an interval's end follows a great circle (the chord) with a bend. Its deviation from the chord
// is the bend times the product of the distances from both meridians. The bend is known after a meridian in between was
// evaluated.
#pragma once

#include "brackets.hpp"
#include "tables.hpp"

#include <array>

namespace pushplan::boundary {

// Latitude of a counter-clockwise turn about the chain frame's origin.
constexpr double POLE = PI / 2.0;

// Largest deviation of the boundary from the great circle between neighbouring meridians, rad.
constexpr double FLATNESS = 1e-6;

// m meridians: longitudes, numbers of intervals, and the (m, width, 2) ends and bends of the intervals.
struct MeridianTable {
    Row<const double> at;
    Row<const std::int64_t> counts;
    const double *ends, *bend;
    std::ptrdiff_t width;

    std::ptrdiff_t place(std::int64_t meridian, std::ptrdiff_t i, int j) const {
        return (meridian * width + i) * 2 + j;
    }
    double end(std::int64_t meridian, std::ptrdiff_t i, int j) const { return ends[place(meridian, i, j)]; }
    double bend_at(std::int64_t meridian, std::ptrdiff_t i, int j) const { return bend[place(meridian, i, j)]; }
};

// A gap: its left and right meridian in a table, and a longitude between them.
struct Gap {
    std::int64_t left, right;
    double middle;
};

struct Gaps {
    Row<const std::int64_t> left, right;
    Row<const double> middle;

    std::ptrdiff_t size() const { return left.size; }
    Gap operator[](std::ptrdiff_t g) const { return {left[g], right[g], middle[g]}; }
};

// Brackets of the lower and the upper end of an interval.
using Ends = std::array<Bracket, 2>;

struct Intervals {
    std::vector<std::int64_t> member;
    std::vector<Ends> ends;
};

// Return latitudes around the intervals on both sides of chosen gaps, and the poles. A fan widens with the distance in
// longitude, because intervals can slope. Wide gaps get more latitudes.
Questions fans(const MeridianTable &table, const Gaps &gaps, Row<const std::int64_t> chosen);

// Return latitudes that test whether the intervals in gaps are as expected from both sides. For each interval: outside
// and inside its lower end, its middle, inside and outside its upper end. And one between two intervals.
Questions probes(const MeridianTable &table, const Gaps &gaps, Row<const std::int64_t> chosen, double wider);

// Return the intervals that are as expected, given the values at the probed latitudes.
Intervals followed(Row<const double> x, Row<const double> value, Row<const std::int64_t> member);

struct Bends {
    std::vector<double> bend;       // of the ends found; nan if unknown
    std::vector<std::uint8_t> more; // by gap: whether the boundary is not yet flat
};

// Return the bends of meridians found in gaps.
Bends bends(const MeridianTable &table, const Gaps &gaps, const MeridianTable &found);

} // namespace pushplan::boundary
