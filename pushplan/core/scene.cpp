#include "scene.hpp"

namespace pushplan {

namespace {

// Separations below this (m), or below twice the clearance, are refined from the bound of separating axes to the exact
// distance.
constexpr double EXACT_BELOW = 0.01;

// Maximum number of open intervals of an arc. Each is at most half of the one below it.
constexpr int DEPTH = 128;

// Maximum number of checked poses of an arc: a second of work.
constexpr int MOST_POSES = 1'000'000;

// Minimum and maximum by value, so that the compiler needs no branch.
inline double least(double value, double other) { return other < value ? other : value; }
inline double most(double value, double other) { return other > value ? other : value; }

// The corners of one convex polygon.
struct Polygon {
    const Corner *first, *last;

    const Corner &after(const Corner *corner) const { return corner + 1 < last ? corner[1] : *first; }
};

inline Polygon polygon(const Shapes &shapes, std::int64_t i) {
    return {shapes.corners.data() + shapes.starts[i], shapes.corners.data() + shapes.starts[i + 1]};
}

// A pose with the cosine and sine of its heading.
struct Frame {
    double c, s, x, y;

    double x_of(double px, double py) const { return x + c * px - s * py; }
    double y_of(double px, double py) const { return y + s * px + c * py; }
    // R^T (-t), R^T.
    Frame inverse() const { return {c, -s, -(c * x + s * y), s * x - c * y}; }
};

// Return the largest separation from polygon b along the edge normals of polygon a (moved by the pose).
double axis_separation(const Polygon &a, const Polygon &b, const Frame &pose) {
    const double c = pose.c, s = pose.s, x = pose.x, y = pose.y;
    double best = -INF;
    for (const Corner *p = a.first; p != a.last; ++p) {
        const double nx = c * p->nx - s * p->ny;
        const double ny = s * p->nx + c * p->ny;
        const double offset = nx * (x + c * p->x - s * p->y) + ny * (y + s * p->x + c * p->y);
        double nearest = INF;
        for (const Corner *q = b.first; q != b.last; ++q)
            nearest = least(nearest, nx * q->x + ny * q->y);
        best = most(best, nearest - offset);
    }
    return best;
}

// Return the squared distance of a point from a segment.
inline double point_segment(double px, double py, double ax, double ay, double bx, double by) {
    const double ex = bx - ax, ey = by - ay;
    double t = ((px - ax) * ex + (py - ay) * ey) / (ex * ex + ey * ey);
    t = least(1.0, most(0.0, t));
    const double dx = px - ax - t * ex, dy = py - ay - t * ey;
    return dx * dx + dy * dy;
}

// Return the smallest squared distance from a corner of a (moved by the pose) to an edge of b.
double corner_distance(const Polygon &a, const Polygon &b, const Frame &pose) {
    double best = INF;
    for (const Corner *p = a.first; p != a.last; ++p) {
        const double px = pose.x_of(p->x, p->y), py = pose.y_of(p->x, p->y);
        for (const Corner *q = b.first; q != b.last; ++q) {
            const Corner &next = b.after(q);
            best = least(best, point_segment(px, py, q->x, q->y, next.x, next.y));
        }
    }
    return best;
}

// Return the distance of two convex polygons, or a lower bound if it is above `exact_below`; <= 0 on overlap.
double polygon_separation(const Polygon &a, const Polygon &b, const Frame &pose, double exact_below) {
    const double forward = axis_separation(a, b, pose);
    if (forward >= exact_below)
        return forward;
    // Exchange the roles: the inverse pose takes b into the frame of a.
    const Frame inverse = pose.inverse();
    const double separation = most(forward, axis_separation(b, a, inverse));
    if (separation <= 0.0 || separation >= exact_below)
        return separation;
    // No edge normal gives their distance, so it is between two corners, or a corner and an edge.
    return std::sqrt(least(corner_distance(a, b, pose), corner_distance(b, a, inverse)));
}

// Return the distance of a convex polygon (moved by the pose) from a disc; <= 0 on overlap.
double disc_separation(const Polygon &a, const Circle &disc, const Frame &pose) {
    const double c = pose.c, s = pose.s;
    const double px = c * (disc.x - pose.x) + s * (disc.y - pose.y);
    const double py = -s * (disc.x - pose.x) + c * (disc.y - pose.y);
    double inside = -INF, nearest = INF;
    for (const Corner *p = a.first; p != a.last; ++p) {
        const Corner &next = a.after(p);
        inside = most(inside, p->nx * (px - p->x) + p->ny * (py - p->y));
        nearest = least(nearest, point_segment(px, py, p->x, p->y, next.x, next.y));
    }
    return inside <= 0.0 ? inside - disc.radius : std::sqrt(nearest) - disc.radius;
}

// Return the distance of a point from the workspace's walls; negative outside.
inline double from_walls(const Area &walls, double x, double y) {
    return least(least(least(x - walls.xmin, y - walls.ymin), walls.xmax - x), walls.ymax - y);
}

// Return the distance of the body from the workspace's walls; negative outside.
double wall_separation(const Shapes &body, const Area &walls, const Frame &pose) {
    double best = INF;
    for (const Corner &p : body.corners)
        best = least(best, from_walls(walls, pose.x_of(p.x, p.y), pose.y_of(p.x, p.y)));
    return best;
}

// The body at a pose, with its bounding circle around (cx, cy).
struct Placed {
    const Shapes &pieces;
    Frame pose;
    double cx, cy, radius;

