// A tree of arcs that another program drives, OMPL's planners, which say from where and along what it grows; and what
// joins it to the tree that it grows towards.
#pragma once

#include "problem.hpp"

#include <memory>
#include <vector>

namespace pushplan {

// What has become of an extension: whether its end may be on a path below the bound; the cost of the whole path through
// it, infinite where every connection is blocked; the cost of the cheapest word to the other tree's root, blocked or
// not; and its pose.
struct Extension {
    bool kept = false;
    double cost = INF;
    double promise = INF;
    Pose pose{0.0, 0.0, 0.0};
};

// Nodes of the other tree, nearest to a new one, that words are tried to.
constexpr std::size_t JOINED = 6;

class Tree {
  public:
    // A tree of the root alone. It grows from the root on, or (`back`) against the direction of travel from poses that
    // lead there. `heading_length` is what a radian counts as in the choice of the nearest nodes, m.
    Tree(std::shared_ptr<const Problem> problem, const Pose &root, double heading_length, bool back)
        : problem_(std::move(problem)), heading_length_(heading_length), back_(back) {
        clear(root);
    }

    void take(std::shared_ptr<const Problem> problem) { problem_ = std::move(problem); }

    // Forget the tree but for its root.
    void clear(const Pose &root) {
        nodes_.clear();
        nodes_.push_back({root, 0.0, -1.0, {{0.0, 0.0, 0.0}, 0.0}});
        path_.clear();
    }

    const std::vector<Node> &nodes() const { return nodes_; }

    bool back() const { return back_; }

    // The path that the last connection closed, from the start to the goal; empty before the first one.
    const std::vector<Arc> &path() const { return path_; }

    // Grow by one arc from the pose of a row, and try to connect its end exactly to a tree that grows the other way: to
    // its root and the nodes nearest by. What is kept is appended, unless the row is -1: no arc led to such a pose.
    //
    // The controls are three numbers in [0, 1]: which segment of the stable set, where on it, length of the arc; a
    // whole path must stay below the bound.
    Extension extend(std::int64_t row, const Pose &pose, const std::array<double, 3> &controls, double bound,
                     const Tree &other);

    // Connect the pose of a row, or of none, with the root of the other tree by any word.
    Extension connect(std::int64_t row, const Pose &pose, double bound, const Tree &other) const;

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
               const Pose &end, Node &child) const;
    Connection word_between(const Node &node, const Node &other, Row<const Family> families, double bound,
                            int tries) const;
    std::array<std::int64_t, JOINED> nearest(const Pose &pose) const;

    std::shared_ptr<const Problem> problem_;
    double heading_length_;
    bool back_;
    std::vector<Node> nodes_;
    std::vector<Arc> path_;
};

} // namespace pushplan
