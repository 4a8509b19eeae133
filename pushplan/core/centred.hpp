// Loads with only a known centre: the least value of a row of the contact conditions over all their distributions.
//
// A unit load at x that moves with v gives the row q(x) = g . w(x), w = (u, x x u / L), u = v / |v|. A distribution has
// parts p_j >= 0 with sum p_j = 1 and sum p_j y_j = g_0, y_j = x_j - h mu u_j (a push at height h shifts the load by
// its friction). The minimum of sum p_j q_j is a linear program. Its dual has three variables: a plane a + b . (y -
// g_0) <= q. On rays from the centre of rotation (COR), q and y are affine. So points of the outline and the COR, where
// the direction of friction is free, are enough. Edges are sampled in steps that grow with the distance from the COR,
// and more finely near the optimum. The plane lowered by the possible sampling error is a safe bound.
//
// Intervals of height and friction give an interval of h mu. Each part of a distribution can then have any shift in it,
// which includes all loads with one common shift. q - b . y is linear in the shift, so both ends of the interval are
// enough. If the centre can move by up to d along each axis, the bound falls by |b_x| d_x + |b_y| d_y: a plane below
// all q bounds the row for every centre.
#pragma once

#include "friction.hpp"

#include <vector>

namespace pushplan::mechanics {

// Number of samples on every edge of an outline that can carry load; number of refined samples between two of them; and
// maximum number of refined intervals at one twist.
constexpr int EDGE_POINTS = 16, BETWEEN = 12, INTERVALS = 32;

// Possible sampling error of a unit row's minimum, subtracted from the result; and the error before refinement.
constexpr double MISS = 1e-4, COARSE_MISS = 3e-2;

struct Point {
    double x, y;
};

// Centre g_0 (m), least shift h mu (m), nudge of g_0 away from edges between loads, width of the shift's interval (m),
// and possible error of the centre along each axis (m); a row of `centers`.
struct Centre {
    double x, y, shift, nudge_x, nudge_y, more, drift_x, drift_y;
};

// Dual variables: height at the centre and slope b.
struct Plane {
    double height, bx, by;
};

// A unit load of a distribution: y about the centre, its wrench, and the shift used in y.
struct UnitLoad {
    double x, y;
    Wrench pull;
    double shift;

    // Return q - b . y.
    double over(const Facet &g, double bx, double by) const { return dot(g, pull) - bx * x - by * y; }
    double over(const Facet &g, const Plane &plane) const { return over(g, plane.bx, plane.by) - plane.height; }
};

// Barycentric coordinates of a point in a triangle.
using Shares = std::array<double, 3>;

// An object with such a load, at one twist. Each result leaves the worst distribution as the basis of the next one.
class CentredLoad {
  public:
    // `corners`: feet, or corners of a convex outline, counter-clockwise, about the centre. `solid`: whether the whole
    // outline can carry load. `length`: the chain's length. `most`: maximum number of loads at one twist.
    CentredLoad(const Centre &centre, std::vector<Point> corners, bool solid, double length, std::size_t most);

    // Sample the feet, or the outline, at a twist scaled to 1.
    void set_twist(const Twist &twist);

    // Return the minimum of a row of a unit load. `slope` receives |b|, the largest change per metre of the centre.
    double least(const Facet &g);
    double slope() const { return slope_; }

    // Return a lower bound of it: the plane that touches q at the centre, lowered below all q.
    double quick(const Facet &g) const;

  private:
    struct Basic {
        UnitLoad load;
        bool there; // false at first: a distant place without a load
    };
    struct Sample : UnitLoad {
        bool refined; // whether there are samples between this one and the next
        // Return how much lower it lies with the largest shift than with the least one.
        double lower(double bx, double by, double more) const {
            return std::min(more * (bx * pull.x + by * pull.y), 0.0);
        }
    };
    struct Lowest {
        UnitLoad load;
        double gap; // distance above the plane
    };

    // Return the shares of a load about the centre that the three basic loads carry.
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
    double off(double bx, double by) const; // reduction of a bound by an error of the centre
    Lowest lowest(const Facet &g, const Plane &plane) const;
    bool enter(const UnitLoad &load);
    bool refine(const Facet &g, const Plane &plane);

    Centre centre_;
    std::vector<Point> corners_;
    bool solid_;
    double length_;
    std::size_t most_;

    Twist twist_{};
    double vx_ = 0.0, vy_ = 0.0;   // velocity of the centre
    std::vector<Sample> samples_;  // first samples of the outline in order, then refined ones
    std::size_t first_count_ = 0;  // number of first samples; 0 for feet
    bool inside_ = false;          // whether a load can rest on the COR
    std::array<Basic, 3> basis_{};
    double slope_ = 0.0;
};

} // namespace pushplan::mechanics
