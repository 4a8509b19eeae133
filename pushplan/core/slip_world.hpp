// What does not change while bodies are pushed about: objects on their feet, convex pieces, and which may touch.
//
// Bodies are counted: the n objects, then the pusher (n), then all that stands still (n + 1).
#pragma once

#include "tables.hpp"

#include <algorithm>
#include <vector>

namespace pushplan::slip {

// A point under an object that carries load, in the object's frame.
struct Foot {
    double x, y;      // m
    double load;      // mu N, N
    double stiffness; // share in carrying a load that shifts
};

struct Object {
    int first_foot, last_foot;
    double load;          // sum of mu N, N
    double shift;         // h mu, m: a push at height h shifts the load
    double sxx, sxy, syy; // second moments of the stiffness, m^2
    double cx, cy;        // stiffness centre, m
};

// A corner of a piece, in its body's frame, with the outward normal of the edge that begins there.
struct Corner {
    double x, y, nx, ny;
    double outer; // 1 where that edge is a piece of the outline, 0 where it only parts two convex pieces
};

// A circle around a piece, in its body's frame, and the radius that the piece's corners are rounded by, m.
struct Circle {
    double x, y, radius, rounding;
};

// A convex piece of a body; one corner is a disc.
struct Piece {
    int body;
    int first, last; // corners: first to one past the last
    Circle circle;
};

// Two pieces that may touch.
struct Pair {
    int a, b;
    int contact; // the chain's contact whose bodies these are, or -1
    double friction;
};

struct World {
    std::vector<Foot> feet;
    std::vector<Object> objects;
    std::vector<Corner> corners;
    std::vector<Piece> pieces;
    std::vector<Pair> pairs; // those of the chain's contacts come first, in their order
    double length;           // characteristic length L, m
    std::vector<int> order;  // the caller's number of every object

    int plate() const { return static_cast<int>(objects.size()); }
    int standing() const { return plate() + 1; }

    // Most manifolds at once: 16 an object and 16 more.
    std::size_t room() const { return std::min(16 * objects.size() + 16, pairs.size()); }

    // Sum of mu N of all objects, N.
    double friction() const {
        double force = 0.0;
        for (const Object &object : objects)
            force += object.load;
        return force;
    }
};

} // namespace pushplan::slip
