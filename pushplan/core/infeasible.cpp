// `pushplan.core.infeasible`: the Python bindings of `pockets.hpp`.
#include "cells.hpp"
#include "numpy_poses.hpp"
#include "pockets.hpp"

namespace pushplan {

namespace {

static_assert(sizeof(Cell) == 3 * sizeof(std::int64_t), "a row of NumPy's table");

Steps to_steps(double side, std::int64_t headings, double sign, double travel, double longest, double near,
               double turned, const Numbers &ahead, std::int64_t turn, const Numbers &aside, double touching) {
    if (ahead.size() != 2)
        throw std::invalid_argument("the travel ahead needs least and most, not " + std::to_string(ahead.size()));
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
        throw std::invalid_argument("the number of slots must be a power of two from 2 to 2^23, not " +
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
        "infeasible", "Poses without a push that leads away or in: reachable cells of a grid, step by step.");
    m.attr("CLOSED") = static_cast<int>(SpreadEnd::CLOSED);
    m.attr("MET") = static_cast<int>(SpreadEnd::MET);
    m.attr("OPEN") = static_cast<int>(SpreadEnd::OPEN);
    m.attr("ORIGIN") = ORIGIN;
    nb::class_<Steps>(m, "Steps", R"(
    Cells and steps, relative to the body's middle, which moves ahead (+x) in every stable push.

    Args:
        side: Side of a cell, m.
        headings: Number of heading cells in a full turn.
        sign: 1 for steps ahead, -1 for steps back.
        travel: Travel of the body's middle ahead in a step, m.
        longest: Upper bound of the path of the body's middle in a step or a part of one, m.
        near: Maximum distance between the middles of cells joined by a step or a part of one, m.
        turned: Maximum turn in a step or a part of one, rad.
        ahead: (2,) least and most travel along the initial heading, m.
        turn: Turn of the first row of `aside`, in heading cells.
        aside: (k, 2) least and most travel to the left (m) for each turn; least > most if there is none.
        touching: Distance at a cell's middle (m) below which the body touches something at every pose of the cell.
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
    Find the reachable cells, step by step, until there are no more.

    Args:
        scene: The body and the obstacles.
        begin: (3,) initial position of the body's middle and heading, world; the middle of a cell.
        steps: Cells and steps.
        other: (3,) position of the body's middle and heading to search for, world.
        slots: Slots of the table of cells, a power of two; at most half as many cells are visited.

    Returns:
        (outcome, cells): outcome of the search; (n, 3) column, row and heading of the visited cells.

    Raises:
        ValueError: If the number of slots is not such a power of two.
    )");
}

} // namespace pushplan
