// Root finding and maximisation in many brackets at once, of functions that are known by their values only.
//
// The functions are asked from outside: a search says which of them it wants to know where, and takes the values. Those
// that are done drop out.
#pragma once

#include <cstdint>
#include <vector>

namespace pushplan::boundary {

// Width of the bracket in which a root is enclosed.
constexpr double TOLERANCE = 1e-12;

// Which functions are to be asked where: members (n,) of a family, and places (n,).
struct Questions {
    std::vector<std::int64_t> member;
    std::vector<double> x;

    void add(std::int64_t i, double at) { member.push_back(i), x.push_back(at); }
    // Put a question to the front of those that are answered.
    void ask(std::size_t n, std::int64_t i, double at) { member[n] = i, x[n] = at; }
    void shorten(std::size_t n) { member.resize(n), x.resize(n); }
};

// Places inside (f > 0) and outside (f <= 0), and the values there.
struct Bracket {
    double inside, outside, inside_value, outside_value;
};

// The last points with f > 0 on the way from the inside to the outside: the ITP method (Oliveira & Takahashi 2020),
// superlinear on smooth functions, never worse than bisection by more than a few steps, jumps included.
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
        double steps = 0.0, kappa = 0.0; // steps left; 0: not begun
    };

    std::vector<State> states_;
    Questions questions_;
};

// Four places and the values there; the maximum is sought between the outer ones.
struct Section {
    double a, b, c, d, fa, fb, fc, fd;
    double steps; // left
};

// Golden-section searches; each stops once above a goal, or, with values at both ends given, where a rise by DOUBT
// times what a concave function could still have would not reach it.
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
