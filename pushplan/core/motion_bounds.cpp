#include "motion_bounds.hpp"

#include <algorithm>

namespace pushplan {

namespace {

// Coefficients smaller than the largest one by this factor have no sign.
constexpr double SIGNLESS = 1e-9;

// Minimum reserve (N) of a contact condition, so that no reserve means a large use instead of a division by 0.
constexpr double TINY = 1e-12;

constexpr double binomial(int n, int k) {
    double value = 1.0;
    for (int i = 1; i <= k; ++i)
        value = value * (n - k + i) / i; // an integer at every step
    return value;
}

// Conversion from power to Bernstein coefficients on [0, 1] for one degree: b_k = sum_j C(k, j) / C(degree, j) p_j.
template <int DEGREE> struct ToBernstein {
    double factor[DEGREE + 1][DEGREE + 1];

    constexpr ToBernstein() : factor() {
        for (int k = 0; k <= DEGREE; ++k)
            for (int j = 0; j <= k; ++j)
                factor[k][j] = binomial(k, j) / binomial(DEGREE, j);
    }
};

template <int DEGREE> constexpr ToBernstein<DEGREE> TO_BERNSTEIN{};

// N coefficients, lowest order first, of polynomials with C columns.
template <int N, int C> using Polynomials = double[N][C];

// Return the length of the longest Bernstein coefficient over [0, 1] of the columns [first, last).
template <int N, int C> double longest(const Polynomials<N, C> &p, int first, int last) {
    double largest = 0.0;
    for (int k = 0; k < N; ++k) {
        double square = 0.0;
        for (int c = first; c < last; ++c) {
            double value = 0.0;
            for (int j = 0; j <= k; ++j)
                value += TO_BERNSTEIN<N - 1>.factor[k][j] * p[j][c];
            square += value * value;
        }
        largest = std::max(largest, square);
    }
    return std::sqrt(largest);
}

struct Hull {
    double low;
    double high;
};

// Return the smallest and the largest Bernstein coefficient over [0, 1] of a column.
template <int N, int C> Hull hull_of(const Polynomials<N, C> &p, int column) {
    Hull hull{INF, -INF};
    for (int k = 0; k < N; ++k) {
        double value = 0.0;
        for (int j = 0; j <= k; ++j)
            value += TO_BERNSTEIN<N - 1>.factor[k][j] * p[j][column];
        hull = {std::min(hull.low, value), std::max(hull.high, value)};
    }
    return hull;
}

// Return the limit of the side given by a polynomial's sign; the smaller limit if the sign is unclear.
double limit_of(const Hull &sign, const TwoSided &limit) {
    const double tiny = SIGNLESS * std::max(-sign.low, sign.high);
    if (sign.low >= -tiny)
        return limit.positive;
    return sign.high > tiny ? std::min(limit.negative, limit.positive) : limit.negative;
}

// Return the largest share of its limits that a polynomial uses on either side.
double used(const Hull &hull, const TwoSided &limit) {
    return std::max(-hull.low / limit.negative, hull.high / limit.positive);
}

// The twist of a piece and its time derivatives, as polynomials of time / duration.
struct Motion {
    double twist[3][3];
    double first[2][3];
    double second[1][3];
    double acceleration[5][2];
    double jerk[7][2];
    double power[7][1]; // acceleration . v; its sign shows whether the speed grows

    Motion(double duration, const Quadratic &piece) : acceleration(), jerk(), power() {
        const double powers[] = {1.0, duration, duration * duration};
        for (int c = 0; c < 3; ++c) {
            for (int j = 0; j < 3; ++j)
                twist[j][c] = piece.c[j][c] * powers[j];
            first[0][c] = twist[1][c] / duration;
            first[1][c] = 2.0 * twist[2][c] / duration;
            second[0][c] = first[1][c] / duration;
        }
        for (int c = 0; c < 2; ++c) {
            jerk[0][c] = second[0][c];
            for (int j = 0; j < 2; ++j)
                acceleration[j][c] = first[j][c];
        }
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                add_turn(i, j);
        for (int i = 0; i < 5; ++i)
            for (int j = 0; j < 3; ++j)
                power[i + j][0] += acceleration[i][0] * twist[j][0] + acceleration[i][1] * twist[j][1];
    }

