#include "transit.hpp"

#include "numpy_poses.hpp"

#include <algorithm>

namespace pushplan {
namespace {

// Maximum number of nodes to which a new pose is joined.
constexpr int NEAREST = 3;

// Maximum number of paths checked between two poses.
constexpr int WORD_TRIES = 3;

// Maximum number of paths checked for a shortcut.
constexpr int SHORTCUT_TRIES = 2;

// The smallest saving of a shortcut, m.
constexpr double SAVING = 1e-6;

// A pose that a path joins to its parent, a row of the tree or -1.
struct WayNode {
    Pose pose;
    int parent;
    DrivenWord word;
};

using WayTree = std::vector<WayNode>;

// The region from which poses are drawn.
struct Region {
    std::array<Pose, 3> ends; // start, goal and load
    Area box;
    double spread; // m, distance from the ends

    // Draw a pose from the box or, as often, around one of the ends.
    Pose draw(Random &random) const {
        // Transits between pushes lead around the load or are short, so most of the room is useless for them.
        Pose pose;
        if (random() < 0.5) {
            const Pose &end = ends[static_cast<std::size_t>(random() * static_cast<double>(ends.size()))];
            const double reach = spread * random(), way = 2.0 * PI * random();
            pose.x = end.x + reach * std::cos(way), pose.y = end.y + reach * std::sin(way);
        } else {
            pose.x = box.xmin + (box.xmax - box.xmin) * random();
            pose.y = box.ymin + (box.ymax - box.ymin) * random();
        }
        pose.theta = 2.0 * PI * random() - PI;
        return pose;
    }
};

// The rows of the nodes nearest to a pose, nearest first.
struct Near {
    std::array<int, NEAREST> rows;
    std::array<double, NEAREST> away;
    int count;

