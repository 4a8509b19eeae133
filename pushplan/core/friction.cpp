#include "friction.hpp"

namespace pushplan::mechanics {

namespace {

// Integrals of v / |v| over a unit pressure (or sums over the load's fractions), and of v / |v| times x and y.
struct Sums {
    Wrench force;
    Wrench along_x, along_y;
};

// Integrals over a polygon of r / |r| (two numbers) and of |r|, with r from the centre (cx, cy).
struct UniformIntegrals {
    double gx = 0.0, gy = 0.0, q = 0.0;
};

UniformIntegrals uniform_integrals(Table<const double> edges, std::ptrdiff_t start, std::ptrdiff_t stop, double cx,
                                   double cy) {
    UniformIntegrals sum;
    const Edge first = read<Edge>(edges[start]);
    double d = first.n_p - (first.ty * cx - first.tx * cy);
    double s = first.t_p - (first.tx * cx + first.ty * cy);
    double rho = std::sqrt(s * s + d * d);
    for (std::ptrdiff_t e = start; e < stop; ++e) {
        const auto [tx, ty, n_p, t_p, length] = read<Edge>(edges[e]);
        d = n_p - (ty * cx - tx * cy);
        s = t_p - (tx * cx + ty * cy);
        const double end = s + length;
        const double rho_end = std::sqrt(end * end + d * d);
        const double integral = 0.5 * (end * rho_end - s * rho + edge_log(d, length, rho + rho_end));
        sum.gx += ty * integral;
        sum.gy -= tx * integral;
        sum.q += d * integral;
        rho = rho_end;
    }
    sum.q = sum.q / 3.0;
    return sum;
}

// Integrals over a polygon of r r^T / |r| (xx, xy, yy) and of |r| r (x, y).
struct AffineIntegrals {
    double gxx = 0.0, gxy = 0.0, gyy = 0.0, qx = 0.0, qy = 0.0;
};

AffineIntegrals affine_integrals(Table<const double> edges, std::ptrdiff_t start, std::ptrdiff_t stop, double cx,
                                 double cy) {
    AffineIntegrals sum;
    for (std::ptrdiff_t e = start; e < stop; ++e) {
        const auto [tx, ty, n_p, t_p, length] = read<Edge>(edges[e]);
        const double nx = ty, ny = -tx;
        const double d = n_p - (ty * cx - tx * cy);
        const double s = t_p - (tx * cx + ty * cy);
        const double end = s + length;
        const double rho = std::sqrt(s * s + d * d), rho_end = std::sqrt(end * end + d * d);
        const double step = length * (s + end) / (rho + rho_end);
        const double logarithm = edge_log(d, length, rho + rho_end);
        const double integral = 0.5 * (end * rho_end - s * rho + logarithm);
        const double nn = d * logarithm, nt = d * d * step, tt = d * (integral - logarithm);
        sum.gxx += nx * nx * nn + 2.0 * nx * tx * nt + tx * tx * tt;
        sum.gxy += nx * ny * nn + (nx * ty + ny * tx) * nt + tx * ty * tt;
        sum.gyy += ny * ny * nn + 2.0 * ny * ty * nt + ty * ty * tt;
        const double along = d * step * (rho * rho + rho * rho_end + rho_end * rho_end) / 3.0;
        sum.qx += d * d * integral * nx + along * tx;
        sum.qy += d * d * integral * ny + along * ty;
    }
    return {sum.gxx / 3.0, sum.gxy / 3.0, sum.gyy / 3.0, sum.qx / 4.0, sum.qy / 4.0};
}

// Return the integral of v / |v| over a polygon and its moment. Twist and moment refer to the anchor.
Wrench uniform_sums(const Supports &supports, std::ptrdiff_t i, double radius, const Twist &twist) {
    const auto [vx, vy, omega] = twist;
    const double speed = std::sqrt(vx * vx + vy * vy);
    if (in_reach(speed, omega, radius)) {
        const SeriesPair pair = series_pair(supports.series, WEIGHTS * i, vx, vy, omega * radius);
        return {pair.first.real(), pair.first.imag(), pair.second.imag()};
    }
    const double cx = -vy / omega, cy = vx / omega;
    const std::int64_t *link = supports.links[i];
    const auto [gx, gy, q] = uniform_integrals(supports.parts, link[FIRST_PART], link[PAST_LAST_PART], cx, cy);
    const double sign = std::copysign(1.0, omega);
    const double fx = -sign * gy, fy = sign * gx;
    return {fx, fy, sign * q + cx * fy - cy * fx};
}

// Return the sums over a polygon from the series. With e = v / |v| as a complex number, they are integrals of e, e
// conj(z), e z ..., where x = (z + conj z) / 2 and y = -i (z - conj z) / 2.
Sums far_sums(const Supports &supports, std::ptrdiff_t i, double vx, double vy, double spin) {
    const auto [plain, turned] = series_pair(supports.series, WEIGHTS * i, vx, vy, spin);
    const auto [straight, turned_twice] = series_pair(supports.series, WEIGHTS * i + 2, vx, vy, spin);
    const std::complex<double> even = series_pair(supports.series, WEIGHTS * i + 3, vx, vy, spin).second;
    const std::complex<double> sum = straight + turned, difference = straight - turned;
    return {{plain.real(), plain.imag(), turned.imag()},
            {0.5 * sum.real(), 0.5 * sum.imag(), 0.5 * (even.imag() + turned_twice.imag())},
            {0.5 * difference.imag(), -0.5 * difference.real(), -0.5 * (even.real() - turned_twice.real())}};
}

Sums polygon_sums(const Supports &supports, std::ptrdiff_t i, double radius, const Twist &twist) {
    const auto [vx, vy, omega] = twist;
    const double speed = std::sqrt(vx * vx + vy * vy);
    if (in_reach(speed, omega, radius))
        return far_sums(supports, i, vx, vy, omega * radius);
    const double cx = -vy / omega, cy = vx / omega;
    const std::int64_t *link = supports.links[i];
    const std::ptrdiff_t start = link[FIRST_PART], stop = link[PAST_LAST_PART];
    const auto [gx, gy, q] = uniform_integrals(supports.parts, start, stop, cx, cy);
    const auto [gxx, gxy, gyy, qx, qy] = affine_integrals(supports.parts, start, stop, cx, cy);
    const double sign = std::copysign(1.0, omega);
    Sums sums;
    sums.force.x = -sign * gy, sums.force.y = sign * gx;
    sums.force.m = sign * q + cx * sums.force.y - cy * sums.force.x;
    sums.along_x.x = -sign * (gxy + gy * cx), sums.along_y.x = -sign * (gyy + gy * cy);
    sums.along_x.y = sign * (gxx + gx * cx), sums.along_y.y = sign * (gxy + gx * cy);
    sums.along_x.m = sign * (qx + q * cx) + cx * sums.along_x.y - cy * sums.along_x.x;
    sums.along_y.m = sign * (qy + q * cy) + cx * sums.along_y.y - cy * sums.along_y.x;
    return sums;
}

// Return exact sums over points, of fractions and of stiffnesses times the place. A point at the COR adds nothing.
Sums point_sums(const Supports &supports, std::ptrdiff_t i, double radius, const Twist &twist) {
    const auto [vx, vy, omega] = twist;
    Sums sums{};
    const double still = 1e-14 * (std::sqrt(vx * vx + vy * vy) + std::fabs(omega) * radius);
    const std::int64_t *link = supports.links[i];
    for (std::ptrdiff_t e = link[FIRST_PART]; e < link[PAST_LAST_PART]; ++e) {
        const PointLoad point = read<PointLoad>(supports.parts[e]);
        const double x = point.x, y = point.y, stiffness = point.stiffness;
        double ux = vx - omega * y, uy = vy + omega * x;
        const double speed = std::sqrt(ux * ux + uy * uy);
        if (speed <= still)
            continue;
        ux = ux / speed, uy = uy / speed;
        const double moment = x * uy - y * ux;
        sums.force.x += point.fraction * ux;
        sums.force.y += point.fraction * uy;
        sums.force.m += point.fraction * moment;
        sums.along_x.x += stiffness * ux * x;
        sums.along_y.x += stiffness * ux * y;
        sums.along_x.y += stiffness * uy * x;
        sums.along_y.y += stiffness * uy * y;
        sums.along_x.m += stiffness * moment * x;
        sums.along_y.m += stiffness * moment * y;
    }
    return sums;
}

// Return the change of the wrench if the load's centre moves by (cx, cy), including the further shift by friction: M b
// with (S - h M) b = c.
Wrench moved(const Support &support, const Sums &sums, double cx, double cy) {
    const double h = support.shift;
    const auto &[force, along_x, along_y] = sums;
    const double xx = support.xx - h * along_x.x, xy = support.xy - h * along_y.x;
    const double yx = support.xy - h * along_x.y, yy = support.yy - h * along_y.y;
    const double det = xx * yy - xy * yx;
    const double bx = (cx * yy - cy * xy) / det, by = (xx * cy - yx * cx) / det;
    return {along_x.x * bx + along_y.x * by, along_x.y * bx + along_y.y * by, along_x.m * bx + along_y.m * by};
}

// Return the force including the load's shift by the push height: the centre moves by h f_0.
Wrench shifted(const Support &support, const Sums &sums) {
    const double h = support.shift;
    const Wrench added = moved(support, sums, h * sums.force.x, h * sums.force.y);
    return {sums.force.x + added.x, sums.force.y + added.y, sums.force.m + added.m};
}

// Return `uniform_sums` for the whole load of an object with any support and push height.
Wrench general_sums(const Supports &supports, std::ptrdiff_t i, const Support &support, const Twist &twist) {
    Sums sums;
    if (supports.links[i][KIND] == POINTS) {
        sums = point_sums(supports, i, support.radius, twist);
    } else {
        sums = polygon_sums(supports, i, support.radius, twist);
        const auto pressed = [&](double one, double x, double y) {
            return support.density * one + support.gradient_x * x + support.gradient_y * y;
        };
        sums.force = {pressed(sums.force.x, sums.along_x.x, sums.along_y.x),
                      pressed(sums.force.y, sums.along_x.y, sums.along_y.y),
                      pressed(sums.force.m, sums.along_x.m, sums.along_y.m)};
    }
    return support.shift > 0.0 ? shifted(support, sums) : sums.force;
}

} // namespace

double edge_log(double d, double length, double rho_sum) {
    const double gap = rho_sum - length;
    if (gap <= 0.0)
        return 0.0;
    const double q = length / rho_sum;
    if (q < 0.1) {
        const double q2 = q * q;
        const double tail = q2 * (1.0 / 7 + q2 * (1.0 / 9 + q2 * (1.0 / 11 + q2 * (1.0 / 13 + q2 / 15))));
        return d * d * 2.0 * q * (1.0 + q2 * (1.0 / 3 + q2 * (1.0 / 5 + tail)));
    }
    return d * d * std::log((rho_sum + length) / gap);
}

SeriesPair series_pair(Table<const std::complex<double>> series, std::ptrdiff_t row, double vx, double vy,
                       double spin) {
    const double speed = std::sqrt(vx * vx + vy * vy);
    const double ux = vx / speed, uy = vy / speed;
    const double size = std::fabs(spin) / speed;
    const double square = size * size, turned = std::copysign(size, spin);
    const double zx = uy * turned, zy = ux * turned; // kappa radius
    const int top = square < NEGLIGIBLE ? 1 : square * square * size < NEGLIGIBLE ? 4 : ORDER;
    double x = 0.0, y = 0.0, u = 0.0, w = 0.0;
    double px = 1.0, py = 0.0;
    int end = 0;
    const std::complex<double> *one = series[row], *two = series[row + 1];
    for (int m = 0; m <= top; ++m) {
        end += 2 * ((ORDER - m) / 2 + 1);
        // Sum and difference of each row.
        double ar = 0.0, ai = 0.0, br = 0.0, bi = 0.0, cr = 0.0, ci = 0.0, dr = 0.0, di = 0.0;
        for (int k = end - 2 * ((top - m) / 2 + 1); k < end; k += 2) {
            ar = ar * square + one[k].real(), ai = ai * square + one[k].imag();
            br = br * square + one[k + 1].real(), bi = bi * square + one[k + 1].imag();
            cr = cr * square + two[k].real(), ci = ci * square + two[k].imag();
            dr = dr * square + two[k + 1].real(), di = di * square + two[k + 1].imag();
        }
        x = x + px * ar - py * bi, y = y + px * ai + py * br;
        u = u + px * cr - py * di, w = w + px * ci + py * dr;
        const double turned_px = px * zx - py * zy;
        py = px * zy + py * zx;
        px = turned_px;
    }
    return {{x * ux - y * uy, x * uy + y * ux}, {u * ux - w * uy, u * uy + w * ux}};
}

namespace {

// Return a twist about the anchor of a support.
Twist anchored(const Support &support, const Twist &twist) {
    return {twist.vx - twist.omega * support.y, twist.vy + twist.omega * support.x, twist.omega};
}

} // namespace

Wrench moved_wrench(const Supports &supports, std::ptrdiff_t i, const Twist &twist, double cx, double cy) {
    const Support support = read<Support>(supports.objects[i]);
    const Twist anchor = anchored(support, twist);
    const Sums sums = supports.links[i][KIND] == POINTS ? point_sums(supports, i, support.radius, anchor)
                                                        : polygon_sums(supports, i, support.radius, anchor);
    const Wrench added = moved(support, sums, cx, cy);
    const double fx = support.load * added.x, fy = support.load * added.y;
    return {fx, fy, support.load * added.m + support.x * fy - support.y * fx};
}

Wrench carried_wrench(const Supports &supports, std::ptrdiff_t i, const Twist &twist) {
    const Support support = read<Support>(supports.objects[i]);
    const double ax = support.x, ay = support.y;
    const Twist anchor = anchored(support, twist);
    double load = support.load;
    Wrench sum;
    if (supports.links[i][KIND] == UNIFORM) {
        sum = uniform_sums(supports, i, support.radius, anchor);
        load *= support.density;
    } else {
        sum = general_sums(supports, i, support, anchor);
    }
    const double fx = load * sum.x, fy = load * sum.y, m = load * sum.m;
    return {fx, fy, m + ax * fy - ay * fx};
}

} // namespace pushplan::mechanics
