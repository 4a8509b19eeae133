#include "step_sum.hpp"

#include <algorithm>

namespace pushplan {

namespace {

constexpr double SQRT_3 = 1.7320508075688772;
constexpr double GAUSS = SQRT_3 / 6.0; // distance of the nodes of Gauss's rule from the middle, as a share of the width

std::array<double, 3> twist_at(const Quadratic &twist, double tau) {
    const auto &c = twist.c;
    return {c[0][0] + tau * (c[1][0] + tau * c[2][0]), c[0][1] + tau * (c[1][1] + tau * c[2][1]),
            c[0][2] + tau * (c[1][2] + tau * c[2][2])};
}

// Return the motion under a twist from its beginning to the time h: a fourth-order step of the Magnus series.
std::array<double, 3> motion_over(const Quadratic &twist, double h) {
    const double middle = 0.5 * h;
    const double early = middle - GAUSS * h, late = middle + GAUSS * h;
    const auto [ax, ay, aw] = twist_at(twist, early);
    const auto [bx, by, bw] = twist_at(twist, late);
    const double bracket = SQRT_3 / 12.0 * h * h;
    const double x = 0.5 * h * (ax + bx) + bracket * (bw * ay - aw * by);
    const double y = 0.5 * h * (ay + by) + bracket * (aw * bx - bw * ax);
    const double half = 0.25 * h * (aw + bw);
    const double chord = std::abs(half) < 1e-8 ? 1.0 : std::sin(half) / half;
    const double p = chord * std::cos(half), q = chord * std::sin(half);
    return {p * x - q * y, q * x + p * y, 2.0 * half};
}

// A step between two levels: its beginning and end, and its windows.
struct Step {
    double begin;
    double end;
    double length; // long
    double brief;  // short
};

std::vector<Step> steps_between(Table<const double> levels, Row<const double> centers, Table<const double> widths) {
    std::vector<Step> steps(static_cast<std::size_t>(centers.size));
    for (std::ptrdiff_t j = 0; j < centers.size; ++j) {
        const double *here = levels[j], *next = levels[j + 1];
        const bool equal = next[0] == here[0] && next[1] == here[1] && next[2] == here[2];
        const double length = equal ? 0.0 : widths[j][0], brief = equal ? 0.0 : widths[j][1];
        const double half = (length + brief) / 2.0;
        steps[static_cast<std::size_t>(j)] = {centers[j] - half, centers[j] + half, length, brief};
    }
    return steps;
}

// Return the times at which phases of steps begin or end, increasing by more than `SAME_TIME`.
std::vector<double> phases_of(const std::vector<Step> &steps) {
    std::vector<double> times;
    times.reserve(4 * steps.size());
    for (const Step &step : steps)
        for (const double time : {step.begin, step.begin + step.brief, step.end - step.brief, step.end}) {
            std::size_t k = times.size(); // nearly sorted: at most neighbours overlap
            while (k > 0 && times[k - 1] > time)
                --k;
            times.insert(times.begin() + static_cast<std::ptrdiff_t>(k), time);
        }
    std::vector<double> kept{times[0]};
    double last = times[0];
    for (std::size_t k = 1; k < times.size(); ++k) {
        if (times[k] - last > SAME_TIME)
            kept.push_back(times[k]);
        last = times[k];
    }
    return kept;
}

// Beginnings and ends of steps, each in order.
struct Bounds {
    std::vector<double> begins;
    std::vector<double> ends;

    explicit Bounds(const std::vector<Step> &steps) {
        for (const Step &step : steps)
            begins.push_back(step.begin), ends.push_back(step.end);
        std::sort(begins.begin(), begins.end());
        std::sort(ends.begin(), ends.end());
    }

    // Return the number of completed steps.
    std::ptrdiff_t over(double time) const {
        return std::lower_bound(ends.begin(), ends.end(), time) - ends.begin();
    }

    bool under_way(double time) const {
        const auto begun = std::lower_bound(begins.begin(), begins.end(), time) - begins.begin();
        return begun > std::upper_bound(ends.begin(), ends.end(), time) - ends.begin();
    }
};

// Return the times at which phases begin or end, with finer ones in between during steps.
std::vector<double> breaks_of(const std::vector<Step> &steps, const Bounds &bounds) {
    const std::vector<double> phases = phases_of(steps);
    std::vector<double> breaks;
    for (std::size_t i = 0; i + 1 < phases.size(); ++i) {
        const double begin = phases[i], end = phases[i + 1];
        std::int64_t count = 1;
        if (bounds.under_way(0.5 * (begin + end))) {
            const double wanted = std::ceil((end - begin) / FINEST);
            count = wanted < static_cast<double>(MOST_OF_PHASE) ? static_cast<std::int64_t>(wanted) : MOST_OF_PHASE;
        }
        for (std::int64_t k = 0; k < count; ++k)
            breaks.push_back(begin + static_cast<double>(k) / static_cast<double>(count) * (end - begin));
    }
    breaks.push_back(phases.back());
    return breaks;
}

// Return the coefficients of a step b_j about a time `u` after its beginning, in the phase at the time `into`.
std::array<double, 3> phase(double u, double into, double length, double brief) {
    const double w = length + brief - u;
    if (into > length + brief)
        return {1.0, 0.0, 0.0};
    if (into > length)
        return {1.0 - w * w / (2.0 * length * brief), w / (length * brief), -1.0 / (2.0 * length * brief)};
    if (into > brief)
        return {(u - brief / 2.0) / length, 1.0 / length, 0.0};
    return {u * u / (2.0 * length * brief), u / (length * brief), 1.0 / (2.0 * length * brief)};
}

// Sum of the first level and the steps so far, for increasing times. Completed steps are added once.
class Sum {
  public:
    Sum(Table<const double> levels, const std::vector<Step> &steps)
        : levels_(levels), steps_(steps), earliest_(steps.size()) {
        std::copy(levels[0], levels[0] + 3, past_.c[0]);
        double earliest = steps.back().begin;
        for (std::size_t j = steps.size(); j-- > 0;)
            earliest_[j] = earliest = std::min(earliest, steps[j].begin);
    }

