// What one step of pushed bodies works on.
//
// All places are in world axes about the plate's reference point O at the step's start. Twists U are displacements
// (v_x, v_y, L w) about O; wrenches are (f_x, f_y, m / L).
#pragma once

#include "poses.hpp"
#include "slip_world.hpp"

#include <array>

namespace pushplan::slip {

// A displacement or a wrench.
struct Vector {
    double x = 0.0, y = 0.0, w = 0.0;
};

// A symmetric matrix.
struct Symmetric {
    double xx = 0.0, xy = 0.0, xw = 0.0, yy = 0.0, yw = 0.0, ww = 0.0;

    Vector operator*(const Vector &v) const {
        return {xx * v.x + xy * v.y + xw * v.w, xy * v.x + yy * v.y + yw * v.w, xw * v.x + yw * v.y + ww * v.w};
    }
};

// A body where it is in this step, and how it moves.
struct Body {
    double x = 0.0, y = 0.0, c = 1.0, s = 0.0; // place, cosine and sine of the heading
    Vector u;                                  // U
    bool linked = false;                       // active contacts connect it with the pusher
};

// An object against the floor: friction wrench g, secant K, curvature H, and the inverse of the step's matrix M.
struct Floor {
    Vector g;
    Symmetric secant, curvature, inverse;
};

// A foot at x / L, y / L.
struct PlacedFoot {
    double x, y, load;
};

// A corner where its body is.
struct PlacedCorner {
    double x, y, nx, ny;
};

constexpr int NORMALS = 2, TANGENT = 2; // rows 0 and 1 are of the normals, row 2 of the tangent

// Where two bodies touch: one normal, one or two points, and one tangential multiplier.
struct Manifold {
    int a = 0, b = 0;                      // bodies; the normal points from a into b
    int pair = 0;                          // the first pair of pieces that touches here
    int points = 0;                        // one or two
    double nx = 0.0, ny = 0.0;             // normal; the tangent is (-ny, nx)
    double friction = 0.0;
    std::array<double, 2> x{}, y{}, gap{}; // of the right and the left point; a single one is the first
    std::array<Vector, 3> row{};           // row . (U_b - U_a) is the relative displacement
    std::array<double, 3> force{};         // multipliers, N
    // 1 where a normal is active; tangent: 0 free, 1 sticks, 2 or -2 slips with a force of that sign; -1 not known.
    std::array<int, 3> mode{-1, -1, -1};

    double tx() const { return -ny; }
    double ty() const { return nx; }

    // Whether row k is an equation of the guessed modes.
    bool acts(int k) const { return mode[k] == 1 && (k == TANGENT || k < points); }

    // The wrench on body b.
    Vector wrench() const {
        Vector sum;
        for (int k = 0; k < 3; ++k) {
            sum.x += force[k] * row[k].x;
            sum.y += force[k] * row[k].y;
            sum.w += force[k] * row[k].w;
        }
        return sum;
    }
};

// The size of a step and of the forces in it, by which all thresholds are measured.
struct Scale {
    double size;  // displacement of the plate, m
    double force; // sum of mu N, N

    // eps over the size of a step: from 1e-4 to 1e-2 pushes come out the same.
    static constexpr double SMOOTHING = 1e-3;
    // Residual over the sum of mu N that a step iterates to, and up to which it counts as solved.
    static constexpr double WANTED = 1e-7, ACCEPTED = 1e-4;

    // eps goes with the step: an absolute one would make slow pushes viscous.
    double eps() const { return SMOOTHING * size; }
    // r brings forces and displacements to one size, so that neither decides modes alone, N/m.
    double stiffness() const { return force / size; }
    double wanted() const { return WANTED * force; }
    double accepted() const { return ACCEPTED * force; }
};

struct Work {
    explicit Work(const World &world)
        : world(&world), bodies(world.objects.size() + 2), floors(world.objects.size()), feet(world.feet.size()),
          corners(world.corners.size()), found(world.pairs.size(), -1) {
        manifolds.reserve(world.room());
    }

    const World *world;
    std::vector<Body> bodies;
    std::vector<Floor> floors;
    std::vector<PlacedFoot> feet;
    std::vector<PlacedCorner> corners;
    std::vector<Manifold> manifolds;
    std::vector<int> found;      // the manifold that every pair belongs to, or -1
    std::vector<double> matrix;  // linear system of the multipliers
    std::vector<double> tableau; // of Lemke's method
    std::vector<int> basis;      // likewise
    std::vector<Vector> left;    // of the balances

    int plate() const { return world->plate(); }
    bool is_object(int body) const { return body < world->plate(); }

    // Row k of a manifold times U_b - U_a.
    double relative_motion(const Manifold &m, int k) const {
        const Vector &a = bodies[m.a].u, &b = bodies[m.b].u, &row = m.row[k];
        return row.x * (b.x - a.x) + row.y * (b.y - a.y) + row.w * (b.w - a.w);
    }
};

// Bring all corners of bodies to where these are.
void place_corners(Work &work);

// Find all manifolds with a gap below `reach` (m); false if there are more than there is room for.
bool find_manifolds(Work &work, double reach);

// Fill gradient, secant and curvature at the twists U.
void floor_terms(Work &work, double eps);

// Fill the inverses of M; of K where nothing links an object with the pusher, which ends its motion at once.
void matrices(Work &work, double tau);

// Mark the bodies that active contacts connect with the pusher: what moves the others is nothing.
void link(Work &work);

// Move U to where the balance linearised at it would be without contact forces: U - M^-1 g.
void release(Work &work);

// Add to U what the force of a manifold displaces.
void push_bodies(Work &work, const Manifold &m);

// The largest component of what is left of an object's balance, N.
double balance_residual(Work &work);

// Solve a step from U and the multipliers in `work`; return the residual (N), infinite if it did not converge.
double newton(Work &work, const Scale &scale);

// Ends of Lemke's method: a solution, a ray, or too many pivots.
enum class Ending { SOLVED, RAY, LOST };

// Solve a step by passes with exact contacts, from the U in `work`; return how Lemke's method ended last.
//
// `least` is the smallest tau, with which M is nearest to H, and `most` the largest; above 1 it shortens steps further
// than K does, which ends cycles of two.
Ending reweighted(Work &work, const Scale &scale, double least, double most);

} // namespace pushplan::slip
