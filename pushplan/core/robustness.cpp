// `pushplan.core.robustness`: contact conditions of perturbed chains at instants of a motion.
#include "arrays.hpp"
#include "inertia.hpp"

#include <algorithm>
#include <tuple>

namespace pushplan::mechanics {

namespace {

using Bools = Kept<bool>::Array;
using Series = Kept<std::complex<double>>::Array;

// The arrays of `robustness.Variants` and `robustness.Moments`.
using VariantArrays = std::tuple<Numbers, Numbers, Integers, Bools, Numbers, Numbers, Numbers, Bools>;
using MomentArrays = std::tuple<Numbers, Numbers, Numbers, Integers>;

// The numbers of each variant, or of all variants if the first axis has length 1.
struct PerVariant {
    const double *data;
    std::ptrdiff_t count, numbers, columns; // number of variants, of numbers in a variant, and in a row

    // `shape`: shape of one variant's table.
    PerVariant(const Numbers &array, std::ptrdiff_t variants, const std::vector<std::ptrdiff_t> &shape,
               const char *name)
        : data(array.data()) {
        std::vector<std::ptrdiff_t> wanted{-1};
        wanted.insert(wanted.end(), shape.begin(), shape.end());
        require_shape(array, wanted, name);
        count = array.shape(0);
        if (count < 1 || (count != 1 && count != variants))
            throw std::invalid_argument(std::string(name) + " must be given for one or for every variant");
        numbers = array.size() / count;
        columns = array.shape(1) > 0 ? numbers / array.shape(1) : 0;
    }

    Table<const double> operator[](std::ptrdiff_t a) const {
        return {data + std::min(a, count - 1) * numbers, columns > 0 ? numbers / columns : 0, columns};
    }
};

// q perturbed chains of n objects. The arrays are described in Python.
struct Variants {
    std::ptrdiff_t count, n;
    PerVariant objects, parts;
    Table<const std::complex<double>> series;
    Table<const std::int64_t> links;
    Table<const bool> changed;
    PerVariant poses, centers, facets;

    Variants(const VariantArrays &arrays, const Series &coefficients)
        : count(std::get<7>(arrays).size()), n(std::get<2>(arrays).ndim() > 0 ? std::get<2>(arrays).shape(0) : 0),
          objects(std::get<0>(arrays), count, {n, OBJECT_COLUMNS}, "objects"),
          parts(std::get<1>(arrays), count, {-1, PART_COLUMNS}, "parts"), series(table(coefficients)),
          links(table(std::get<2>(arrays))), changed(table(std::get<3>(arrays))),
          poses(std::get<4>(arrays), count, {n, 3}, "poses"), centers(std::get<5>(arrays), count, {n, 2}, "centers"),
          facets(std::get<6>(arrays), count, {n, 4, 3}, "facets") {
        if (series.rows != WEIGHTS * n || series.columns != TERMS || links.columns != LINK_COLUMNS ||
            changed.rows != count || changed.columns != n)
            throw std::invalid_argument("the arrays of perturbed chains do not fit together");
        for (std::ptrdiff_t k = 0; k < n; ++k)
            if (links[k][FIRST_PART] < 0 || links[k][FIRST_PART] >= links[k][PAST_LAST_PART] ||
                links[k][PAST_LAST_PART] > std::get<1>(arrays).shape(1) || links[k][PUSHER] >= k)
                throw std::invalid_argument("a link of a perturbed chain is outside the chain");
    }

    Supports supports(std::ptrdiff_t a) const { return {objects[a], parts[a], series, links}; }
};

struct Moments {
    Table<const double> directions, twists, rates;
    Row<const std::int64_t> group;