    // Return whether the bounding circles of the body and an obstacle are nearer than `enough`.
    bool may_be_near(const Circle &other, double enough) const {
        const double dx = cx - other.x, dy = cy - other.y;
        const double reach = enough + radius + other.radius;
        return dx * dx + dy * dy < reach * reach;
    }
};

// Return the separation of the body from a polygonal obstacle, capped at `enough`.
double body_to_polygon(const Placed &body, const Shapes &obstacles, std::int64_t o, double clearance, double enough) {
    const Circle &around = obstacles.bounds[o];
    if (!body.may_be_near(around, enough))
        return enough;
    const double exact_below = most(EXACT_BELOW, 2.0 * clearance);
    const Frame &pose = body.pose;
    double best = enough;
    for (std::int64_t p = 0; p < body.pieces.count(); ++p) {
        const Circle &piece = body.pieces.bounds[p];
        const double dx = pose.x_of(piece.x, piece.y) - around.x;
        const double dy = pose.y_of(piece.x, piece.y) - around.y;
        const double reach = best + piece.radius + around.radius;
        if (dx * dx + dy * dy < reach * reach)
            best = least(best, polygon_separation(polygon(body.pieces, p), polygon(obstacles, o), pose, exact_below));
    }
    return best;
}

// Return the separation of the body from a round obstacle, capped at `enough`.
double body_to_disc(const Placed &body, const Circle &disc, double enough) {
    if (!body.may_be_near(disc, enough))
        return enough;
    double best = enough;
    for (std::int64_t p = 0; p < body.pieces.count(); ++p)
        best = least(best, disc_separation(polygon(body.pieces, p), disc, body.pose));
    return best;
}

// Return the largest speed of a body point under a body twist. The speed is convex, so a corner has the maximum.
double top_speed(const Shapes &body, const Twist &twist) {
    double best = 0.0;
    for (const Corner &p : body.corners) {
        const double px = twist.vx - twist.omega * p.y, py = twist.vy + twist.omega * p.x;
        best = most(best, px * px + py * py);
    }
    return std::sqrt(best);
}

} // namespace

double separation(const Scene &scene, const Pose &at, double enough) {
    const Frame pose{std::cos(at.theta), std::sin(at.theta), at.x, at.y};
    const Circle &bound = scene.body->bound;
    const Obstacles &room = *scene.obstacles;
    const Placed body{*scene.body->pieces, pose, pose.x_of(bound.x, bound.y), pose.y_of(bound.x, bound.y),
                      bound.radius};
    double best = enough;
    if (from_walls(room.walls, body.cx, body.cy) < enough + body.radius)
        best = least(best, wall_separation(body.pieces, room.walls, pose));
    const std::int64_t nodes = static_cast<std::int64_t>(room.tree.size());
    for (std::int64_t i = 0; i < nodes;) {
        const TreeNode &box = room.tree[i];
        const double dx = most(most(box.xmin - body.cx, body.cx - box.xmax), 0.0);
        const double dy = most(most(box.ymin - body.cy, body.cy - box.ymax), 0.0);
        const double reach = best + body.radius;
        if (dx * dx + dy * dy >= reach * reach) {
            i = box.after; // a miss skips all inner boxes
            continue;
        }
        for (std::int64_t o = box.first_polygon; o < box.last_polygon; ++o)
            best = body_to_polygon(body, *room.polygons, o, scene.clearance, best);
        for (std::int64_t o = box.first_circle; o < box.last_circle; ++o)
            best = body_to_disc(body, room.circles[o], best);
        ++i;
    }
    return best;
}

bool sweep_is_free(const Scene &scene, const Pose &pose, const Twist &twist, double length) {
    struct Interval {
        double begin, end;
    };
    const double top = top_speed(*scene.body->pieces, twist);
    std::array<Interval, DEPTH> left;
    left[0] = {0.0, length};
    int n = 1, poses = 0;
    while (n > 0) {
        const auto [begin, end] = left[--n];
        const double middle = 0.5 * (begin + end);
        // Separations that cover the whole interval need not be exact.
        const double enough = 0.5 * (end - begin) * top + 2.0 * scene.clearance;
        const double gap = separation(scene, step(pose, twist, middle), enough);
        if (!(gap >= scene.clearance))
            return false;
        const double covered = (gap - scene.kept) / top;
        if (middle - covered > begin) {
            if (n + 2 > DEPTH || ++poses > MOST_POSES)
                throw std::runtime_error("a swept arc needs too many intervals");
            left[n++] = {begin, middle - covered};
            left[n++] = {middle + covered, end};
        }
    }
    return true;
}

} // namespace pushplan
