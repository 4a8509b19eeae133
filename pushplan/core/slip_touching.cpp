// Contact manifolds: one normal and one or two points for two touching convex pieces (reference-face clipping).
//
// The face whose line separates the two pieces best is the reference face. The most opposed edge of the other piece is
// clipped to it (Catto 2006, "Fast and simple physics using sequential impulses"). Both points lie on the reference
// face, so one tangential multiplier is enough for both. Pieces beside one another's faces touch with one corner each.
// Discs are pieces with one corner and a radius.
#include "slip_work.hpp"

#include <utility>

namespace pushplan::slip {

namespace {

// Distance up to which two points of a manifold are one, m.
constexpr double SHORTEST = 1e-9;

// Contact of two pieces: normal from a into b, right (0) and left (1) point, and their gaps.
struct Touch {
    double nx, ny;
    std::array<double, 2> x, y;
    std::array<double, 2> gap; // infinite if there is no such point

    // Return the contact with the opposite normal; right and left are exchanged.
    Touch turned_round() const { return {-nx, -ny, {x[1], x[0]}, {y[1], y[0]}, {gap[1], gap[0]}}; }
};

// Return whether the circles around two pieces are farther apart than `reach`.
bool apart(const Work &work, const Piece &a, const Piece &b, double reach) {
    const Body &one = work.bodies[a.body], &other = work.bodies[b.body];
    const Circle &p = a.circle, &q = b.circle;
    const double dx = other.x + other.c * q.x - other.s * q.y - one.x - one.c * p.x + one.s * p.y;
    const double dy = other.y + other.s * q.x + other.c * q.y - one.y - one.s * p.x - one.c * p.y;
    const double most = p.radius + q.radius + reach;
    return dx * dx + dy * dy > most * most;
}

struct Face {
    double away = -INF; // separation from another piece; < 0 on overlap
    int corner = -1;    // first corner; -1 for a disc
};

// Return the face of a piece that separates it best from another one.
Face best_face(const std::vector<PlacedCorner> &corners, const Piece &piece, const Piece &other) {
    Face best;
    if (piece.last - piece.first == 1)
        return best;
    for (int k = piece.first; k < piece.last; ++k) {
        const PlacedCorner &face = corners[k];
        double nearest = INF;
        for (int m = other.first; m < other.last; ++m)
            nearest = std::min(nearest, (corners[m].x - face.x) * face.nx + (corners[m].y - face.y) * face.ny);
        if (nearest > best.away)
            best = {nearest, k};
    }
    return best;
}

// Search for the contact of two pieces nearer than `reach`.
struct Search {
    const Work &work;
    double reach;
    double rounding; // of both pieces

    // Contact of two corners. The piece of the first one is rounded by `inset`.
    bool corner_pair(int one, int other, double inset, Touch &touch) const {
        const PlacedCorner &from = work.corners[one], &to = work.corners[other];
        const double dx = to.x - from.x, dy = to.y - from.y;
        const double distance = std::sqrt(dx * dx + dy * dy);
        // The line between two coinciding corners has no direction.
        if (distance - rounding >= reach || distance <= 1e-12)
            return false;
        const double nx = dx / distance, ny = dy / distance;
        const double x = from.x + inset * nx, y = from.y + inset * ny;
        touch = {nx, ny, {x, x}, {y, y}, {distance - rounding, INF}};
        return true;
    }

    // Return the first corner of a piece's edge that is most opposed to a face.
    int facing(const PlacedCorner &face, const Piece &piece) const {
        int one = piece.first;
        double most = INF;
        if (piece.last - piece.first > 1)
            for (int m = piece.first; m < piece.last; ++m) {
                const double along = work.corners[m].nx * face.nx + work.corners[m].ny * face.ny;
                if (work.world->corners[m].outer != 0.0 && along < most) {
                    most = along;
                    one = m;
                }
            }
        return one;
    }

