// Semismooth Newton for one step: force balance on the floor, exact Coulomb contacts at the current normals.
//
//     g_i(U_i) = sum over contacts of +-(ln n + lt t)                                  balance of object i
//     gap + n . (U_b - U_a) >= 0  _|_  ln >= 0                                         at every point
//     |lt| <= mu sum ln, and lt = -mu sum ln sign(t . (U_b - U_a)) where it slips      for every manifold
//
// Each round guesses from U and the multipliers which points press and which manifolds stick or slip. It then solves
// the remaining linear system in the multipliers (Schur complement) with the matrix M_i = (1 - tau) H_i + tau K_i.
//
// The floor friction of an object is the gradient of a dissipation, with secant and curvature:
//
//     D(U) = sum_j mu N_j r_j,   r_j = sqrt(|v_j|^2 + eps^2),   v_j = J_j U = (v_x - w y_j, v_y + w x_j)
//     g = sum (mu N / r) J^T v = K U,   K = sum (mu N / r) J^T J,   H = K - sum (mu N / r^3) (J^T v) (J^T v)^T
//
// K is at least H everywhere, so a step with K never increases D (majorise and minimise).
#include "slip_work.hpp"

#include <cstdlib>
#include <utility>

namespace pushplan::slip {

static void terms_of(const PlacedFoot *first, const PlacedFoot *last, const Vector &u, double eps, Floor &floor) {
    const double vx = u.x, vy = u.y, w = u.w;
    double kxx = 0.0, kxw = 0.0, kyw = 0.0, kww = 0.0;
    double hxx = 0.0, hxy = 0.0, hxw = 0.0, hyy = 0.0, hyw = 0.0, hww = 0.0;
    for (const PlacedFoot *foot = first; foot != last; ++foot) {
        const double x = foot->x, y = foot->y;
        double ux = vx - w * y, uy = vy + w * x;
        // 1 / r, and c = mu N / r.
        const double inverse = 1.0 / std::sqrt(ux * ux + uy * uy + eps * eps);
        const double c = foot->load * inverse;
        kxx += c;
        kxw -= c * y;
        kyw += c * x;
        kww += c * (x * x + y * y);
        ux *= inverse;
        uy *= inverse;
        const double turning = x * uy - y * ux; // last component of J^T v / r
        hxx += c * ux * ux;
        hxy += c * ux * uy;
        hxw += c * ux * turning;
        hyy += c * uy * uy;
        hyw += c * uy * turning;
        hww += c * turning * turning;
    }
    floor.g = {kxx * vx + kxw * w, kxx * vy + kyw * w, kxw * vx + kyw * vy + kww * w};
    floor.secant = {kxx, 0.0, kxw, kxx, kyw, kww};
    floor.curvature = {kxx - hxx, -hxy, kxw - hxw, kxx - hyy, kyw - hyw, kww - hww};
}

void floor_terms(Work &work, double eps) {
    for (std::size_t i = 0; i < work.floors.size(); ++i) {
        const Object &object = work.world->objects[i];
        const PlacedFoot *feet = work.feet.data();
        terms_of(feet + object.first_foot, feet + object.last_foot, work.bodies[i].u, eps, work.floors[i]);
    }
}

// Return the inverse of a positive definite matrix.
static Symmetric inverse_of(const Symmetric &a) {
    const double cxx = a.yy * a.ww - a.yw * a.yw, cxy = a.xw * a.yw - a.xy * a.ww, cxw = a.xy * a.yw - a.xw * a.yy;
    const double scale = 1.0 / (a.xx * cxx + a.xy * cxy + a.xw * cxw);
    return {cxx * scale,
            cxy * scale,
            cxw * scale,
            (a.xx * a.ww - a.xw * a.xw) * scale,
            (a.xy * a.xw - a.xx * a.yw) * scale,
            (a.xx * a.yy - a.xy * a.xy) * scale};
}

void matrices(Work &work, double tau) {
    constexpr double SMALL = 1e-9; // share of the trace of K that is added to the diagonal of M
    for (std::size_t i = 0; i < work.floors.size(); ++i) {
        const Symmetric &k = work.floors[i].secant, &h = work.floors[i].curvature;
        const double part = work.bodies[i].linked ? tau : 1.0, rest = 1.0 - part;
        // Friction is homogeneous of degree 1, so H U = 0. Without a contact that fixes the travel of a body, M has no
        // inverse.
        const double extra = SMALL * (k.xx + k.yy + k.ww);
        work.floors[i].inverse = inverse_of({part * k.xx + rest * h.xx + extra, part * k.xy + rest * h.xy,
                                             part * k.xw + rest * h.xw, part * k.yy + rest * h.yy + extra,
                                             part * k.yw + rest * h.yw, part * k.ww + rest * h.ww + extra});
    }
}

void link(Work &work) {
    for (Body &body : work.bodies)
        body.linked = false;
    work.bodies[work.plate()].linked = true;
    // Each pass reaches at least one more body; a chain of n objects needs n passes.
    for (int pass = 0; pass < work.plate(); ++pass) {
        for (const Manifold &m : work.manifolds) {
            Body &a = work.bodies[m.a], &b = work.bodies[m.b];
            if (m.mode[TANGENT] != 0 && (a.linked || b.linked))
                a.linked = b.linked = true;
        }
        // Fixed bodies transmit no motion: objects that touch the same wall are not linked.
        work.bodies[work.world->standing()].linked = false;
    }
}

void release(Work &work) {
    for (std::size_t i = 0; i < work.floors.size(); ++i) {
        const Vector d = work.floors[i].inverse * work.floors[i].g;
        Vector &u = work.bodies[i].u;
        u = {u.x - d.x, u.y - d.y, u.w - d.w};
    }
}

void push_bodies(Work &work, const Manifold &m) {
    const Vector wrench = m.wrench();
    for (int side = 0; side < 2; ++side) {
        const int i = side == 0 ? m.a : m.b;
        if (!work.is_object(i))
            continue;
        const Vector d = work.floors[i].inverse * wrench;
        const double sign = side == 0 ? -1.0 : 1.0;
        Vector &u = work.bodies[i].u;
        u = {u.x + sign * d.x, u.y + sign * d.y, u.w + sign * d.w};
    }
}

double balance_residual(Work &work) {
    std::vector<Vector> &left = work.left;
    left.resize(work.floors.size());
    for (std::size_t i = 0; i < left.size(); ++i)
        left[i] = work.floors[i].g;
    for (const Manifold &m : work.manifolds) {
        const Vector f = m.wrench();
        if (work.is_object(m.a))
            left[m.a] = {left[m.a].x + f.x, left[m.a].y + f.y, left[m.a].w + f.w};
        if (work.is_object(m.b))
            left[m.b] = {left[m.b].x - f.x, left[m.b].y - f.y, left[m.b].w - f.w};
    }
    double worst = 0.0;
    for (const Vector &v : left)
        for (const double part : {v.x, v.y, v.w})
            worst = std::max(worst, std::abs(part));
    return worst;
}

// Return the wrench of a unit of multiplier k on body b. A slipping normal force includes its friction.
static Vector force_row(const Manifold &m, int k) {
    const Vector &row = m.row[k];
    // A sticking manifold has its tangential multiplier as a separate unknown.
    if (k == TANGENT || m.mode[TANGENT] == 1)
        return row;
    const double friction = 0.5 * m.mode[TANGENT] * m.friction; // the mode of a slip is 2 or -2
    const Vector &along = m.row[TANGENT];
    return {row.x + friction * along.x, row.y + friction * along.y, row.w + friction * along.w};
}

// Fill in the displacements at every equation by a unit of multiplier k of manifold m.
static void fill_column(Work &work, const Manifold &m, int k, Table<double> matrix, int column) {
    const Vector force = force_row(m, k);
    const Vector ua = work.is_object(m.a) ? work.floors[m.a].inverse * force : Vector{};
    const Vector ub = work.is_object(m.b) ? work.floors[m.b].inverse * force : Vector{};
    int line = 0;
    for (const Manifold &d : work.manifolds) {
        // A row refers to U_b - U_a. The force acts on b and its reaction on a; manifold d is affected if it shares one
        // of them.
        const double sa = (d.a == m.a) * 1.0 - (d.b == m.a) * 1.0, sb = (d.b == m.b) * 1.0 - (d.a == m.b) * 1.0;
        const Vector u = {sa * ua.x + sb * ub.x, sa * ua.y + sb * ub.y, sa * ua.w + sb * ub.w};
        for (int j = 0; j < 3; ++j)
            if (d.acts(j))
                matrix[line++][column] = d.row[j].x * u.x + d.row[j].y * u.y + d.row[j].w * u.w;
    }
}

// Assemble the system A lambda = rhs of all active equations.
static Table<double> assemble(Work &work) {
    int size = 0;
    for (const Manifold &m : work.manifolds)
        for (int k = 0; k < 3; ++k)
            size += m.acts(k);
    work.matrix.resize(static_cast<std::size_t>(size) * (size + 1));
    const Table<double> matrix{work.matrix.data(), size, size + 1};
    int column = 0;
    for (const Manifold &m : work.manifolds)
        for (int k = 0; k < 3; ++k)
            if (m.acts(k)) {
                fill_column(work, m, k, matrix, column);
                matrix[column][size] = -work.relative_motion(m, k) - (k < NORMALS ? m.gap[k] : 0.0);
                ++column;
            }
    return matrix;
}

// Solve in place by elimination with partial pivoting; the last column becomes the solution.
static bool eliminate(Table<double> matrix) {
    const std::ptrdiff_t size = matrix.rows;
    double trace = 0.0;
    for (std::ptrdiff_t i = 0; i < size; ++i)
        trace += std::abs(matrix[i][i]);
    for (std::ptrdiff_t i = 0; i < size; ++i) {
        std::ptrdiff_t pivot = i;
        for (std::ptrdiff_t r = i + 1; r < size; ++r)
            if (std::abs(matrix[r][i]) > std::abs(matrix[pivot][i]))
                pivot = r;
        // Singular (or NaN): e.g. more contacts stick than a body has degrees of freedom. The fallback needs no
        // independent equations.
        if (!(std::abs(matrix[pivot][i]) > 1e-15 * trace))
            return false;
        if (pivot != i)
            std::swap_ranges(matrix[i] + i, matrix[i] + size + 1, matrix[pivot] + i);
        const double inverse = 1.0 / matrix[i][i];
        for (std::ptrdiff_t r = i + 1; r < size; ++r) {
            const double factor = matrix[r][i] * inverse;
            if (factor != 0.0)
                for (std::ptrdiff_t j = i + 1; j <= size; ++j)
                    matrix[r][j] -= factor * matrix[i][j];
        }
    }
    for (std::ptrdiff_t i = size - 1; i >= 0; --i) {
        double total = matrix[i][size];
        for (std::ptrdiff_t j = i + 1; j < size; ++j)
            total -= matrix[i][j] * matrix[j][size];
        matrix[i][size] = total / matrix[i][i];
    }
    return true;
}

// Read the multipliers from the solved system.
static void take_forces(Work &work, Table<double> matrix) {
    int line = 0;
    for (Manifold &m : work.manifolds) {
        double pressed = 0.0;
        for (int k = 0; k < 3; ++k) {
            m.force[k] = m.acts(k) ? matrix[line++][matrix.rows] : 0.0;
            if (k < NORMALS)
                pressed += m.force[k];
        }
        if (std::abs(m.mode[TANGENT]) == 2)
            m.force[TANGENT] = 0.5 * m.mode[TANGENT] * m.friction * pressed;
    }
}

// Solve the balance, linearised at U, for the multipliers of the guessed modes. Update U and the multipliers.
static bool solve_linear(Work &work) {
    release(work);
    const Table<double> matrix = assemble(work);
    if (!eliminate(matrix))
        return false;
    take_forces(work, matrix);
    for (const Manifold &m : work.manifolds)
        push_bodies(work, m);
    return true;
}

static int tangent_mode(const Work &work, const Manifold &m, double pressed, double stiffness) {
    if (m.mode[0] == 0 && (m.points == 1 || m.mode[1] == 0))
        return 0;
    // lt is the point of the friction interval nearest to lt - r ut. It sticks inside and slips at an end.
    const double wish = m.force[TANGENT] - stiffness * work.relative_motion(m, TANGENT);
    if (std::abs(wish) <= m.friction * pressed)
        return 1;
    return wish > 0.0 ? 2 : -2;
}

// Guess every mode from forces and displacements. Return whether any mode changed.
static bool set_modes(Work &work, double stiffness) {
    bool changed = false;
    for (Manifold &m : work.manifolds) {
        double pressed = 0.0;
        for (int k = 0; k < m.points; ++k) {
            const double ln = m.force[k];
            // min(ln, r w) = 0 means ln >= 0 _|_ w >= 0 (w: gap after the step). The smaller one is set to 0.
            const int active = ln - stiffness * (m.gap[k] + work.relative_motion(m, k)) > 0.0;
            changed = changed || active != m.mode[k];
            m.mode[k] = active;
            pressed += active * std::max(ln, 0.0);
        }
        const int mode = tangent_mode(work, m, pressed, stiffness);
        changed = changed || mode != m.mode[TANGENT];
        m.mode[TANGENT] = mode;
    }
    return changed;
}

// Return the violation of active normals and sticking tangents by the motion, m.
static double violation(const Work &work) {
    double worst = 0.0;
    for (const Manifold &m : work.manifolds)
        for (int k = 0; k < 3; ++k)
            if (m.acts(k))
                worst = std::max(worst, std::abs((k < NORMALS ? m.gap[k] : 0.0) + work.relative_motion(m, k)));
    return worst;
}

// Give bodies that stick at both ends of a closed contact exactly the same motion, so that no drift adds up.
//
// Pairs are in the order of the chain's contacts, so the pushing object already has its motion.
static void hold_together(Work &work) {
    constexpr double CLOSED = 1e-12; // share of L up to which a gap is rounding
    for (const Manifold &m : work.manifolds) {
        if (m.points != 2 || m.mode[0] != 1 || m.mode[1] != 1 || m.mode[TANGENT] != 1)
            continue;
        if (std::abs(m.gap[0]) + std::abs(m.gap[1]) < CLOSED * work.world->length && work.is_object(m.b))
            work.bodies[m.b].u = work.bodies[m.a].u;
    }
}

double newton(Work &work, const Scale &scale) {
    constexpr int ROUNDS = 25;     // rounds before the fallback takes over
    constexpr int PATIENCE = 6;    // rounds before tau moves towards the majorising matrix if little is gained
    constexpr double EXACT = 100.0; // tolerance of constraints, in units of wanted residual over stiffness
    const double stiffness = scale.stiffness(), wanted = scale.wanted();
    double tau = 0.0, before = INF;
    floor_terms(work, scale.eps());
    for (int round = 0; round < ROUNDS; ++round) {
        // In the first round, the forces are those of the last step, which do not belong to U. So the residual means
        // nothing.
        const bool changed = set_modes(work, stiffness);
        const double residual = round > 0 ? balance_residual(work) : INF;
        if (!changed && residual < wanted && stiffness * violation(work) < EXACT * wanted) {
            hold_together(work);
            return residual;
        }
        if (round > PATIENCE)
            tau = residual > 0.5 * before ? std::min(1.0, tau + 0.5) : std::max(0.0, tau - 0.25);
        before = residual;
        link(work);
        matrices(work, tau);
        if (!solve_linear(work))
            return INF;
        floor_terms(work, scale.eps());
    }
    return INF;
}

} // namespace pushplan::slip