    explicit Moments(const MomentArrays &arrays)
        : directions(twist_table(std::get<0>(arrays))), twists(twist_table(std::get<1>(arrays))),
          rates(twist_table(std::get<2>(arrays))), group(row(std::get<3>(arrays))) {
        if (twists.rows != directions.rows || rates.rows != directions.rows || group.size != directions.rows)
            throw std::invalid_argument("the arrays of instants do not fit together");
    }
    std::ptrdiff_t count() const { return twists.rows; }
};

// Return the wrench that moves object k against the floor after a motion: transform the twist into the moved frame, and
// the wrench back.
Wrench moved_wrench(const Supports &supports, std::ptrdiff_t k, const Pose &pose, const Twist &twist) {
    const double x = pose.x, y = pose.y, cos = std::cos(pose.theta), sin = std::sin(pose.theta);
    const double vx = twist.vx - twist.omega * y, vy = twist.vy + twist.omega * x;
    const Wrench w = carried_wrench(supports, k, {cos * vx + sin * vy, cos * vy - sin * vx, twist.omega});
    const double fx = cos * w.x - sin * w.y, fy = sin * w.x + cos * w.y;
    return {fx, fy, w.m + x * fy - y * fx};
}

Made<double> floor_wrenches(const VariantArrays &arrays, const Series &series, const Numbers &directions) {
    const Variants variants(arrays, series);
    const auto twists = twist_table(directions);
    const std::ptrdiff_t n = variants.n;
    auto out = new_array<double>({twists.rows, n, 3});
    auto *wrench = reinterpret_cast<Wrench *>(out.data());
    nb::gil_scoped_release free;
    const Supports supports = variants.supports(variants.count - 1);
    const Table<const double> poses = variants.poses[variants.count - 1];
    for (std::ptrdiff_t s = 0; s < twists.rows; ++s)
        for (std::ptrdiff_t k = 0; k < n; ++k)
            *wrench++ = moved_wrench(supports, k, pose_at(poses[k]), twist_at(twists[s]));
    return out;
}

// Masses (n,) and moments of inertia (n,) of every variant.
struct Bodies {
    PerVariant mass, moment;
};

// Compute the facet values (m, n, 4) of variant a.
void fill_values(const Variants &variants, std::ptrdiff_t a, const Bodies &bodies, const Moments &moments,
                 const Wrench *known, double *out) {
    const std::ptrdiff_t n = variants.n;
    const bool *changed = variants.changed[a];
    const Supports supports = variants.supports(a);
    const Table<const double> poses = variants.poses[a], centers = variants.centers[a], facets = variants.facets[a];
    const Table<const double> mass = bodies.mass[a], moment = bodies.moment[a];
    std::vector<std::array<double, 2>> center(n);
    for (std::ptrdiff_t k = 0; k < n; ++k) {
        const Pose pose = pose_at(poses[k]);
        const double cos = std::cos(pose.theta), sin = std::sin(pose.theta);
        center[k] = {pose.x + cos * centers[k][0] - sin * centers[k][1],
                     pose.y + sin * centers[k][0] + cos * centers[k][1]};
    }
    std::vector<Wrench> floor(n, Wrench{0.0, 0.0, 0.0}), carried(n);
    for (std::ptrdiff_t s = 0; s < moments.count(); ++s) {
        const Twist v = twist_at(moments.twists[s]), dv = twist_at(moments.rates[s]);
        const bool fresh = s == 0 || moments.group[s] != moments.group[s - 1];
        for (std::ptrdiff_t k = 0; k < n; ++k) {
            if (changed[k] && fresh)
                floor[k] = moved_wrench(supports, k, pose_at(poses[k]), twist_at(moments.directions[s]));
            const Wrench &w = changed[k] ? floor[k] : known[s * n + k];
            const auto [x, y] = center[k];
            const auto [fx, fy] = inertia_force(mass[k][0], x, y, v, dv);
            carried[k] = {w.x + fx, w.y + fy, w.m + moment[k][0] * dv.omega + x * fy - y * fx};
        }
        for (std::ptrdiff_t k = n - 1; k >= 0; --k) {
            const Wrench &w = carried[k];
            const Facets own = read<Facets>(facets[k]);
            for (int j = 0; j < 4; ++j)
                out[(s * n + k) * 4 + j] = dot(own[j], w);
            const std::int64_t pusher = variants.links[k][PUSHER];
            if (pusher >= 0)
                carried[pusher].x += w.x, carried[pusher].y += w.y, carried[pusher].m += w.m;
        }
    }
}

Made<double> facet_values(const VariantArrays &arrays, const Series &series, const Numbers &mass, const Numbers &moment,
                          const MomentArrays &when, const Numbers &known) {
    const Variants variants(arrays, series);
    const Moments moments(when);
    const std::ptrdiff_t n = variants.n, m = moments.count();
    const Bodies bodies{{mass, variants.count, {n}, "masses"}, {moment, variants.count, {n}, "moments of inertia"}};
    require_shape(known, {m, n, 3}, "known");
    const auto *wrenches = reinterpret_cast<const Wrench *>(known.data());
    auto out = new_array<double>({variants.count, m, n, 4});
    double *values = out.data();
    nb::gil_scoped_release free;
    for (std::ptrdiff_t a = 0; a < variants.count; ++a)
        fill_values(variants, a, bodies, moments, wrenches, values + a * m * n * 4);
    return out;
}

} // namespace

} // namespace pushplan::mechanics

namespace pushplan {

void bind_robustness(nb::module_ &core) {
    using namespace mechanics;
    nb::module_ m =
        core.def_submodule("robustness", "Contact conditions of perturbed chains at instants of a motion.");
    m.def(
        "floor_wrenches", &floor_wrenches, nb::arg("variants"), nb::arg("series"), nb::arg("directions"),
        "Return the wrenches (m, n, 3) that move each object of the last variant against the floor at twists (m, 3).");
    m.def("facet_values", &facet_values, nb::arg("variants"), nb::arg("series"), nb::arg("mass"), nb::arg("moment"),
          nb::arg("moments"), nb::arg("known"), R"(
    Return the facet values (q, m, n, 4) of the contacts of q variants at m instants, N and N m.

    Args:
        variants: The chains.
        series: Power series of the `PackedChain`.
        mass: (q, n) or (1, n) masses, kg.
        moment: (q, n) or (1, n) moments of inertia, kg m^2.
        moments: Instants.
        known: (m, n, 3) wrenches that move the objects against the floor, for objects that are not `changed`.
    )");
}

} // namespace pushplan
