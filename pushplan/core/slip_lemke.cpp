// The fallback of a step: floor friction linearised with K, then increasingly with H, and an LCP of the contacts.
//
// Stewart and Trinkle 1996: for every manifold the multipliers ln (one or two), b+ and b- along the tangent and the
// slack s of the friction cone, all >= 0 and complementary to
//
//     w_n = gap + n . (U_b - U_a),   w+- = s +- t . (U_b - U_a),   w_s = mu sum ln - b+ - b-.
//
// Lemke's method solves it. With K alone, the passes are iteratively reweighted least squares, which converge slowly.
// With H, they are Newton's method. A ray means that no motion satisfies all contacts: a jam.
#include "slip_work.hpp"

namespace pushplan::slip {

namespace {

constexpr int SLACK = -1;

// Unknown j of a manifold: its row (0, 1 normals, 2 tangent, or the slack) and its sign.
struct Unknown {
    int row;
    double sign;
};

// Return the number of unknowns of a manifold: its normals, b+, b-, s.
int width(const Manifold &m) { return m.points + 3; }

Unknown unknown(const Manifold &m, int j) {
    if (j < m.points)
        return {j, 1.0};
    if (j == m.points)
        return {TANGENT, 1.0};
    if (j == m.points + 1)
        return {TANGENT, -1.0};
    return {SLACK, 0.0};
}

// [I, -A, -1, q] of w = A z + q. Displacements are divided by the step's size, forces by its force.
struct Tableau {
    Table<double> numbers;
    int size;                // number of lines
    std::vector<int> &basis; // variable of each line: w below `size`, then z, then the artificial one

