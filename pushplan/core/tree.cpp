#include "tree.hpp"

#include <algorithm>

namespace pushplan {

bool Tree::grown(const Node &parent, std::int64_t row, const std::array<double, 3> &controls, double bound,
                 const Pose &end, Node &child) const {
    const Problem &problem = *problem_;
    const Twist twist = choose_twist(problem, controls[0], controls[1]), driven = back_ ? twist.reversed() : twist;
    const double length = controls[2] * problem.longest;
    const Pose pose = step(parent.pose, driven, length);
    if (length <= 0.0 || parent.cost + length + remaining(pose, end) >= bound)
        return false;
    if (!sweep_is_free(problem.scene, parent.pose, driven, length))
        return false;
    child = {pose, parent.cost + length, static_cast<double>(row), {twist, length}};
    return true;
}

Connection Tree::word_between(const Node &node, const Node &other, Row<const Family> families, double bound,
                              int tries) const {
    const Pose &first = back_ ? other.pose : node.pose, &last = back_ ? node.pose : other.pose;
    return pushplan::connect(problem_->scene, families, first, last, bound - node.cost - other.cost, tries);
}

// Return the nodes nearest to a pose, nearest first; 0, the root, if there are fewer.
std::array<std::int64_t, JOINED> Tree::nearest(const Pose &pose) const {
    std::array<std::int64_t, JOINED> found{};
    std::array<double, JOINED> distances;
    distances.fill(INF);
    for (std::size_t i = 1; i < nodes_.size(); ++i) {
        const double d = apart(nodes_[i].pose, pose, heading_length_);
        // Insert into the few kept nodes. Most nodes fail this test.
        if (d >= distances.back())
            continue;
        std::size_t k = JOINED - 1;
        for (; k > 0 && distances[k - 1] > d; --k) {
            distances[k] = distances[k - 1];
            found[k] = found[k - 1];
        }
        distances[k] = d;
        found[k] = static_cast<std::int64_t>(i);
    }
    return found;
}

Extension Tree::extend(std::int64_t row, const Pose &pose, const std::array<double, 3> &controls, double bound,
                       const Tree &other) {
    const Node &root = other.nodes_[0];
    Node child;
    if (!grown(node_at(row, pose), row, controls, bound, root.pose, child))
        return {};
    Connection best = word_between(child, root, problem_->all_families(), bound, TRIES);
    const bool kept = child.cost + best.promise < bound || best.promise == INF;
    Extension extension{kept, child.cost + best.cost, best.promise, child.pose};
    std::int64_t partner = 0;
    for (const std::int64_t near : other.nearest(child.pose)) {
        if (near == 0)
            continue;
        const Node &node = other.nodes_[near];
        const double so_far = child.cost + node.cost;
        const Connection found =
            word_between(child, node, problem_->first_family(), std::min(bound, extension.cost), TRIES);
        if (so_far + found.cost < extension.cost) {
            extension.cost = so_far + found.cost;
            best = found;
            partner = near;
        }
    }
    if (!kept || row < 0)
        return extension;
    nodes_.push_back(child);
    if (extension.cost < bound) {
        // From the start to the goal: the start's tree, the steering path, and the goal's tree from its leaf on.
        const auto own = static_cast<std::int64_t>(nodes_.size()) - 1;
        const Tree &from_start = back_ ? other : *this, &to_goal = back_ ? *this : other;
        path_.clear();
        trace(from_start.nodes_, back_ ? partner : own, path_);
        append_word(best.arcs, path_);
        for (const Node *node = &to_goal.nodes_[back_ ? own : partner]; node->parent >= 0.0;
             node = &to_goal.nodes_[static_cast<std::size_t>(node->parent)])
            path_.push_back(node->arc);
    }
    return extension;
}

Extension Tree::connect(std::int64_t row, const Pose &pose, double bound, const Tree &other) const {
    const Node node = node_at(row, pose);
    const Connection found = word_between(node, other.nodes_[0], problem_->all_families(), bound, MAX_WORDS);
    return {true, node.cost + found.cost, found.promise, node.pose};
}

} // namespace pushplan
