// The boundary of a stable set between meridians of the twist sphere: where to look, and what was found.
//
// Between two meridians an end of an interval runs along a great circle, with a bend that is known once a meridian was
// put between: off the chord by the bend times the product of the distances from both.
#pragma once

#include "brackets.hpp"
#include "tables.hpp"

#include <array>

namespace pushplan::boundary {

// Latitude of a counter-clockwise turn about the chain frame's origin.
constexpr double POLE = PI / 2.0;

// Largest angle by which the boundary may leave the great circle between neighbouring meridians, rad.
constexpr double FLATNESS = 1e-6;

// m meridians: longitudes, numbers of intervals, and these intervals' (m, width, 2) ends and bends.
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

// Meridians of a table to the left and to the right, and a longitude between.
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

// Latitudes around the intervals to both sides of chosen gaps, and the poles. A fan opens with the distance in
// longitude, as intervals may lean. Where gaps are wide, there are more.
Questions fans(const MeridianTable &table, const Gaps &gaps, Row<const std::int64_t> chosen);

// Latitudes that tell whether as many intervals as to both sides are as expected: for each, outside and inside of its
// lower end, its middle, inside and outside of the upper one; and one between two intervals.
Questions probes(const MeridianTable &table, const Gaps &gaps, Row<const std::int64_t> chosen, double wider);

// The intervals that are as expected, from the values at the latitudes that were probed.
Intervals followed(Row<const double> x, Row<const double> value, Row<const std::int64_t> member);

struct Bends {
    std::vector<double> bend;       // of the ends found; nan where it is not known
    std::vector<std::uint8_t> more; // of a gap: whether the boundary is not flat there yet
};

// The bends of meridians that were found in gaps.
Bends bends(const MeridianTable &table, const Gaps &gaps, const MeridianTable &found);

} // namespace pushplan::boundary
