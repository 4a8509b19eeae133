// `pushplan.core.uncertain`: chains whose loads and frictions are known only within bounds.
#include "uncertain.hpp"

#include <algorithm>

namespace pushplan::mechanics {

namespace {

using Bools = Kept<bool>::Array;

PackedLoads packed_loads(const PackedChain &units, const Integers &unit, const Numbers &points, const Integers &first,
                         const Numbers &total, const Numbers &miss, const Numbers &centers, const Integers &free,
                         const Numbers &corners, const Integers &corner, bool centred, const Numbers &loads,
                         const Bools &carried, const Numbers &facets, double length) {
    const std::ptrdiff_t n = loads.ndim() > 0 ? loads.shape(0) : 0;
    PackedLoads packed{units,
                       {unit, {n}, "unit"},
                       {points, {-1, 4}, "points"},
                       {first, {n + 1}, "first"},
                       {total, {n}, "total"},
                       {miss, {n, 2}, "miss"},
                       {centers, {n, 8}, "centers"},
                       {free, {n}, "free"},
                       {corners, {-1, 2}, "corners"},
                       {corner, {n + 1}, "corner"},
                       centred,
                       {loads, {n, 2}, "loads"},
                       {carried, {n, n}, "carried"},
                       {facets, {n, 4, 3}, "facets"},
                       length};
    packed.check();
    return packed;
}

PackedLoads without_miss(PackedLoads packed) {
    std::fill(packed.miss.numbers.begin(), packed.miss.numbers.end(), 0.0);
    return packed;
}

Made<double> least_margins_of(const PackedLoads &packed, const Numbers &twists, double floor) {
    const auto rows = twist_table(twists);
    auto out = new_array<double>({rows.rows});
    double *margins = out.data();
    nb::gil_scoped_release free;
    LeastRows least(packed);
    for (std::ptrdiff_t t = 0; t < rows.rows; ++t) {
        least.set_twist(twist_at(rows[t]));
        margins[t] = least.margin(floor);
    }
    return out;
}

// Return the forces for `set` and `ranges` at each of many instants.
template <class Set>
Made<double> forces_at(const PackedLoads &packed, std::ptrdiff_t count, Table<const double> ranges, const Set &set) {
    auto forces = new_array<double>({count, 3});
    double *force = forces.data();
    nb::gil_scoped_release free;
    LeastRows least(packed);
    for (std::ptrdiff_t t = 0; t < count; ++t) {
        set(least, t);
        const auto found = least.force(ranges);
        force = std::copy(found.begin(), found.end(), force);
    }
    return forces;
}

// Return the rows and sizes for `set` and `ranges` at each of many instants. `set(least, t)` prepares instant t.
template <bool slopes = false, class Set>
auto rows_at(const PackedLoads &packed, std::ptrdiff_t count, Table<const double> ranges, const Set &set) {
    const std::ptrdiff_t n = packed.count();
    const std::ptrdiff_t leaning = slopes ? n : 0;
    auto rows = new_array<double>({count, n, 4}), sizes = new_array<double>({count, n}),
         steep = new_array<double>({count, n, 4, leaning});
    double *row = rows.data(), *size = sizes.data(), *slope = steep.data();
    {
        nb::gil_scoped_release free;
        LeastRows least(packed);
        for (std::ptrdiff_t t = 0; t < count; ++t) {
            set(least, t);
            least.work_out(ranges);
            for (const auto &found : least.rows())
                row = std::copy(found.begin(), found.end(), row);
            size = std::copy(least.sizes().begin(), least.sizes().end(), size);
            if (slopes)
                slope = std::copy(least.slopes().begin(), least.slopes().end(), slope);
        }
    }
    if constexpr (slopes)
        return std::make_tuple(rows, sizes, steep);
    else
        return std::make_tuple(rows, sizes);
}

auto moving_with(Table<const double> twists) {
    return [=](LeastRows &least, std::ptrdiff_t t) { least.set_twist(twist_at(twists[t])); };
}

auto least_rows_of(const PackedLoads &packed, const Numbers &twists) {
    const auto rows = twist_table(twists);
    return rows_at(packed, rows.rows, packed.loads.table(), moving_with(rows));
}

auto sloped_rows_of(const PackedLoads &packed, const Numbers &twists) {
    const auto rows = twist_table(twists);
    return rows_at<true>(packed, rows.rows, packed.loads.table(), moving_with(rows));
}

void require_places(const PackedLoads &packed) {
    if (packed.centred)
        throw std::invalid_argument("a load with only a known centre has no known places");
}

Made<double> forces_of(const PackedLoads &packed, const Numbers &twists) {
    require_places(packed);
    const auto rows = twist_table(twists);
    return forces_at(packed, rows.rows, packed.loads.table(), moving_with(rows));
}

void require_wrenches(const PackedLoads &packed, const Numbers &masses, const Numbers &known, const Numbers &pulls) {
    const std::ptrdiff_t n = packed.count(), p = packed.points.size();
    require_places(packed);
    require_shape(masses, {n, 2}, "masses");
    require_shape(known, {-1, n, 3}, "known");
    require_shape(pulls, {known.shape(0), p, 3}, "pulls");
}

auto wrenches_at(const PackedLoads &packed, const Numbers &known, const Numbers &pulls) {
    const std::ptrdiff_t n = packed.count(), p = packed.points.size();
    const double *of_known = known.data(), *of_points = pulls.data();
    return [=](LeastRows &least, std::ptrdiff_t t) { least.set_wrenches(of_known + 3 * n * t, of_points + 3 * p * t); };
}

Made<double> inertia_forces_of(const PackedLoads &packed, const Numbers &masses, const Numbers &known,
                               const Numbers &pulls) {
    require_wrenches(packed, masses, known, pulls);
    return forces_at(packed, known.shape(0), table(masses), wrenches_at(packed, known, pulls));
}

auto inertia_rows_of(const PackedLoads &packed, const Numbers &masses, const Numbers &known, const Numbers &pulls) {
    require_wrenches(packed, masses, known, pulls);
    return rows_at(packed, known.shape(0), table(masses), wrenches_at(packed, known, pulls));
}

nb::tuple state_of(const nb::object &self) {
    const auto &packed = nb::cast<const PackedLoads &>(self);
    return nb::make_tuple(packed.units, packed.unit.shown(self), packed.points.shown(self), packed.first.shown(self),
                          packed.total.shown(self), packed.miss.shown(self), packed.centers.shown(self),
                          packed.free.shown(self), packed.corners.shown(self), packed.corner.shown(self),
                          packed.centred, packed.loads.shown(self), packed.carried.shown(self),
                          packed.facets.shown(self), packed.length);
}

PackedLoads of_state(const nb::tuple &s) {
    return packed_loads(nb::cast<const PackedChain &>(s[0]), nb::cast<Integers>(s[1]), nb::cast<Numbers>(s[2]),
                        nb::cast<Integers>(s[3]), nb::cast<Numbers>(s[4]), nb::cast<Numbers>(s[5]),
                        nb::cast<Numbers>(s[6]), nb::cast<Integers>(s[7]), nb::cast<Numbers>(s[8]),
                        nb::cast<Integers>(s[9]), nb::cast<bool>(s[10]), nb::cast<Numbers>(s[11]),
                        nb::cast<Bools>(s[12]), nb::cast<Numbers>(s[13]), nb::cast<double>(s[14]));
}

void bind_packed_loads(nb::module_ &m) {
    nb::class_<PackedLoads> bound(m, "PackedLoads", R"(
    The loads and contacts of n objects.

    Attributes:
        units: Objects with known loads, each with a unit friction load.
        unit: (n,) index of each object in `units`, or -1.
        points: (p, 4) x, y (m), smallest and largest part of the load on uncertain points.
        first: (n + 1,) first point of each object.
        total: (n,) sum of the parts of each object's points.
        miss: (n, 2) possible error due to variation between points, as a share and as a part of the load.
        centers: (n, 8) data of objects with only a known centre: x, y (m), least shift h mu (m), nudge away from edges
            between loads (2), width of the shift's interval (m), and possible errors of the centre along x and y (m).
        free: (n,) 1 for feet, 2 for a whole outline that carries the load, 0 for objects of other kinds.
        corners: (c, 2) feet, or counter-clockwise corners of the convex outline, about that centre, m.
        corner: (n + 1,) first corner of each object.
        centred: Whether any object has only a known centre.
        loads: (n, 2) smallest and largest friction load of each object, N.
        carried: (n, n) whether contact k carries object i.
        facets: (n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length) > 0.
        length: Characteristic length of the chain, m.

    Raises:
        ValueError: If the arrays do not fit together.
    )");
    bound.def(MadeBy(&packed_loads), nb::kw_only(), nb::arg("units"), nb::arg("unit"), nb::arg("points"),
              nb::arg("first"), nb::arg("total"), nb::arg("miss"), nb::arg("centers"), nb::arg("free"),
              nb::arg("corners"), nb::arg("corner"), nb::arg("centred"), nb::arg("loads"), nb::arg("carried"),
              nb::arg("facets"), nb::arg("length"));
    def_shown(bound, "points", &PackedLoads::points);
    def_shown(bound, "first", &PackedLoads::first);
    def_shown(bound, "total", &PackedLoads::total);
    def_shown(bound, "free", &PackedLoads::free);
    def_shown(bound, "carried", &PackedLoads::carried);
    def_shown(bound, "facets", &PackedLoads::facets);
    bound.def_ro("length", &PackedLoads::length);
    bound.def("without_miss", &without_miss, "Return the loads with a `miss` of 0.");
    bound.def(Pickled(&state_of, &of_state));
}

} // namespace

} // namespace pushplan::mechanics

