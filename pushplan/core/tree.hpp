// A tree of arcs that OMPL's planners grow: they choose the node and the control of each extension. It also connects to
// the opposite tree.
#pragma once

#include "problem.hpp"

#include <memory>
#include <vector>

namespace pushplan {

// Result of an extension: whether its end can be on a path below the bound; the cost of the whole path through it,
// infinite if every connection is blocked; the cost of the cheapest steering path to the other tree's root, blocked or
// not; and its pose.
struct Extension {
    bool kept = false;
    double cost = INF;
    double promise = INF;
    Pose pose{0.0, 0.0, 0.0};
};

// Number of nearest nodes of the other tree that a new node tries to reach.
constexpr std::size_t JOINED = 6;

class Tree {
  public:
    // A tree with only the root. It grows from the root or (`back`) against the direction of travel towards the root.
    // `heading_length` is the distance that a radian counts as in the choice of the nearest nodes, m.
    Tree(std::shared_ptr<const Problem> problem, const Pose &root, double heading_length, bool back)
        : problem_(std::move(problem)), heading_length_(heading_length), back_(back) {
        clear(root);
    }

    void take(std::shared_ptr<const Problem> problem) { problem_ = std::move(problem); }

    // Clear the tree except for its root.
    void clear(const Pose &root) {
        nodes_.clear();
        nodes_.push_back({root, 0.0, -1.0, {{0.0, 0.0, 0.0}, 0.0}});
        path_.clear();
    }

    const std::vector<Node> &nodes() const { return nodes_; }

    bool back() const { return back_; }

    // Return the path of the last connection, from the start to the goal; empty before the first one.
    const std::vector<Arc> &path() const { return path_; }

    // Grow by one arc from the pose of a row, and try to connect its end exactly to the root and the nearest nodes of
    // the opposite tree. A kept node is appended, unless the row is -1 (no arc leads to the pose).
    //
    // The controls are three numbers in [0, 1]: segment of the stable set, place on it, and length of the arc. A whole
    // path must stay below the bound.
    Extension extend(std::int64_t row, const Pose &pose, const std::array<double, 3> &controls, double bound,
                     const Tree &other);

    // Connect the pose of a row, or of no row, with the root of the other tree by any steering path.
    Extension connect(std::int64_t row, const Pose &pose, double bound, const Tree &other) const;

    // Return the body's distance (m) from all obstacles at a pose, beyond the clearance; negative if too near.
    // Distances are capped at twice the clearance.
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
