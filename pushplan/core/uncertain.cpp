#include "uncertain.hpp"

#include <algorithm>

namespace pushplan::mechanics {

namespace {

// Columns of `points`, selected by index to avoid an unpredictable branch.
constexpr int LOW = 2, HIGH = 3;

Range range_at(Table<const double> ranges, std::ptrdiff_t i) { return read<Range>(ranges[i]); }

// Throw std::invalid_argument unless `firsts` (n + 1,) begin at 0, never fall, and end at `size`.
void check_firsts(const Kept<std::int64_t> &firsts, std::ptrdiff_t size, const char *name) {
    const auto &numbers = firsts.numbers;
    if (numbers.front() != 0 || numbers.back() != size || !std::is_sorted(numbers.begin(), numbers.end()))
        throw std::invalid_argument(std::string(name) + " does not cover all of them");
}

} // namespace

void PackedLoads::check() const {
    check_firsts(first, points.size(), "first");
    check_firsts(corner, corners.size(), "corner");
    for (std::ptrdiff_t i = 0; i < count(); ++i) {
        if (unit.numbers[i] >= units.count())
            throw std::invalid_argument("object " + std::to_string(i) + " has no unit load");
        if (by_centre(i) && corner.numbers[i] == corner.numbers[i + 1])
            throw std::invalid_argument("the load of object " + std::to_string(i) + " has no points to rest on");
    }
}

LeastRows::LeastRows(const PackedLoads &packed)
    : packed_(packed), known_(packed.count(), Wrench{0.0, 0.0, 0.0}), pulls_(packed.points.size()),
      values_(packed.points.size()), centred_(packed.count()), rows_(packed.count()), sizes_(packed.count()),
      slopes_(4 * packed.count() * packed.count(), 0.0) {
    const auto &corner = packed.corner.numbers;
    std::int64_t most = 1;
    for (std::ptrdiff_t i = 0; i < packed.count(); ++i)
        most = std::max(most, EDGE_POINTS * (corner[i + 1] - corner[i]) + BETWEEN * INTERVALS);
    for (std::ptrdiff_t i = 0; i < packed.count(); ++i) {
        if (!packed.by_centre(i))
            continue;
        std::vector<Point> corners;
        for (std::int64_t k = corner[i]; k < corner[i + 1]; ++k)
            corners.push_back(read<Point>(packed.corners.table()[k]));
        centred_[i].emplace(packed.centre(i), std::move(corners), packed.free.numbers[i] == 2, packed.length, most);
    }
}

void LeastRows::set_twist(const Twist &twist) {
    const double speed = std::max(std::abs(twist.vx), std::abs(twist.vy));
    const double scale = 1.0 / std::max(speed, std::abs(twist.omega) * packed_.length);
    const double vx = twist.vx * scale, vy = twist.vy * scale, omega = twist.omega * scale;
    const Supports supports = packed_.units.supports();
    for (std::ptrdiff_t i = 0; i < packed_.count(); ++i) {
        if (packed_.known(i)) {
            const Wrench w = carried_wrench(supports, packed_.unit.numbers[i], {vx, vy, omega});
            known_[i] = {w.x, w.y, w.m / packed_.length};
        }
        if (centred_[i])
            centred_[i]->set_twist({vx, vy, omega});
    }
    for (std::size_t p = 0; p < pulls_.size(); ++p) {
        const auto [x, y, low, high] = packed_.part(p);
        double u = vx - omega * y, v = vy + omega * x;
        const double speed = std::sqrt(u * u + v * v);
        if (speed > 0.0) // friction is 0 at a point at rest
            u = u / speed, v = v / speed;
        pulls_[p] = {u, v, (x * v - y * u) / packed_.length};
    }
}

void LeastRows::set_wrenches(const double *known, const double *pulls) {
    const auto set = [this](std::vector<Wrench> &wrenches, const double *numbers) {
        for (Wrench &w : wrenches) {
            w = {numbers[0], numbers[1], numbers[2] / packed_.length};
            numbers += 3;
        }
    };
    set(known_, known);
    set(pulls_, pulls);
}

// ---- distributions on points

// Return the minimum of sum_p phi_p values_p over parts phi_p in their intervals that sum to `total`. The dual sum is
// concave and a lower bound for every c. It equals the minimum for the c below which parts must be high. This c is one
// of the values, found by bisection.
double LeastRows::least_sum(std::ptrdiff_t first, std::ptrdiff_t stop, double total) const {
    if (stop - first <= 8) {
        double best = -INF;
        for (std::ptrdiff_t p = first; p < stop; ++p)
            best = std::max(best, dual_sum(first, stop, total, values_[p]));
        return best;
    }
    const Table<const double> parts = packed_.points.table();
    double mean = 0.0, spread = 0.0, weight = 0.0;
    for (std::ptrdiff_t p = first; p < stop; ++p) {
        const double part = parts[p][HIGH] - parts[p][LOW];
        mean = mean + part * values_[p], spread = spread + part * values_[p] * values_[p], weight = weight + part;
    }
    mean /= weight;
    const double sigma = std::sqrt(std::max(spread / weight - mean * mean, 0.0));
    double low = mean - 2.0 * sigma, high = mean + 2.0 * sigma; // the median is at most sigma away from the mean
    for (int halving = 0; halving < HALVINGS; ++halving) {
        const double c = 0.5 * (low + high);
        double filled = 0.0;
        for (std::ptrdiff_t p = first; p < stop; ++p)
            filled += parts[p][values_[p] < c ? HIGH : LOW];
        (filled > total ? high : low) = c;
    }
    return dual_sum(first, stop, total, 0.5 * (low + high));
}

// Return c total + sum over p of min(low (v - c), high (v - c)).
double LeastRows::dual_sum(std::ptrdiff_t first, std::ptrdiff_t stop, double total, double c) const {
    const Table<const double> parts = packed_.points.table();
    double least = c * total;
    for (std::ptrdiff_t p = first; p < stop; ++p) {
        const double over = values_[p] - c;
        least += parts[p][over > 0.0 ? LOW : HIGH] * over;
    }
    return least;
}

// Return the minimum of a row over the uncertain loads on the points of object i, per unit load.
double LeastRows::least_on_points(std::ptrdiff_t i, const Facet &g) {
    const std::ptrdiff_t first = packed_.first.numbers[i], stop = packed_.first.numbers[i + 1];
    const double total = packed_.total.numbers[i];
    for (std::ptrdiff_t p = first; p < stop; ++p)
        values_[p] = dot(g, pulls_[p]);
    const double least = least_sum(first, stop, total);
    if (total == 0.0) // a loss
        return (1.0 + packed_.miss.table()[i][0]) * least - packed_.miss.table()[i][1];
    return least;
}

// ---- rows, sizes, margins

// Return the minimum e_i of a row of a unit load on object i, or a bound of it.
double LeastRows::least(std::ptrdiff_t i, const Facet &g, Asked how) {
    if (centred_[i])
        return how == Asked::LOWER ? centred_[i]->quick(g) : centred_[i]->least(g);
    double least = packed_.known(i) ? dot(g, known_[i]) : 0.0;
    const bool some = packed_.first.numbers[i] < packed_.first.numbers[i + 1];
    if (some && !(how == Asked::UPPER && packed_.total.numbers[i] == 0.0))
        least += least_on_points(i, g);
    return least;
}

// Return the minimum of row j of contact k, N, or a bound of it.
double LeastRows::row(Table<const double> ranges, std::ptrdiff_t k, int j, Asked how) {
    const Facet g = packed_.facet(k, j);
    double total = 0.0;
    for (std::ptrdiff_t i = 0; i < packed_.count(); ++i) {
        const Range range = range_at(ranges, i);
        if (!packed_.carries(k, i) || !(range.high > 0.0))
            continue;
        total += range.least(least(i, g, how));
        if (centred_[i])
            slopes_[(4 * k + j) * packed_.count() + i] = range.high * centred_[i]->slope();
    }
    return total;
}

// Return the mean wrench of a unit load on points, and its maximum deviation, with moments times a factor.
LeastRows::Middle LeastRows::middle(std::ptrdiff_t i, double moments) const {
    Wrench sum = packed_.known(i) ? known_[i] : Wrench{0.0, 0.0, 0.0};
    const std::ptrdiff_t first = packed_.first.numbers[i], stop = packed_.first.numbers[i + 1];
    const double *miss = packed_.miss.table()[i];
    double cx = 0.0, cy = 0.0, cm = 0.0, weight = 0.0, spread = 0.0;
    if (packed_.total.numbers[i] == 0.0 && first < stop) { // parts with sum 0 deviate from the mean
        for (std::ptrdiff_t p = first; p < stop; ++p) {
            const double part = packed_.part(p).high;
            cx = cx + part * pulls_[p].x, cy = cy + part * pulls_[p].y;
            cm = cm + part * pulls_[p].m, weight = weight + part;
        }
        cx = cx / weight, cy = cy / weight, cm = cm / weight;
    }
    for (std::ptrdiff_t p = first; p < stop; ++p) {
        const auto [x, y, low, high] = packed_.part(p);
        const Wrench d{pulls_[p].x - cx, pulls_[p].y - cy, moments * (pulls_[p].m - cm)};
        const double half = 0.5 * (low + high);
        sum.x = sum.x + half * d.x, sum.y = sum.y + half * d.y, sum.m = sum.m + half * d.m;
        spread += 0.5 * (high - low) * length_of(d);
    }
    return {sum, (1.0 + miss[0]) * spread + miss[1]};
}

// Bound the sizes: |sum F_i w_i| at the means plus half of the widths, for loads on points.
void LeastRows::bound(Table<const double> ranges) {
    const std::ptrdiff_t n = packed_.count();
    std::vector<Wrench> middles(n, Wrench{0.0, 0.0, 0.0});
    std::fill(sizes_.begin(), sizes_.end(), 0.0);
    for (std::ptrdiff_t i = 0; i < n; ++i) {
        const auto [low, high] = range_at(ranges, i);
        const auto [w, spread] = middle(i);
        const double half = 0.5 * (low + high);
        const double added = 0.5 * (high - low) * length_of(w) + high * spread;
        for (std::ptrdiff_t k = 0; k < n; ++k) {
            if (!packed_.carries(k, i))
                continue;
            Wrench &sum = middles[k];
            sum.x = sum.x + half * w.x, sum.y = sum.y + half * w.y, sum.m = sum.m + half * w.m;
            sizes_[k] = sizes_[k] + added;
        }
    }
    for (std::ptrdiff_t k = 0; k < n; ++k)
        sizes_[k] += length_of(middles[k]);
}

std::array<double, 3> LeastRows::force(Table<const double> ranges) const {
    std::array<double, 3> disc{0.0, 0.0, 0.0};
    for (std::ptrdiff_t i = 0; i < packed_.count(); ++i) {
        const auto [low, high] = range_at(ranges, i);
        const auto [w, spread] = middle(i, 0.0);
        const double half = 0.5 * (low + high);
        disc[0] = disc[0] + half * w.x, disc[1] = disc[1] + half * w.y;
        disc[2] = disc[2] + 0.5 * (high - low) * std::hypot(w.x, w.y) + high * spread;
    }
    return disc;
}

// Bound the sizes if only centres are known: the largest force, sum F_i, and the largest moment.
void LeastRows::bound_centred(Table<const double> ranges) {
    const std::ptrdiff_t n = packed_.count();
    std::vector<Range> moments(n, Range{0.0, 0.0});
    std::fill(sizes_.begin(), sizes_.end(), 0.0);
    for (std::ptrdiff_t i = 0; i < n; ++i) {
        const Range range = range_at(ranges, i);
        const double low = least(i, {0.0, 0.0, 1.0}, Asked::EXACT), high = -least(i, {0.0, 0.0, -1.0}, Asked::EXACT);
        for (std::ptrdiff_t k = 0; k < n; ++k) {
            if (!packed_.carries(k, i))
                continue;
            moments[k].low += range.least(low);
            moments[k].high += range.most(high);
            sizes_[k] += range.high;
        }
    }
    for (std::ptrdiff_t k = 0; k < n; ++k)
        sizes_[k] = std::hypot(sizes_[k], std::max(-moments[k].low, moments[k].high));
}

void LeastRows::work_out(Table<const double> ranges) {
    packed_.centred ? bound_centred(ranges) : bound(ranges);
    for (std::ptrdiff_t k = 0; k < packed_.count(); ++k)
        for (int j = 0; j < 4; ++j)
            rows_[k][j] = row(ranges, k, j, Asked::EXACT);
}

double LeastRows::margin(double floor) {
    const Table<const double> loads = packed_.loads.table();
    const Asked how = packed_.centred ? Asked::LOWER : Asked::UPPER;
    double lowest = INF;
    packed_.centred ? bound_centred(loads) : bound(loads);
    for (std::ptrdiff_t k = 0; k < packed_.count(); ++k) {
        if (sizes_[k] == 0.0)
            lowest = 0.0;
        for (int j = 0; j < 4; ++j)
            rows_[k][j] = sizes_[k] > 0.0 ? row(loads, k, j, how) / sizes_[k] : INF;
    }
    return packed_.centred ? least_in_order(lowest, floor) : least_bounded(lowest, floor);
}

// Return the minimum of all rows, unless its value without pressure errors is already low enough.
double LeastRows::least_bounded(double lowest, double floor) {
    double upper = lowest;
    for (const auto &rows : rows_)
        for (const double row : rows)
            upper = std::min(upper, row);
    if (floor >= 0.0 && upper <= floor)
        return upper;
    for (std::ptrdiff_t k = 0; k < packed_.count(); ++k)
        for (int j = 0; j < 4; ++j)
            if (sizes_[k] > 0.0)
                lowest = std::min(lowest, row(packed_.loads.table(), k, j, Asked::EXACT) / sizes_[k]);
    return lowest;
}

// Evaluate rows from the lowest quick bound on, until no other row can be the minimum.
double LeastRows::least_in_order(double lowest, double floor) {
    while (lowest > floor) {
        std::ptrdiff_t best = 0;
        int next = 0;
        for (std::ptrdiff_t k = 0; k < packed_.count(); ++k)
            for (int j = 0; j < 4; ++j)
                if (rows_[k][j] < rows_[best][next])
                    best = k, next = j;
        if (rows_[best][next] >= lowest)
            break;
        rows_[best][next] = INF;
        lowest = std::min(lowest, row(packed_.loads.table(), best, next, Asked::EXACT) / sizes_[best]);
    }
    return lowest;
}

} // namespace pushplan::mechanics
