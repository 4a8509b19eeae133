// Collision checks of the rigid chain: separation and swept arcs.
//
// A swept arc is proven free by conservative advancement (Mirtich 1996): from a pose with a separation d from every
// obstacle, no point of the body can touch anything before it has travelled d.
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

// Flattened convex polygons. Polygon i has the corners from starts[i] on, and bounds[i] is a circle around it.
struct Shapes {
    std::vector<Corner> corners;
    std::vector<std::int64_t> starts;
    std::vector<Circle> bounds;

    std::int64_t count() const { return static_cast<std::int64_t>(bounds.size()); }
};

// A box around a group of obstacles. Nodes are in preorder: those inside this one end before row `after`. A leaf has
// the polygons and circles [first, last). Other nodes have none.
struct TreeNode {
    double xmin, ymin, xmax, ymax;
    std::int64_t after, first_polygon, last_polygon, first_circle, last_circle;
};

// The moving body: convex pieces in the chain frame, and a circle around all of them.
struct Body {
    std::shared_ptr<const Shapes> pieces;
    Circle bound;
};

// Obstacles in the order of their tree, and the workspace (infinite if there is none).
struct Obstacles {
    std::shared_ptr<const Shapes> polygons;
    std::vector<Circle> circles;
    std::vector<TreeNode> tree;
    Area walls;
};

// Scenes share body and obstacles, so copying a scene copies two pointers.
struct Scene {
    std::shared_ptr<const Body> body;
    std::shared_ptr<const Obstacles> obstacles;
    double clearance; // m, distance from all obstacles at checked poses
    double kept;      // m, smaller distance that is proven between them

    Scene with_distances(double clearance, double kept) const { return {body, obstacles, clearance, kept}; }
};

// Return a lower bound (m) of the body's distance from all obstacles at a pose, capped at `enough`.
double separation(const Scene &scene, const Pose &pose, double enough);

// Return whether an arc is proven to be collision-free.
//
// Every checked pose has at least `scene.clearance`, every pose in between at least `scene.kept`: a separation d at s
// covers all s' with |s' - s| <= (d - kept) / (top speed of the body). Intervals are checked in the middle first, where
// a collision is found soonest. An arc that comes closer than `scene.clearance` can be refused.
bool sweep_is_free(const Scene &scene, const Pose &pose, const Twist &twist, double length);

// Extra clearance of checked poses, m, so that the poses between them provably keep the clearance.
constexpr double SLACK = 2e-4;

// Possible rounding error of the distances of start and goal, m.
constexpr double ROUNDING = 1e-9;

// Maximum amount by which the proven distance is below the clearance, m; `pushplan.util.names`.
constexpr double CLEARANCE_ROOM = 1e-5;

// Return the scene with the distances that can be kept if start and goal have the distance `gap`.
//
// A sweep proves the distance between poses from that at the poses. If the two distances were equal, it would need
// infinitely many poses.
inline Scene scene_with_gap(const Scene &scene, double gap, double clearance) {
    const double looked_at = (clearance > gap ? clearance : gap) - ROUNDING, least = looked_at - CLEARANCE_ROOM;
    return scene.with_distances(looked_at, least < clearance ? least : clearance);
}

} // namespace pushplan