    double *operator[](int line) const { return numbers[line]; }
    int artificial() const { return 2 * size; }
    int last() const { return 2 * size + 1; }
};

// Fill in the displacements by a unit of row k of a manifold, times `scale`.
void respond(const Work &work, const Manifold &m, int k, double scale, const Tableau &tableau, int column) {
    const Vector &force = m.row[k];
    const Vector ua = work.is_object(m.a) ? work.floors[m.a].inverse * force : Vector{};
    const Vector ub = work.is_object(m.b) ? work.floors[m.b].inverse * force : Vector{};
    int line = 0;
    for (const Manifold &d : work.manifolds) {
        const double sa = (d.a == m.a) * scale - (d.b == m.a) * scale;
        const double sb = (d.b == m.b) * scale - (d.a == m.b) * scale;
        const Vector u = {sa * ua.x + sb * ub.x, sa * ua.y + sb * ub.y, sa * ua.w + sb * ub.w};
        for (int j = 0; j < width(d); ++j, ++line) {
            const auto [row, sign] = unknown(d, j);
            if (row == SLACK)
                continue;
            const Vector &r = d.row[row];
            tableau[line][column] -= sign * (r.x * u.x + r.y * u.y + r.w * u.w);
        }
    }
}

// Fill in -A: the displacements at every unknown by every other one, and the friction cones.
void fill_responses(const Work &work, double scale, const Tableau &tableau) {
    int column = tableau.size, start = 0;
    for (const Manifold &m : work.manifolds) {
        const int points = m.points;
        for (int j = 0; j < width(m); ++j, ++column) {
            const auto [row, sign] = unknown(m, j);
            if (row != SLACK) {
                respond(work, m, row, sign * scale, tableau, column);
                tableau[start + points + 2][column] -= row < NORMALS ? m.friction : -1.0;
            } else {
                tableau[start + points][column] -= 1.0;
                tableau[start + points + 1][column] -= 1.0;
            }
        }
        start += width(m);
    }
}

Tableau fill_tableau(Work &work, const Scale &scale) {
    int size = 0;
    for (const Manifold &m : work.manifolds)
        size += width(m);
    const int columns = 2 * size + 2;
    work.tableau.assign(static_cast<std::size_t>(size) * columns, 0.0);
    work.basis.resize(size);
    const Tableau tableau{{work.tableau.data(), size, columns}, size, work.basis};
    int line = 0;
    for (const Manifold &m : work.manifolds)
        for (int j = 0; j < width(m); ++j, ++line) {
            const auto [row, sign] = unknown(m, j);
            tableau[line][line] = 1.0;
            tableau[line][tableau.artificial()] = -1.0;
            double offset = 1e-12 * (line + 1.0); // makes all ratios different
            if (row != SLACK)
                offset += sign * (work.relative_motion(m, row) + (row < NORMALS ? m.gap[row] : 0.0)) / scale.size;
            tableau[line][tableau.last()] = offset;
            work.basis[line] = line;
        }
    fill_responses(work, scale.force / scale.size, tableau);
    return tableau;
}

void pivot(const Tableau &tableau, int line, int column) {
    const int columns = 2 * tableau.size + 2;
    double *const chosen = tableau[line];
    const double inverse = 1.0 / chosen[column];
    for (int j = 0; j < columns; ++j)
        chosen[j] *= inverse;
    for (int i = 0; i < tableau.size; ++i) {
        double *const row = tableau[i];
        const double factor = row[column];
        if (i != line && factor != 0.0)
            for (int j = 0; j < columns; ++j)
                row[j] -= factor * chosen[j];
    }
}

// Return the line whose variable reaches 0 first, or -1. Among equals, the artificial variable comes first.
int leaving_line(const Tableau &tableau, int entering) {
    constexpr double TINY = 1e-13;
    double best = INF;
    int line = -1;
    for (int i = 0; i < tableau.size; ++i) {
        const double slope = tableau[i][entering];
        // A rounding error of 0 as a pivot would blow up the tableau. By the choice of units, entries are of order 1.
        if (slope <= 1e-11)
            continue;
        const double ratio = tableau[i][tableau.last()] / slope;
        if (ratio < best - TINY || (ratio < best + TINY && tableau.basis[i] == tableau.artificial())) {
            best = ratio;
            line = i;
        }
    }
    return line;
}

// Pivot w = A z + q to a complementary solution; q becomes the basic variables' values.
Ending lemke(const Tableau &tableau) {
    const int size = tableau.size;
    int leaving = -1;
    double least = 0.0;
    for (int i = 0; i < size; ++i)
        if (tableau[i][tableau.last()] < least) {
            least = tableau[i][tableau.last()];
            leaving = i;
        }
    if (leaving < 0)
        return Ending::SOLVED;
    // The artificial variable enters at the smallest q. All others are then >= 0.
    int entering = tableau.artificial();
    for (int round = 0; round < 50 * size; ++round) {
        pivot(tableau, leaving, entering);
        const int left = tableau.basis[leaving];
        tableau.basis[leaving] = entering;
        if (left == tableau.artificial())
            return Ending::SOLVED;
        // The complement of the variable that left enters, so that at most one pair has no basic variable.
        entering = left < size ? left + size : left - size;
        leaving = leaving_line(tableau, entering);
        if (leaving < 0)
            return Ending::RAY;
    }
    return Ending::LOST;
}

// Read the multipliers from the tableau, and apply their displacements to the bodies.
void take_solution(Work &work, const Tableau &tableau, double force) {
    for (Manifold &m : work.manifolds)
        m.force = {};
    for (int line = 0; line < tableau.size; ++line) {
        int place = tableau.basis[line] - tableau.size;
        if (place < 0 || place >= tableau.size)
            continue;
        std::size_t c = 0;
        for (; place >= width(work.manifolds[c]); ++c)
            place -= width(work.manifolds[c]);
        Manifold &m = work.manifolds[c];
        const auto [row, sign] = unknown(m, place);
        if (row != SLACK)
            m.force[row] += sign * force * tableau[line][tableau.last()];
    }
    for (const Manifold &m : work.manifolds)
        push_bodies(work, m);
}

// Set the modes of pressing contacts, as `link` needs them.
void mark_pressed(Work &work) {
    for (Manifold &m : work.manifolds) {
        for (int k = 0; k < NORMALS; ++k)
            m.mode[k] = m.force[k] > 0.0;
        m.mode[TANGENT] = m.mode[0] + m.mode[1] > 0;
    }
}

} // namespace

Ending reweighted(Work &work, const Scale &scale, double least, double most) {
    constexpr int PASSES = 40, PATIENT_PASSES = 300; // maximum passes with a varying tau, and with a fixed one
    double tau = std::max(1.0, least), before = INF;
    // If nothing is linked, `matrices` uses K alone in the first pass. K is at least the true curvature everywhere.
    for (Body &body : work.bodies)
        body.linked = false;
    floor_terms(work, scale.eps());
    for (int pass = 0; pass < (least < most ? PASSES : PATIENT_PASSES); ++pass) {
        matrices(work, tau);
        release(work);
        const Tableau tableau = fill_tableau(work, scale);
        const Ending ending = lemke(tableau);
        if (ending != Ending::SOLVED)
            return ending;
        take_solution(work, tableau, scale.force);
        floor_terms(work, scale.eps());
        const double residual = balance_residual(work);
        if (residual < scale.wanted())
            break;
        mark_pressed(work);
        link(work);
        // As in the Levenberg-Marquardt method: move towards Newton while that helps, and back quickly if it does not.
        tau = residual < before ? std::max(least, 0.5 * tau) : std::min(most, 4.0 * tau);
        before = residual;
    }
    return Ending::SOLVED;
}

} // namespace pushplan::slip
