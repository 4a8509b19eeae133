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

Made<double> stack_of(std::vector<Quadratic> &&quadratics) {
    auto *kept = new std::vector<Quadratic>(std::move(quadratics));
    nb::capsule owner(kept, [](void *pointer) noexcept { delete static_cast<std::vector<Quadratic> *>(pointer); });
    return {reinterpret_cast<double *>(kept->data()), {kept->size(), 3, 3}, owner};
}

Made<double> rows_of(std::vector<double> &&numbers, std::ptrdiff_t columns) {
    const auto count = static_cast<std::ptrdiff_t>(numbers.size()) / columns;
    return to_numpy(std::move(numbers), {count, columns});
}

nb::tuple bind_step_sum(const Numbers &levels, const Numbers &centers, const Numbers &widths) {
    const auto level_rows = table(levels), width_rows = table(widths);
    const auto times = row(centers);
    for (const Numbers *array : {&levels, &centers, &widths})
        require_all_finite(array->data(), array->size(), "a step");
    for (std::ptrdiff_t i = 0; i < widths.size(); ++i)
        require_not_negative(widths.data()[i], "a width");
    Pieces pieces;
    {
        nb::gil_scoped_release free;
        pieces = step_sum(level_rows, times, width_rows);
    }
    return nb::make_tuple(to_numpy(std::move(pieces.durations)), stack_of(std::move(pieces.coefficients)),
                          to_numpy(std::move(pieces.level)));
}

Made<double> bind_poses_after(const Numbers &start, const Numbers &coefficients, const Numbers &durations) {
    if (row(start).size != 3)
        throw std::invalid_argument("a pose has 3 numbers");
    std::vector<double> poses;
    const auto twists = quadratics(coefficients);
    const auto times = row(durations);
    {
        nb::gil_scoped_release free;
        poses = poses_after(start.data(), twists, times);
    }
    return rows_of(std::move(poses), 3);
}

Made<double> bind_limit_use(const Numbers &durations, const Numbers &coefficients, const Numbers &sides, double jerk,
                            double angular_jerk) {
    const auto side = table(sides);
    if (side.rows != 4 || side.columns != 2)
        throw std::invalid_argument("limits of speeds and accelerations must be (4, 2)");
    const PusherLimits limits{{side[0][0], side[0][1]},
                              {side[1][0], side[1][1]},
                              {side[2][0], side[2][1]},
                              {side[3][0], side[3][1]},
                              jerk,
                              angular_jerk};
    const auto times = row(durations);
    const auto twists = quadratics(coefficients);
    std::vector<double> shares;
    {
        nb::gil_scoped_release free;
        shares = limit_use(times, twists, limits);
    }
    return rows_of(std::move(shares), 3);
}

nb::tuple bind_instants(const Numbers &durations, const Numbers &coefficients) {
    Instants instants = instants_of(row(durations), quadratics(coefficients));
    return nb::make_tuple(rows_of(std::move(instants.twists), 3), rows_of(std::move(instants.rates), 3),
                          to_numpy(std::move(instants.piece)));
}

using Wrenches = std::pair<Numbers, Numbers>;

ContactRows contact_rows(const Wrenches &wrenches, std::ptrdiff_t instants, std::ptrdiff_t contacts) {
    const auto &[rows, size] = wrenches;
    if (rows.ndim() != 3 || rows.shape(0) != instants || rows.shape(1) != contacts || rows.shape(2) != 4)
        throw std::invalid_argument("rows of contacts must be (k, n, 4) for k instants and n contacts");
    if (size.ndim() != 2 || size.shape(0) != instants || size.shape(1) != contacts)
        throw std::invalid_argument("sizes of wrenches must be (k, n) for k instants and n contacts");
    return {rows.data(), size.data()};
}

nb::tuple bind_contact_use(const Wrenches &floor, const Wrenches &inertia, const Wrenches &steady,
                           const Integers &piece, std::ptrdiff_t pieces, double margin, double room) {
    const auto instants = row(piece);
    if (floor.second.ndim() != 2)
        throw std::invalid_argument("sizes of wrenches must be (k, n) for k instants and n contacts");
    const std::ptrdiff_t contacts = floor.second.shape(1);
    const ContactQuestion question{contacts,
                                   contact_rows(floor, instants.size, contacts),
                                   contact_rows(inertia, instants.size, contacts),
                                   contact_rows(steady, instants.size, contacts),
                                   margin,
                                   room};
    ContactUse use;
    {
        nb::gil_scoped_release free;
        use = contact_use(question, instants, pieces);
    }
    return nb::make_tuple(to_numpy(std::move(use.shares)), to_numpy(std::move(use.slowing)));
}

} // namespace

void bind_timing(nb::module_ &core) {
    nb::module_ m = core.def_submodule("timing");
    m.def("step_sum", bind_step_sum, nb::arg("levels"), nb::arg("centers"), nb::arg("widths"));
    m.def(
        "wider_steps",
        [](const Numbers &centers, const Numbers &widths) {
            WiderSteps found = wider_steps(row(centers), table(widths));
            return nb::make_tuple(to_numpy(std::move(found.which)), rows_of(std::move(found.bounds), 2));
        },
        nb::arg("centers"), nb::arg("widths"));
    m.def("poses_after", bind_poses_after, nb::arg("start"), nb::arg("coefficients"), nb::arg("durations"));
    m.def("limit_use", bind_limit_use, nb::arg("durations"), nb::arg("coefficients"), nb::arg("sides"), nb::arg("jerk"),
          nb::arg("angular_jerk"));
    m.def("instants", bind_instants, nb::arg("durations"), nb::arg("coefficients"));
    m.def("contact_use", bind_contact_use, nb::arg("floor"), nb::arg("inertia"), nb::arg("steady"), nb::arg("piece"),
          nb::arg("pieces"), nb::arg("margin"), nb::arg("room"));
}

} // namespace pushplan
