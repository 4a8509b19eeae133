// Poses without a push that leads away or in: reachable cells of a grid, step by step.
//
// A cell is a column, a row and a heading of the body's middle, relative to the beginning. A step leads from a cell to
// all cells where some push with a given travel can end, or more. So if no cell is left, no push leads out of the cells
// found.
#pragma once

#include "scene.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace pushplan {

// Column and row of the cell around the initial pose.
constexpr std::int64_t ORIGIN = std::int64_t{1} << 19;

// Outcome: no more cells, the other pose was met, or too many cells for a decision.
enum class SpreadEnd { CLOSED = 0, MET = 1, OPEN = 2 };

// A range from least to most; empty if least > most.
struct Span {
    double low;
    double high;
};

// Cells and steps, relative to the body's middle, which moves ahead (+x) in every stable push.
struct Steps {
    double side;             // side of a cell, m
    std::int64_t headings;   // heading cells in a full turn
    double sign;             // 1 for steps ahead, -1 for steps back
    double travel;           // travel of the body's middle ahead in a step, m
    double longest;          // upper bound of the path of the body's middle in a step or a part of one, m
    double near;             // maximum distance of cell middles joined by a step or a part of one, m
    double turned;           // maximum turn in a step or a part of one, rad
    Span ahead;              // travel along the initial heading, m
    std::int64_t turn;       // turn of the first row of `aside`, in heading cells
    std::vector<Span> aside; // travel to the left (m) for each turn
    double touching;         // the body at every pose of a cell touches something if its distance at the cell's middle
                             // is below, m
};

struct Cell {
    std::int64_t column;
    std::int64_t row;
    std::int64_t heading;
};

struct Spreading {
    SpreadEnd end;
    std::vector<Cell> cells; // reachable cells
};

// Find the cells that can be reached from `begin`, step by step, until there are no more or `other` is near. Both are
// the position of the body's middle and its heading. The number of slots is a power of two up to 2^23; at most half as
// many cells are visited.
Spreading spread(const Scene &scene, const Pose &begin, const Steps &steps, const Pose &other, std::size_t slots);

} // namespace pushplan