    Near(const WayTree &tree, const Pose &pose) : count(std::min(static_cast<int>(tree.size()), NEAREST)) {
        rows.fill(0), away.fill(INF);
        for (int i = 0; i < static_cast<int>(tree.size()); ++i) {
            const double d = apart(tree[i].pose, pose, TURN_LENGTH);
            int k = NEAREST;
            for (; k > 0 && d < away[k - 1]; --k) {
                if (k < NEAREST)
                    rows[k] = rows[k - 1], away[k] = away[k - 1];
            }
            if (k < NEAREST)
                rows[k] = i, away[k] = d;
        }
    }
};

// Join a pose to a tree by a free path from the tree to the pose, or back. Return whether there is one.
bool join(const Surroundings &around, const Wheels &wheels, WayTree &tree, const Pose &pose, bool from_tree) {
    const Near near(tree, pose);
    for (int k = 0; k < near.count; ++k) {
        const Pose &other = tree[near.rows[k]].pose;
        const DrivenWord word =
            drive(around, wheels, from_tree ? other : pose, from_tree ? pose : other, INF, WORD_TRIES);
        if (word.cost < INF) {
            tree.push_back({pose, near.rows[k], word});
            return true;
        }
    }
    return false;
}

// Return the arcs from the root of one tree to the common last node of both trees and on to the other root.
Way joined_way(const WayTree &forth, const WayTree &back) {
    Way way;
    for (int at = static_cast<int>(forth.size()) - 1; at >= 0; at = forth[at].parent)
        way.insert(way.begin(), forth[at].word.begin(), forth[at].word.end());
    for (int at = static_cast<int>(back.size()) - 1; at >= 0; at = back[at].parent)
        way.insert(way.end(), back[at].word.begin(), back[at].word.end());
    return way;
}

// Grow trees of paths from both ends until a pose is in both trees.
std::optional<Way> grow_trees(const Surroundings &around, const Wheels &wheels, const Region &region, Random &random,
                              int iterations) {
    WayTree forth{{region.ends[0], -1, {}}}, back{{region.ends[1], -1, {}}};
    for (int i = 0; i < iterations; ++i) {
        const Pose pose = region.draw(random);
        if (!around.is_clear(pose))
            continue;
        const bool reached = join(around, wheels, forth, pose, true);
        const bool reaches = join(around, wheels, back, pose, false);
        if (reached && reaches) {
            Way way = joined_way(forth, back);
            return way.size() <= MOST_ARCS ? std::optional<Way>(std::move(way)) : std::nullopt;
        }
    }
    return std::nullopt;
}

// Return the poses at the beginning of every arc of a transit.
std::vector<Pose> poses_along(const Pose &start, const Way &way) {
    std::vector<Pose> poses;
    Pose pose = start;
    for (const Arc &arc : way) {
        poses.push_back(pose);
        pose = step(pose, arc.twist, arc.length);
    }
    return poses;
}

} // namespace

std::optional<Way> find_transit(const Surroundings &around, const Wheels &wheels, const Pose &start, const Pose &goal,
                                const Area &box, double spread, Random &random, int iterations) {
    const DrivenWord direct = drive(around, wheels, start, goal, INF, 2 * WORD_TRIES);
    if (direct.cost < INF)
        return Way(direct.begin(), direct.end());
    if (!around.is_clear(start) || !around.is_clear(goal))
        return std::nullopt;
    const Region region{{start, goal, around.place}, box, spread};
    auto way = grow_trees(around, wheels, region, random, iterations);
    // Paths through random poses have detours, which shortcuts remove.
    if (way)
        way = shortened(around, wheels, start, std::move(*way), random, 40);
    return way;
}

Way shortened(const Surroundings &around, const Wheels &wheels, const Pose &start, Way way, Random &random,
              int attempts) {
    std::vector<Pose> poses = poses_along(start, way);
    for (int attempt = 0; attempt < attempts; ++attempt) {
        // A shortcut from a place within arc i to one within arc j.
        const double count = static_cast<double>(way.size());
        const int one = static_cast<int>(random() * count), other = static_cast<int>(random() * count);
        if (one == other)
            continue;
        const int i = std::min(one, other), j = std::max(one, other);
        const double a = random() * way[i].length, b = random() * way[j].length;
        double old = way[i].length - a + b;
        for (int k = i + 1; k < j; ++k)
            old += way[k].length;
        const Pose first = step(poses[i], way[i].twist, a), last = step(poses[j], way[j].twist, b);
        const DrivenWord word = drive(around, wheels, first, last, old - SAVING, SHORTCUT_TRIES);
        if (word.cost == INF || static_cast<int>(way.size()) - (j - i) + 1 + word.count > MOST_ARCS)
            continue;
        way[i].length = a;
        way[j].length -= b;
        way.erase(way.begin() + i + 1, way.begin() + j);
        way.insert(way.begin() + i + 1, word.begin(), word.end());
        poses = poses_along(start, way);
    }
    return way;
}

namespace {

std::optional<Made<double>> transit_between(const Surroundings &around, const Wheels &wheels, const Numbers &start,
                                            const Numbers &goal, const std::array<double, 4> &box, double spread,
                                            RandomState state, int iterations) {
    const Pose first = to_pose(start), last = to_pose(goal);
    require_all_finite(box.data(), 4, "box");
    require_finite(spread, "spread");
    require_count(iterations, "iterations");
    const Area region{box[0], box[1], box[2], box[3]};
    Random &random = random_of(state);
    std::optional<Way> way;
    {
        nb::gil_scoped_release free;
        way = find_transit(around, wheels, first, last, region, spread, random, iterations);
    }
    if (!way)
        return std::nullopt;
    return to_table(*way);
}

Made<double> shortened_arcs(const Surroundings &around, const Wheels &wheels, const Numbers &start, const Numbers &arcs,
                            RandomState state, int attempts) {
    const Pose first = to_pose(start);
    Way way = to_arcs(arcs);
    require_count(attempts, "attempts");
    Random &random = random_of(state);
    {
        nb::gil_scoped_release free;
        way = shortened(around, wheels, first, std::move(way), random, attempts);
    }
    return to_table(way);
}

} // namespace

void bind_transit(nb::module_ &core) {
    auto m = core.def_submodule(
        "transit",
        "Transits of the robot between two poses: a direct path, or trees from both ends (Kuffner and LaValle 2000).");
    m.def("find_transit", &transit_between, nb::arg("around"), nb::arg("wheels"), nb::arg("start"), nb::arg("goal"),
          nb::arg("box"), nb::arg("spread"), nb::arg("state").noconvert(), nb::arg("iterations"), R"(
    Find a collision-free transit between two poses of the robot.

    Args:
        around: Obstacles of the robot.
        wheels: Kinematics of the robot.
        start: (3,) start pose.
        goal: (3,) goal pose.
        box: (xmin, ymin, xmax, ymax) of drawn poses.
        spread: Distance from the ends within which other poses are drawn, m.
        state: State of the random numbers.
        iterations: Maximum number of drawn poses.

    Returns:
        The arcs (k, 4), empty if both poses are the same; None if no transit was found.
    )");
    m.def("shortened", &shortened_arcs, nb::arg("around"), nb::arg("wheels"), nb::arg("start"), nb::arg("arcs"),
          nb::arg("state").noconvert(), nb::arg("attempts"), R"(
    Shorten a transit (k, 4) by cheaper paths between random pairs of places, and return its arcs.

    Args:
        around: Obstacles of the robot.
        wheels: Kinematics of the robot.
        start: (3,) pose.
        arcs: (k, 4) arcs of a free transit from the start.
        state: State of the random numbers.
        attempts: Maximum number of pairs.
    )");
}

} // namespace pushplan
