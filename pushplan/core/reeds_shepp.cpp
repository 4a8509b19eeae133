#include "reeds_shepp.hpp"

#include <algorithm>
#include <initializer_list>

namespace pushplan {
namespace {

constexpr double L = 1.0, S = 0.0, R = -1.0;

// By so much, in radii of turning, lengths of the wrong sign are zeros; not tuned.
constexpr double WRONG_SIGN = 1e-10;

bool is_below_zero(double length) { return length < -WRONG_SIGN; }
bool is_above_zero(double length) { return length > WRONG_SIGN; }

// Where a word ends: the heading phi, and where the centre of the last turn is from the centre of the first, as
// coordinates (xi, eta) and as distance and direction (rho, theta).
struct End {
    double phi, xi, eta, rho, theta;

    End() = default;
    // `side` is 1 where the last turn is to the same side as the first, -1 where it is to the other; c and s are
    // cosine and sine of phi.
    End(double x, double y, double phi, double c, double s, double side)
        : phi(phi), xi(x - side * s), eta(y - 1.0 + side * c), rho(std::hypot(xi, eta)), theta(std::atan2(eta, xi)) {}
};

bool fill(ReedsSheppWord &word, std::initializer_list<double> letters, std::initializer_list<double> lengths) {
    word.count = static_cast<int>(letters.size());
    std::copy(letters.begin(), letters.end(), word.letters.begin());
    std::copy(lengths.begin(), lengths.end(), word.lengths.begin());
    return true;
}

// First and last turn (tau, omega) of the words of four turns whose middle ones are u and v.
struct OuterTurns {
    double tau, omega;

