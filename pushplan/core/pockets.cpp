#include "pockets.hpp"

#include "cells.hpp"

#include <algorithm>

namespace pushplan {

namespace {

// Maximum number of visits to cells per slot of their table, most of them known already.
constexpr std::int64_t LOOKS = 64;

// Return the pose of a cell's middle in the world.
Pose pose_of(const Pose &begin, const Steps &steps, const Cell &cell) {
    const double c = std::cos(begin.theta), s = std::sin(begin.theta);
    const double x = steps.side * static_cast<double>(cell.column - ORIGIN);
    const double y = steps.side * static_cast<double>(cell.row - ORIGIN);
    const double turn = 2.0 * PI * static_cast<double>(cell.heading) / static_cast<double>(steps.headings);
    return {begin.x + c * x - s * y, begin.y + s * x + c * y, begin.theta + turn};
}

// Return whether the body may be free at some pose of a cell. `near` exceeds the distance that decides.
bool may_hold(const Scene &scene, const Pose &begin, const Steps &steps, const Cell &cell, double near) {
    const Pose middle = pose_of(begin, steps, cell);
    const double c = std::cos(middle.theta), s = std::sin(middle.theta);
    const Circle &bound = scene.body->bound;
    const double x = middle.x - c * bound.x + s * bound.y, y = middle.y - s * bound.x - c * bound.y;
    return separation(scene, {x, y, middle.theta}, near) >= steps.touching;
}

// A range of columns and rows.
struct Window {
    std::int64_t first_column;
    std::int64_t last_column;
    std::int64_t first_row;
    std::int64_t last_row;
};

// Return the cells that a step with a turn can reach; c and s are the cosine and sine of the middle's heading.
Window window_of(const Steps &steps, const Cell &cell, const Span &aside, double c, double s) {
    double xmin = INF, ymin = INF, xmax = -INF, ymax = -INF;
    for (const double along : {steps.ahead.low, steps.ahead.high})
        for (const double across : {aside.low, aside.high}) {
            const double ahead = steps.sign * along, left = steps.sign * across;
            const double x = c * ahead - s * left, y = s * ahead + c * left;
            xmin = std::min(xmin, x);
            xmax = std::max(xmax, x);
            ymin = std::min(ymin, y);
            ymax = std::max(ymax, y);
        }
    // Both ends can be anywhere in their cells, so add one cell on every side.
    const auto column = static_cast<double>(cell.column), row = static_cast<double>(cell.row);
    // `look_at` refuses all cells outside the grid.
    const auto whole = [](double place) {
        return static_cast<std::int64_t>(std::clamp(place, -1.0, static_cast<double>(MOST_CELLS)));
    };
    return {whole(std::ceil(column - 1.0 + xmin / steps.side)), whole(std::floor(column + 1.0 + xmax / steps.side)),
            whole(std::ceil(row - 1.0 + ymin / steps.side)), whole(std::floor(row + 1.0 + ymax / steps.side))};
}

// Return a heading cell within a full turn.
std::int64_t within_a_turn(std::int64_t heading, std::int64_t headings) {
    const std::int64_t rest = heading % headings;
    return rest < 0 ? rest + headings : rest;
}

// The cells found so far, and those known to touch something.
class Spreader {
  public:
    Spreader(const Scene &scene, const Pose &begin, const Steps &steps, std::size_t slots)
        : scene_(scene), begin_(begin), steps_(steps), most_(slots / 2),
          left_(LOOKS * static_cast<std::int64_t>(slots)),
          // `separation` is capped a little above the distance that is compared.
          near_(std::max(steps.touching, 0.0) + steps.side) {
        known_.clear(slots);
        const Cell first{ORIGIN, ORIGIN, 0};
        const std::int64_t key = cell_key(first.column, first.row, first.heading);
        known_[known_.slot_of(key)] = key;
        cells_.push_back(first);
    }

    Spreading until(const Pose &other) {
        for (std::size_t done = 0; done < cells_.size(); ++done) {
            const Cell cell = cells_[done];
            const Pose middle = pose_of(begin_, steps_, cell);
            const double turn = std::abs(floored_mod(middle.theta - other.theta + PI, 2.0 * PI) - PI);
            if (std::hypot(middle.x - other.x, middle.y - other.y) < steps_.near && turn < steps_.turned)
                return {SpreadEnd::MET, std::move(cells_)};
            if (left_ < 0 || !expand(cell))
                return {SpreadEnd::OPEN, std::move(cells_)};
        }
        return {SpreadEnd::CLOSED, std::move(cells_)};
    }

  private:
    // Add the cells that a step leads to; return false if there is no room for another one.
    bool expand(const Cell &cell) {
        const double theta = 2.0 * PI * static_cast<double>(cell.heading) / static_cast<double>(steps_.headings);
        const double c = std::cos(theta), s = std::sin(theta);
        for (std::size_t row = 0; row < steps_.aside.size(); ++row) {
            const Span &aside = steps_.aside[row];
            if (aside.low > aside.high)
                continue;
            const Window window = window_of(steps_, cell, aside, c, s);
            const std::int64_t heading =
                within_a_turn(cell.heading + steps_.turn + static_cast<std::int64_t>(row), steps_.headings);
            for (std::int64_t column = window.first_column; column <= window.last_column; ++column)
                for (std::int64_t line = window.first_row; line <= window.last_row; ++line)
                    if (!look_at({column, line, heading}))
                        return false;
        }
        return true;
    }

    bool look_at(const Cell &cell) {
        if (std::min(cell.column, cell.row) < 0 || std::max(cell.column, cell.row) >= MOST_CELLS)
            return false;
        --left_;
        const std::int64_t key = cell_key(cell.column, cell.row, cell.heading);
        const std::size_t slot = known_.slot_of(key);
        if (known_[slot] == key)
            return true;
        if (++looked_ > most_)
            return false;
        known_[slot] = key;
        if (may_hold(scene_, begin_, steps_, cell, near_))
            cells_.push_back(cell);
        return true;
    }

    const Scene &scene_;
    const Pose &begin_;
    const Steps &steps_;
    CellTable known_;
    std::vector<Cell> cells_;
    std::size_t most_;
    std::size_t looked_ = 1;
    std::int64_t left_;
    double near_;
};

} // namespace

Spreading spread(const Scene &scene, const Pose &begin, const Steps &steps, const Pose &other, std::size_t slots) {
    return Spreader(scene, begin, steps, slots).until(other);
}

} // namespace pushplan