    // Clip the most opposed edge of the other piece to a face.
    bool clip(const Piece &of, int face, const Piece &piece, Touch &touch) const {
        const std::vector<PlacedCorner> &corners = work.corners;
        const int after = face + 1 < of.last ? face + 1 : of.first;
        const auto [x, y, nx, ny] = corners[face];
        const double inset = of.circle.rounding;
        // s is the position along the face, from the right to the left end; d is the distance from it; 1 and 2 are the
        // edge's ends in the order of s.
        const double tx = -ny, ty = nx;
        const double length = (corners[after].x - x) * tx + (corners[after].y - y) * ty;
        int one = facing(corners[face], piece), other = one + 1 < piece.last ? one + 1 : piece.first;
        double s2 = (corners[one].x - x) * tx + (corners[one].y - y) * ty;
        double d2 = (corners[one].x - x) * nx + (corners[one].y - y) * ny;
        double s1 = (corners[other].x - x) * tx + (corners[other].y - y) * ty;
        double d1 = (corners[other].x - x) * nx + (corners[other].y - y) * ny;
        if (s1 > s2) {
            std::swap(s1, s2);
            std::swap(d1, d2);
            std::swap(one, other);
        }
        // The edge is entirely beside the face: two corners meet, and the normal is the line between them.
        if (s2 < 0.0)
            return corner_pair(face, one, inset, touch);
        if (s1 > length)
            return corner_pair(after, other, inset, touch);
        // Gaps at the ends of the common part of face and edge.
        const double slope = s2 > s1 ? (d2 - d1) / (s2 - s1) : 0.0;
        const double low = std::max(s1, 0.0), high = std::min(s2, length);
        double gap_low = d1 + slope * (low - s1) - rounding, gap_high = d1 + slope * (high - s1) - rounding;
        if (s2 - s1 <= 0.0)
            gap_low = gap_high = std::min(d1, d2) - rounding;
        const bool has_low = gap_low < reach, has_high = gap_high < reach && high - low > SHORTEST;
        if (!has_low && !has_high)
            return false;
        touch = {nx,
                 ny,
                 {x + low * tx + inset * nx, x + high * tx + inset * nx},
                 {y + low * ty + inset * ny, y + high * ty + inset * ny},
                 {has_low ? gap_low : INF, has_high ? gap_high : INF}};
        return true;
    }
};

bool touching(const Work &work, const Piece &a, const Piece &b, double reach, Touch &touch) {
    // The second piece's face is the reference only if its separation is larger by this share of L. Otherwise, rounding
    // would choose between parallel faces in every step.
    constexpr double SAME = 1e-9;
    const Search search{work, reach, a.circle.rounding + b.circle.rounding};
    const Face face_a = best_face(work.corners, a, b), face_b = best_face(work.corners, b, a);
    if (std::max(face_a.away, face_b.away) - search.rounding >= reach)
        return false;
    if (face_a.corner < 0 && face_b.corner < 0)
        return search.corner_pair(a.first, b.first, a.circle.rounding, touch);
    const bool second = face_b.away > face_a.away + SAME * work.world->length;
    // The face is inside the body, between two of its pieces, so another piece has the contact.
    if (work.world->corners[second ? face_b.corner : face_a.corner].outer == 0.0)
        return false;
    if (!second)
        return search.clip(a, face_a.corner, b, touch);
    if (!search.clip(b, face_b.corner, a, touch))
        return false;
    touch = touch.turned_round();
    return true;
}

void set_point(Manifold &m, int k, double x, double y, double gap) {
    m.x[k] = x;
    m.y[k] = y;
    m.gap[k] = gap;
}

// Keep the two outermost points of a manifold and a new point.
void widen(Manifold &m, double x, double y, double gap) {
    const double s = (x - m.x[0]) * m.tx() + (y - m.y[0]) * m.ty();
    if (std::abs(s) <= SHORTEST) // a corner shared by two pieces
        return;
    if (m.points == 1) {
        if (s < 0.0)
            set_point(m, 1, m.x[0], m.y[0], m.gap[0]);
        m.points = 2;
        set_point(m, s < 0.0 ? 0 : 1, x, y, gap);
    } else if (s < 0.0) {
        set_point(m, 0, x, y, gap);
    } else if ((x - m.x[1]) * m.tx() + (y - m.y[1]) * m.ty() > 0.0) {
        set_point(m, 1, x, y, gap);
    }
}

// Add the points to an earlier manifold of the same bodies on the same line. Return its number, or -1.
//
// Otherwise, a face shared by convex pieces would have a tangential multiplier for each of them: a singular system.
int merged(Work &work, int a, int b, const Touch &touch) {
    constexpr double FLUSH = 1e-6; // sine of the angle, and share of L, up to which two manifolds lie on one line
    for (std::size_t c = 0; c < work.manifolds.size(); ++c) {
        Manifold &m = work.manifolds[c];
        if (m.a != a || m.b != b)
            continue;
        const double aside = (touch.x[0] - m.x[0]) * m.nx + (touch.y[0] - m.y[0]) * m.ny;
        if (m.nx * touch.nx + m.ny * touch.ny < 0.0 || std::abs(m.nx * touch.ny - m.ny * touch.nx) > FLUSH ||
            std::abs(aside) > FLUSH * work.world->length)
            continue;
        for (int k = 0; k < 2; ++k)
            if (touch.gap[k] < INF)
                widen(m, touch.x[k], touch.y[k], touch.gap[k]);
        return static_cast<int>(c);
    }
    return -1;
}

Manifold manifold_of(const Touch &touch, int a, int b, int pair, double friction) {
    Manifold m;
    m.a = a;
    m.b = b;
    m.pair = pair;
    m.friction = friction;
    m.nx = touch.nx;
    m.ny = touch.ny;
    for (int k = 0; k < 2; ++k)
        if (touch.gap[k] < INF)
            set_point(m, m.points++, touch.x[k], touch.y[k], touch.gap[k]);
    return m;
}

// Fill in the rows of a manifold: n and t as wrenches about O, with moments divided by L.
void set_rows(Manifold &m, double length) {
    for (int k = 0; k < 2; ++k)
        m.row[k] = {m.nx, m.ny, (m.x[k] * m.ny - m.y[k] * m.nx) / length};
    m.row[TANGENT] = {m.tx(), m.ty(), (m.x[0] * m.ty() - m.y[0] * m.tx()) / length};
}

} // namespace

void place_corners(Work &work) {
    for (const Piece &piece : work.world->pieces) {
        const Body &body = work.bodies[piece.body];
        for (int k = piece.first; k < piece.last; ++k) {
            const Corner &p = work.world->corners[k];
            work.corners[k] = {body.x + body.c * p.x - body.s * p.y, body.y + body.s * p.x + body.c * p.y,
                               body.c * p.nx - body.s * p.ny, body.s * p.nx + body.c * p.ny};
        }
    }
}

bool find_manifolds(Work &work, double reach) {
    const World &world = *work.world;
    work.manifolds.clear();
    for (std::size_t q = 0; q < world.pairs.size(); ++q) {
        const Pair &pair = world.pairs[q];
        const Piece &a = world.pieces[pair.a], &b = world.pieces[pair.b];
        Touch touch{};
        work.found[q] = -1;
        if (apart(work, a, b, reach) || !touching(work, a, b, reach, touch))
            continue;
        work.found[q] = merged(work, a.body, b.body, touch);
        if (work.found[q] >= 0)
            continue;
        if (work.manifolds.size() == world.room())
            return false;
        work.found[q] = static_cast<int>(work.manifolds.size());
        work.manifolds.push_back(manifold_of(touch, a.body, b.body, static_cast<int>(q), pair.friction));
    }
    for (Manifold &m : work.manifolds)
        set_rows(m, world.length);
    return true;
}

} // namespace pushplan::slip