    OuterTurns(double u, double v, const End &end) {
        const double delta = wrapped(u - v);
        const double a = std::sin(u) - std::sin(delta), b = std::cos(u) - std::cos(delta) - 1.0;
        const double first = std::atan2(end.eta * a - end.xi * b, end.xi * a + end.eta * b);
        const double second = 2.0 * (std::cos(delta) - std::cos(v) - std::cos(u)) + 3.0;
        tau = second < 0.0 ? wrapped(first + PI) : wrapped(first);
        omega = wrapped(tau - u + v - end.phi);
    }
};

// A - stands behind the letters that are driven backwards.

bool solve_lsl(const End &end, ReedsSheppWord &word) {
    const double t = end.theta, u = end.rho, v = wrapped(end.phi - t);
    if (is_below_zero(t) || is_below_zero(v))
        return false;
    return fill(word, {L, S, L}, {t, u, v});
}

bool solve_lsr(const End &end, ReedsSheppWord &word) {
    if (end.rho < 2.0)
        return false;
    const double u = std::sqrt(end.rho * end.rho - 4.0);
    const double t = wrapped(end.theta + std::atan2(2.0, u)), v = wrapped(t - end.phi);
    if (is_below_zero(t) || is_below_zero(v))
        return false;
    return fill(word, {L, S, R}, {t, u, v});
}

// L R- L
bool solve_lrl(const End &end, ReedsSheppWord &word) {
    if (end.rho > 4.0)
        return false;
    const double u = -2.0 * std::asin(0.25 * end.rho);
    const double t = wrapped(end.theta + 0.5 * u + PI), v = wrapped(end.phi - t + u);
    if (is_below_zero(t) || is_above_zero(u))
        return false;
    return fill(word, {L, R, L}, {t, u, v});
}

// L R L- R-
bool solve_lrlr_by_halves(const End &end, ReedsSheppWord &word) {
    const double share = 0.25 * (2.0 + end.rho);
    if (share > 1.0)
        return false;
    const double u = std::acos(share);
    const OuterTurns turns(u, -u, end);
    if (is_below_zero(turns.tau) || is_above_zero(turns.omega))
        return false;
    return fill(word, {L, R, L, R}, {turns.tau, u, -u, turns.omega});
}

// L R- L- R
bool solve_lrlr(const End &end, ReedsSheppWord &word) {
    const double share = (20.0 - end.rho * end.rho) / 16.0;
    if (share < 0.0 || share > 1.0)
        return false;
    const double u = -std::acos(share);
    const OuterTurns turns(u, u, end);
    if (is_below_zero(turns.tau) || is_below_zero(turns.omega))
        return false;
    return fill(word, {L, R, L, R}, {turns.tau, u, u, turns.omega});
}

// L R- S- L-, with a quarter of a turn R
bool solve_lrsl(const End &end, ReedsSheppWord &word) {
    if (end.rho < 2.0)
        return false;
    const double r = std::sqrt(end.rho * end.rho - 4.0), u = 2.0 - r;
    const double t = wrapped(end.theta + std::atan2(r, -2.0)), v = wrapped(end.phi - 0.5 * PI - t);
    if (is_below_zero(t) || is_above_zero(u) || is_above_zero(v))
        return false;
    return fill(word, {L, R, S, L}, {t, -0.5 * PI, u, v});
}

// L R- S- R-, with a quarter of a turn R at first
bool solve_lrsr(const End &end, ReedsSheppWord &word) {
    if (end.rho < 2.0)
        return false;
    const double t = std::atan2(end.xi, -end.eta), u = 2.0 - end.rho, v = wrapped(t + 0.5 * PI - end.phi);
    if (is_below_zero(t) || is_above_zero(u) || is_above_zero(v))
        return false;
    return fill(word, {L, R, S, R}, {t, -0.5 * PI, u, v});
}

// L R- S- L- R, with quarters of a turn R- and L-
bool solve_lrslr(const End &end, ReedsSheppWord &word) {
    if (end.rho < 2.0)
        return false;
    const double u = 4.0 - std::sqrt(end.rho * end.rho - 4.0);
    if (is_above_zero(u))
        return false;
    const double t =
        wrapped(std::atan2((4.0 - u) * end.xi - 2.0 * end.eta, -2.0 * end.xi + (u - 4.0) * end.eta));
    const double v = wrapped(t - end.phi);
    if (is_below_zero(t) || is_below_zero(v))
        return false;
    return fill(word, {L, R, S, L, R}, {t, -0.5 * PI, u, -0.5 * PI, v});
}

struct Formula {
    bool (*solve)(const End &, ReedsSheppWord &);
    bool other_side; // the last turn is not to the side of the first
    bool turned;     // the letters come in the opposite order
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

// Driven backwards or not, mirrored or not.
constexpr std::array<std::array<double, 2>, 4> SENSES = {{{1.0, 1.0}, {1.0, -1.0}, {-1.0, 1.0}, {-1.0, -1.0}}};

// The ends of words by side, order of the letters and sense: several formulas have each of them.
using Ends = std::array<std::array<std::array<End, SENSES.size()>, 2>, 2>;

Ends ends_at(double x, double y, double phi) {
    const double c = std::cos(phi), s = std::sin(phi);
    Ends ends;
    for (const bool turned : {false, true}) {
        // The way back, seen from the goal, has the letters in the opposite order.
        const double px = turned ? x * c + y * s : x, py = turned ? x * s - y * c : y;
        for (std::size_t k = 0; k < SENSES.size(); ++k) {
            const auto [flip, mirror] = SENSES[k];
            const double sense = flip * mirror;
            for (const bool other : {false, true})
                ends[other][turned][k] =
                    End(flip * px, mirror * py, sense * phi, c, sense * s, other ? -1.0 : 1.0);
        }
    }
    return ends;
}

} // namespace

void find_reeds_shepp(double x, double y, double phi, ReedsSheppWords &found) {
    const Ends ends = ends_at(x, y, phi);
    found.count = 0;
    for (const Formula &formula : FORMULAS) {
        for (std::size_t k = 0; k < SENSES.size(); ++k) {
            const auto [flip, mirror] = SENSES[k];
            ReedsSheppWord &word = found.words[found.count];
            if (!formula.solve(ends[formula.other_side][formula.turned][k], word))
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
