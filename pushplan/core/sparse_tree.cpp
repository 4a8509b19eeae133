#include "sparse_tree.hpp"

namespace pushplan {

SparseTree::SparseTree(const Pose &start, const Pose &goal, const Area &area, const SparseRadii &radii)
    : area_(area), radii_(radii) {
    nodes_.push_back({start, 0.0, -1.0, {}});
    roles_.push_back({remaining(start, goal), 0, true});
    witnesses_.push_back({start, 0});
}

// Row of the cheapest node near a random pose, or of the nearest node; -1 if none can lead below the bound.
std::int64_t SparseTree::selected(Random &random, double bound) const {
    Pose pose;
    pose.x = area_.xmin + (area_.xmax - area_.xmin) * random();
    pose.y = area_.ymin + (area_.ymax - area_.ymin) * random();
    pose.theta = 2.0 * PI * random();
    std::int64_t nearest = -1, best = -1;
    double distance = INF, cost = INF;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        const Node &node = nodes_[i];
        // Inactive nodes only carry branches: what they stand for is reached cheaper by others.
        if (!roles_[i].active || node.cost + roles_[i].to_go >= bound)
            continue;
        const double d = apart(node.pose, pose, radii_.heading_length);
        if (d < distance) {
            nearest = static_cast<std::int64_t>(i);
            distance = d;
        }
        if (d < radii_.selection && node.cost < cost) {
            best = static_cast<std::int64_t>(i);
            cost = node.cost;
        }
    }
    return best >= 0 ? best : nearest;
}

// Index of the nearest witness close to a pose, -1 if there is none.
std::int64_t SparseTree::witness_near(const Pose &pose) const {
    std::int64_t nearest = -1;
    double distance = radii_.witness;
    for (std::size_t i = 0; i < witnesses_.size(); ++i) {
        const double d = apart(witnesses_[i].pose, pose, radii_.heading_length);
        if (d < distance) {
            nearest = static_cast<std::int64_t>(i);
            distance = d;
        }
    }
    return nearest;
}

// Let a node stand for nothing any more, and prune the branch that ends there.
void SparseTree::retire(std::int64_t row) {
    roles_[row].active = false;
    // The root (row 0) stays: everything hangs from it.
    while (row > 0 && !roles_[row].active && roles_[row].children == 0) {
        const auto parent = static_cast<std::int64_t>(nodes_[row].parent);
        --roles_[parent].children;
        unused_.push_back(row);
        row = parent;
    }
}

// Let a new node stand for a witness, -1 for a new one at its own pose, instead of the node that did.
void SparseTree::represent(std::int64_t witness, std::int64_t row) {
    roles_[row].active = true;
    if (witness < 0) {
        witnesses_.push_back({nodes_[row].pose, row});
        return;
    }
    retire(witnesses_[witness].row);
    witnesses_[witness].row = row;
}

// Grow the tree by a random arc if it ends cheaper than its witness's node; return the row, or -1.
std::int64_t SparseTree::extend(const Problem &problem, Random &random, std::int64_t parent, double bound) {
    const Node from = nodes_[parent];
    const double u0 = random(), u1 = random(), length = random() * problem.longest;
    const Twist twist = choose_twist(problem, u0, u1);
    const Pose pose = step(from.pose, twist, length);
    const double to_go = remaining(pose, problem.goal);
    if (length <= 0.0 || from.cost + length + to_go >= bound)
        return -1;
    const std::int64_t witness = witness_near(pose);
    // Asked before the sweep, which costs most of an extension.
    if (witness >= 0 && nodes_[witnesses_[witness].row].cost <= from.cost + length)
        return -1;
    if (!sweep_is_free(problem.scene, from.pose, twist, length))
        return -1;
    std::int64_t row;
    if (unused_.empty()) {
        row = static_cast<std::int64_t>(nodes_.size());
        nodes_.emplace_back();
        roles_.emplace_back();
    } else {
        row = unused_.back();
        unused_.pop_back();
    }
    nodes_[row] = {pose, from.cost + length, static_cast<double>(parent), {twist, length}};
    roles_[row] = {to_go, 0, false};
    ++roles_[parent].children;
    represent(witness, row);
    return row;
}

std::int64_t SparseTree::grow(const Problem &problem, Random &random, double bound, std::int64_t iterations,
                              std::vector<Arc> &path) {
    for (std::int64_t done = 1; done <= iterations; ++done) {
        const std::int64_t parent = selected(random, bound);
        if (parent < 0)
            return done;
        const std::int64_t row = extend(problem, random, parent, bound);
        if (row < 0)
            continue;
        const Node node = nodes_[row];
        const double limit = bound - node.cost;
        const Connection found = connect(problem.scene, problem.all_families(), node.pose, problem.goal, limit, TRIES);
        if (found.cost < limit) {
            trace(nodes_, row, path);
            append_word(found.arcs, path);
            return done;
        }
    }
    return iterations;
}

} // namespace pushplan
