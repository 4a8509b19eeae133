// A tree of arcs that another program drives, OMPL's planners, which say from where and along what it grows.
#pragma once

#include "problem.hpp"

#include <memory>
#include <vector>

namespace pushplan {

// What has become of an extension: whether its end may be on a path below the bound; the cost of the whole path through
// it, infinite where the connection to the goal is blocked; the cost of the cheapest word from it, blocked or not; and
// its pose.
struct Extension {
    bool kept = false;
    double cost = INF;
    double promise = INF;
    Pose pose{0.0, 0.0, 0.0};
};

class Tree {
  public:
    Tree(std::shared_ptr<const Problem> problem, const Pose &start) : problem_(std::move(problem)) { clear(start); }

    void take(std::shared_ptr<const Problem> problem) { problem_ = std::move(problem); }

    // Forget the tree but for its root, the start.
    void clear(const Pose &start) {
        nodes_.clear();
        nodes_.push_back({start, 0.0, -1.0, {{0.0, 0.0, 0.0}, 0.0}});
    }

    const std::vector<Node> &nodes() const { return nodes_; }

    // Grow by one arc from the pose of a row, and try the exact connection from its end to the goal. What is kept is
    // appended, unless the row is -1: no arc from the start led to such a pose.
    //
    // The controls are three numbers in [0, 1]: which segment of the stable set, where on it, length of the arc; a
    // whole path must stay below the bound.
    Extension extend(std::int64_t row, const Pose &pose, const std::array<double, 3> &controls, double bound);

    // Connect the pose of a row, or of none, with the goal by any word.
    Extension connect(std::int64_t row, const Pose &pose, double bound) const {
        return connected(node_at(row, pose), MAX_WORDS, bound);
    }

    // How far (m) the body is from everything at a pose, beyond the clearance; negative where it is too near. Distances
    // above twice the clearance are not told apart.
    double room_at(const Pose &pose) const {
        const Scene &scene = problem_->scene;
        return separation(scene, pose, 2.0 * scene.clearance) - scene.clearance;
    }

  private:
    Node node_at(std::int64_t row, const Pose &pose) const {
        if (row >= 0)
            return nodes_[row];
        return {pose, remaining(nodes_[0].pose, pose), -1.0, {{0.0, 0.0, 0.0}, 0.0}};
    }
    bool grown(const Node &parent, std::int64_t row, const std::array<double, 3> &controls, double bound,
               Node &child) const;
    Extension connected(const Node &node, int tries, double bound) const;

    std::shared_ptr<const Problem> problem_;
    std::vector<Node> nodes_;
};

} // namespace pushplan
