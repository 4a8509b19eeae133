// Trees grown from start and goal until they join.
#pragma once

#include "problem.hpp"

#include <array>
#include <vector>

namespace pushplan {

// A node: a pose, the cost to the tree's root, the row of the parent (-1 of a root), and up to three arcs between the
// node and its parent, in the order of travel. As numbers, a row of a table (n, 17).
struct BranchNode {
    Pose pose;
    double cost;
    double parent;
    std::array<Arc, 3> arcs;
};

static_assert(sizeof(BranchNode) == 17 * sizeof(double), "a row of NumPy's table");

class Forest {
  public:
    mutable Lock lock;

    // `heading_length` is what a radian counts as in the choice of the nearest nodes, m; `reach` is the longest piece
    // of a word that is added at a time, m of cost.
    Forest(const Area &area, double heading_length, double reach)
        : area_(area), heading_length_(heading_length), reach_(reach) {}

    // Reduce both trees to their roots.
    void plant(const Pose &start, const Pose &goal);

    // Grow the trees in turn until a path below the bound is found; return the extensions tried, `iterations` at most.
    // The path stays empty where none is found.
    std::int64_t grow(const Problem &problem, Random &random, double bound, std::int64_t iterations,
                      std::vector<Arc> &path);

    const std::vector<BranchNode> &start_tree() const { return trees_[0]; }
    const std::vector<BranchNode> &goal_tree() const { return trees_[1]; }

  private:
    // The tree from the start is number 0, that to the goal number 1.
    using Number = int;

    // What joins both trees: a node of either, and the arcs between them.
    struct Join {
        double cost = INF;
        std::int64_t partner = -1;
        std::array<Arc, 3> arcs;
    };

    Pose draw(Random &random, double bound) const;
    bool draw_free(const Problem &problem, Random &random, double bound, Pose &pose) const;
    std::int64_t extend(const Problem &problem, Number number, const Pose &sample, double bound);
    Join join(const Problem &problem, Number number, std::int64_t row, double bound) const;
    void whole(std::int64_t start_node, std::int64_t goal_node, const std::array<Arc, 3> &arcs,
               std::vector<Arc> &path) const;

    Area area_;
    double heading_length_, reach_;
    std::array<std::vector<BranchNode>, 2> trees_;
};

} // namespace pushplan
