// What Python calls of `step_sum.hpp` and `motion_bounds.hpp`: `pushplan.core.timing`.
#include "motion_bounds.hpp"
#include "numpy.hpp"
#include "step_sum.hpp"

#include <utility>

namespace pushplan {

namespace {

static_assert(sizeof(Quadratic) == 9 * sizeof(double), "coefficients (q, 3, 3) are read as quadratics");

Row<const Quadratic> quadratics(const Numbers &coefficients) {
    if (coefficients.ndim() != 3 || coefficients.shape(1) != 3 || coefficients.shape(2) != 3)
        throw std::invalid_argument("the coefficients of q pieces must be (q, 3, 3)");
    return {reinterpret_cast<const Quadratic *>(coefficients.data()), coefficients.shape(0)};
}

py::array_t<double> stack_of(std::vector<Quadratic> &&quadratics) {
    auto *kept = new std::vector<Quadratic>(std::move(quadratics));
    py::capsule owner(kept, [](void *pointer) { delete static_cast<std::vector<Quadratic> *>(pointer); });
    const auto count = static_cast<py::ssize_t>(kept->size());
    return py::array_t<double>({count, py::ssize_t{3}, py::ssize_t{3}}, &kept->data()->c[0][0], owner);
}

template <class Number> py::array_t<Number> column(std::vector<Number> &&numbers) {
    const auto count = static_cast<py::ssize_t>(numbers.size());
    return to_numpy(std::move(numbers), {count});
}

py::array_t<double> rows_of(std::vector<double> &&numbers, py::ssize_t columns) {
    const auto count = static_cast<py::ssize_t>(numbers.size()) / columns;
    return to_numpy(std::move(numbers), {count, columns});
}

py::tuple bind_step_sum(const Numbers &levels, const Numbers &centers, const Numbers &widths) {
    const auto level_rows = table(levels), width_rows = table(widths);
    const auto times = row(centers);
    Pieces pieces;
    {
        py::gil_scoped_release free;
        pieces = step_sum(level_rows, times, width_rows);
    }
    return py::make_tuple(column(std::move(pieces.durations)), stack_of(std::move(pieces.coefficients)),
                          column(std::move(pieces.level)));
}

py::array_t<double> bind_poses_after(const Numbers &start, const Numbers &coefficients, const Numbers &durations) {
    if (row(start).size != 3)
        throw std::invalid_argument("a pose has 3 numbers");
    std::vector<double> poses;
    const auto twists = quadratics(coefficients);
    const auto times = row(durations);
    {
        py::gil_scoped_release free;
        poses = poses_after(start.data(), twists, times);
    }
    return rows_of(std::move(poses), 3);
}

py::array_t<double> bind_limit_use(const Numbers &durations, const Numbers &coefficients, const Numbers &sides,
                                   double jerk, double angular_jerk) {
    const auto side = table(sides);
    if (side.rows != 4 || side.columns != 2)
        throw std::invalid_argument("limits of speeds and accelerations must be (4, 2)");
    const PusherLimits limits{{side[0][0], side[0][1]}, {side[1][0], side[1][1]}, {side[2][0], side[2][1]},
                              {side[3][0], side[3][1]}, jerk,                     angular_jerk};
    const auto times = row(durations);
    const auto twists = quadratics(coefficients);
    std::vector<double> shares;
    {
        py::gil_scoped_release free;
        shares = limit_use(times, twists, limits);
    }
    return rows_of(std::move(shares), 3);
}

py::tuple bind_instants(const Numbers &durations, const Numbers &coefficients) {
    Instants instants = instants_of(row(durations), quadratics(coefficients));
    return py::make_tuple(rows_of(std::move(instants.twists), 3), rows_of(std::move(instants.rates), 3),
                          column(std::move(instants.piece)));
}

using Wrenches = std::pair<Numbers, Numbers>;

ContactRows contact_rows(const Wrenches &wrenches, py::ssize_t instants, py::ssize_t contacts) {
    const auto &[rows, size] = wrenches;
    if (rows.ndim() != 3 || rows.shape(0) != instants || rows.shape(1) != contacts || rows.shape(2) != 4)
        throw std::invalid_argument("rows of contacts must be (k, n, 4) for k instants and n contacts");
    if (size.ndim() != 2 || size.shape(0) != instants || size.shape(1) != contacts)
        throw std::invalid_argument("sizes of wrenches must be (k, n) for k instants and n contacts");
    return {rows.data(), size.data()};
}

py::tuple bind_contact_use(const Wrenches &floor, const Wrenches &inertia, const Wrenches &steady,
                           const Integers &piece, py::ssize_t pieces, double margin, double room) {
    const auto instants = row(piece);
    if (floor.second.ndim() != 2)
        throw std::invalid_argument("sizes of wrenches must be (k, n) for k instants and n contacts");
    const py::ssize_t contacts = floor.second.shape(1);
    const ContactQuestion question{contacts,
                                   contact_rows(floor, instants.size, contacts),
                                   contact_rows(inertia, instants.size, contacts),
                                   contact_rows(steady, instants.size, contacts),
                                   margin,
                                   room};
    ContactUse use;
    {
        py::gil_scoped_release free;
        use = contact_use(question, instants, pieces);
    }
    return py::make_tuple(column(std::move(use.shares)), column(std::move(use.slowing)));
}

} // namespace

void bind_timing(py::module_ &core) {
    py::module_ m = core.def_submodule("timing");
    m.attr("FINEST") = FINEST;
    m.attr("MOST_OF_PHASE") = MOST_OF_PHASE;
    m.def("step_sum", bind_step_sum, py::arg("levels"), py::arg("centers"), py::arg("widths"));
    m.def(
        "ordered_widths",
        [](const Numbers &centers, const Numbers &widths) {
            return rows_of(ordered_widths(row(centers), table(widths)), 2);
        },
        py::arg("centers"), py::arg("widths"));
    m.def("poses_after", bind_poses_after, py::arg("start"), py::arg("coefficients"), py::arg("durations"));
    m.def("limit_use", bind_limit_use, py::arg("durations"), py::arg("coefficients"), py::arg("sides"),
          py::arg("jerk"), py::arg("angular_jerk"));
    m.def(
        "top_rates",
        [](const Numbers &durations, const Numbers &coefficients, double reach) {
            return column(top_rates(row(durations), quadratics(coefficients), reach));
        },
        py::arg("durations"), py::arg("coefficients"), py::arg("reach"));
    m.def("instants", bind_instants, py::arg("durations"), py::arg("coefficients"));
    m.def("contact_use", bind_contact_use, py::arg("floor"), py::arg("inertia"), py::arg("steady"), py::arg("piece"),
          py::arg("pieces"), py::arg("margin"), py::arg("room"));
}

} // namespace pushplan
