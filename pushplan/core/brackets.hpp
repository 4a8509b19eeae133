// Root finding and maximisation in many brackets at once, for functions that are evaluated outside.
//
// A search names the functions and places to evaluate, and takes the values. Finished searches drop out.
#pragma once

#include <cstdint>
#include <vector>

namespace pushplan::boundary {

// Width of the bracket in which a root is enclosed.
constexpr double TOLERANCE = 1e-12;

// Evaluations that a search needs: members (n,) of a family of functions, and places (n,).
struct Questions {
    std::vector<std::int64_t> member;
    std::vector<double> x;

    void add(std::int64_t i, double at) { member.push_back(i), x.push_back(at); }
    // Store the n-th question.
    void ask(std::size_t n, std::int64_t i, double at) { member[n] = i, x[n] = at; }
    void shorten(std::size_t n) { member.resize(n), x.resize(n); }
};

// Places inside (f > 0) and outside (f <= 0), and the values at them.
struct Bracket {
    double inside, outside, inside_value, outside_value;
};

// Search for the last points with f > 0 between inside and outside. The ITP method (Oliveira & Takahashi 2020) is
// superlinear on smooth functions, and at most a few steps slower than bisection, even at jumps.
class RootSearch {
  public:
    explicit RootSearch(const std::vector<Bracket> &brackets);

    const Questions &questions() const { return questions_; }
    void take(const double *values);

    double end(std::size_t i) const { return states_[i].bracket.inside; }
    std::size_t count() const { return states_.size(); }

  private:
    struct State {
        Bracket bracket;
        double steps = 0.0, kappa = 0.0; // remaining steps; 0: not begun
    };

    std::vector<State> states_;
    Questions questions_;
};

// Four places and their values. The maximum is searched between the outer ones.
struct Section {
    double a, b, c, d, fa, fb, fc, fd;
    double steps; // remaining
};

// Golden-section searches. Each stops once above a goal. With values at both ends, it also stops if DOUBT times the
// largest possible rise of a concave function would not reach the goal.
class PeakSearch {
  public:
    PeakSearch(const std::vector<double> &low, const std::vector<double> &high, double goal, int iterations);
    void know_ends(const std::vector<double> &low, const std::vector<double> &high);

    const Questions &questions() const { return questions_; }
    void take(const double *values);

    const std::vector<Section> &sections() const { return sections_; }

  private:
    bool done(const Section &section) const;

    std::vector<Section> sections_;
    Questions questions_;
    double goal_;
    bool begun_ = false, concave_ = false;
};

} // namespace pushplan::boundary
