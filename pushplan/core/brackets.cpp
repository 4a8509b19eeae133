#include "brackets.hpp"

#include <algorithm>
#include <cmath>

namespace pushplan::boundary {

namespace {

constexpr double PUSH = 1e-3, DOUBT = 4.0;
const double GOLDEN = (std::sqrt(5.0) - 1.0) / 2.0;

// Return the largest possible value of a concave function with four known values.
double highest(const Section &s) {
    const double rise = (s.fb - s.fa) / (s.b - s.a), slope = (s.fc - s.fb) / (s.c - s.b);
    const double fall = (s.fd - s.fc) / (s.d - s.c);
    const double crossing = std::min(std::max((s.fc - s.fb - fall * (s.c - s.b)) / (rise - fall), 0.0), s.c - s.b);
    return std::max(std::max(s.fb + rise * crossing, s.fb - slope * (s.b - s.a)), s.fc + slope * (s.d - s.c));
}

} // namespace

RootSearch::RootSearch(const std::vector<Bracket> &brackets) {
    std::vector<double> values;
    for (const Bracket &bracket : brackets) {
        questions_.member.push_back(static_cast<std::int64_t>(states_.size()));
        questions_.x.push_back(bracket.inside);
        values.push_back(bracket.inside_value);
        states_.push_back({bracket});
    }
    take(values.data());
}

void RootSearch::take(const double *values) {
    std::size_t n = 0;
    for (std::size_t j = 0; j < questions_.x.size(); ++j) {
        const std::int64_t i = questions_.member[j];
        State &state = states_[i];
        auto &[a, b, fa, fb] = state.bracket;
        if (values[j] > 0.0)
            a = questions_.x[j], fa = values[j];
        else
            b = questions_.x[j], fb = values[j];
        const double half = 0.5 * (a + b), gap = std::abs(b - a);
        if (state.kappa == 0.0) {
            const double width = std::max(gap, TOLERANCE);
            state.steps = std::ceil(std::log2(width / TOLERANCE)) + 3.0, state.kappa = PUSH / width;
        }
        state.steps -= 1.0;
        if (!(gap > TOLERANCE && half != a))
            continue;
        const double falsi = (fb * a - fa * b) / (fb - fa);
        const double delta = std::max(state.kappa * gap * gap, 0.4 * TOLERANCE);
        const double towards = half > falsi ? 1.0 : -1.0;
        double point = delta <= std::abs(half - falsi) ? falsi + towards * delta : half;
        const double reach =
            std::max(0.5 * TOLERANCE * std::pow(2.0, std::max(state.steps, 0.0)) - 0.5 * gap, 0.0);
        if (std::abs(point - half) > reach)
            point = half - towards * reach;
        questions_.ask(n++, i, point);
    }
    questions_.shorten(n);
}

// First ask for both inner places of every section: all lower ones, then all upper ones.
PeakSearch::PeakSearch(const std::vector<double> &low, const std::vector<double> &high, double goal, int iterations)
    : goal_(goal) {
    for (std::size_t i = 0; i < low.size(); ++i) {
        const double a = low[i], d = high[i];
        const double b = d - GOLDEN * (d - a), c = a + GOLDEN * (d - a);
        sections_.push_back({a, b, c, d, 0.0, 0.0, 0.0, 0.0, static_cast<double>(iterations)});
    }
    for (const bool upper : {false, true}) {
        for (std::size_t i = 0; i < low.size(); ++i) {
            questions_.member.push_back(static_cast<std::int64_t>(i));
            questions_.x.push_back(upper ? sections_[i].c : sections_[i].b);
        }
    }
}

void PeakSearch::know_ends(const std::vector<double> &low, const std::vector<double> &high) {
    for (std::size_t i = 0; i < sections_.size(); ++i)
        sections_[i].fa = low[i], sections_[i].fd = high[i];
    concave_ = true;
}

bool PeakSearch::done(const Section &section) const {
    const double best = std::max(section.fb, section.fc);
    return best > goal_ || section.steps < -0.5 ||
           (concave_ && best + DOUBT * (highest(section) - best) <= goal_);
}

void PeakSearch::take(const double *values) {
    std::size_t n = 0, first = 0;
    if (!begun_) { // both inner values arrive at once
        for (std::size_t i = 0; i < sections_.size(); ++i)
            sections_[i].fb = values[i];
        first = sections_.size();
        begun_ = true;
    }
    for (std::size_t j = first; j < questions_.x.size(); ++j) {
        const std::int64_t i = questions_.member[j];
        Section &s = sections_[i];
        (questions_.x[j] == s.c ? s.fc : s.fb) = values[j];
        s.steps -= 1.0;
        if (done(s))
            continue;
        if (s.fb < s.fc) {
            s.a = s.b, s.b = s.c, s.fa = s.fb, s.fb = s.fc;
            s.c = s.a + GOLDEN * (s.d - s.a);
            questions_.ask(n++, i, s.c);
        } else {
            s.d = s.c, s.c = s.b, s.fd = s.fc, s.fc = s.fb;
            s.b = s.d - GOLDEN * (s.d - s.a);
            questions_.ask(n++, i, s.b);
        }
    }
    questions_.shorten(n);
}

} // namespace pushplan::boundary
