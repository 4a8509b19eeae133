// `pushplan.core.sphere`: operations on many points of the sphere of twist directions.
#include "arrays.hpp"
#include "poses.hpp"

#include <algorithm>

namespace pushplan {

namespace {

// Maximum difference of components (relative to the largest one) within one direction. Rounding in blended trajectories
// stays below 1e-13, even near rest.
constexpr double SAME = 1e-12;

// Number of neighbours that a climb evaluates.
constexpr std::ptrdiff_t SPOKES = 8;

double largest(double x, double y, double z) { return std::max(std::max(std::abs(x), std::abs(y)), std::abs(z)); }

auto directions(const Numbers &twists, double length) {
    const auto rows = twist_table(twists);
    std::vector<std::int64_t> owner(rows.rows), first;
    Twist direction{0.0, 0.0, 0.0};
    for (std::ptrdiff_t i = 0; i < rows.rows; ++i) {
        const double x = rows[i][0], y = rows[i][1], turn = length * rows[i][2];
        const double size = largest(x, y, turn);
        const Twist own{x / size, y / size, turn / size};
        if (first.empty() ||
            largest(own.vx - direction.vx, own.vy - direction.vy, own.omega - direction.omega) > SAME) {
            direction = own;
            first.push_back(i);
        }
        owner[i] = static_cast<std::int64_t>(first.size()) - 1;
    }
    return std::make_tuple(to_numpy(std::move(owner)), to_numpy(std::move(first)));
}

Made<double> twists_on(const Numbers &east, const Numbers &north, double length, const Integers &member,
                       const Numbers &latitude) {
    const auto x = row(east), y = row(north), lat = row(latitude);
    const auto who = row(member);
    if (y.size != x.size || lat.size != who.size)
        throw std::invalid_argument("the numbers of east and north, or of members and latitudes, differ");
    std::vector<double> out(3 * who.size);
    for (std::ptrdiff_t j = 0; j < who.size; ++j) {
        if (who[j] < 0 || who[j] >= x.size)
            throw std::out_of_range("there is no meridian " + std::to_string(who[j]));
        const double flat = std::cos(lat[j]);
        out[3 * j] = flat * x[who[j]], out[3 * j + 1] = flat * y[who[j]];
        out[3 * j + 2] = std::sin(lat[j]) / length;
    }
    return to_numpy(std::move(out), {who.size, 3});
}

// Throw std::out_of_range unless all `live` are indices below `count`.
void check_places(Row<const std::int64_t> live, std::ptrdiff_t count) {
    for (const std::int64_t i : live)
        if (i < 0 || i >= count)
            throw std::out_of_range("there is no place " + std::to_string(i));
}

Made<double> neighbours(const Numbers &at, const Numbers &step, const Integers &live, double turn) {
    const auto place = twist_table(at);
    const auto angle_to = row(step);
    const auto who = row(live);
    if (angle_to.size != place.rows)
        throw std::invalid_argument("the numbers of places and steps differ");
    check_places(who, place.rows);
    std::vector<double> out(3 * SPOKES * who.size);
    for (std::ptrdiff_t j = 0; j < SPOKES * who.size; ++j) {
        const std::int64_t i = who[j / SPOKES];
        const double angle = turn + 2.0 * PI * (j % SPOKES) / SPOKES;
        const double x = place[i][0], y = place[i][1], z = place[i][2];
        const bool flat = std::abs(z) < 0.7;
        const double size = flat ? std::sqrt(x * x + y * y) : std::sqrt(y * y + z * z);
        const double ex = flat ? -y / size : 0.0, ey = flat ? x / size : -z / size, ez = flat ? 0.0 : y / size;
        const double east[3] = {ex, ey, ez};
        const double north[3] = {y * ez - z * ey, z * ex - x * ez, x * ey - y * ex};
        for (int axis = 0; axis < 3; ++axis) {
            const double spoke = std::cos(angle) * east[axis] + std::sin(angle) * north[axis];
            out[3 * j + axis] = std::cos(angle_to[i]) * place[i][axis] + std::sin(angle_to[i]) * spoke;
        }
    }
    return to_numpy(std::move(out), {SPOKES * who.size, 3});
}

void move(Written &at, Written &values, Written &step, const Integers &live, const Numbers &around,
          const Numbers &found) {
    require_shape(at, {-1, 3}, "at");
    auto place = table(at);
    auto value = row(values), angle = row(step);
    const auto who = row(live);
    const auto next = twist_table(around);
    const auto margin = row(found);
    if (value.size != place.rows || angle.size != place.rows || next.rows != SPOKES * who.size ||
        margin.size != next.rows)
        throw std::invalid_argument("the numbers of places, values and steps, or of neighbours and margins, differ");
    check_places(who, place.rows);
    for (std::ptrdiff_t j = 0; j < who.size; ++j) {
        const std::int64_t i = who[j];
        std::ptrdiff_t best = j * SPOKES;
        for (std::ptrdiff_t k = best; k < (j + 1) * SPOKES; ++k)
            if (margin[k] > margin[best])
                best = k;
        if (margin[best] > value[i]) {
            value[i] = margin[best];
            std::copy_n(next[best], 3, place[i]);
        } else {
            angle[i] *= 0.6;
        }
    }
}

} // namespace

void bind_sphere(nb::module_ &core) {
    nb::module_ m = core.def_submodule("sphere", "Operations on many points of the sphere of twist directions.");
    m.def("directions", &directions, nb::arg("twists"), nb::arg("length"), R"(
    Return the index of each twist's direction (m,), and the first twist of each direction (d,).

    Neighbours whose components, as shares of the largest one, differ by at most 1e-12 have one direction.

    Args:
        twists: (m, 3) nonzero twists.
        length: Factor of angular velocities for the comparison with linear ones, m.
    )");
    m.def(
        "twists_on", &twists_on, nb::arg("east"), nb::arg("north"), nb::arg("length"), nb::arg("member"),
        nb::arg("latitude"),
        "Return the unit twists (k, 3) at latitudes (k,) of meridians `member` (k,), given by their directions (m,).");
    m.def("neighbours", &neighbours, nb::arg("at"), nb::arg("step"), nb::arg("live"), nb::arg("turn"), R"(
    Return unit vectors (8 m, 3) at angles `step` (k,) around those m of the unit vectors (k, 3) that are `live`.

    Args:
        at: (k, 3) unit vectors.
        step: (k,) angles of the neighbours, rad.
        live: (m,) indices.
        turn: Direction of the first neighbour, rad.
    )");
    m.def("move", &move, nb::arg("at").noconvert(), nb::arg("values").noconvert(), nb::arg("step").noconvert(),
          nb::arg("live"), nb::arg("around"), nb::arg("found"), R"(
    Move to the highest neighbours, or reduce the steps.

    Args:
        at: (k, 3) unit vectors; changed in place, as are `values` and `step`.
        values: (k,) values at the vectors.
        step: (k,) steps, rad.
        live: (m,) indices of the vectors to move.
        around: (8 m, 3) neighbours of these.
        found: (8 m,) values at the neighbours.
    )");
}

} // namespace pushplan
