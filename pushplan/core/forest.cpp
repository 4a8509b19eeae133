#include "forest.hpp"

#include <algorithm>
#include <cmath>

namespace pushplan {

namespace {

// Nodes of a tree, nearest to a sample, from which words are tried.
constexpr int NEAREST = 2;

struct NearestNodes {
    std::array<std::int64_t, NEAREST> rows;
    int count = 0;
};

// The nodes nearest to a pose, nearest first.
NearestNodes nearest(const std::vector<BranchNode> &tree, const Pose &pose, double heading_length) {
    NearestNodes found;
    std::array<double, NEAREST> distances;
    distances.fill(INF);
    for (std::size_t i = 0; i < tree.size(); ++i) {
        const double d = apart(tree[i].pose, pose, heading_length);
        // Insertion into the few that are kept: most nodes fail this one test.
        if (d >= distances.back())
            continue;
        int k = std::min(found.count, NEAREST - 1);
        for (; k > 0 && distances[k - 1] > d; --k) {
            distances[k] = distances[k - 1];
            found.rows[k] = found.rows[k - 1];
        }
        distances[k] = d;
        found.rows[k] = static_cast<std::int64_t>(i);
        found.count = std::min(found.count + 1, NEAREST);
    }
    return found;
}

double length_of(const std::array<Arc, 3> &word) { return word[0].length + word[1].length + word[2].length; }

// Shorten a word to `reach`, keeping its beginning, or its end.
void clip(std::array<Arc, 3> &word, double reach, bool from_end) {
    double excess = length_of(word) - reach;
    for (int i = 0; i < 3; ++i) {
        // The goal tree grows backwards: the end of its words lies at the node, and has to stay.
        Arc &arc = word[from_end ? i : 2 - i];
        const double cut = std::min(std::max(excess, 0.0), arc.length);
        arc.length -= cut;
        excess -= cut;
    }
}

// Whether a word is free; the pose is moved to that after it, or before it (`back`).
bool walk(const Scene &scene, Pose &pose, const std::array<Arc, 3> &word, bool back) {
    for (int i = 0; i < 3; ++i) {
        const Arc &arc = word[back ? 2 - i : i];
        if (arc.length <= 0.0)
            continue;
        const Twist twist = back ? arc.twist.reversed() : arc.twist;
        if (!sweep_is_free(scene, pose, twist, arc.length))
            return false;
        pose = step(pose, twist, arc.length);
    }
    return true;
}

} // namespace

void Forest::plant(const Pose &start, const Pose &goal) {
    for (const int number : {0, 1}) {
        trees_[number].clear();
        trees_[number].push_back({number == 0 ? start : goal, 0.0, -1.0, {}});
    }
}

// Draw a pose: its position from the area, or from the ellipse that paths below the bound stay in, if smaller.
Pose Forest::draw(Random &random, double bound) const {
    const Pose &start = trees_[0][0].pose, &goal = trees_[1][0].pose;
    Pose pose;
    pose.theta = 2.0 * PI * random();
    const double dx = goal.x - start.x, dy = goal.y - start.y;
    const double minor_squared = bound * bound - dx * dx - dy * dy;
    const double minor = std::sqrt(std::max(minor_squared, 0.0));
    const double width = area_.xmax - area_.xmin, height = area_.ymax - area_.ymin;
    if (PI * bound * minor < 4.0 * width * height) {
        const double r = std::sqrt(random()), angle = 2.0 * PI * random();
        const double along = 0.5 * bound * r * std::cos(angle);
        const double across = 0.5 * minor * r * std::sin(angle);
        const double distance = std::max(std::hypot(dx, dy), 1e-12);
        const double ux = dx / distance, uy = dy / distance;
        pose.x = 0.5 * (start.x + goal.x) + ux * along - uy * across;
        pose.y = 0.5 * (start.y + goal.y) + uy * along + ux * across;
    } else {
        pose.x = area_.xmin + width * random();
        pose.y = area_.ymin + height * random();
    }
    return pose;
}

// Draw a free pose that a path cheaper than the bound could pass; give up after some tries.
bool Forest::draw_free(const Problem &problem, Random &random, double bound, Pose &pose) const {
    const Pose &start = trees_[0][0].pose;
    const double clearance = problem.scene.clearance;
    for (int i = 0; i < 20; ++i) {
        pose = draw(random, bound);
        const double through = remaining(pose, problem.goal) + remaining(start, pose);
        if (through < bound && separation(problem.scene, pose, 2.0 * clearance) >= clearance)
            return true;
    }
    return false;
}

// Grow one tree towards a sample; return the new node's row, or -1.
std::int64_t Forest::extend(const Problem &problem, Number number, const Pose &sample, double bound) {
    auto &tree = trees_[number];
    const bool back = number == 1;
    const NearestNodes near = nearest(tree, sample, heading_length_);
    for (int i = 0; i < near.count; ++i) {
        const std::int64_t parent = near.rows[i];
        Pose pose = tree[parent].pose;
        BestWord word = best_word(problem.first_family(), back ? sample : pose, back ? pose : sample);
        if (word.cost == INF)
            continue;
        clip(word.arcs, reach_, back);
        if (!walk(problem.scene, pose, word.arcs, back))
            continue;
        // Cost so far plus a lower bound of what is left: no path through the node is cheaper than that.
        const double so_far = tree[parent].cost + word.arcs[0].length + word.arcs[1].length + word.arcs[2].length;
        if (so_far + remaining(pose, trees_[1 - number][0].pose) < bound) {
            tree.push_back({pose, so_far, static_cast<double>(parent), word.arcs});
            return static_cast<std::int64_t>(tree.size()) - 1;
        }
    }
    return -1;
}

// Connect a node exactly to the root and the nearest nodes of the other tree; the cost is that of the whole path,
// infinite when nothing below the bound is free.
Forest::Join Forest::join(const Problem &problem, Number number, std::int64_t row, double bound) const {
    const auto &other = trees_[1 - number];
    const BranchNode &node = trees_[number][row];
    const NearestNodes near = nearest(other, node.pose, heading_length_);
    Join best;
    // -1 stands for the other tree's root: of the nodes near by, none may lead there directly.
    for (int i = -1; i < near.count; ++i) {
        const std::int64_t j = i < 0 ? 0 : near.rows[i];
        const double so_far = node.cost + other[j].cost;
        const Pose &first = number == 0 ? node.pose : other[j].pose, &last = number == 0 ? other[j].pose : node.pose;
        const double limit = std::min(bound, best.cost) - so_far;
        if (limit <= 0.0)
            continue;
        const Connection found = connect(problem.scene, problem.first_family(), first, last, limit, TRIES);
        if (so_far + found.cost < best.cost)
            best = {so_far + found.cost, j, found.arcs};
    }
    return best;
}

// Write the arcs start tree, connection, goal tree.
void Forest::whole(std::int64_t start_node, std::int64_t goal_node, const std::array<Arc, 3> &arcs,
                   std::vector<Arc> &path) const {
    std::vector<const BranchNode *> branch;
    for (const BranchNode *node = &trees_[0][start_node]; node->parent >= 0.0;
         node = &trees_[0][static_cast<std::int64_t>(node->parent)])
        branch.push_back(node);
    for (auto node = branch.rbegin(); node != branch.rend(); ++node)
        path.insert(path.end(), (*node)->arcs.begin(), (*node)->arcs.end());
    path.insert(path.end(), arcs.begin(), arcs.end());
    for (const BranchNode *node = &trees_[1][goal_node]; node->parent >= 0.0;
         node = &trees_[1][static_cast<std::int64_t>(node->parent)])
        path.insert(path.end(), node->arcs.begin(), node->arcs.end());
}

std::int64_t Forest::grow(const Problem &problem, Random &random, double bound, std::int64_t iterations,
                          std::vector<Arc> &path) {
    for (std::int64_t done = 1; done <= iterations; ++done) {
        const Number number = trees_[0].size() > trees_[1].size() ? 1 : 0; // the smaller tree grows
        Pose sample;
        if (random() < 0.05)
            sample = trees_[1 - number][0].pose;
        else if (!draw_free(problem, random, bound, sample))
            continue;
        const std::int64_t row = extend(problem, number, sample, bound);
        if (row < 0)
            continue;
        const Join joined = join(problem, number, row, bound);
        if (joined.cost < bound) {
            whole(number == 0 ? row : joined.partner, number == 0 ? joined.partner : row, joined.arcs, path);
            return done;
        }
    }
    return iterations;
}

} // namespace pushplan