    Quadratic between(double begin, double end) {
        const double middle = 0.5 * (begin + end);
        for (; first_ < steps_.size() && middle - steps_[first_].begin > width(steps_[first_]); ++first_)
            add(past_, first_, begin, middle);
        Quadratic piece = past_;
        for (std::size_t j = first_; j < steps_.size() && middle >= earliest_[j]; ++j)
            if (middle >= steps_[j].begin)
                add(piece, j, begin, middle);
        return piece;
    }

  private:
    static double width(const Step &step) { return step.length + step.brief; }

    void add(Quadratic &piece, std::size_t j, double begin, double middle) const {
        const Step &step = steps_[j];
        const auto shape = phase(begin - step.begin, middle - step.begin, step.length, step.brief);
        const double *here = levels_[static_cast<std::ptrdiff_t>(j)], *next = here + 3;
        for (int d = 0; d < 3; ++d) {
            const double change = next[d] - here[d];
            for (int order = 0; order < 3; ++order)
                piece.c[order][d] += shape[static_cast<std::size_t>(order)] * change;
        }
    }

    Table<const double> levels_;
    const std::vector<Step> &steps_;
    std::vector<double> earliest_; // earliest beginning of this step and all later ones
    Quadratic past_{};
    std::size_t first_ = 0; // first step that is not over
};

} // namespace

Pieces step_sum(Table<const double> levels, Row<const double> centers, Table<const double> widths) {
    if (centers.size < 1 || levels.rows != centers.size + 1 || levels.columns != 3)
        throw std::invalid_argument("levels must be (m + 1, 3) for m >= 1 steps");
    if (widths.rows != centers.size || widths.columns != 2)
        throw std::invalid_argument("widths must be (m, 2) for m steps");
    const std::vector<Step> steps = steps_between(levels, centers, widths);
    const Bounds bounds(steps);
    const std::vector<double> breaks = breaks_of(steps, bounds);
    Sum sum(levels, steps);
    Pieces pieces;
    const std::size_t count = breaks.size() - 1;
    pieces.durations.reserve(count);
    pieces.coefficients.reserve(count);
    pieces.level.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        pieces.durations.push_back(breaks[i + 1] - breaks[i]);
        pieces.coefficients.push_back(sum.between(breaks[i], breaks[i + 1]));
        pieces.level.push_back(bounds.over(0.5 * (breaks[i] + breaks[i + 1])));
    }
    return pieces;
}

WiderSteps wider_steps(Row<const double> centers, Table<const double> widths) {
    if (widths.rows != centers.size || widths.columns != 2)
        throw std::invalid_argument("widths must be (m, 2) for m steps");
    WiderSteps found;
    for (std::ptrdiff_t i = 0; i < centers.size; ++i) {
        const double own_length = widths[i][0], own_brief = widths[i][1];
        double length = own_length, brief = own_brief;
        for (std::ptrdiff_t j = 0; j < centers.size; ++j) {
            const double apart = std::abs(centers[i] - centers[j]);
            length = std::max(length, widths[j][0] - apart);
            brief = std::max(brief, widths[j][1] - apart);
        }
        if (own_length > 0.0 && (length > own_length || brief > own_brief)) {
            found.which.push_back(i);
            found.bounds.insert(found.bounds.end(), {1.0 / length, 1.0 / (length * brief)});
        }
    }
    return found;
}

std::vector<double> poses_after(const double *start, Row<const Quadratic> coefficients, Row<const double> durations) {
    if (coefficients.size != durations.size)
        throw std::invalid_argument("the numbers of coefficients and of durations differ");
    std::vector<double> poses(static_cast<std::size_t>(3 * (durations.size + 1)));
    double *pose = poses.data();
    std::copy(start, start + 3, pose);
    for (std::ptrdiff_t i = 0; i < durations.size; ++i, pose += 3) {
        const auto [x, y, turn] = motion_over(coefficients[i], durations[i]);
        const double c = std::cos(pose[2]), s = std::sin(pose[2]);
        pose[3] = pose[0] + c * x - s * y;
        pose[4] = pose[1] + s * x + c * y;
        pose[5] = pose[2] + turn;
    }
    return poses;
}

} // namespace pushplan
