// The data of one step of pushed bodies.
//
// All places are in world axes relative to the plate's reference point O at the step's start. Twists U are
// displacements (v_x, v_y, L w) about O; wrenches are (f_x, f_y, m / L).
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

// The place and motion of a body in this step.
struct Body {
    double x = 0.0, y = 0.0, c = 1.0, s = 0.0; // place; cosine and sine of the heading
    Vector u;                                  // U
    bool linked = false;                       // active contacts connect it with the pusher
};

// Floor friction of an object: wrench g, secant K, curvature H, and the inverse of the step's matrix M.
struct Floor {
    Vector g;
    Symmetric secant, curvature, inverse;
};

// A foot at x / L, y / L.
struct PlacedFoot {
    double x, y, load;
};

// A corner at the place of its body.
struct PlacedCorner {
    double x, y, nx, ny;
};

constexpr int NORMALS = 2, TANGENT = 2; // rows 0 and 1: normals; row 2: tangent

// A contact of two bodies: one normal, one or two points, and one tangential multiplier.
struct Manifold {
    int a = 0, b = 0;                      // bodies; the normal points from a into b
    int pair = 0;                          // the first pair of pieces that touches here
    int points = 0;                        // one or two
    double nx = 0.0, ny = 0.0;             // normal; the tangent is (-ny, nx)
    double friction = 0.0;
    std::array<double, 2> x{}, y{}, gap{}; // of the right and left point; a single point is the first
    std::array<Vector, 3> row{};           // row . (U_b - U_a) is the relative displacement
    std::array<double, 3> force{};         // multipliers, N
    // Normal: 1 if active. Tangent: 0 free, 1 sticks, 2 or -2 slips with a force of that sign. -1: unknown.
    std::array<int, 3> mode{-1, -1, -1};

    double tx() const { return -ny; }
    double ty() const { return nx; }

    // Return whether row k is an equation of the guessed modes.
    bool acts(int k) const { return mode[k] == 1 && (k == TANGENT || k < points); }

    // Return the wrench on body b.
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

// Size of a step and of its forces: the units of all thresholds.
struct Scale {
    double size;  // displacement of the plate, m
    double force; // sum of mu N, N

    // eps over the size of a step. Pushes are the same from 1e-4 to 1e-2.
    static constexpr double SMOOTHING = 1e-3;
    // Residual over the sum of mu N at which iteration stops, and up to which a step counts as solved.
    static constexpr double WANTED = 1e-7, ACCEPTED = 1e-4;

    // eps scales with the step, because an absolute eps would make slow pushes viscous.
    double eps() const { return SMOOTHING * size; }
    // r scales forces and displacements to one size, so that neither decides modes alone, N/m.
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
    std::vector<int> found;      // manifold of each pair, or -1
    std::vector<double> matrix;  // linear system of the multipliers
    std::vector<double> tableau; // of Lemke's method
    std::vector<int> basis;      // of Lemke's method
    std::vector<Vector> left;    // residuals of the balances

    int plate() const { return world->plate(); }
    bool is_object(int body) const { return body < world->plate(); }

    // Return row k of a manifold times U_b - U_a.
    double relative_motion(const Manifold &m, int k) const {
        const Vector &a = bodies[m.a].u, &b = bodies[m.b].u, &row = m.row[k];
        return row.x * (b.x - a.x) + row.y * (b.y - a.y) + row.w * (b.w - a.w);
    }
};

// Place all corners at the places of their bodies.
void place_corners(Work &work);

// Find all manifolds with a gap below `reach` (m). Return false if there are too many.
bool find_manifolds(Work &work, double reach);

// Compute gradient, secant and curvature at the twists U.
void floor_terms(Work &work, double eps);

// Compute the inverses of M, or of K for objects that nothing links with the pusher, which stops them at once.
void matrices(Work &work, double tau);

// Mark the bodies that active contacts connect with the pusher. Nothing moves the others.
void link(Work &work);

// Set U to the solution of the linearised balance without contact forces: U - M^-1 g.
void release(Work &work);

// Add the displacement by the force of a manifold to U.
void push_bodies(Work &work, const Manifold &m);

// Return the largest component of the residuals of the objects' balances, N.
double balance_residual(Work &work);

// Solve a step from U and the multipliers in `work`. Return the residual (N); infinite without convergence.
double newton(Work &work, const Scale &scale);

// Outcomes of Lemke's method: a solution, a ray, or too many pivots.
enum class Ending { SOLVED, RAY, LOST };

// Solve a step by passes with exact contacts, from the U in `work`. Return the last outcome of Lemke's method.
//
// `least` is the smallest tau, where M is nearest to H, and `most` the largest. Above 1, it shortens steps more than K
// does, which breaks cycles of two.
Ending reweighted(Work &work, const Scale &scale, double least, double most);

} // namespace pushplan::slip
