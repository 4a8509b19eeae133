#include "centred.hpp"

#include <algorithm>

namespace pushplan::mechanics {

namespace {

constexpr double FLAT = 1e-12, TINY = 1e-9, ABSENT = 1e3;
constexpr int PIVOTS = 60, ROUNDS = 6;

} // namespace

CentredLoad::CentredLoad(const Centre &centre, std::vector<Point> corners, bool solid, double length, std::size_t most)
    : centre_(centre), corners_(std::move(corners)), solid_(solid), length_(length), most_(most) {
    samples_.reserve(most);
}

// ---- samples

// Add a unit load at (x, y) about the centre that moves in the direction (ux, uy).
void CentredLoad::add(double x, double y, double ux, double uy) {
    const double moment = ((centre_.x + x) * uy - (centre_.y + y) * ux) / length_;
    const double shift = centre_.shift;
    samples_.push_back({{x - shift * ux, y - shift * uy, {ux, uy, moment}, shift}, false});
}

void CentredLoad::set_twist(const Twist &twist) {
    const double omega = twist.omega;
    twist_ = twist;
    vx_ = twist.vx - omega * centre_.y, vy_ = twist.vy + omega * centre_.x;
    samples_.clear();
    double size = 1e-9;
    for (const Point &corner : corners_)
        size = std::max(size, std::hypot(corner.x, corner.y));
    const double still = TINY * size * std::abs(omega);
    inside_ = solid_ && omega != 0.0;
    for (std::size_t k = 0; k < corners_.size(); ++k) {
        const auto [x, y] = corners_[k];
        if (solid_) {
            sample_edge(corners_[k], corners_[k + 1 < corners_.size() ? k + 1 : 0], still);
            continue;
        }
        const double ux = vx_ - omega * y, uy = vy_ + omega * x;
        const double speed = std::sqrt(ux * ux + uy * uy);
        if (speed <= still)
            inside_ = true; // this foot is the COR
        else
            add(x, y, ux / speed, uy / speed);
    }
    first_count_ = solid_ ? samples_.size() : 0;
    const double reach = 4.0 * (size + centre_.shift + centre_.more);
    for (int j = 0; j < 3; ++j) {
        const double angle = 2.0 + 2.0 * PI * j / 3.0;
        basis_[j] = {{reach * std::cos(angle), reach * std::sin(angle), {0.0, 0.0, 0.0}, 0.0}, false};
    }
}

// Sample an edge, and return whether the COR is to its right, outside.
void CentredLoad::sample_edge(const Point &corner, const Point &next, double still) {
    const double omega = twist_.omega;
    const double ux = vx_ - omega * corner.y, uy = vy_ + omega * corner.x;
    double tx = next.x - corner.x, ty = next.y - corner.y;
    const double edge = std::hypot(tx, ty);
    if (edge == 0.0)
        return;
    tx = tx / edge, ty = ty / edge;
    // The velocity along the edge is constant; to its left it is rho + omega s.
    const double a = ux * tx + uy * ty, rho = uy * tx - ux * ty;
    if (std::copysign(1.0, omega) * a < -still)
        inside_ = false;
    if (std::abs(a) <= still) // the COR lies on the edge's line, and q is affine on both sides of it
        sample_line(corner, tx, ty, edge, rho);
    else
        sample_along(corner, tx, ty, edge, a, rho);
}

// Add the moving ends of an edge whose line contains the COR.
void CentredLoad::sample_line(const Point &corner, double tx, double ty, double edge, double rho) {
    for (const double s : {0.0, edge}) {
        const double across = rho + twist_.omega * s;
        if (across != 0.0) {
            const double sign = std::copysign(1.0, across);
            add(corner.x + s * tx, corner.y + s * ty, -sign * ty, sign * tx);
        }
    }
}

// Add the beginning of an edge and points on it. Its velocity is v = (a, rho + omega s) along tangent and normal. The
// points have equal steps of z, where rho + omega s = |a| sinh z.
void CentredLoad::sample_along(const Point &corner, double tx, double ty, double edge, double a, double rho) {
    const double omega = twist_.omega;
    const double begin = std::asinh(rho / std::abs(a)), end = std::asinh((rho + omega * edge) / std::abs(a));
    const double sign = std::copysign(1.0, a), step = (end - begin) / EDGE_POINTS;
    const bool even = std::abs(end - begin) < 1e-3;
    double cosh = std::cosh(begin), sinh = std::sinh(begin);
    const double c = std::cosh(step), s = std::sinh(step);
    for (int j = 0; j < EDGE_POINTS; ++j) {
        double along = j * edge / EDGE_POINTS;
        if (!even)
            along = j > 0 ? std::min(std::max((std::abs(a) * sinh - rho) / omega, 0.0), edge) : 0.0;
        const double across = rho + omega * along;
        const double speed = std::sqrt(a * a + across * across);
        const double ux = (sign * std::abs(a) * tx - across * ty) / speed;
        const double uy = (sign * std::abs(a) * ty + across * tx) / speed;
        add(corner.x + along * tx, corner.y + along * ty, ux, uy);
        const double next = cosh * c + sinh * s;
        sinh = sinh * c + cosh * s;
        cosh = next;
    }
}

// Add loads between a sample and the next one, on the same edge.
void CentredLoad::sample_between(std::size_t k) {
    const double omega = twist_.omega, shift = centre_.shift;
    const UnitLoad one = samples_[k], other = samples_[k + 1 < first_count_ ? k + 1 : 0];
    const double x = one.x + shift * one.pull.x, y = one.y + shift * one.pull.y;
    const double dx = other.x + shift * other.pull.x - x, dy = other.y + shift * other.pull.y - y;
    for (int j = 0; j < BETWEEN; ++j) {
        const double t = (j + 1.0) / (BETWEEN + 1.0);
        const double px = x + t * dx, py = y + t * dy;
        const double ux = vx_ - omega * py, uy = vy_ + omega * px;
        const double speed = std::sqrt(ux * ux + uy * uy);
        if (speed > 0.0)
            add(px, py, ux / speed, uy / speed);
    }
    samples_[k].refined = true;
}

// Return the share of the possible sampling error: 0 for feet and translations, because q is affine.
double CentredLoad::bend() const {
    if (!solid_)
        return 0.0;
    const double near = std::abs(twist_.omega) * length_, speed = std::sqrt(vx_ * vx_ + vy_ * vy_);
    return near < speed ? near / speed : 1.0;
}

// ---- the linear program

Shares CentredLoad::shares(double x, double y) const {
    const auto &[first, second, third] = basis_;
    const double ax = first.load.x - x, ay = first.load.y - y, bx = second.load.x - x, by = second.load.y - y;
    const double cx = third.load.x - x, cy = third.load.y - y;
    const double one = bx * cy - by * cx, two = cx * ay - cy * ax, three = ax * by - ay * bx;
    const double scale = 1.0 / (one + two + three);
    return {one * scale, two * scale, three * scale};
}

// Return the plane through the basic loads; a high one if there are none yet.
Plane CentredLoad::plane(const Facet &g) const {
    const auto &[first, second, third] = basis_;
    const auto height = [&](const Basic &basic) { return basic.there ? dot(g, basic.load.pull) : ABSENT; };
    const double q0 = height(first), q1 = height(second), q2 = height(third);
    const double x1 = second.load.x - first.load.x, y1 = second.load.y - first.load.y;
    const double x2 = third.load.x - first.load.x, y2 = third.load.y - first.load.y;
    const double scale = 1.0 / (x1 * y2 - x2 * y1);
    const double bx = ((q1 - q0) * y2 - (q2 - q0) * y1) * scale, by = ((q2 - q0) * x1 - (q1 - q0) * x2) * scale;
    return {q0 - bx * first.load.x - by * first.load.y, bx, by};
}

// Return the lowest load on the COR relative to a plane.
UnitLoad CentredLoad::at_cor(const Facet &g, double bx, double by) const {
    const UnitLoad least = at_cor(g, bx, by, centre_.shift);
    if (centre_.more == 0.0)
        return least;
    const UnitLoad most = at_cor(g, bx, by, centre_.shift + centre_.more);
    return most.over(g, bx, by) < least.over(g, bx, by) ? most : least;
}

// For one shift: u . (gamma + shift b + kappa J x) is least if u points against the bracket.
UnitLoad CentredLoad::at_cor(const Facet &g, double bx, double by, double shift) const {
    const double omega = twist_.omega, kappa = g.m / length_;
    const double x = -twist_.vy / omega, y = twist_.vx / omega;
    const double ax = g.x + shift * bx - kappa * y, ay = g.y + shift * by + kappa * x;
    const double size = std::sqrt(ax * ax + ay * ay);
    const double ux = size > 0.0 ? -ax / size : 0.0, uy = size > 0.0 ? -ay / size : 0.0;
    return {x - centre_.x - shift * ux, y - centre_.y - shift * uy, {ux, uy, (x * uy - y * ux) / length_}, shift};
}

// Return the lowest load relative to a plane.
CentredLoad::Lowest CentredLoad::lowest(const Facet &g, const Plane &plane) const {
    const Sample *best = nullptr;
    double least = INF;
    for (const Sample &sample : samples_) {
        const double gap = sample.over(g, plane.bx, plane.by) + sample.lower(plane.bx, plane.by, centre_.more);
        if (gap < least)
            best = &sample, least = gap;
    }
    if (inside_) {
        const UnitLoad load = at_cor(g, plane.bx, plane.by);
        const double gap = load.over(g, plane.bx, plane.by);
        if (gap < least)
            return {load, gap - plane.height};
    }
    if (best == nullptr)
        throw std::runtime_error("no place of a load can be compared with others: a number is not finite");
    UnitLoad load = *best;
    if (best->lower(plane.bx, plane.by, centre_.more) < 0.0) {
        load.x -= centre_.more * load.pull.x, load.y -= centre_.more * load.pull.y;
        load.shift += centre_.more;
    }
    return {load, least - plane.height};
}

double CentredLoad::off(double bx, double by) const {
    return std::abs(bx) * centre_.drift_x + std::abs(by) * centre_.drift_y;
}

// Exchange a basic load for another one. Return whether the centre stays between the basic loads.
bool CentredLoad::enter(const UnitLoad &load) {
    const auto [one, two, three] = shares(centre_.nudge_x, centre_.nudge_y);
    const auto [first, second, third] = shares(load.x, load.y);
    int leaving = -1;
    double ratio = INF;
    if (first > FLAT)
        leaving = 0, ratio = std::max(one, 0.0) / first;
    if (second > FLAT && std::max(two, 0.0) < ratio * second)
        leaving = 1, ratio = std::max(two, 0.0) / second;
    if (third > FLAT && std::max(three, 0.0) < ratio * third)
        leaving = 2;
    if (leaving < 0)
        return false;
    basis_[leaving] = {load, true};
    return true;
}

// Sample on both sides of the lowest samples above the plane, and return whether there are new samples. Between two
// samples, q can be lower than at either by COARSE_MISS.
bool CentredLoad::refine(const Facet &g, const Plane &plane) {
    const std::size_t count = first_count_;
    bool added = false;
    if (count == 0)
        return false;
    const auto gap = [&](const Sample &sample) {
        return sample.over(g, plane) + sample.lower(plane.bx, plane.by, centre_.more);
    };
    double before = gap(samples_[count - 1]), here = gap(samples_[0]);
    for (std::size_t k = 0; k < count; ++k) {
        const double after = gap(samples_[k + 1 < count ? k + 1 : 0]);
        if (here < COARSE_MISS && here <= before && here <= after) {
            for (const std::size_t first : {k, k > 0 ? k - 1 : count - 1}) {
                if (!samples_[first].refined && samples_.size() + BETWEEN <= most_) {
                    sample_between(first);
                    added = true;
                }
            }
        }
        before = here, here = after;
    }
    return added;
}

double CentredLoad::least(const Facet &g) {
    double height = 0.0;
    for (int round = 0; round < ROUNDS; ++round) {
        double gap = 0.0;
        Plane through{};
        for (int pivot = 0; pivot < PIVOTS; ++pivot) {
            through = plane(g);
            const Lowest found = lowest(g, through);
            gap = found.gap, height = through.height;
            if (gap >= -1e-9 || !enter(found.load))
                break;
        }
        height += std::min(gap, 0.0) - off(through.bx, through.by);
        slope_ = std::hypot(through.bx, through.by);
        if (!refine(g, plane(g)))
            break;
    }
    return height - MISS * bend();
}

double CentredLoad::quick(const Facet &g) const {
    const double omega = twist_.omega, kappa = g.m / length_;
    const double ax = g.x - kappa * centre_.y, ay = g.y + kappa * centre_.x;
    const double speed = std::sqrt(vx_ * vx_ + vy_ * vy_);
    if (speed <= TINY * std::abs(omega) * length_ || (solid_ && first_count_ == 0))
        return -INF;
    const double ux = vx_ / speed, uy = vy_ / speed;
    // The gradient of u . (a + kappa J x) at the centre: u turns by omega / speed along itself.
    const double turn = (ax * -uy + ay * ux) * omega / speed;
    const double bx = turn * ux + kappa * uy, by = turn * uy - kappa * ux;
    const Plane touching{ux * ax + uy * ay + centre_.shift * (bx * ux + by * uy), bx, by};
    const double miss = COARSE_MISS * bend();
    return touching.height + std::min(lowest(g, touching).gap, 0.0) - off(bx, by) - miss;
}

} // namespace pushplan::mechanics