    // Add the products of the i-th coefficient of omega and the j-th coefficient of the vector that it turns.
    void add_turn(int i, int j) {
        acceleration[i + j][0] -= twist[i][2] * twist[j][1];
        acceleration[i + j][1] += twist[i][2] * twist[j][0];
        if (j < 2) {
            jerk[i + j][0] -= 2.0 * twist[i][2] * first[j][1];
            jerk[i + j][1] += 2.0 * twist[i][2] * first[j][0];
            jerk[i + j][0] -= first[j][2] * twist[i][1];
            jerk[i + j][1] += first[j][2] * twist[i][0];
        }
        for (int k = 0; k < 3; ++k)
            for (int c = 0; c < 2; ++c)
                jerk[i + j + k][c] -= twist[i][2] * twist[j][2] * twist[k][c];
    }
};

void require_pieces(Row<const double> durations, Row<const Quadratic> coefficients) {
    if (coefficients.size != durations.size)
        throw std::invalid_argument("the numbers of coefficients and of durations differ");
}

} // namespace

std::vector<double> limit_use(Row<const double> durations, Row<const Quadratic> coefficients,
                              const PusherLimits &limits) {
    require_pieces(durations, coefficients);
    std::vector<double> shares;
    shares.reserve(static_cast<std::size_t>(3 * durations.size));
    for (std::ptrdiff_t i = 0; i < durations.size; ++i) {
        const Motion motion(durations[i], coefficients[i]);
        const double speed = longest(motion.twist, 0, 2), gain = longest(motion.acceleration, 0, 2);
        shares.push_back(std::max(speed / limit_of(hull_of(motion.twist, 0), limits.speed),
                                  used(hull_of(motion.twist, 2), limits.angular_speed)));
        shares.push_back(std::max(gain / limit_of(hull_of(motion.power, 0), limits.acceleration),
                                  used(hull_of(motion.first, 2), limits.angular_acceleration)));
        shares.push_back(std::max(longest(motion.jerk, 0, 2) / limits.jerk,
                                  longest(motion.second, 2, 3) / limits.angular_jerk));
    }
    return shares;
}

ContactUse contact_use(const ContactQuestion &question, Row<const std::int64_t> piece, std::ptrdiff_t pieces) {
    const auto &[contacts, floor, inertia, steady, margin, room_share] = question;
    ContactUse use{std::vector<double>(static_cast<std::size_t>(pieces), 0.0),
                   std::vector<double>(static_cast<std::size_t>(pieces), 1.0)};
    for (std::ptrdiff_t i = 0; i < piece.size; ++i) {
        if (piece[i] < 0 || piece[i] >= pieces)
            throw std::invalid_argument("an instant is on a piece that does not exist: " + std::to_string(piece[i]));
        const auto own = static_cast<std::size_t>(piece[i]);
        double share = use.shares[own], factor = use.slowing[own];
        for (std::ptrdiff_t n = i * contacts; n < (i + 1) * contacts; ++n)
            for (std::ptrdiff_t j = 4 * n; j < 4 * n + 4; ++j) {
                const double room = std::max(room_share * (floor.rows[j] - margin * floor.size[n]), TINY);
                const double spent = margin * inertia.size[n] - inertia.rows[j];
                share = std::max(share, spent / room);
                if (spent > room) {
                    // If the twist changes more slowly, the inertial part at a steady twist stays, and the rest shrinks
                    // in proportion.
                    const double kept = margin * steady.size[n] - steady.rows[j];
                    factor = std::max(factor, (spent - kept) / std::max(room - kept, TINY));
                }
            }
        use.shares[own] = share;
        use.slowing[own] = factor;
    }
    return use;
}

} // namespace pushplan
