// What Python calls of `pockets.hpp`: `pushplan.core.infeasible`.
#include "cells.hpp"
#include "numpy_poses.hpp"
#include "pockets.hpp"

namespace pushplan {

namespace {

static_assert(sizeof(Cell) == 3 * sizeof(std::int64_t), "a row of NumPy's table");

Steps to_steps(double side, std::int64_t headings, double sign, double travel, double longest, double near,
               double turned, const Numbers &ahead, std::int64_t turn, const Numbers &aside, double touching) {
    if (ahead.size() != 2)
        throw std::invalid_argument("the travel ahead has a least and a most, not " + std::to_string(ahead.size()));
    require_all_finite(ahead.data(), 2, "ahead");
    require_positive(side, "side");
    require_index(headings, 1, MOST_CELLS, "headings");
    require_index(turn, -headings, headings + 1, "turn");
    for (const double number : {sign, travel, longest, near, turned, touching})
        require_finite(number, "a step");
    return {side,    headings,
            sign,    travel,
            longest, near,
            turned,  {ahead.data()[0], ahead.data()[1]},
            turn,    to_rows<Span>(aside, "the travel aside"),
            touching};
}

auto bind_spread(const Scene &scene, const Numbers &begin, const Steps &steps, const Numbers &other,
                 std::size_t slots) {
    const Pose first = to_pose(begin), last = to_pose(other);
    if (slots < 2 || (slots & (slots - 1)) != 0 || slots > 8 * MOST_CELLS)
        throw std::invalid_argument("the slots for cells are a power of two from 2 to 2^23, not " +
                                    std::to_string(slots));
    Spreading found;
    {
        nb::gil_scoped_release free;
        found = spread(scene, first, steps, last, slots);
    }
    auto cells = new_array<std::int64_t>({static_cast<std::ptrdiff_t>(found.cells.size()), 3});
    copy_bytes(cells.data(), found.cells.data(), found.cells.size() * sizeof(Cell));
    return std::make_tuple(static_cast<int>(found.end), cells);
}

} // namespace

void bind_infeasible(nb::module_ &core) {
    auto m = core.def_submodule(
        "infeasible", "Poses that no push leads out of, or into: what can be reached on a grid, step by step.");
    m.attr("CLOSED") = static_cast<int>(SpreadEnd::CLOSED);
    m.attr("MET") = static_cast<int>(SpreadEnd::MET);
    m.attr("OPEN") = static_cast<int>(SpreadEnd::OPEN);
    m.attr("ORIGIN") = ORIGIN;
    nb::class_<Steps>(m, "Steps", R"(
    Cells, and what a step can do; seen from the body's middle, which moves ahead, +x, in every stable push.

    Args:
        side: Of a cell, m.
        headings: Cells of a full turn.
        sign: 1 for steps ahead, -1 for steps back.
        travel: Of the body's middle ahead in a step, m.
        longest: Bound on the way of the body's middle in a step or a part of one, m.
        near: Distance of cells' middles, m, that a step or a part of one bridges at most.
        turned: Turn, rad, likewise.
        ahead: (2,) least and most travel along the heading at its beginning, m.
        turn: Cells of heading to the first row of `aside`.
        aside: (k, 2) least and most travel to the left (m) with each turn; the first is larger where there is none.
        touching: The body at every pose of a cell touches something if its distance at the cell's middle is below, m.
    )")
        .def(MadeBy(&to_steps), nb::arg("side"), nb::arg("headings"), nb::arg("sign"), nb::arg("travel"),
             nb::arg("longest"), nb::arg("near"), nb::arg("turned"), nb::arg("ahead"), nb::arg("turn"),
             nb::arg("aside"), nb::arg("touching"))
        .def_ro("side", &Steps::side)
        .def_ro("headings", &Steps::headings)
        .def_ro("sign", &Steps::sign)
        .def_ro("travel", &Steps::travel)
        .def_ro("longest", &Steps::longest);
    m.def("spread", &bind_spread, nb::arg("scene"), nb::arg("begin"), nb::arg("steps"), nb::arg("other"),
          nb::arg("slots"), R"(
    Find the cells that can be reached, step by step, until there are no more.

    Args:
        scene: The body and what it must not touch.
        begin: (3,) position of the body's middle and heading to begin at, world; a cell's middle.
        steps: What a step can do.
        other: (3,) the like of the pose that is looked for.
        slots: Of the table of cells, a power of two; half as many cells are looked at.

    Returns:
        (end, cells): how it ended; (n, 3) column, row and heading of the cells found.

    Raises:
        ValueError: On another number of slots.
    )");
}

} // namespace pushplan
