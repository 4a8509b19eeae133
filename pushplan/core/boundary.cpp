// The boundary of a stable set between meridians: latitudes to evaluate, and their results.
#include "boundary.hpp"

#include <algorithm>
#include <cmath>

namespace pushplan::boundary {

namespace {

// Ratio of bends after halving a gap: 1/4 on a smooth boundary, above this next to a corner.
constexpr double SMOOTH = 0.3;

// Distance to the next meridian (rad) from which a doubtful meridian is sampled from pole to pole.
constexpr double WIDE_GAP = 0.02;

// Product of the distances from both neighbours (rad^2) up to which a bend is only rounding.
constexpr double NO_BEND = 1e-14;

// Initial limit of a bend, 1/rad; its relative change from one level to the next (more at corners); and the smallest
// search distance around an end, rad.
constexpr double UNKNOWN = 0.5, DOUBTFUL = 0.4, LEAST_REACH = 1e-10;

// Number of samples from pole to pole, and across a fan.
constexpr int GRID = 17, FAN = 13;
constexpr double OPENING = 1.5;

// Return the k-th of `count` equally spaced values from -end to end.
double spaced(double end, int count, int k) {
    return k + 1 < count ? k * (2.0 * end / (count - 1)) + -end : end;
}

// Return the latitude, at longitude x, of the great circle through an interval's end on two meridians.
double chord(const MeridianTable &table, std::int64_t a, std::int64_t b, double x, std::ptrdiff_t i, int j) {
    const double first = std::sin(table.at[b] - x), last = std::sin(x - table.at[a]);
    const double height = first * std::tan(table.end(a, i, j)) + last * std::tan(table.end(b, i, j));
    return std::atan(height / std::sin(table.at[b] - table.at[a]));
}

struct Expected {
    double guess, reach;
};

// Return the expected latitude of an end at longitude x between two meridians, and its uncertainty.
Expected expected(const MeridianTable &table, std::int64_t a, std::int64_t b, double x, std::ptrdiff_t i, int j) {
    const double span = (x - table.at[a]) * (table.at[b] - x), bend = table.bend_at(std::max(a, b), i, j);
    const double guess = chord(table, a, b, x, i, j);
    if (std::isnan(bend))
        return {guess, std::max(UNKNOWN * span, LEAST_REACH)};
    return {guess + bend * span, std::max(DOUBTFUL * std::abs(bend) * span, LEAST_REACH)};
}

// Return five latitudes of an interval: outside and inside its lower end, its middle, inside and outside its upper end.
std::array<double, 5> five_about(const MeridianTable &table, const Gap &gap, std::ptrdiff_t i, double wider) {
    std::array<double, 5> x{};
    double half = 0.0;
    for (int j = 0; j < 2; ++j) {
        const double outward = 2.0 * j - 1.0;
        const auto [guess, reach] = expected(table, gap.left, gap.right, gap.middle, i, j);
        x[4 * j] = std::min(std::max(guess + outward * wider * reach, -POLE), POLE);
        x[1 + 2 * j] = guess - outward * wider * reach;
        if (outward * guess >= POLE)
            x[1 + 2 * j] = outward * POLE;
        half += 0.5 * guess;
    }
    x[1] = std::min(x[1], half), x[2] = half, x[3] = std::max(half, x[3]);
    return x;
}

} // namespace

Questions fans(const MeridianTable &table, const Gaps &gaps, Row<const std::int64_t> chosen) {
    Questions found;
    for (const std::int64_t g : chosen) {
        double apart = 0.0;
        for (const std::int64_t side : {gaps[g].left, gaps[g].right}) {
            apart = floored_mod(std::abs(table.at[side] - gaps[g].middle), 2.0 * PI);
            for (std::int64_t i = 0; i < table.counts[side]; ++i) {
                const double low = table.end(side, i, 0), high = table.end(side, i, 1);
                for (int k = 0; k < FAN; ++k) {
                    const double x =
                        0.5 * (low + high) + std::max(high - low, 1.5 * apart) * spaced(OPENING, FAN, k);
                    if (std::abs(x) < POLE)
                        found.add(g, x);
                }
            }
        }
        for (int k = 0; k < GRID; ++k) {
            const double x = spaced(POLE, GRID, k);
            if (std::abs(x) >= POLE || apart > WIDE_GAP)
                found.add(g, x);
        }
    }
    return found;
}

Questions probes(const MeridianTable &table, const Gaps &gaps, Row<const std::int64_t> chosen, double wider) {
    Questions found;
    for (const std::int64_t g : chosen) {
        const Gap gap = gaps[g];
        if (table.counts[gap.left] != table.counts[gap.right])
            continue;
        for (std::int64_t i = 0; i < table.counts[gap.left]; ++i) {
            const auto five = five_about(table, gap, i, wider);
            if (i > 0)
                found.add(g, 0.5 * (found.x.back() + five[0]));
            for (const double x : five)
                found.add(g, x);
        }
    }
    return found;
}

Intervals followed(Row<const double> x, Row<const double> value, Row<const std::int64_t> member) {
    Intervals found;
    std::ptrdiff_t k = 0;
    while (k < x.size) {
        const std::size_t first = found.member.size();
        const std::int64_t now = member[k];
        double before = -INF;
        bool good = true;
        while (true) {
            if (k + 5 > x.size)
                throw std::invalid_argument("the latitudes of an interval are not five");
            Ends ends{};
            for (int j = 0; j < 2; ++j) {
                const std::ptrdiff_t outside = j == 0 ? k : k + 4, inside = j == 0 ? k + 1 : k + 3;
                const bool pole = std::abs(x[inside]) >= POLE;
                good &= value[inside] > 0.0 && (pole || !(value[outside] > 0.0));
                ends[j] = {x[inside], x[outside], value[inside], value[outside]};
            }
            good &= value[k + 2] > 0.0 && x[k] > before && x[k] <= x[k + 2] && x[k + 2] <= x[k + 4];
            found.member.push_back(now), found.ends.push_back(ends);
            before = x[k + 4], k += 5;
            if (k == x.size || member[k] != now)
                break;
            good &= !(value[k] > 0.0);
            ++k;
        }
        if (!good)
            found.member.resize(first), found.ends.resize(first);
    }
    return found;
}

Bends bends(const MeridianTable &table, const Gaps &gaps, const MeridianTable &found) {
    Bends known{std::vector<double>(2 * found.width * gaps.size(), std::nan("")),
                std::vector<std::uint8_t>(gaps.size(), 1)};
    for (std::ptrdiff_t g = 0; g < gaps.size(); ++g) {
        const auto [a, b, middle] = gaps[g];
        if (table.counts[a] != table.counts[b] || table.counts[b] != found.counts[g])
            continue;
        const double span = (middle - table.at[a]) * (table.at[b] - middle);
        double worst = 0.0, worst_above = 0.0;
        for (std::int64_t i = 0; i < found.counts[g]; ++i) {
            for (int j = 0; j < 2; ++j) {
                const double off = found.end(g, i, j) - chord(table, a, b, middle, i, j);
                worst = std::max(worst, std::abs(off));
                known.bend[found.place(g, i, j)] = span > NO_BEND ? off / span : std::nan("");
                worst_above = std::max(worst_above, 4.0 * span * std::abs(table.bend_at(std::max(a, b), i, j)));
            }
        }
        const bool smooth = worst <= 4.0 * FLATNESS && worst <= SMOOTH * worst_above;
        known.more[g] = !(worst <= FLATNESS || smooth);
    }
    return known;
}

} // namespace pushplan::boundary
