#include "reeds_shepp.hpp"

#include <algorithm>
#include <initializer_list>

namespace pushplan {
namespace {

constexpr double L = 1.0, S = 0.0, R = -1.0;

// Lengths of the wrong sign up to this size (in turning radii) count as zero. Not tuned.
constexpr double WRONG_SIGN = 1e-10;

bool is_below_zero(double length) { return length < -WRONG_SIGN; }
bool is_above_zero(double length) { return length > WRONG_SIGN; }

// Return an angle in (-pi, pi], as std::atan2 does.
double directed(double angle) { return -wrapped(-angle); }

// Data of the line from the centre of a word's first turn to that of its last turn. Words that are driven backwards or
// in the opposite order share it.
struct Centres {
    double rho, theta;       // distance and direction
    double root = 0.0;       // second leg of the right triangle with hypotenuse rho and a leg of 2
    double beta = 0.0;       // angle opposite to the leg of 2
    double middle = 0.0;     // middle turn of L R- L, < 0
    double halves = 0.0;     // first middle turn of L R L- R-
    double equal = 0.0;      // middle turns of L R- L- R, < 0
    double equal_turn = 0.0; // angle of its first turn beyond the direction of the centres

    // `other_side`: whether the last turn is to the other side than the first.
    Centres(double xi, double eta, bool other_side) : rho(std::hypot(xi, eta)), theta(std::atan2(eta, xi)) {
        if (rho >= 2.0)
            root = std::sqrt(rho * rho - 4.0), beta = std::atan2(2.0, root);
        if (!other_side) {
            middle = rho > 4.0 ? 0.0 : -2.0 * std::asin(0.25 * rho);
            return;
        }
        halves = rho > 2.0 ? 0.0 : std::acos(0.25 * (2.0 + rho));
        const double share = (20.0 - rho * rho) / 16.0;
        if (share >= 0.0 && share <= 1.0) {
            equal = -std::acos(share);
            equal_turn = std::atan2(2.0 - share, -std::sqrt(1.0 - share * share));
        }
    }
};

// The end of a word: heading phi, and the centre of the last turn in the direction theta.
struct End {
    double phi, theta;
    const Centres *between;
};

bool fill(ReedsSheppWord &word, std::initializer_list<double> letters, std::initializer_list<double> lengths) {
    word.count = static_cast<int>(letters.size());
    std::copy(letters.begin(), letters.end(), word.letters.begin());
    std::copy(lengths.begin(), lengths.end(), word.lengths.begin());
    return true;
}

// A - follows letters that are driven backwards.

bool solve_lsl(const End &end, ReedsSheppWord &word) {
    const double t = end.theta, u = end.between->rho, v = wrapped(end.phi - t);
    if (is_below_zero(t) || is_below_zero(v))
        return false;
    return fill(word, {L, S, L}, {t, u, v});
}

bool solve_lsr(const End &end, ReedsSheppWord &word) {
    if (end.between->rho < 2.0)
        return false;
    const double t = wrapped(end.theta + end.between->beta), v = wrapped(t - end.phi);
    if (is_below_zero(t) || is_below_zero(v))
        return false;
    return fill(word, {L, S, R}, {t, end.between->root, v});
}

// L R- L
bool solve_lrl(const End &end, ReedsSheppWord &word) {
    if (end.between->rho > 4.0)
        return false;
    const double u = end.between->middle;
    const double t = wrapped(end.theta + 0.5 * u + PI), v = wrapped(end.phi - t + u);
    if (is_below_zero(t))
        return false;
    return fill(word, {L, R, L}, {t, u, v});
}

// L R L- R-
bool solve_lrlr_by_halves(const End &end, ReedsSheppWord &word) {
    if (end.between->rho > 2.0)
        return false;
    const double u = end.between->halves;
    const double t = wrapped(end.theta + u + 0.5 * PI), v = wrapped(t - 2.0 * u - end.phi);
    if (is_below_zero(t) || is_above_zero(v))
        return false;
    return fill(word, {L, R, L, R}, {t, u, -u, v});
}

// L R- L- R
bool solve_lrlr(const End &end, ReedsSheppWord &word) {
    if (end.between->equal_turn == 0.0)
        return false;
    const double u = end.between->equal;
    const double t = wrapped(end.theta + end.between->equal_turn), v = wrapped(t - end.phi);
    if (is_below_zero(t) || is_below_zero(v))
        return false;
    return fill(word, {L, R, L, R}, {t, u, u, v});
}

// L R- S- L-, with a quarter turn R
bool solve_lrsl(const End &end, ReedsSheppWord &word) {
    const double u = 2.0 - end.between->root;
    if (end.between->rho < 2.0 || is_above_zero(u))
        return false;
    const double t = wrapped(end.theta + end.between->beta + 0.5 * PI), v = wrapped(end.phi - 0.5 * PI - t);
    if (is_below_zero(t) || is_above_zero(v))
        return false;
    return fill(word, {L, R, S, L}, {t, -0.5 * PI, u, v});
}

// L R- S- R-, with a quarter turn R first
bool solve_lrsr(const End &end, ReedsSheppWord &word) {
    const double u = 2.0 - end.between->rho;
    if (u > 0.0)
        return false;
    const double t = directed(end.theta + 0.5 * PI), v = wrapped(t + 0.5 * PI - end.phi);
    if (is_below_zero(t) || is_above_zero(v))
        return false;
    return fill(word, {L, R, S, R}, {t, -0.5 * PI, u, v});
}

// L R- S- L- R, with quarter turns R- and L-
bool solve_lrslr(const End &end, ReedsSheppWord &word) {
    const double u = 4.0 - end.between->root;
    if (is_above_zero(u))
        return false;
    const double t = wrapped(end.theta + end.between->beta + 0.5 * PI), v = wrapped(t - end.phi);
    if (is_below_zero(t) || is_below_zero(v))
        return false;
    return fill(word, {L, R, S, L, R}, {t, -0.5 * PI, u, -0.5 * PI, v});
}

struct Formula {
    bool (*solve)(const End &, ReedsSheppWord &);
    bool other_side; // the last turn is to the other side than the first
    bool turned;     // the letters are in the opposite order
};

constexpr std::array<Formula, 11> FORMULAS = {{
    {solve_lsl, false, false},
    {solve_lsr, true, false},
    {solve_lrl, false, false},
    {solve_lrlr_by_halves, true, false},
    {solve_lrlr, true, false},
    {solve_lrsl, false, false},
    {solve_lrsr, true, false},
    {solve_lrslr, true, false},
    {solve_lrl, false, true},
    {solve_lrsl, false, true},
    {solve_lrsr, true, true},
}};

// Signs of the words: driven backwards or not, mirrored or not.
constexpr std::array<std::array<double, 2>, 4> SENSES = {{{1.0, 1.0}, {1.0, -1.0}, {-1.0, 1.0}, {-1.0, -1.0}}};

// The ends of words by side, order of the letters and sense, shared by several formulas.
struct Ends {
    std::array<std::array<Centres, 2>, 2> centres; // by side, mirrored or not
    std::array<std::array<std::array<End, SENSES.size()>, 2>, 2> at;

