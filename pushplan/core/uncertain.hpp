// The minimum of every contact condition over all possible loads and frictions.
//
// A row of contact k is sum_i F_i q_i over the objects that it carries. It is linear in each friction load F_i = mu_i
// m_i g and in the distribution of this load. With F_i in [low_i, high_i] and independent distributions, its minimum is
//
//     sum_i min over F_i in {low_i, high_i} of F_i e_i ,    e_i the minimum of q_i over its distributions.
//
// A distribution is one of
//
// - known: e = g . w, w in closed form;
// - parts p_j of points x_j with l_j <= p_j <= u_j and sum p_j = t: feet with intervals (t = 1), or cells of a pressure
//   with a relative error (t = 0, in addition to the known w). This is a fractional knapsack. Its dual has one
//   variable, e = max over c of t c + sum_j min(l_j (q_j - c), u_j (q_j - c)). Any c gives a lower bound, the best c
//   the minimum;
// - any distribution with the centre g_0; see `centred.hpp`.
//
// The margin of contact k is its least row divided by a bound of |w_k|. So it is at most the sine for known loads, and
// equal to it if everything is known.
#pragma once

#include "centred.hpp"
#include "packed.hpp"

#include <optional>

namespace pushplan::mechanics {

// Number of halvings of the interval that contains the dual's maximum for many points. The error is of second order in
// the rest.
constexpr int HALVINGS = 6;

// Smallest and largest friction load (N) or mass (kg) of an object; a row of a table.
struct Range {
    double low, high;

    // Return the minimum, and the maximum, of the range times a number.
    double least(double e) const { return std::min(low * e, high * e); }
    double most(double e) const { return std::max(low * e, high * e); }
};

// A place (m) with the smallest and the largest part of the load on it; a row of `points`.
struct Part {
    double x, y, low, high;
};

// The loads and contacts of n objects. The arrays are described in `uncertain.pyi`.
struct PackedLoads {
    PackedChain units;
    Kept<std::int64_t> unit;
    Kept<double> points;
    Kept<std::int64_t> first;
    Kept<double> total, miss, centers;
    Kept<std::int64_t> free;
    Kept<double> corners;
    Kept<std::int64_t> corner;
    bool centred;
    Kept<double> loads;
    Kept<bool> carried;
    Kept<double> facets;
    double length;

    std::ptrdiff_t count() const { return loads.size(); }
    bool known(std::ptrdiff_t i) const { return unit.numbers[i] >= 0; }
    bool by_centre(std::ptrdiff_t i) const { return free.numbers[i] > 0; }
    bool carries(std::ptrdiff_t k, std::ptrdiff_t i) const { return carried.numbers[k * count() + i] != 0; }
    Part part(std::ptrdiff_t p) const { return read<Part>(points.table()[p]); }
    Facet facet(std::ptrdiff_t k, int j) const { return read<Facets>(facets.table()[k])[j]; }
    Centre centre(std::ptrdiff_t i) const { return read<Centre>(centers.table()[i]); }

    // Throw std::invalid_argument if an index is outside an array.
    void check() const;
};

// Kind of a least row: exact; a quick lower bound if only centres are known; or without the effect of pressure errors.
enum class Asked { EXACT, LOWER, UPPER };

// The rows of a chain at one twist. Moments are divided by the length.
class LeastRows {
  public:
    explicit LeastRows(const PackedLoads &packed);

    // Set a body twist other than 0.
    void set_twist(const Twist &twist);

    // Set the wrenches of unit loads instead: known loads (n, 3), and loads on points (p, 3), with moments in N m.
    void set_wrenches(const double *known, const double *pulls);

    // Compute all rows and sizes for ranges (n, 2) of friction loads (N) or masses (kg).
    void work_out(Table<const double> ranges);

    // Return the mean force (x, y) of all objects together, and its maximum deviation: half of the widths of the ranges
    // and of the parts, each times the size of its effect.
    std::array<double, 3> force(Table<const double> ranges) const;

    // Return the smallest margin, or any number up to `floor` for a smaller one.
    double margin(double floor);

    const std::vector<std::array<double, 4>> &rows() const { return rows_; }
    const std::vector<double> &sizes() const { return sizes_; } // upper bounds of the wrenches

    // (n, 4, n) maximum change of each row per metre of an object's centre, N/m, from `work_out`.
    const std::vector<double> &slopes() const { return slopes_; }

  private:
    struct Middle {
        Wrench wrench;
        double spread;
    };

    double least(std::ptrdiff_t i, const Facet &g, Asked how);
    double least_on_points(std::ptrdiff_t i, const Facet &g);
    double least_sum(std::ptrdiff_t first, std::ptrdiff_t stop, double total) const;
    double dual_sum(std::ptrdiff_t first, std::ptrdiff_t stop, double total, double c) const;
    double row(Table<const double> ranges, std::ptrdiff_t k, int j, Asked how);
    Middle middle(std::ptrdiff_t i, double moments = 1.0) const;
    void bound(Table<const double> ranges);
    void bound_centred(Table<const double> ranges);
    double least_bounded(double lowest, double floor);
    double least_in_order(double lowest, double floor);

    const PackedLoads &packed_;
    std::vector<Wrench> known_, pulls_;
    std::vector<double> values_; // values of one row on the points
    std::vector<std::optional<CentredLoad>> centred_;
    std::vector<std::array<double, 4>> rows_;
    std::vector<double> sizes_, slopes_;
};

} // namespace pushplan::mechanics
