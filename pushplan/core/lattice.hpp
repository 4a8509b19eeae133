// Best-first search over a lattice of poses.
#pragma once

#include "cells.hpp"
#include "problem.hpp"

#include <array>
#include <memory>
#include <vector>

namespace pushplan {

// Square cells of the floor from the lower left corner (x, y) on, `side` (m) wide.
struct Grid {
    double x, y, side;
    std::int64_t columns, rows;

    // The cell that a place is in, or is nearest to.
    std::int64_t cell(double px, double py) const {
        return place((px - x) / side, columns) * rows + place((py - y) / side, rows);
    }

    // Clamped before it is a whole number: what is far outside does not fit into one.
    static std::int64_t place(double along, std::int64_t count) {
        return static_cast<std::int64_t>(std::clamp(along, 0.0, static_cast<double>(count - 1)));
    }
};

// Return the lengths of ways, one a cell, to each of two cells through cells whose middles keep `least` (m) from
// everything. What moves in the scene is a point. Steps to or from other cells count as ways along all the floor: a
// gap that the cells miss is not closed, but looked at last.
std::array<std::vector<double>, 2> floor_distances(const Scene &point, const Grid &grid, double least,
                                                   const std::array<std::int64_t, 2> &places);

// The sizes of a search's cells and arcs: side (m) and angle (rad) of a cell, typical length of an arc (m of cost).
struct LatticeSizes {
    double side, angle, arc;
};

// One search at a time, from the start to the goal or back from the goal; the next one takes over the memory.
class Lattice {
  public:
    mutable Lock lock;

    // `middle` is the body's point for which distances over the floor count, chain frame, m; `away` has these to the
    // start and to the goal.
    Lattice(std::shared_ptr<const Problem> problem, const Pose &start, const std::array<double, 2> &middle,
            const Grid &grid, std::array<std::vector<double>, 2> away)
        : problem_(std::move(problem)), ends_{start, problem_->goal}, middle_(middle), grid_(grid),
          away_(std::move(away)) {}

    // Begin with the start alone, or with the goal (`back`). Cells cover the area; there is room for so many nodes.
    void plant(bool back, const Area &area, const LatticeSizes &sizes, std::int64_t room);

    // Expand nodes, the most promising first, until arcs are tried, a few more at most, or nothing promises less than
    // the bound: the cost that a path must stay below, m, which falls to that of each path that is found. Return the
    // bound then, and whether the search is over.
    std::pair<double, bool> expand(double bound, std::int64_t arcs, Random &random);

    // The best path; empty while there is none.
    std::vector<Arc> path() const;

    std::int64_t tried() const { return tried_; }
    const std::vector<Node> &nodes() const { return nodes_; }

  private:
    // A node to expand, and the cost of the paths through it that it promises.
    struct Entry {
        double promise;
        std::int64_t row;

        bool operator<(const Entry &other) const { // the most promising is at the top of a heap
            return promise > other.promise || (promise == other.promise && row > other.row);
        }
    };

    std::int64_t key_of(const Pose &pose) const;
    double left(const Pose &pose) const;
    void grow(std::int64_t parent, int number, double bound, Random &random);

    std::shared_ptr<const Problem> problem_;
    std::array<Pose, 2> ends_;
    std::array<double, 2> middle_;
    Grid grid_;
    std::array<std::vector<double>, 2> away_;

    bool back_ = false;
    Area area_{};
    LatticeSizes sizes_{};
    std::size_t room_ = 0;
    std::vector<Node> nodes_;
    std::vector<Entry> queue_;
    CellTable cells_;
    std::vector<double> costs_; // of the cheapest node in each slot's cell
    std::int64_t tried_ = 0;
    std::int64_t partner_ = -1; // the node that the last word of the best path leaves, or enters
    std::array<Arc, 3> word_{};
};

} // namespace pushplan
