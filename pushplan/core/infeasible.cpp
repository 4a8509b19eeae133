// What Python calls of `pockets.hpp`: `pushplan.core.infeasible`.
#include "numpy_poses.hpp"
#include "pockets.hpp"

namespace pushplan {

namespace {

static_assert(sizeof(Cell) == 3 * sizeof(std::int64_t), "a row of NumPy's table");

Steps to_steps(double side, std::int64_t headings, double sign, double travel, double longest, double near,
               double turned, const Numbers &ahead, std::int64_t turn, const Numbers &aside, double touching) {
    if (ahead.size() != 2)
        throw std::invalid_argument("the travel ahead has a least and a most, not " + std::to_string(ahead.size()));
    return {side,   headings, sign,
            travel, longest,  near,
            turned, {ahead.data()[0], ahead.data()[1]}, turn,
            to_rows<Span>(aside, "the travel aside"), touching};
}

py::tuple bind_spread(const Scene &scene, const Numbers &begin, const Steps &steps, const Numbers &other,
                      std::size_t slots) {
    const Pose first = to_pose(begin), last = to_pose(other);
    Spreading found;
    {
        py::gil_scoped_release free;
        found = spread(scene, first, steps, last, slots);
    }
    py::array_t<std::int64_t> cells({static_cast<py::ssize_t>(found.cells.size()), py::ssize_t{3}});
    copy_bytes(cells.mutable_data(), found.cells.data(), found.cells.size() * sizeof(Cell));
    return py::make_tuple(static_cast<int>(found.end), cells);
}

} // namespace

void bind_infeasible(py::module_ &core) {
    auto m = core.def_submodule("infeasible");
    m.attr("CLOSED") = static_cast<int>(SpreadEnd::CLOSED);
    m.attr("MET") = static_cast<int>(SpreadEnd::MET);
    m.attr("OPEN") = static_cast<int>(SpreadEnd::OPEN);
    m.attr("ORIGIN") = ORIGIN;
    py::class_<Steps>(m, "Steps")
        .def(py::init(&to_steps), py::arg("side"), py::arg("headings"), py::arg("sign"), py::arg("travel"),
             py::arg("longest"), py::arg("near"), py::arg("turned"), py::arg("ahead"), py::arg("turn"),
             py::arg("aside"), py::arg("touching"))
        .def_readonly("side", &Steps::side)
        .def_readonly("headings", &Steps::headings)
        .def_readonly("sign", &Steps::sign)
        .def_readonly("travel", &Steps::travel)
        .def_readonly("longest", &Steps::longest);
    m.def("spread", &bind_spread, py::arg("scene"), py::arg("begin"), py::arg("steps"), py::arg("other"),
          py::arg("slots"));
}

} // namespace pushplan
