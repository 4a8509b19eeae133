// `pushplan.core.timing`: the Python bindings of `step_sum.hpp` and `motion_bounds.hpp`.
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

auto bind_step_sum(const Numbers &levels, const Numbers &centers, const Numbers &widths) {
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
    return std::make_tuple(to_numpy(std::move(pieces.durations)), stack_of(std::move(pieces.coefficients)),
                           to_numpy(std::move(pieces.level)));
}

Made<double> bind_poses_after(const Numbers &start, const Numbers &coefficients, const Numbers &durations) {
    if (row(start).size != 3)
        throw std::invalid_argument("a pose needs 3 numbers");
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

using Wrenches = std::pair<Numbers, Numbers>;

ContactRows contact_rows(const Wrenches &wrenches, std::ptrdiff_t instants, std::ptrdiff_t contacts) {
    const auto &[rows, size] = wrenches;
    if (rows.ndim() != 3 || rows.shape(0) != instants || rows.shape(1) != contacts || rows.shape(2) != 4)
        throw std::invalid_argument("rows of contacts must be (k, n, 4) for k instants and n contacts");
    if (size.ndim() != 2 || size.shape(0) != instants || size.shape(1) != contacts)
        throw std::invalid_argument("sizes of wrenches must be (k, n) for k instants and n contacts");
    return {rows.data(), size.data()};
}

auto bind_contact_use(const Wrenches &floor, const Wrenches &inertia, const Wrenches &steady, const Integers &piece,
                      std::ptrdiff_t pieces, double margin, double room) {
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
    return std::make_tuple(to_numpy(std::move(use.shares)), to_numpy(std::move(use.slowing)));
}

} // namespace

void bind_timing(nb::module_ &core) {
    nb::module_ m = core.def_submodule(
        "timing", "Blended twists as sequences of quadratics in time, and bounds of their use of limits.");
    m.def("step_sum", bind_step_sum, nb::arg("levels"), nb::arg("centers"), nb::arg("widths"), R"(
    Return the twist that passes through `levels` by a sequence of smooth steps.

    V(t) = V_0 + sum_j (V_j+1 - V_j) b_j(t), where b_j is a step from 0 to 1: a jump at its centre, averaged over both
    of its windows. With `wider_steps`, a convex set that contains the levels contains V.

    Args:
        levels: (m + 1, 3) body twists.
        centers: (m,) non-decreasing times of the steps, s; at least one.
        widths: (m, 2) long and short windows of the steps, s. Those of a step between equal levels do not matter.

    Returns:
        Durations (q,) of the pieces, s; coefficients (q, 3, 3) of the twist in the time since the beginning of each
        piece, lowest order first; and the level (q,) of each piece, after the last completed step.

    Raises:
        ValueError: If the shapes are wrong.
    )");
    m.def(
        "wider_steps",
        [](const Numbers &centers, const Numbers &widths) {
            WiderSteps found = wider_steps(row(centers), table(widths));
            return std::make_tuple(to_numpy(std::move(found.which)), rows_of(std::move(found.bounds), 2));
        },
        nb::arg("centers"), nb::arg("widths"), R"(
    Return the steps (w,) that must be wider to keep the levels' weights positive, and their limits.

    Args:
        centers: (m,) times of the steps, s.
        widths: (m, 2) long and short windows of the steps, s; zero if there is no step.

    Returns:
        Their indices (w,), and limits (w, 2) of the first and second derivative of a step from 0 to 1, 1/s and 1/s^2,
        with which the fastest step is just wide enough.

    Raises:
        ValueError: If the shapes are wrong.
    )");
    m.def("poses_after", bind_poses_after, nb::arg("start"), nb::arg("coefficients"), nb::arg("durations"),
          "Return the poses (q + 1, 3) at the ends of pieces with twists `coefficients` (q, 3, 3), from `start`.");
    m.def("limit_use", bind_limit_use, nb::arg("durations"), nb::arg("coefficients"), nb::arg("sides"), nb::arg("jerk"),
          nb::arg("angular_jerk"), R"(
    Return upper bounds of each trajectory piece's used shares of its limits.

    Args:
        durations: (q,) durations of the pieces, s.
        coefficients: (q, 3, 3) coefficients of the twist, lowest order first.
        sides: (4, 2) limits of speed, acceleration, angular speed and angular acceleration, each for negative and for
            other values.
        jerk: Limit of the jerk, m/s^3.
        angular_jerk: Limit of the angular jerk, rad/s^3.

    Returns:
        (q, 3) shares for speed, acceleration and jerk: the larger of the linear and the angular share.
    )");
    m.def("contact_use", bind_contact_use, nb::arg("floor"), nb::arg("inertia"), nb::arg("steady"), nb::arg("piece"),
          nb::arg("pieces"), nb::arg("margin"), nb::arg("room"), R"(
    Return the contact use of pieces.

    If the twist changes more slowly, the inertial part at a steady twist stays, and the rest shrinks in proportion.

    Args:
        floor: Rows (k, n, 4) and sizes (k, n) of the wrenches without inertia, N; see `Wrenches`.
        inertia: Rows and sizes of the part added by inertia, N.
        steady: Rows and sizes of the part added by inertia at a steady twist, N.
        piece: (k,) piece of each instant.
        pieces: Number of pieces, q.
        margin: Share of the size that every row keeps.
        room: Share of a row's reserve above it that inertia can use.

    Returns:
        Used shares (q,) of the reserve, 0 for pieces without instants; and factors (q,) by which the twists must change
        more slowly so that the contacts hold.
    )");
}

} // namespace pushplan
