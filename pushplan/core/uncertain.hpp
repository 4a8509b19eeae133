// The least of every contact condition over all that loads and frictions may be.
//
// A row of contact k is sum_i F_i q_i over the objects it carries: linear in the friction load F_i = mu_i m_i g of each
// and in how that load is spread. With F_i in [low_i, high_i] and spreads that are independent, its least value is
//
//     sum_i min over F_i in {low_i, high_i} of F_i e_i ,    e_i the least of q_i over the spreads of object i.
//
// A spread is one of
//
// - known: e = g . w, w in closed form;
// - parts p_j of points x_j with l_j <= p_j <= u_j and sum p_j = t: feet with intervals (t = 1), and cells of a
//   pressure that is off by a share (t = 0, beside the known w). A fractional knapsack; its dual has one variable,
//   e = max over c of t c + sum_j min(l_j (q_j - c), u_j (q_j - c)): any c gives a lower bound, the best the least;
// - any with the centre g_0; see `centred.hpp`.
//
// The margin of contact k is its least row over a bound of |w_k|, so that it is at most the sine that known loads would
// give, and equal to it where everything is known.
#pragma once

#include "centred.hpp"
#include "packed.hpp"

#include <optional>

namespace pushplan::mechanics {

// Of the interval in which the dual of a knapsack of many points is largest: second order in what is left of it.
constexpr int HALVINGS = 6;

// Least and largest friction load (N) or mass (kg) of an object; a row of a table.
struct Range {
    double low, high;

    // The least of the range times a number, and the most.
    double least(double e) const { return std::min(low * e, high * e); }
    double most(double e) const { return std::max(low * e, high * e); }
};

// A place (m) with the least and the largest part of the load that may rest on it; a row of `points`.
struct Part {
    double x, y, low, high;
};

// The loads and contacts of n objects; the arrays are described in `uncertain.pyi`.
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

    // Throw std::invalid_argument if an index leads out of an array.
    void check() const;
};

// How a least row is asked for: itself, a quick lower bound where only centres are known, or the row without what
// pressures that are off take from it.
enum class Asked { EXACT, LOWER, UPPER };

// The rows of a chain at one twist. Moments are divided by the length.
class LeastRows {
  public:
    explicit LeastRows(const PackedLoads &packed);

    // Set a body twist other than 0.
    void set_twist(const Twist &twist);

    // Set what unit loads ask for instead: known ones (n, 3), and on points (p, 3), with moments in N m.
    void set_wrenches(const double *known, const double *pulls);

    // Work out all rows and sizes for ranges (n, 2) of friction loads (N) or masses (kg).
    void work_out(Table<const double> ranges);

    // The force (x, y) of all objects together in the middle of what it may be, and by how much it may differ at most:
    // half the widths of the ranges and of the parts, each times the size of what it changes.
    std::array<double, 3> force(Table<const double> ranges) const;

    // The smallest margin, or any number up to `floor` for a smaller one.
    double margin(double floor);

    const std::vector<std::array<double, 4>> &rows() const { return rows_; }
    const std::vector<double> &sizes() const { return sizes_; } // bounds of the wrenches

    // (n, 4, n) how much a metre by which an object's centre moves changes each row at most, N; of `work_out`.
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
    std::vector<double> values_; // of one row, on the points
    std::vector<std::optional<CentredLoad>> centred_;
    std::vector<std::array<double, 4>> rows_;
    std::vector<double> sizes_, slopes_;
};

} // namespace pushplan::mechanics
