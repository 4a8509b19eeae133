// Poses that no push leads out of, or into: what can be reached on a grid, step by step.
//
// A cell is a column, a row and a heading, seen from where one begins, of the body's middle. A step leads from any pose
// of a cell to all cells that some push of a given travel may end in, or more: when no cell is left to step from, no
// push leads out of the cells that were found.
#pragma once

#include "scene.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace pushplan {

// Column and row of the cell around the pose where it begins.
constexpr std::int64_t ORIGIN = std::int64_t{1} << 19;

// How spreading ends: no more cells, near the other pose, or with too many cells to tell.
enum class SpreadEnd { CLOSED = 0, MET = 1, OPEN = 2 };

// Least and most of something; the first is larger where there is none.
struct Span {
    double low;
    double high;
};

// Cells, and what a step can do; seen from the body's middle, which moves ahead, +x, in every stable push.
struct Steps {
    double side;             // of a cell, m
    std::int64_t headings;   // cells of a full turn
    double sign;             // 1 for steps ahead, -1 for steps back
    double travel;           // of the body's middle ahead in a step, m
    double longest;          // bound on the way of the body's middle in a step or a part of one, m
    double near;             // distance of cells' middles, m, that a step or a part of one bridges at most
    double turned;           // turn, rad, likewise
    Span ahead;              // travel along the heading at its beginning, m
    std::int64_t turn;       // cells of heading to the first row of `aside`
    std::vector<Span> aside; // travel to the left (m) with each turn
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
    std::vector<Cell> cells; // that can be reached
};

// Find the cells that can be reached from `begin`, step by step, until there are no more, or `other` is near; both are
// the place of the body's middle and its heading. At most half as many cells are looked at as there are slots for, a
// power of two up to 2^23.
Spreading spread(const Scene &scene, const Pose &begin, const Steps &steps, const Pose &other, std::size_t slots);

} // namespace pushplan
