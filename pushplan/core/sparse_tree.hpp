// Stable sparse RRT (SST; Li, Littlefield, Bekris 2016).
#pragma once

#include "problem.hpp"

#include <vector>

namespace pushplan {

// Of a node: what is at least left from there to the goal (m of cost), how many children it has, and whether it stands
// for a witness.
struct Role {
    double to_go;
    std::int64_t children;
    bool active;
};

// A pose, and the row of the node that stands for it: the cheapest one near by.
struct Witness {
    Pose pose;
    std::int64_t row;
};

// Metres that a radian counts as; how far from a random pose the best node is looked for; how far apart witnesses are.
struct SparseRadii {
    double heading_length, selection, witness;
};

class SparseTree {
  public:
    mutable Lock lock;

    // A tree of the start alone, which is the first witness too; positions are drawn from the area.
    SparseTree(const Pose &start, const Pose &goal, const Area &area, const SparseRadii &radii);

    // Grow the tree until a path below the bound is found; return the extensions tried, `iterations` at most. The path
    // stays empty where none is found.
    std::int64_t grow(const Problem &problem, Random &random, double bound, std::int64_t iterations,
                      std::vector<Arc> &path);

    const std::vector<Node> &nodes() const { return nodes_; }
    // Rows that were pruned.
    const std::vector<std::int64_t> &unused() const { return unused_; }

  private:
    std::int64_t selected(Random &random, double bound) const;
    std::int64_t witness_near(const Pose &pose) const;
    void retire(std::int64_t row);
    void represent(std::int64_t witness, std::int64_t row);
    std::int64_t extend(const Problem &problem, Random &random, std::int64_t parent, double bound);

    Area area_;
    SparseRadii radii_;
    std::vector<Node> nodes_;
    std::vector<Role> roles_; // of the nodes
    std::vector<Witness> witnesses_;
    std::vector<std::int64_t> unused_;
};

} // namespace pushplan
