// The rigid chain against the obstacles: separation and swept arcs.
//
// A swept arc is proven free by conservative advancement (Mirtich 1996): from a pose whose separation from every
// obstacle is d, no point of the body can touch anything before it has travelled d.
#pragma once

#include "poses.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace pushplan {

// A corner of a convex polygon, counter-clockwise, and the outward unit normal of the edge that begins there.
struct Corner {
    double x, y, nx, ny;
};

struct Circle {
    double x, y, radius;
};

// Convex polygons, flattened: polygon i has the corners from starts[i] on, and bounds[i] is a circle around it.
struct Shapes {
    std::vector<Corner> corners;
    std::vector<std::int64_t> starts;
    std::vector<Circle> bounds;

    std::int64_t count() const { return static_cast<std::int64_t>(bounds.size()); }
};

// A box around a group of obstacles. Nodes are in preorder: those inside this one end before the row `after`. A leaf
// has the polygons and the circles from the first to before the last; other nodes have none of their own.
struct TreeNode {
    double xmin, ymin, xmax, ymax;
    std::int64_t after, first_polygon, last_polygon, first_circle, last_circle;
};

// What moves: convex pieces in the chain frame, and a circle around all of them.
struct Body {
    std::shared_ptr<const Shapes> pieces;
    Circle bound;
};

// What stands still: obstacles in the order of their tree, and the workspace, infinite where there is none.
struct Obstacles {
    std::shared_ptr<const Shapes> polygons;
    std::vector<Circle> circles;
    std::vector<TreeNode> tree;
    Area walls;
};

// Body and obstacles are shared by the scenes that differ in the rest: a copy of a scene copies two pointers.
struct Scene {
    std::shared_ptr<const Body> body;
    std::shared_ptr<const Obstacles> obstacles;
    double clearance; // m, from everything at the poses that are looked at
    double kept;      // m, smaller, that is proven between these poses

    Scene with_distances(double clearance, double kept) const { return {body, obstacles, clearance, kept}; }
};

// Return a lower bound (m) on the distance of the body at a pose from everything, capped at `enough`.
double separation(const Scene &scene, const Pose &pose, double enough);

// Return whether the body keeps clear of everything along an arc: proven, never merely sampled.
//
// Every pose looked at has `scene.clearance`, every one between has `scene.kept` at least: a separation d at s covers
// all s' with |s' - s| <= (d - kept) / (top speed of the body). Intervals are looked at in the middle first, where a
// collision shows soonest. An arc that comes closer than `scene.clearance` may be refused.
bool sweep_is_free(const Scene &scene, const Pose &pose, const Twist &twist, double length);

// Distance beyond the clearance, m, that the poses looked at have, so that those between can be proven to keep it.
constexpr double SLACK = 2e-4;

// Start and goal may fail by rounding to have the distance they have, m.
constexpr double ROUNDING = 1e-9;

// What is proven between poses is less than the clearance by so much at most, m; `pushplan.util.names`.
constexpr double CLEARANCE_ROOM = 1e-5;

// Return a scene with what the poses looked at keep, and those between, where start and goal have the distance `gap`.
//
// A sweep proves what lies between poses from what is seen at them: with no room between the two distances it would
// need infinitely many.
inline Scene scene_with_gap(const Scene &scene, double gap, double clearance) {
    const double looked_at = (clearance > gap ? clearance : gap) - ROUNDING, least = looked_at - CLEARANCE_ROOM;
    return scene.with_distances(looked_at, least < clearance ? least : clearance);
}

} // namespace pushplan