namespace pushplan {

void bind_uncertain(nb::module_ &core) {
    using namespace mechanics;
    nb::module_ m = core.def_submodule(
        "uncertain", "The minimum of every contact condition over all possible loads and frictions.");
    bind_packed_loads(m);
    m.def("margins_of", &least_margins_of, nb::arg("packed"), nb::arg("twists"), nb::arg("floor"),
          "Return the smallest margins (m,) at many nonzero twists (m, 3); any number up to `floor` for smaller ones.");
    m.def(
        "rows_of", &least_rows_of, nb::arg("packed"), nb::arg("twists"),
        "Return the least rows (m, n, 4) and upper bounds of the wrenches (m, n), N, at many nonzero twists (m, 3).");
    m.def(
        "sloped_rows_of", &sloped_rows_of, nb::arg("packed"), nb::arg("twists"),
        "Return `rows_of`, and the reductions (m, n, 4, n) of rows per metre of an object's centre, N/m.");
    m.def("forces_of", &forces_of, nb::arg("packed"), nb::arg("twists"), R"(
    Return the forces (m, 3) that slide all objects together at nonzero twists (m, 3).

    Each is the mean force x, y and its maximum deviation, N. No load can have only a known centre.
    )");
    m.def("inertia_forces_of", &inertia_forces_of, nb::arg("packed"), nb::arg("masses"), nb::arg("known"),
          nb::arg("pulls"), "Return the forces (m, 3) that inertia needs; see `inertia_rows_of`.");
    m.def("inertia_rows_of", &inertia_rows_of, nb::arg("packed"), nb::arg("masses"), nb::arg("known"), nb::arg("pulls"),
          R"(
    Return the minimum that inertia adds to the rows (m, n, 4), and its largest wrenches (m, n), N.

    The wrench of a mass point is a polynomial of its place, so the error of the points is negligible.

    Args:
        packed: Loads without an object with only a known centre, and with a `miss` of 0.
        masses: (n, 2) smallest and largest masses, kg.
        known: (m, n, 3) inertial wrenches of 1 kg of each object with a known load, N, with moments about the origin, N
            m.
        pulls: (m, p, 3) inertial wrenches of 1 kg on each point.
    )");
}

} // namespace pushplan
