// Best-first search over a lattice of poses.
#pragma once

#include "cells.hpp"
#include "problem.hpp"

#include <array>
#include <memory>
#include <vector>

namespace pushplan {

// Square cells of the floor, `side` (m) wide, beginning at the lower left corner (x, y).
struct Grid {
    double x, y, side;
    std::int64_t columns, rows;

    // Return the cell that contains a place, or the nearest one.
    std::int64_t cell(double px, double py) const {
        return place((px - x) / side, columns) * rows + place((py - y) / side, rows);
    }

    // Clamp before conversion, because distant places do not fit into an integer.
    static std::int64_t place(double along, std::int64_t count) {
        return static_cast<std::int64_t>(std::clamp(along, 0.0, static_cast<double>(count - 1)));
    }
};

// Return for every cell the length of the path to one cell, through cells whose middles keep `least` (m) from
// everything. The moving body of the scene is a point. A step to or from another cell costs as much as a path along the
// whole floor. So a gap that the cells miss is not closed, but searched last.
std::vector<double> floor_distances(const Scene &point, const Grid &grid, double least, std::int64_t place);

// Sizes of a search: side (m) and angle (rad) of a cell, and typical length of an arc (m of cost).
struct LatticeSizes {
    double side, angle, arc;
};

// A search from the start to the goal. The next search reuses the memory.
class Lattice {
  public:
    mutable Lock lock;

    // `middle` is the reference point of the floor distances on the body, chain frame, m. `away` holds the distances to
    // the goal.
    Lattice(std::shared_ptr<const Problem> problem, const Pose &start, const std::array<double, 2> &middle,
            const Grid &grid, std::vector<double> away)
        : problem_(std::move(problem)), start_(start), middle_(middle), grid_(grid), away_(std::move(away)) {}

    // Begin with the start alone. Cells cover the area; `room` is the maximum number of nodes.
    void plant(const Area &area, const LatticeSizes &sizes, std::int64_t room);

    // Expand nodes, lowest estimate first, until about `arcs` arcs were tried or no estimate is below the bound. The
    // bound is the upper limit of a path's cost, m. It falls to the cost of each path found. Return the final bound,
    // and whether the search is over.
    std::pair<double, bool> expand(double bound, std::int64_t arcs, Random &random);

    // Return the best path; empty if there is none.
    std::vector<Arc> path() const;

    std::int64_t tried() const { return tried_; }
    const std::vector<Node> &nodes() const { return nodes_; }

  private:
    // A node to expand, and the estimated cost of a path through it.
    struct Entry {
        double promise;
        std::int64_t row;

        bool operator<(const Entry &other) const { // the lowest estimate is at the top of a heap
            return promise > other.promise || (promise == other.promise && row > other.row);
        }
    };

    std::int64_t key_of(const Pose &pose) const;
    double left(const Pose &pose) const;
    void grow(std::int64_t parent, int number, double bound, Random &random);

    std::shared_ptr<const Problem> problem_;
    Pose start_;
    std::array<double, 2> middle_;
    Grid grid_;
    std::vector<double> away_;

    Area area_{};
    LatticeSizes sizes_{};
    std::size_t room_ = 0;
    std::vector<Node> nodes_;
    std::vector<Entry> queue_;
    CellTable cells_;
    std::vector<double> costs_; // cost of the cheapest node in each slot's cell
    std::int64_t tried_ = 0;
    std::int64_t partner_ = -1; // the node at which the best path's last steering path begins
    std::array<Arc, 3> word_{};
};

} // namespace pushplan
