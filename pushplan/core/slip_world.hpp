// The constant data of pushed bodies: objects on their feet, convex pieces, and the pairs that can touch.
//
// Bodies have numbers: first the n objects, then the pusher (n), then all fixed bodies together (n + 1).
#pragma once

#include "tables.hpp"

#include <algorithm>
#include <vector>

namespace pushplan::slip {

// A point under an object that carries load, in the object's frame.
struct Foot {
    double x, y;      // m
    double load;      // mu N, N
    double stiffness; // share of a shifted load
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
    double outer; // 1 for an edge of the outline, 0 for an edge between two convex pieces
};

// A circle around a piece, in its body's frame, and the rounding radius of the piece's corners, m.
struct Circle {
    double x, y, radius, rounding;
};

// A convex piece of a body. A piece with one corner is a disc.
struct Piece {
    int body;
    int first, last; // first corner, and one past the last
    Circle circle;
};

// Two pieces that can touch.
struct Pair {
    int a, b;
    int contact; // the chain's contact between their bodies, or -1
    double friction;
};

struct World {
    std::vector<Foot> feet;
    std::vector<Object> objects;
    std::vector<Corner> corners;
    std::vector<Piece> pieces;
    std::vector<Pair> pairs; // the chain's contacts come first, in their order
    double length;           // characteristic length L, m
    std::vector<int> order;  // caller's number of each object

    int plate() const { return static_cast<int>(objects.size()); }
    int standing() const { return plate() + 1; }

    // Maximum number of manifolds: 16 for each object and 16 more.
    std::size_t room() const { return std::min(16 * objects.size() + 16, pairs.size()); }

    // Return the sum of mu N of all objects, N.
    double friction() const {
        double force = 0.0;
        for (const Object &object : objects)
            force += object.load;
        return force;
    }
};

} // namespace pushplan::slip
