// Floor friction on objects with known loads: closed forms for points, polygons and affine pressures.
//
// An object with friction load F = mu m g moves on a floor with v(r) = v + omega J r. It needs the wrench
//
//     w = F sum_p p (u, r x u),    u = v(r) / |v(r)|,
//
// as a sum over its points or an integral over its pressure p. About the centre of rotation (COR) c = J v / omega, this
// is omega / |omega| times integrals of J (r - c) / |r - c|, which are sums over edges. If the COR is far away, these
// sums cancel, and a power series in omega / |v| replaces them.
//
// A push at a height shifts the load by its friction f: the pressure increases by stiffness times b . r, with S b = h
// f, the second moments S of the stiffness, and h the height times mu.
#pragma once

#include "poses.hpp"

#include <complex>
#include <cstring>
#include <type_traits>

namespace pushplan::mechanics {

// f_x, f_y (N) and the moment about a frame's origin (N m, or N if divided by a length).
struct Wrench {
    double x, y, m;
};

// A unit facet g of the cone of a contact's wrenches. The contact holds if all g . w > 0.
struct Facet {
    double x, y, m;
};

inline double dot(const Facet &g, const Wrench &w) { return g.x * w.x + g.y * w.y + g.m * w.m; }
inline double length_of(const Wrench &w) { return std::sqrt(w.x * w.x + w.y * w.y + w.m * w.m); }

// The facets of one contact, in the order of `packed.contact_rows`.
using Facets = std::array<Facet, 4>;

// Columns of `PackedChain.objects`: friction load F (N), anchor x, y, radius (m), density a and gradient b of the base
// pressure of a unit weight, h mu (m), moments of the stiffness.
struct Support {
    double load, x, y, radius, density, gradient_x, gradient_y, shift, xx, xy, yy;
};

// Columns of `PackedChain.parts` for a polygon edge: tangent, n . p, t . p and length, with the first vertex p about
// the anchor and the outward normal n.
struct Edge {
    double tx, ty, n_p, t_p, length;
};

// Columns of `PackedChain.parts` for a point: place about the anchor, fraction of the weight, stiffness.
struct PointLoad {
    double x, y, fraction, stiffness, unused;
};

constexpr std::ptrdiff_t OBJECT_COLUMNS = 11, PART_COLUMNS = 5, LINK_COLUMNS = 4, FACET_NUMBERS = 12;
static_assert(sizeof(Support) == OBJECT_COLUMNS * sizeof(double), "a row of a table");
static_assert(sizeof(Edge) == PART_COLUMNS * sizeof(double), "a row of a table");
static_assert(sizeof(PointLoad) == sizeof(Edge), "a row of the same table");
static_assert(sizeof(Facets) == FACET_NUMBERS * sizeof(double), "a row of a table");

// Return a row of a table as a struct.
template <class Struct> Struct read(const double *row) {
    static_assert(std::is_trivially_copyable_v<Struct>, "numbers only");
    Struct found;
    std::memcpy(&found, row, sizeof(Struct));
    return found;
}

// Kinds of support.
constexpr std::int64_t UNIFORM = 0, AFFINE = 1, POINTS = 2;

// Columns of `PackedChain.links`.
constexpr int KIND = 0, FIRST_PART = 1, PAST_LAST_PART = 2, PUSHER = 3;

// Power series: highest power of u; largest |omega| radius / |v0| at which it is used (REACH^(ORDER + 1) is below
// rounding); and size below which its powers are left out, for pushes that are nearly straight.
constexpr int ORDER = 10;
constexpr double REACH = 0.05, NEGLIGIBLE = 1e-17;

// Return the number of terms in a row of the series: two for each power m of the direction and h of r^2 with m + 2 h <=
// ORDER.
constexpr int series_terms() {
    int pairs = 0;
    for (int m = 0; m <= ORDER; ++m)
        pairs += (ORDER - m) / 2 + 1;
    return 2 * pairs;
}
constexpr int TERMS = series_terms();

// Number of rows of the series of one object.
constexpr std::ptrdiff_t WEIGHTS = 5;

// Supports of the objects: the arrays of a `PackedChain`.
struct Supports {
    Table<const double> objects;
    Table<const double> parts;
    Table<const std::complex<double>> series;
    Table<const std::int64_t> links;
};

// Return whether the COR is far enough for the series.
inline bool in_reach(double speed, double omega, double radius) {
    return std::fabs(omega) * radius < REACH * speed;
}

// Return d^2 Lambda: 0 on the line of the edge, without cancellation for distant edges.
double edge_log(double d, double length, double rho_sum);

struct SeriesPair {
    std::complex<double> first, second;
};

// Return the integrals of rows `row` and `row` + 1 of the series for a nonzero velocity (vx, vy) of the anchor and
// `spin`, omega times the radius.
SeriesPair series_pair(Table<const std::complex<double>> series, std::ptrdiff_t row, double vx, double vy,
                       double spin);

// Return the wrench that moves object i at a twist against the floor, about the frame's origin: minus the floor's
// friction. The twist can have any unit but must not be zero.
Wrench carried_wrench(const Supports &supports, std::ptrdiff_t i, const Twist &twist);

// Return its change if something else moves the centre of the load by (cx, cy), m. It is linear in these.
Wrench moved_wrench(const Supports &supports, std::ptrdiff_t i, const Twist &twist, double cx, double cy);

} // namespace pushplan::mechanics