    Ends(double x, double y, double phi, double c, double s)
        : centres{{{Centres(x - s, y - 1.0 + c, false), Centres(x + s, -y - 1.0 + c, false)},
                   {Centres(x + s, y - 1.0 - c, true), Centres(x - s, -y - 1.0 - c, true)}}} {
        for (const bool other : {false, true}) {
            for (const bool turned : {false, true}) {
                for (std::size_t k = 0; k < SENSES.size(); ++k) {
                    const auto [flip, mirror] = SENSES[k];
                    // The path back, seen from the goal, has the letters in the opposite order. Its first turn is the
                    // last turn of the path there.
                    const Centres &between = centres[other][(mirror < 0.0) != (other && turned)];
                    const double back = mirror * phi + (other ? between.theta : -between.theta);
                    const double theta = turned ? directed(back) : between.theta;
                    at[other][turned][k] = {flip * mirror * phi,
                                            flip < 0.0 ? std::copysign(PI, theta) - theta : theta, &between};
                }
            }
        }
    }
    Ends(const Ends &) = delete; // the ends refer to the centres
};

} // namespace

void find_reeds_shepp(double x, double y, double phi, ReedsSheppWords &found) {
    const Ends ends(x, y, phi, std::cos(phi), std::sin(phi));
    found.count = 0;
    for (const Formula &formula : FORMULAS) {
        for (std::size_t k = 0; k < SENSES.size(); ++k) {
            const auto [flip, mirror] = SENSES[k];
            ReedsSheppWord &word = found.words[found.count];
            if (!formula.solve(ends.at[formula.other_side][formula.turned][k], word))
                continue;
            for (int i = 0; i < word.count; ++i) {
                word.lengths[i] *= flip;
                word.letters[i] *= mirror;
            }
            if (formula.turned) {
                std::reverse(word.letters.begin(), word.letters.begin() + word.count);
                std::reverse(word.lengths.begin(), word.lengths.begin() + word.count);
            }
            ++found.count;
        }
    }
}

} // namespace pushplan
