#include "tree.hpp"

namespace pushplan {

bool Tree::grown(const Node &parent, std::int64_t row, const std::array<double, 3> &controls, double bound,
                 Node &child) const {
    const Problem &problem = *problem_;
    const Twist twist = choose_twist(problem, controls[0], controls[1]);
    const double length = controls[2] * problem.longest;
    const Pose pose = step(parent.pose, twist, length);
    if (length <= 0.0 || parent.cost + length + remaining(pose, problem.goal) >= bound)
        return false;
    if (!sweep_is_free(problem.scene, parent.pose, twist, length))
        return false;
    child = {pose, parent.cost + length, static_cast<double>(row), {twist, length}};
    return true;
}

Extension Tree::connected(const Node &node, int tries, double bound) const {
    const Problem &problem = *problem_;
    const Connection found =
        pushplan::connect(problem.scene, problem.all_families(), node.pose, problem.goal, bound - node.cost, tries);
    const bool kept = node.cost + found.promise < bound || found.promise == INF;
    return {kept, node.cost + found.cost, found.promise, node.pose};
}

Extension Tree::extend(std::int64_t row, const Pose &pose, const std::array<double, 3> &controls, double bound) {
    Node child;
    if (!grown(node_at(row, pose), row, controls, bound, child))
        return {};
    const Extension extension = connected(child, TRIES, bound);
    if (extension.kept && row >= 0)
        nodes_.push_back(child);
    return extension;
}

} // namespace pushplan
