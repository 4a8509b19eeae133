// Loads of which only the centre is known: the least of a row of the contact conditions over all of their spreads.
//
// A unit load at x that moves with v gives the row q(x) = g . w(x), w = (u, x x u / L), u = v / |v|. A spread has parts
// p_j >= 0 with sum p_j = 1 and sum p_j y_j = g_0, y_j = x_j - h mu u_j (a push at height h shifts the load by its
// friction). The least of sum p_j q_j is a linear program; its dual has three variables, a plane
// a + b . (y - g_0) <= q. On rays from the centre of rotation (COR) q and y are affine, so that points of the outline
// and the COR, where the direction of friction is free, suffice. Edges are sampled in steps that grow with the distance
// from the COR, and beside the optimum once more between the samples; the plane moved down by what they may miss is a
// safe answer.
//
// Heights and frictions that are intervals give an interval of h mu: each part of a spread may then have any shift in it,
// which is more than all loads with one shift can do. q - b . y is linear in the shift, so that its two ends suffice. What
// else may move the centre, by up to some d along either axis, costs |b_x| d_x + |b_y| d_y: a plane below all q bounds
// the row for every centre.
#pragma once

#include "friction.hpp"

#include <vector>

namespace pushplan::mechanics {

// Samples of every edge of an outline that may carry any load, and those between two of them, where these are asked
// for; and between how many they may be at one twist.
constexpr int EDGE_POINTS = 16, BETWEEN = 12, INTERVALS = 32;

// What a sampled outline may miss of the least of a unit row, taken off the answer; and before anything was sampled in
// between.
constexpr double MISS = 1e-4, COARSE_MISS = 3e-2;

struct Point {
    double x, y;
};

// A centre g_0 (m), the least shift h mu (m), the nudge that takes g_0 off edges between loads, how much more the shift
// may be, and how far the centre may be off along either axis (m); a row of `centers`.
struct Centre {
    double x, y, shift, nudge_x, nudge_y, more, drift_x, drift_y;
};

// The dual variables: height at the centre and slope b.
struct Plane {
    double height, bx, by;
};

// A unit load that may be a part of a spread: y about the centre, its wrench, and the shift that y is for.
struct UnitLoad {
    double x, y;
    Wrench pull;
    double shift;

    // q less b . y.
    double over(const Facet &g, double bx, double by) const { return dot(g, pull) - bx * x - by * y; }
    double over(const Facet &g, const Plane &plane) const { return over(g, plane.bx, plane.by) - plane.height; }
};

// What `shares` returns: the barycentric coordinates of a point in a triangle.
using Shares = std::array<double, 3>;

// One such object at one twist. Answers leave the worst spread as the basis, from which the next one starts.
class CentredLoad {
  public:
    // `corners`: feet, or the corners of a convex outline, counter-clockwise, about the centre; `solid`: whether the
    // whole outline may carry load; `length`: the chain's; `most`: loads that are kept at one twist.
    CentredLoad(const Centre &centre, std::vector<Point> corners, bool solid, double length, std::size_t most);

    // Sample the feet, or the outline, at a twist that is scaled to 1.
    void set_twist(const Twist &twist);

    // The least of a row of a unit load; leaves |b| in `slope`, by which a centre elsewhere changes it at most.
    double least(const Facet &g);
    double slope() const { return slope_; }

    // A lower bound of it: the plane that touches q at the centre, moved down below all q.
    double quick(const Facet &g) const;

  private:
    struct Basic {
        UnitLoad load;
        bool there; // false at first: a place far outside without a load
    };
    struct Sample : UnitLoad {
        bool refined; // whether there are more between this one and the next
        // How much lower than with the least shift it lies with the largest one.
        double lower(double bx, double by, double more) const {
            return std::min(more * (bx * pull.x + by * pull.y), 0.0);
        }
    };
    struct Lowest {
        UnitLoad load;
        double gap; // by how much it lies above the plane
    };

    // The shares of a load about the centre that the three basic ones carry.
    Shares shares(double x, double y) const;
    void add(double x, double y, double ux, double uy);
    void sample_edge(const Point &corner, const Point &next, double still);
    void sample_line(const Point &corner, double tx, double ty, double edge, double rho);
    void sample_along(const Point &corner, double tx, double ty, double edge, double a, double rho);
    void sample_between(std::size_t k);
    double bend() const;
    Plane plane(const Facet &g) const;
    UnitLoad at_cor(const Facet &g, double bx, double by) const;
    UnitLoad at_cor(const Facet &g, double bx, double by, double shift) const;
    double off(double bx, double by) const; // what a centre elsewhere takes from a bound
    Lowest lowest(const Facet &g, const Plane &plane) const;
    bool enter(const UnitLoad &load);
    bool refine(const Facet &g, const Plane &plane);

    Centre centre_;
    std::vector<Point> corners_;
    bool solid_;
    double length_;
    std::size_t most_;

    Twist twist_{};
    double vx_ = 0.0, vy_ = 0.0;   // of the centre
    std::vector<Sample> samples_;  // the first ones of the outline, in their order, then those between
    std::size_t first_count_ = 0;  // of the first ones; 0 for feet
    bool inside_ = false;          // whether a load may rest on the COR
    std::array<Basic, 3> basis_{};
    double slope_ = 0.0;
};

} // namespace pushplan::mechanics
